//! A reader: the receiving side of a user's own process.
//!
//! ```no_run
//! use inekf_client::read::EstimateReader;
//! use inekf_shared::topic::Instance;
//!
//! let mut reader: EstimateReader = EstimateReader::open(&Instance::new("default")?)?;
//! while let Some(estimate) = reader.next_estimate()? {
//!     println!("{} {:?}", estimate.head.stamp_ns, estimate.p_w_m);
//! }
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! The estimates of the model `imu` are meant where nothing else is said; those of odometry are read as
//! `EstimateReader::<EstimateSe2>` or `EstimateReader::<EstimateSe3>`. [`model_of`] says which a daemon has.

use inekf_shared::message::{EstimateMessage, EstimateSe23, SmoothedState};
use inekf_shared::topic::Instance;
use inekf_shared::transport::{self, LatestReader, Node, Received, Subscriber, TransportError};

use crate::model::Model;

/// Estimates or smoothed states could not be received.
#[derive(Debug, thiserror::Error)]
#[error("receiving from the daemon: {cause}")]
pub struct ReadError {
    /// iceoryx2's word for it.
    pub cause: String,
}

/// The model of the daemon of `instance`; `None` if none has started, or if its estimates are of another version.
///
/// # Errors
/// [`TransportError`], naming the service and the remedy.
pub fn model_of(instance: &Instance) -> Result<Option<Model>, TransportError> {
    let node = transport::open_node("inekf-model")?;
    Ok(transport::estimate_model(&node, instance)?.and_then(Model::from_code))
}

/// Receives every estimate of one daemon, in order, and counts those it missed.
pub struct EstimateReader<E: EstimateMessage = EstimateSe23> {
    estimates: Subscriber<E>,
    next_seq: Option<u64>,
    missed: u64,
    _node: Node,
}

impl<E: EstimateMessage> EstimateReader<E> {
    /// A reader of `instance`; it gets what is published from now on.
    ///
    /// # Errors
    /// [`TransportError`], naming the service and the remedy; the daemon's model has to be that of `E`.
    pub fn open(instance: &Instance) -> Result<Self, TransportError> {
        Self::open_on(transport::open_node("inekf-reader")?, instance)
    }

    /// The same on a node of one's own.
    ///
    /// # Errors
    /// [`TransportError`], naming the service and the remedy.
    pub fn open_on(node: Node, instance: &Instance) -> Result<Self, TransportError> {
        let estimates = transport::estimate::<E>(&node, instance)?.subscriber()?;
        Ok(Self {
            estimates,
            next_seq: None,
            missed: 0,
            _node: node,
        })
    }

    /// The next estimate where it lies in shared memory, or `None` if none waits. Never blocks, copies nothing.
    ///
    /// Drop it soon: at most [`MAX_BORROWED`](inekf_shared::qos::MAX_BORROWED) may be held at a time.
    ///
    /// # Errors
    /// [`ReadError`].
    pub fn borrow_next(&mut self) -> Result<Option<Received<E>>, ReadError> {
        let received = self.estimates.receive().map_err(|error| ReadError {
            cause: error.to_string(),
        })?;
        if let Some(estimate) = &received {
            let seq = estimate.head().estimate_seq;
            // A smaller number is a daemon that has started again.
            if let Some(expected) = self.next_seq
                && seq > expected
            {
                self.missed += seq - expected;
            }
            self.next_seq = Some(seq + 1);
        }
        Ok(received)
    }

    /// A copy of the next estimate, or `None` if none waits. Never blocks.
    ///
    /// # Errors
    /// [`ReadError`].
    pub fn next_estimate(&mut self) -> Result<Option<E>, ReadError> {
        Ok(self.borrow_next()?.map(|estimate| *estimate))
    }

    /// Estimates that were overwritten before they were read.
    pub fn missed(&self) -> u64 {
        self.missed
    }
}

/// Receives the smoothed states of one daemon, in order, and counts those it missed: each state that leaves the
/// window, and the whole window when a request asks for it.
pub struct SmoothedReader {
    states: Subscriber<SmoothedState>,
    next_index: Option<u64>,
    missed: u64,
    _node: Node,
}

impl SmoothedReader {
    /// A reader of `instance`; it gets what is published from now on.
    ///
    /// # Errors
    /// [`TransportError`], naming the service and the remedy.
    pub fn open(instance: &Instance) -> Result<Self, TransportError> {
        Self::open_on(transport::open_node("inekf-smoothed")?, instance)
    }

    /// The same on a node of one's own.
    ///
    /// # Errors
    /// [`TransportError`], naming the service and the remedy.
    pub fn open_on(node: Node, instance: &Instance) -> Result<Self, TransportError> {
        Ok(Self {
            states: transport::smoothed(&node, instance)?.subscriber()?,
            next_index: None,
            missed: 0,
            _node: node,
        })
    }

    /// The next state, or `None` if none waits. Never blocks.
    ///
    /// # Errors
    /// [`ReadError`].
    pub fn next_state(&mut self) -> Result<Option<SmoothedState>, ReadError> {
        let received = self.states.receive().map_err(|error| ReadError {
            cause: error.to_string(),
        })?;
        Ok(received.map(|state| {
            if state.request_id == 0 {
                // A smaller number is a daemon that has started again.
                if let Some(expected) = self.next_index
                    && state.index > expected
                {
                    self.missed += state.index - expected;
                }
                self.next_index = Some(state.index + 1);
            }
            *state
        }))
    }

    /// States that left the window and were overwritten before they were read.
    pub fn missed(&self) -> u64 {
        self.missed
    }
}

/// Reads the newest estimate only, as a controller would.
pub struct LatestEstimate<E: EstimateMessage = EstimateSe23> {
    latest: LatestReader<E>,
    _node: Node,
}

impl<E: EstimateMessage> LatestEstimate<E> {
    /// A reader of the newest estimate of `instance`, whose daemon must be running.
    ///
    /// # Errors
    /// [`TransportError`], naming the service and the remedy.
    pub fn open(instance: &Instance) -> Result<Self, TransportError> {
        Self::open_on(transport::open_node("inekf-latest")?, instance)
    }

    /// The same on a node of one's own.
    ///
    /// # Errors
    /// [`TransportError`], naming the service and the remedy.
    pub fn open_on(node: Node, instance: &Instance) -> Result<Self, TransportError> {
        let latest = transport::open_latest::<E>(&node, instance)?.reader()?;
        Ok(Self {
            latest,
            _node: node,
        })
    }

    /// The newest estimate; its `estimate_seq` is 0 before the first.
    pub fn read(&self) -> E {
        self.latest.read()
    }
}
