//! The newest estimate only: a slot that is read as often as one likes.

use core::cell::RefCell;

use inekf_shared::message::{EstimateMessage, EstimateSe23};
use inekf_shared::topic::Instance;
use inekf_shared::transport::{self, LatestReader, Node, TransportError};

use crate::attach::{Attached, Seldom};

/// Name of the reader's node, for people who list the nodes.
const LATEST: &str = "inekf-latest";

/// Reads the newest estimate only, as a controller would.
///
/// ```
/// use inekf_client::read::LatestEstimate;
/// use inekf_shared::message::{EstimateSe23, Zero};
/// use inekf_shared::topic::Instance;
/// use inekf_shared::transport;
///
/// # let root = tempfile::tempdir_in("/tmp")?;
/// # let prefix = root.path().file_name().and_then(|name| name.to_str());
/// # let config = transport::config(root.path().to_str(), prefix)?;
/// # let node = || transport::open_node_with("doc", &config);
/// let instance = Instance::new("car")?;
/// // What a daemon does:
/// let daemon = node()?;
/// let writer = transport::latest(&daemon, &instance, EstimateSe23::ZERO)?.writer()?;
/// let newest = LatestEstimate::<EstimateSe23>::open_on(node()?, &instance)?;
/// // Before the first.
/// assert_eq!(newest.read().head.estimate_seq, 0);
/// for estimate_seq in 1..=3 {
///     let mut estimate = EstimateSe23::ZERO;
///     estimate.head.estimate_seq = estimate_seq;
///     assert!(writer.write(estimate));
/// }
/// // However slow the reader: the newest, and only that.
/// assert_eq!(newest.read().head.estimate_seq, 3);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
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
    ///
    /// ```
    /// use inekf_client::read::LatestEstimate;
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
    /// // There is no newest estimate where no daemon runs.
    /// assert!(LatestEstimate::<EstimateSe23>::open(&Instance::new("car")?).is_err());
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn open(instance: &Instance) -> Result<Self, TransportError> {
        Self::open_on(transport::open_node(LATEST)?, instance)
    }

    /// The same on a node of one's own.
    ///
    /// # Errors
    /// [`TransportError`], naming the service and the remedy.
    ///
    /// ```
    /// use inekf_client::read::LatestEstimate;
    /// use inekf_shared::message::{EstimateSe23, Zero};
    /// use inekf_shared::topic::Instance;
    /// use inekf_shared::transport;
    ///
    /// # let root = tempfile::tempdir_in("/tmp")?;
    /// # let prefix = root.path().file_name().and_then(|name| name.to_str());
    /// # let config = transport::config(root.path().to_str(), prefix)?;
    /// # let node = || transport::open_node_with("doc", &config);
    /// # let instance = Instance::new("car")?;
    /// // What a daemon does:
    /// let daemon = node()?;
    /// let writer = transport::latest(&daemon, &instance, EstimateSe23::ZERO)?.writer()?;
    /// let newest = LatestEstimate::<EstimateSe23>::open_on(node()?, &instance)?;
    /// assert_eq!(newest.read().p_w_m, [0.0; 3]);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
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
    ///
    /// ```
    /// use inekf_client::read::LatestEstimate;
    /// use inekf_shared::message::{EstimateSe23, Zero};
    /// use inekf_shared::topic::Instance;
    /// use inekf_shared::transport;
    ///
    /// # let root = tempfile::tempdir_in("/tmp")?;
    /// # let prefix = root.path().file_name().and_then(|name| name.to_str());
    /// # let config = transport::config(root.path().to_str(), prefix)?;
    /// # let node = || transport::open_node_with("doc", &config);
    /// # let instance = Instance::new("car")?;
    /// // What a daemon does:
    /// let daemon = node()?;
    /// let writer = transport::latest(&daemon, &instance, EstimateSe23::ZERO)?.writer()?;
    /// let newest = LatestEstimate::<EstimateSe23>::open_on(node()?, &instance)?;
    /// let mut estimate = EstimateSe23 { p_w_m: [1.0, 2.0, 3.0], ..EstimateSe23::ZERO };
    /// estimate.head.estimate_seq = 1;
    /// writer.write(estimate);
    /// // As often as one likes, in no more time than it takes to copy it.
    /// assert_eq!((newest.read().p_w_m[1], newest.read().p_w_m[1]), (2.0, 2.0));
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
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
