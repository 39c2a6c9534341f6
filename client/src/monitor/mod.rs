//! A live view of a running daemon: `inekf-client monitor`.
//!
//! [`Watcher`] drains health and estimates and keeps a [`Picture`] of the last second, whatever the model; [`text`] puts
//! a picture in words, [`mod@screen`] on a terminal. The monitor is one more reader: it takes nothing from anybody and
//! slows nobody.

mod picture;
#[cfg(feature = "monitor")]
pub mod screen;
pub mod text;

use std::time::{Duration, Instant};

use inekf_shared::clock::monotonic_ns;
use inekf_shared::message::{EstimateSe2, EstimateSe3, EstimateSe23, Health};
use inekf_shared::topic::Instance;
use inekf_shared::transport::{self, Node};

pub use picture::{Picture, Quantity};

use crate::attach::Attached;
use crate::model::{Estimate, Model};
use crate::read::{EstimateReader, Listening};
use crate::session::running_model;

/// Name of a monitor's node, for people who list the nodes.
const NODE: &str = "inekf-monitor";
/// How often the queues are drained: the reader's buffer holds a second of estimates at 1 kHz.
pub const POLL: Duration = Duration::from_millis(50);
/// The length of a picture.
pub const PERIOD: Duration = Duration::from_secs(1);

/// What is done with each picture; `false` ends the monitor.
///
/// ```
/// use inekf_client::model::Model;
/// use inekf_client::monitor::{Picture, Show};
///
/// // Three pictures, and it is enough.
/// let mut seen = 0;
/// let show: Show<'_> = &mut |_: &Picture| {
///     seen += 1;
///     Ok(seen < 3)
/// };
/// let picture = Picture::new("car", Model::Imu)?;
/// assert!(show(&picture)? && show(&picture)? && !show(&picture)?);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub type Show<'a> = &'a mut dyn FnMut(&Picture) -> anyhow::Result<bool>;

/// Watches the daemon of `instance` and shows a picture every [`PERIOD`], until `show` or `stop` ends it. `stop` is asked
/// every [`POLL`].
///
/// # Errors
/// No daemon answers, a port fails, or what `show` returns.
///
/// It is not run here, for it needs a daemon, another process:
///
/// ```no_run
/// use inekf_client::monitor::{monitor, text};
/// use inekf_shared::topic::Instance;
///
/// monitor(&Instance::new("car")?, &mut || Ok(false), &mut |picture| {
///     println!("{}", text::line(picture));
///     Ok(true)
/// })?;
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn monitor(
    instance: &Instance,
    stop: &mut dyn FnMut() -> anyhow::Result<bool>,
    show: Show<'_>,
) -> anyhow::Result<()> {
    match running_model(instance)? {
        Model::Imu => Watcher::<EstimateSe23>::open(instance)?.run(stop, show),
        Model::Odometry3d => Watcher::<EstimateSe3>::open(instance)?.run(stop, show),
        Model::Odometry2d => Watcher::<EstimateSe2>::open(instance)?.run(stop, show),
    }
}

/// Reads what one daemon says of itself, and its estimates.
///
/// ```
/// use std::time::Duration;
///
/// use inekf_client::monitor::Watcher;
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
/// let reader = EstimateReader::<EstimateSe23>::open_on(node()?, &instance)?;
/// let mut watcher = Watcher::open_on(node()?, reader, &instance)?;
/// // What a daemon does, a few times:
/// let daemon = node()?;
/// let estimates = transport::estimate::<EstimateSe23>(&daemon, &instance)?.publisher()?;
/// for _ in 0..5 {
///     estimates.send_copy(EstimateSe23::ZERO)?;
/// }
/// watcher.drain()?;
/// let picture = watcher.picture(Duration::from_secs(1));
/// assert_eq!((picture.estimate_rate_hz, picture.missed), (5.0, 0));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub struct Watcher<E: Estimate> {
    estimates: EstimateReader<E>,
    health: Listening<Health>,
    picture: Picture,
}

impl<E: Estimate> Watcher<E> {
    /// A watcher of `instance`.
    ///
    /// # Errors
    /// A port cannot be opened, or the daemon has another model.
    ///
    /// ```
    /// use inekf_client::monitor::Watcher;
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
    /// let mut watcher = Watcher::<EstimateSe23>::open(&Instance::new("car")?)?;
    /// watcher.drain()?;
    /// assert!(watcher.picture(inekf_client::monitor::PERIOD).health.is_none());
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn open(instance: &Instance) -> anyhow::Result<Self> {
        Self::open_on(
            transport::open_node(NODE)?,
            EstimateReader::open(instance)?,
            instance,
        )
    }

