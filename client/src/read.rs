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
//!
//! If somebody removes the files in shared memory, every reader attaches anew by itself: it looks when nothing has come
//! for a quarter of a second, and the call that finds them gone takes as long as opening did.

use core::cell::RefCell;

use inekf_shared::message::{EstimateMessage, EstimateSe23, Message, SmoothedState};
use inekf_shared::topic::Instance;
use inekf_shared::transport::{self, LatestReader, Node, Received, Subscriber, TransportError};

use crate::attach::{Attached, Seldom};
use crate::model::Model;

/// Names of the readers' nodes, for people who list the nodes.
const READER: &str = "inekf-reader";
const SMOOTHED: &str = "inekf-smoothed";
const LATEST: &str = "inekf-latest";

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

/// A subscriber that attaches anew when its files have been removed.
pub(crate) struct Listening<M: Message> {
    subscriber: Attached<Subscriber<M>>,
    seldom: Seldom,
}

impl<M: Message> Listening<M> {
    pub(crate) fn new(subscriber: Attached<Subscriber<M>>) -> Self {
        Self {
            subscriber,
            seldom: Seldom::new(),
        }
    }

    /// The next message, or `None` if none waits.
    pub(crate) fn receive(&mut self) -> Result<Option<Received<M>>, ReadError> {
        let received = match self.subscriber.ports() {
            Some(subscriber) => subscriber.receive().map_err(|error| ReadError {
                cause: error.to_string(),
            })?,
            None => None,
        };
        if received.is_some() {
            self.subscriber.heard();
        } else if let Some(now_ns) = self.seldom.now_ns() {
            self.subscriber.look(now_ns);
        }
        Ok(received)
    }
}

/// Receives every estimate of one daemon, in order, and counts those it missed.
pub struct EstimateReader<E: EstimateMessage = EstimateSe23> {
    estimates: Listening<E>,
    next_seq: Option<u64>,
    missed: u64,
}

impl<E: EstimateMessage> EstimateReader<E> {
    /// A reader of `instance`; it gets what is published from now on.
    ///
    /// # Errors
    /// [`TransportError`], naming the service and the remedy; the daemon's model has to be that of `E`.
    pub fn open(instance: &Instance) -> Result<Self, TransportError> {
        Self::open_on(transport::open_node(READER)?, instance)
    }

    /// The same on a node of one's own.
    ///
    /// # Errors
    /// [`TransportError`], naming the service and the remedy.
    pub fn open_on(node: Node, instance: &Instance) -> Result<Self, TransportError> {
        let open = |node: &Node, instance: &Instance| {
            transport::estimate::<E>(node, instance)?.subscriber()
        };
        Ok(Self {
            estimates: Listening::new(Attached::open(node, READER, instance, open)?),
            next_seq: None,
            missed: 0,
        })
    }

    /// How often it attached anew because its files had been removed.
    pub fn reattached(&self) -> u64 {
        self.estimates.subscriber.times()
    }

    /// The next estimate where it lies in shared memory, or `None` if none waits. Never blocks, copies nothing.
    ///
    /// Drop it soon: at most [`MAX_BORROWED`](inekf_shared::qos::MAX_BORROWED) may be held at a time.
    ///
    /// # Errors
    /// [`ReadError`].
    pub fn borrow_next(&mut self) -> Result<Option<Received<E>>, ReadError> {
        let received = self.estimates.receive()?;
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
    states: Listening<SmoothedState>,
    next_index: Option<u64>,
    missed: u64,
}

impl SmoothedReader {
    /// A reader of `instance`; it gets what is published from now on.
    ///
    /// # Errors
    /// [`TransportError`], naming the service and the remedy.
    pub fn open(instance: &Instance) -> Result<Self, TransportError> {
        Self::open_on(transport::open_node(SMOOTHED)?, instance)
    }

    /// The same on a node of one's own.
    ///
    /// # Errors
    /// [`TransportError`], naming the service and the remedy.
    pub fn open_on(node: Node, instance: &Instance) -> Result<Self, TransportError> {
        let open =
            |node: &Node, instance: &Instance| transport::smoothed(node, instance)?.subscriber();
        Ok(Self {
            states: Listening::new(Attached::open(node, SMOOTHED, instance, open)?),
            next_index: None,
            missed: 0,
        })
    }

    /// The next state, or `None` if none waits. Never blocks.
    ///
    /// # Errors
    /// [`ReadError`].
    pub fn next_state(&mut self) -> Result<Option<SmoothedState>, ReadError> {
        let received = self.states.receive()?;
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
    state: RefCell<LatestState<E>>,
}

struct LatestState<E: EstimateMessage> {
    latest: Attached<LatestReader<E>>,
    seldom: Seldom,
    /// The last one that was read while nothing came: what there is while there is no other.
    last: E,
    last_seq: u64,
}

impl<E: EstimateMessage> LatestEstimate<E> {
    /// A reader of the newest estimate of `instance`, whose daemon must be running.
    ///
    /// # Errors
    /// [`TransportError`], naming the service and the remedy.
    pub fn open(instance: &Instance) -> Result<Self, TransportError> {
        Self::open_on(transport::open_node(LATEST)?, instance)
    }

    /// The same on a node of one's own.
    ///
    /// # Errors
    /// [`TransportError`], naming the service and the remedy.
    pub fn open_on(node: Node, instance: &Instance) -> Result<Self, TransportError> {
        let open = |node: &Node, instance: &Instance| {
            transport::open_latest::<E>(node, instance)?.reader()
        };
        Ok(Self {
            state: RefCell::new(LatestState {
                latest: Attached::open(node, LATEST, instance, open)?,
                seldom: Seldom::new(),
                last: E::ZERO,
                last_seq: 0,
            }),
        })
    }

    /// The newest estimate; its `estimate_seq` is 0 before the first. While the daemon's files are gone it is the last
    /// one there was.
    pub fn read(&self) -> E {
        self.state.borrow_mut().read()
    }
}

impl<E: EstimateMessage> LatestState<E> {
    fn read(&mut self) -> E {
        let estimate = match self.latest.ports() {
            Some(latest) => latest.read(),
            None => self.last,
        };
        let seq = estimate.head().estimate_seq;
        if seq != core::mem::replace(&mut self.last_seq, seq) {
            self.latest.heard();
        } else if let Some(now_ns) = self.seldom.now_ns() {
            self.last = estimate;
            self.latest.look(now_ns);
        }
        estimate
    }
}
