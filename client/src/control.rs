//! Requests to a daemon: reset, set state, snapshot, barrier, smoothed window, pause, noise, configuration.

use std::time::{Duration, Instant};

use inekf_shared::clock::monotonic_ns;
use inekf_shared::message::{
    CONTROL_BARRIER, CONTROL_CONFIG, CONTROL_OK, CONTROL_PAUSE, CONTROL_RELOAD_NOISE,
    CONTROL_RESET, CONTROL_RESUME, CONTROL_SET_STATE, CONTROL_SMOOTHED, CONTROL_SNAPSHOT,
    ControlRequest, ControlResponse, ProcessNoise, StateVector, Zero, control_kind_name,
};
use inekf_shared::topic::Instance;
use inekf_shared::transport::{self, ControlClient, Node, TransportError, WakeNotifier};

use crate::attach::Attached;

/// A request was not granted.
#[derive(Debug, thiserror::Error)]
pub enum ControlError {
    /// The daemon said no.
    #[error("the daemon refused the request `{request}`: {reason}")]
    Refused {
        /// What was asked.
        request: &'static str,
        /// Why not.
        reason: String,
    },
    /// No answer came.
    #[error("the daemon did not answer the request `{request}` within {seconds} s: is it running?")]
    Silent {
        /// What was asked.
        request: &'static str,
        /// How long was waited.
        seconds: f64,
    },
    /// The request could not be sent, or the answer not be received.
    #[error("the request `{request}` failed: {cause}")]
    Failed {
        /// What was asked.
        request: &'static str,
        /// iceoryx2's word for it.
        cause: String,
    },
}

/// Name of a controller's node, for people who list the nodes.
const NODE: &str = "inekf-control";

/// No configuration is longer, bytes.
const MAX_CONFIG_LEN: usize = 1 << 20;

/// Sends requests and waits for their answers.
///
/// If somebody removes the files in shared memory it attaches anew by itself at a later request.
///
/// ```no_run
/// use std::time::Duration;
///
/// use inekf_client::control::Controller;
/// use inekf_shared::topic::Instance;
///
/// // A daemon has to run.
/// let mut daemon = Controller::open(&Instance::new("car")?, Duration::from_secs(1))?;
/// println!("at {:?}", daemon.snapshot()?.p_w_m);
/// daemon.reset()?;
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub struct Controller {
    ports: Attached<Ports>,
    next_id: u64,
    timeout: Duration,
}

/// What requests go through.
struct Ports {
    client: ControlClient,
    wake: WakeNotifier,
}

impl Ports {
    fn open(node: &Node, instance: &Instance) -> Result<Self, TransportError> {
        Ok(Self {
            client: transport::control(node, instance)?.client()?,
            wake: transport::wake(node, instance)?.notifier()?,
        })
    }
}

impl Controller {
    /// A controller of `instance` that waits up to `timeout` for each answer.
    ///
    /// # Errors
    /// [`TransportError`], naming the service and the remedy.
    pub fn open(instance: &Instance, timeout: Duration) -> Result<Self, TransportError> {
        Self::open_on(transport::open_node(NODE)?, instance, timeout)
    }

    /// The same on a node of one's own.
    ///
    /// # Errors
    /// [`TransportError`], naming the service and the remedy.
    pub fn open_on(
        node: Node,
        instance: &Instance,
        timeout: Duration,
    ) -> Result<Self, TransportError> {
        Ok(Self {
            ports: Attached::open(node, NODE, instance, Ports::open)?,
            next_id: 1,
            timeout,
        })
    }

    /// Forgets the state and initialises anew.
    ///
    /// # Errors
    /// [`ControlError`].
    pub fn reset(&mut self) -> Result<ControlResponse, ControlError> {
        self.request(CONTROL_RESET, StateVector::ZERO)
    }

    /// Continues from `state`.
    ///
    /// # Errors
    /// [`ControlError`].
    pub fn set_state(&mut self, state: StateVector) -> Result<ControlResponse, ControlError> {
        self.request(CONTROL_SET_STATE, state)
    }

    /// The current state with its covariance.
    ///
    /// # Errors
    /// [`ControlError`].
    pub fn snapshot(&mut self) -> Result<StateVector, ControlError> {
        Ok(self.request(CONTROL_SNAPSHOT, StateVector::ZERO)?.state)
    }