    /// The same on a node and with a reader of one's own.
    ///
    /// # Errors
    /// As [`Watcher::open`].
    ///
    /// ```
    /// use inekf_client::monitor::Watcher;
    /// use inekf_client::read::EstimateReader;
    /// use inekf_shared::message::EstimateSe2;
    /// use inekf_shared::topic::Instance;
    /// use inekf_shared::transport;
    ///
    /// # let root = tempfile::tempdir_in("/tmp")?;
    /// # let prefix = root.path().file_name().and_then(|name| name.to_str());
    /// # let config = transport::config(root.path().to_str(), prefix)?;
    /// # let node = || transport::open_node_with("doc", &config);
    /// # let instance = Instance::new("car")?;
    /// let reader = EstimateReader::<EstimateSe2>::open_on(node()?, &instance)?;
    /// let mut watcher = Watcher::open_on(node()?, reader, &instance)?;
    /// assert_eq!(watcher.picture(inekf_client::monitor::PERIOD).instance, "car");
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn open_on(
        node: Node,
        estimates: EstimateReader<E>,
        instance: &Instance,
    ) -> anyhow::Result<Self> {
        let open =
            |node: &Node, instance: &Instance| transport::health(node, instance)?.subscriber();
        Ok(Self {
            health: Listening::new(Attached::open(node, NODE, instance, open)?),
            estimates,
            picture: Picture::new(instance.as_str(), E::KIND)?,
        })
    }

    /// Takes what has come.
    ///
    /// # Errors
    /// A port fails.
    ///
    /// Nothing waits is no fault:
    ///
    /// ```
    ///
    /// use inekf_client::monitor::Watcher;
    /// use inekf_client::read::EstimateReader;
    /// use inekf_shared::message::EstimateSe2;
    /// use inekf_shared::topic::Instance;
    /// use inekf_shared::transport;
    ///
    /// # let root = tempfile::tempdir_in("/tmp")?;
    /// # let prefix = root.path().file_name().and_then(|name| name.to_str());
    /// # let config = transport::config(root.path().to_str(), prefix)?;
    /// # let node = || transport::open_node_with("doc", &config);
    /// let instance = Instance::new("car")?;
    /// let reader = EstimateReader::<EstimateSe2>::open_on(node()?, &instance)?;
    /// let mut watcher = Watcher::open_on(node()?, reader, &instance)?;
    /// watcher.drain()?;
    /// assert!(watcher.picture(inekf_client::monitor::PERIOD).head.is_none());
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn drain(&mut self) -> anyhow::Result<()> {
        while let Some(health) = self.health.receive()? {
            self.picture.take_health(&health);
        }
        while let Some(estimate) = self.estimates.next_estimate()? {
            self.picture.take_estimate(&estimate);
        }
        Ok(())
    }

    /// The picture of the time since the last one, which took `elapsed`.
    ///
    /// ```
    /// use inekf_client::monitor::Watcher;
    /// use inekf_client::read::EstimateReader;
    /// use inekf_shared::message::EstimateSe2;
    /// use inekf_shared::topic::Instance;
    /// use inekf_shared::transport;
    ///
    /// # let root = tempfile::tempdir_in("/tmp")?;
    /// # let prefix = root.path().file_name().and_then(|name| name.to_str());
    /// # let config = transport::config(root.path().to_str(), prefix)?;
    /// # let node = || transport::open_node_with("doc", &config);
    /// # let instance = Instance::new("car")?;
    /// let reader = EstimateReader::<EstimateSe2>::open_on(node()?, &instance)?;
    /// let mut watcher = Watcher::open_on(node()?, reader, &instance)?;
    /// # use inekf_shared::message::Zero;
    /// # let daemon = node()?;
    /// # let estimates = transport::estimate::<EstimateSe2>(&daemon, &instance)?.publisher()?;
    /// estimates.send_copy(EstimateSe2::ZERO)?;
    /// watcher.drain()?;
    /// // One in half a second.
    /// let picture = watcher.picture(std::time::Duration::from_millis(500));
    /// assert_eq!(picture.estimate_rate_hz, 2.0);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn picture(&mut self, elapsed: Duration) -> &Picture {
        let missed = self.estimates.missed();
        self.picture.finish(monotonic_ns(), elapsed, missed);
        &self.picture
    }

    fn run(
        mut self,
        stop: &mut dyn FnMut() -> anyhow::Result<bool>,
        show: Show<'_>,
    ) -> anyhow::Result<()> {
        let mut last = Instant::now();
        while !stop()? {
            self.drain()?;
            if last.elapsed() >= PERIOD {
                let elapsed = last.elapsed();
                last = Instant::now();
                if !show(self.picture(elapsed))? {
                    return Ok(());
                }
                self.picture.begin();
            }
            std::thread::sleep(POLL);
        }
        Ok(())
    }
}
