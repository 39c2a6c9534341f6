//! Where smoothed states leave: those that the window is done with, and the whole window on request.
//!
//! Everything here runs after an estimate has been published, never before.

use inekf_shared::message::SmoothedState;
use inekf_shared::topic::Instance;
use inekf_shared::transport::{self, Node, Publisher, TransportError};

use crate::engine::{Engine, History, Model};

/// The topic, if the estimator is a smoother.
///
/// ```
/// use inekf_service::daemon::SmoothedPort;
///
/// // Without a topic, as where engines are tested.
/// assert!(format!("{:?}", SmoothedPort::closed()).contains("None"));
/// ```
#[derive(Debug)]
pub struct SmoothedPort {
    publisher: Option<Publisher<SmoothedState>>,
    /// States that could not be published; the watch reports them.
    pub(super) failures: u64,
}

impl SmoothedPort {
    /// Opens the topic for a daemon that `smooths`.
    ///
    /// # Errors
    /// [`TransportError`], naming the service and the remedy.
    pub(super) fn open(
        node: &Node,
        instance: &Instance,
        smooths: bool,
    ) -> Result<Self, TransportError> {
        let publisher = match smooths {
            true => Some(transport::smoothed(node, instance)?.publisher()?),
            false => None,
        };
        Ok(Self {
            publisher,
            failures: 0,
        })
    }

    /// A port without a topic, for a daemon that does not smooth: what is published there goes nowhere.
    ///
    /// ```
    #[doc = include_str!("../engine/example.txt")]
    /// use inekf_service::daemon::{SmoothedPort, Terms, answer};
    ///
    /// # let config = Config::from_toml_str(CONFIG, "example")?;
    /// let terms = Terms { config: &config, config_text: CONFIG, stepped: false, unused_checkpoint: false };
    /// // An engine answers requests without shared memory, too.
    /// let request = ControlRequest { kind: CONTROL_SMOOTHED, request_id: 1, ..ControlRequest::ZERO };
    /// let response = answer(&mut engine, &request, &terms, &mut estimates, &mut SmoothedPort::closed());
    /// assert!(response.reason().contains("no smoother"));
    /// # Ok::<(), inekf_service::config::ConfigFaults>(())
    /// ```
    pub fn closed() -> Self {
        Self {
            publisher: None,
            failures: 0,
        }
    }

    fn publish(&mut self, state: SmoothedState) {
        let Some(publisher) = &self.publisher else {
            return;
        };
        let sent = publisher
            .loan_uninit()
            .is_ok_and(|slot| slot.write_payload(state).send().is_ok());
        if !sent {
            self.failures += 1;
        }
    }

    /// Publishes the states that have left the window.
    pub(super) fn publish_left<M: Model, H: History<M>>(&mut self, engine: &mut Engine<M, H>) {
        while let Some(state) = engine.take_left() {
            self.publish(state);
        }
    }

    /// Publishes the states in the window under `request_id`, and says how many they are.
    ///
    /// # Errors
    /// A sentence that says why there are none.
    pub(super) fn answer<M: Model, H: History<M>>(
        &mut self,
        engine: &mut Engine<M, H>,
        request_id: u64,
    ) -> Result<u64, &'static str> {
        if request_id == 0 {
            return Err(
                "a request for the smoothed states needs an id other than 0, which marks those that \
                 have left the window",
            );
        }
        let count = engine.smoothed(&mut |state| {
            self.publish(SmoothedState {
                request_id,
                ..*state
            });
        })?;
        Ok(count as u64)
    }
}