    /// Returns when everything sent before has been processed; the answer has the counters.
    ///
    /// # Errors
    /// [`ControlError`].
    pub fn barrier(&mut self) -> Result<ControlResponse, ControlError> {
        self.request(CONTROL_BARRIER, StateVector::ZERO)
    }

    /// Has the states in the window of the smoother published, for a [`SmoothedReader`](crate::read::SmoothedReader);
    /// the answer says how many they are, and under which request.
    ///
    /// # Errors
    /// [`ControlError`]; refused if the daemon has no smoother, or no state yet.
    pub fn smoothed(&mut self) -> Result<ControlResponse, ControlError> {
        self.request(CONTROL_SMOOTHED, StateVector::ZERO)
    }

    /// Has the daemon take no sample and no fix until [`Controller::unpause`].
    ///
    /// # Errors
    /// [`ControlError`].
    pub fn pause(&mut self) -> Result<ControlResponse, ControlError> {
        self.request(CONTROL_PAUSE, StateVector::ZERO)
    }

    /// Ends a pause.
    ///
    /// # Errors
    /// [`ControlError`].
    pub fn unpause(&mut self) -> Result<ControlResponse, ControlError> {
        self.request(CONTROL_RESUME, StateVector::ZERO)
    }

    /// Uses this process noise from the next sample on.
    ///
    /// # Errors
    /// [`ControlError`]; refused if a number is out of its range.
    pub fn reload_noise(&mut self, noise: ProcessNoise) -> Result<ControlResponse, ControlError> {
        self.send(ControlRequest {
            kind: CONTROL_RELOAD_NOISE,
            noise,
            ..ControlRequest::ZERO
        })
    }

    /// The text of the daemon's configuration, page by page.
    ///
    /// # Errors
    /// [`ControlError`]; failed if it is no text, or longer than any configuration.
    pub fn config(&mut self) -> Result<String, ControlError> {
        let failed = |cause: &str| ControlError::Failed {
            request: control_kind_name(CONTROL_CONFIG),
            cause: cause.to_owned(),
        };
        let mut text = Vec::new();
        loop {
            let response = self.send(ControlRequest {
                kind: CONTROL_CONFIG,
                argument: text.len() as u32,
                ..ControlRequest::ZERO
            })?;
            text.extend_from_slice(response.page());
            if text.len() as u64 >= response.config_len || response.page().is_empty() {
                break;
            }
            if text.len() > MAX_CONFIG_LEN {
                return Err(failed("the text does not end"));
            }
        }
        String::from_utf8(text).map_err(|_| failed("the configuration is no text"))
    }

    fn request(&mut self, kind: u32, state: StateVector) -> Result<ControlResponse, ControlError> {
        self.send(ControlRequest {
            kind,
            state,
            ..ControlRequest::ZERO
        })
    }

    /// Sends a request under the next id, and waits for its answer.
    ///
    /// # Errors
    /// [`ControlError`].
    pub fn send(&mut self, mut asked: ControlRequest) -> Result<ControlResponse, ControlError> {
        let request = control_kind_name(asked.kind);
        let failed = |cause: String| ControlError::Failed { request, cause };
        asked.request_id = self.next_id;
        self.next_id += 1;
        self.ports.look(monotonic_ns());
        let Some(ports) = self.ports.ports() else {
            return Err(failed(
                "its files in shared memory were removed, and cannot be opened again yet"
                    .to_owned(),
            ));
        };
        let pending = ports
            .client
            .send_copy(asked)
            .map_err(|error| failed(error.to_string()))?;
        let _ = ports.wake.notify();
        let started = Instant::now();
        loop {
            if let Some(response) = pending
                .receive()
                .map_err(|error| failed(error.to_string()))?
            {
                let answer = if response.status == CONTROL_OK {
                    Ok(*response)
                } else {
                    Err(ControlError::Refused {
                        request,
                        reason: response.reason().to_owned(),
                    })
                };
                self.ports.heard();
                return answer;
            }
            let waited = started.elapsed();
            if waited > self.timeout {
                return Err(ControlError::Silent {
                    request,
                    seconds: self.timeout.as_secs_f64(),
                });
            }
            // Spin for what a running daemon needs, then leave the processor to others.
            if waited > Duration::from_micros(200) {
                std::thread::sleep(Duration::from_micros(100));
            } else {
                std::hint::spin_loop();
            }
        }
    }
}
