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

use inekf_shared::message::{EstimateMessage, EstimateSe23, Message, SmoothedState};
use inekf_shared::topic::Instance;
use inekf_shared::transport::{self, Node, Received, Subscriber, TransportError};

use crate::attach::{Attached, Seldom};
use crate::model::Model;

mod latest;

pub use latest::LatestEstimate;

/// Names of the readers' nodes, for people who list the nodes.
const READER: &str = "inekf-reader";
const SMOOTHED: &str = "inekf-smoothed";

/// Estimates or smoothed states could not be received.
///
/// ```
/// use inekf_client::read::ReadError;
///
/// let error = ReadError { cause: "ExceedsMaxBorrows".to_owned() };
/// assert_eq!(error.to_string(), "receiving from the daemon: ExceedsMaxBorrows");
/// ```
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
///
/// ```
/// use inekf_client::read::model_of;
/// use inekf_shared::topic::Instance;
///
/// // Of an instance that nobody has started.
/// let nobody = Instance::new(&format!("doc-{}", std::process::id()))?;
/// assert_eq!(model_of(&nobody)?, None);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
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
///
/// ```
/// use inekf_client::read::EstimateReader;
/// use inekf_shared::message::{EstimateSe23, Zero};
/// use inekf_shared::topic::Instance;
/// use inekf_shared::transport;
///
/// # let root = tempfile::tempdir_in("/tmp")?;
/// # let prefix = root.path().file_name().and_then(|name| name.to_str());
/// # let config = transport::config(root.path().to_str(), prefix)?;
/// # let node = || transport::open_node_with("doc", &config);
/// let instance = Instance::new("car")?;
/// let mut reader = EstimateReader::<EstimateSe23>::open_on(node()?, &instance)?;
/// // What a daemon does:
/// let daemon = node()?;
/// let publisher = transport::estimate(&daemon, &instance)?.publisher()?;
/// for estimate_seq in [1, 2, 5] {
///     let mut estimate = EstimateSe23::ZERO;
///     estimate.head.estimate_seq = estimate_seq;
///     publisher.send_copy(estimate)?;
/// }
/// let mut numbers = Vec::new();
/// while let Some(estimate) = reader.next_estimate()? {
///     numbers.push(estimate.head.estimate_seq);
/// }
/// // In order, and the gap is counted.
/// assert_eq!((numbers, reader.missed()), (vec![1, 2, 5], 2));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
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
    ///
    /// ```
    /// use inekf_client::read::EstimateReader;
    /// use inekf_shared::message::EstimateSe23;
    /// use inekf_shared::topic::Instance;
    ///
    /// # let root = tempfile::tempdir_in("/tmp")?;
    /// # let prefix = root.path().file_name().expect("a name");
    /// # // SAFETY: this process has no other thread.
    /// # unsafe {
    /// #     std::env::set_var("INEKF_IPC_ROOT", root.path());
    /// #     std::env::set_var("INEKF_IPC_PREFIX", prefix);
    /// # }
    /// let mut reader = EstimateReader::<EstimateSe23>::open(&Instance::new("car")?)?;
    /// assert!(reader.next_estimate()?.is_none());
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn open(instance: &Instance) -> Result<Self, TransportError> {
        Self::open_on(transport::open_node(READER)?, instance)
    }

    /// The same on a node of one's own.
    ///
    /// # Errors
    /// [`TransportError`], naming the service and the remedy.
    ///
    /// A node under a configuration of one's own keeps a test apart from all else:
    ///
    /// ```
    /// use inekf_client::read::EstimateReader;
    /// use inekf_shared::message::EstimateSe23;
    /// use inekf_shared::topic::Instance;
    /// use inekf_shared::transport;
    ///
    /// # let root = tempfile::tempdir_in("/tmp")?;
    /// # let prefix = root.path().file_name().and_then(|name| name.to_str());
    /// let config = transport::config(root.path().to_str(), prefix)?;
    /// let node = transport::open_node_with("my-test", &config)?;
    /// let mut reader = EstimateReader::<EstimateSe23>::open_on(node, &Instance::new("car")?)?;
    /// assert!(reader.next_estimate()?.is_none() && reader.missed() == 0);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
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
    ///
    /// ```
    /// use inekf_client::read::EstimateReader;
    /// use inekf_shared::message::{EstimateSe23, Zero};
    /// use inekf_shared::topic::Instance;
    /// use inekf_shared::transport;
    ///
    /// # let root = tempfile::tempdir_in("/tmp")?;
    /// # let prefix = root.path().file_name().and_then(|name| name.to_str());
    /// # let config = transport::config(root.path().to_str(), prefix)?;
    /// # let node = || transport::open_node_with("doc", &config);
    /// # let instance = Instance::new("car")?;
    /// let mut reader = EstimateReader::<EstimateSe23>::open_on(node()?, &instance)?;
    /// // Nobody has removed a file of theirs yet.
    /// assert_eq!(reader.reattached(), 0);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn reattached(&self) -> u64 {
        self.estimates.subscriber.times()
    }

    /// The next estimate where it lies in shared memory, or `None` if none waits. Never blocks, copies nothing.
    ///
    /// Drop it soon: at most [`MAX_BORROWED`](inekf_shared::qos::MAX_BORROWED) may be held at a time.
    ///
    /// # Errors
    /// [`ReadError`].
    ///
    /// ```
    /// # use inekf_client::read::EstimateReader;
    /// # use inekf_shared::message::{EstimateSe23, Zero};
    /// # use inekf_shared::topic::Instance;
    /// # use inekf_shared::transport;
    /// # let root = tempfile::tempdir_in("/tmp")?;
    /// # let prefix = root.path().file_name().and_then(|name| name.to_str());
    /// # let config = transport::config(root.path().to_str(), prefix)?;
    /// # let node = || transport::open_node_with("doc", &config);
    /// # let instance = Instance::new("car")?;
    /// # let mut reader = EstimateReader::<EstimateSe23>::open_on(node()?, &instance)?;
    /// # let daemon = node()?;
    /// # let publisher = transport::estimate(&daemon, &instance)?.publisher()?;
    /// publisher.send_copy(EstimateSe23 { p_w_m: [1.0, 2.0, 3.0], ..EstimateSe23::ZERO })?;
    /// if let Some(estimate) = reader.borrow_next()? {
    ///     // Read where it lies: 1288 bytes that are not copied.
    ///     assert_eq!(estimate.p_w_m[1], 2.0);
    /// }
    /// assert!(reader.borrow_next()?.is_none());
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
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
    ///
    /// ```
    /// # use inekf_client::read::EstimateReader;
    /// # use inekf_shared::message::{EstimateSe23, Zero};
    /// # use inekf_shared::topic::Instance;
    /// # use inekf_shared::transport;
    /// # let root = tempfile::tempdir_in("/tmp")?;
    /// # let prefix = root.path().file_name().and_then(|name| name.to_str());
    /// # let config = transport::config(root.path().to_str(), prefix)?;
    /// # let node = || transport::open_node_with("doc", &config);
    /// # let instance = Instance::new("car")?;
    /// # let mut reader = EstimateReader::<EstimateSe23>::open_on(node()?, &instance)?;
    /// # let daemon = node()?;
    /// # let publisher = transport::estimate(&daemon, &instance)?.publisher()?;
    /// publisher.send_copy(EstimateSe23 { v_w_mps: [0.5, 0.0, 0.0], ..EstimateSe23::ZERO })?;
    /// let copy = reader.next_estimate()?.expect("one was published");
    /// assert_eq!(copy.v_w_mps[0], 0.5);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn next_estimate(&mut self) -> Result<Option<E>, ReadError> {
        Ok(self.borrow_next()?.map(|estimate| *estimate))
    }

    /// Estimates that were overwritten before they were read.
    ///
    /// ```
    /// use inekf_client::read::EstimateReader;
    /// use inekf_shared::message::{EstimateSe23, Zero};
    /// use inekf_shared::topic::Instance;
    /// use inekf_shared::transport;
    ///
    /// # let root = tempfile::tempdir_in("/tmp")?;
    /// # let prefix = root.path().file_name().and_then(|name| name.to_str());
    /// # let config = transport::config(root.path().to_str(), prefix)?;
    /// # let node = || transport::open_node_with("doc", &config);
    /// # let instance = Instance::new("car")?;
    /// let mut reader = EstimateReader::<EstimateSe23>::open_on(node()?, &instance)?;
    /// # let daemon = node()?;
    /// # let publisher = transport::estimate(&daemon, &instance)?.publisher()?;
    /// for estimate_seq in [1, 4] {
    ///     let mut estimate = EstimateSe23::ZERO;
    ///     estimate.head.estimate_seq = estimate_seq;
    ///     publisher.send_copy(estimate)?;
    ///     reader.next_estimate()?;
    /// }
    /// assert_eq!(reader.missed(), 2);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn missed(&self) -> u64 {
        self.missed
    }
}

/// Receives the smoothed states of one daemon, in order, and counts those it missed: each state that leaves the
/// window, and the whole window when a request asks for it.
///
/// ```
/// use inekf_client::read::SmoothedReader;
/// use inekf_shared::message::{SmoothedState, Zero};
/// use inekf_shared::topic::Instance;
/// use inekf_shared::transport;
///
/// # let root = tempfile::tempdir_in("/tmp")?;
/// # let prefix = root.path().file_name().and_then(|name| name.to_str());
/// # let config = transport::config(root.path().to_str(), prefix)?;
/// # let node = || transport::open_node_with("doc", &config);
/// let instance = Instance::new("car")?;
/// let mut reader = SmoothedReader::open_on(node()?, &instance)?;
/// // What a daemon does: states leave the window, oldest first; one of them was overwritten.
/// let daemon = node()?;
/// let publisher = transport::smoothed(&daemon, &instance)?.publisher()?;
/// for index in [0, 1, 3] {
///     publisher.send_copy(SmoothedState { index, stamp_ns: 100 * index, ..SmoothedState::ZERO })?;
/// }
/// let mut stamps_ns = Vec::new();
/// while let Some(state) = reader.next_state()? {
///     stamps_ns.push(state.stamp_ns);
/// }
/// assert_eq!((stamps_ns, reader.missed()), (vec![0, 100, 300], 1));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
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
    ///
    /// ```
    /// use inekf_client::read::SmoothedReader;
    /// use inekf_shared::topic::Instance;
    ///
    /// # let root = tempfile::tempdir_in("/tmp")?;
    /// # let prefix = root.path().file_name().expect("a name");
    /// # // SAFETY: this process has no other thread.
    /// # unsafe {
    /// #     std::env::set_var("INEKF_IPC_ROOT", root.path());
    /// #     std::env::set_var("INEKF_IPC_PREFIX", prefix);
    /// # }
    /// let mut reader = SmoothedReader::open(&Instance::new("car")?)?;
    /// assert!(reader.next_state()?.is_none());
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn open(instance: &Instance) -> Result<Self, TransportError> {
        Self::open_on(transport::open_node(SMOOTHED)?, instance)
    }

    /// The same on a node of one's own.
    ///
    /// # Errors
    /// [`TransportError`], naming the service and the remedy.
    ///
    /// ```
    /// use inekf_client::read::SmoothedReader;
    /// use inekf_shared::message::{SmoothedState, Zero};
    /// use inekf_shared::topic::Instance;
    /// use inekf_shared::transport;
    ///
    /// # let root = tempfile::tempdir_in("/tmp")?;
    /// # let prefix = root.path().file_name().and_then(|name| name.to_str());
    /// # let config = transport::config(root.path().to_str(), prefix)?;
    /// # let node = || transport::open_node_with("doc", &config);
    /// # let instance = Instance::new("car")?;
    /// let mut reader = SmoothedReader::open_on(node()?, &instance)?;
    /// assert!(reader.next_state()?.is_none() && reader.missed() == 0);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
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
    ///
    /// ```
    /// # use inekf_client::read::SmoothedReader;
    /// # use inekf_shared::message::{SmoothedState, Zero};
    /// # use inekf_shared::topic::Instance;
    /// # use inekf_shared::transport;
    /// # let root = tempfile::tempdir_in("/tmp")?;
    /// # let prefix = root.path().file_name().and_then(|name| name.to_str());
    /// # let config = transport::config(root.path().to_str(), prefix)?;
    /// # let node = || transport::open_node_with("doc", &config);
    /// # let (instance, daemon) = (Instance::new("car")?, node()?);
    /// # let mut reader = SmoothedReader::open_on(node()?, &instance)?;
    /// # let publisher = transport::smoothed(&daemon, &instance)?.publisher()?;
    /// // A state that answers a request is still in the window; its place there is no gap.
    /// publisher.send_copy(SmoothedState { request_id: 7, index: 4, ..SmoothedState::ZERO })?;
    /// let state = reader.next_state()?.expect("one was published");
    /// assert_eq!((state.request_id, reader.missed()), (7, 0));
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
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
    ///
    /// ```
    /// use inekf_client::read::SmoothedReader;
    /// use inekf_shared::message::{SmoothedState, Zero};
    /// use inekf_shared::topic::Instance;
    /// use inekf_shared::transport;
    ///
    /// # let root = tempfile::tempdir_in("/tmp")?;
    /// # let prefix = root.path().file_name().and_then(|name| name.to_str());
    /// # let config = transport::config(root.path().to_str(), prefix)?;
    /// # let node = || transport::open_node_with("doc", &config);
    /// # let instance = Instance::new("car")?;
    /// let mut reader = SmoothedReader::open_on(node()?, &instance)?;
    /// # let daemon = node()?;
    /// # let publisher = transport::smoothed(&daemon, &instance)?.publisher()?;
    /// for index in [0, 3] {
    ///     publisher.send_copy(SmoothedState { index, ..SmoothedState::ZERO })?;
    ///     reader.next_state()?;
    /// }
    /// assert_eq!(reader.missed(), 2);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn missed(&self) -> u64 {
        self.missed
    }
}
