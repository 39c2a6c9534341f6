//! A feeder: the sending side of a user's own sensor process.
//!
//! ```no_run
//! use inekf_client::dataset::ImuRow;
//! use inekf_client::feed::Feeder;
//! use inekf_shared::topic::Instance;
//!
//! let mut feeder = Feeder::open(&Instance::new("default")?)?;
//! let receivers = feeder.imu(&ImuRow {
//!     stamp_ns: 1_000_000,
//!     gyro_rps: [0.0; 3],
//!     accel_mps2: [0.0, 0.0, 9.81],
//! })?;
//! assert!(receivers > 0, "no daemon is listening");
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

use inekf_shared::clock::monotonic_ns;
use inekf_shared::message::{
    HeadingFix, ImuSample, Message, Odometry2d, Odometry3d, PositionFix, VelocityFix,
};
use inekf_shared::topic::Instance;
use inekf_shared::transport::{
    self, InputMessage, Node, Outlet, Publisher, TransportError, WakeNotifier,
};

use super::number::Numbering;
use crate::attach::Attached;
use crate::dataset::{
    Event, HeadingRow, ImuRow, Odometry2dRow, Odometry3dRow, PositionRow, VelocityRow,
};

/// Name of a feeder's node, for people who list the nodes.
const NODE: &str = "inekf-feeder";

/// A sample could not be sent.
///
/// ```
/// use inekf_client::feed::SendError;
///
/// let error = SendError { topic: "imu", cause: "LoanError::OutOfMemory".to_owned() };
/// assert!(error.to_string().starts_with("sending on the topic imu: "));
/// ```
#[derive(Debug, thiserror::Error)]
#[error("sending on the topic {topic}: {cause}; is there space in /dev/shm?")]
pub struct SendError {
    /// The topic.
    pub topic: &'static str,
    /// iceoryx2's word for it.
    pub cause: String,
}

/// Numbers, stamps and sends samples of every kind to one daemon, and wakes it.
///
/// Every sending method returns the number of daemons that got the sample: 0 if none is there.
/// Sending never waits. If somebody removes the files in shared memory the feeder attaches anew by itself, within half a
/// second and at the cost of one send that takes as long as opening did; what was sent to nobody meanwhile is lost, and
/// the daemon counts it.
///
/// ```
/// use inekf_client::dataset::ImuRow;
/// use inekf_client::feed::Feeder;
/// use inekf_shared::message::ImuSample;
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
/// let inputs = transport::input::<ImuSample>(&daemon, &instance)?.subscriber()?;
/// // What a sensor's process does:
/// let mut feeder = Feeder::open_on(node()?, &instance)?;
/// let row = ImuRow { stamp_ns: 5_000_000, gyro_rps: [0.0; 3], accel_mps2: [0.0, 0.0, 9.81] };
/// assert_eq!((feeder.imu(&row)?, feeder.imu(&row)?), (1, 1));
/// // Numbered, and of one life of the sender.
/// let (first, second) = (inputs.receive()?.expect("sent"), inputs.receive()?.expect("sent"));
/// assert_eq!((first.header.seq, second.header.seq), (0, 1));
/// assert_eq!(first.header.epoch, second.header.epoch);
/// assert_eq!(first.header.stamp_ns, 5_000_000);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub struct Feeder {
    ports: Attached<Ports>,
    numbering: Numbering,
}

/// What a feeder sends through.
struct Ports {
    imu: Outlet<ImuSample>,
    odometry2d: Outlet<Odometry2d>,
    odometry3d: Outlet<Odometry3d>,
    position: Outlet<PositionFix>,
    velocity: Outlet<VelocityFix>,
    heading: Outlet<HeadingFix>,
    wake: WakeNotifier,
}

impl Ports {
    fn open(node: &Node, instance: &Instance) -> Result<Self, TransportError> {
        let inputs = transport::inputs(node, instance)?;
        Ok(Self {
            imu: ready(inputs.imu.publisher()?),
            odometry2d: ready(inputs.odometry2d.publisher()?),
            odometry3d: ready(inputs.odometry3d.publisher()?),
            position: ready(inputs.position.publisher()?),
            velocity: ready(inputs.velocity.publisher()?),
            heading: ready(inputs.heading.publisher()?),
            wake: transport::wake(node, instance)?.notifier()?,
        })
    }
}

impl Feeder {
    /// A feeder of `instance`, whether its daemon runs already or not.
    ///
    /// # Errors
    /// [`TransportError`], naming the service and the remedy.
    ///
    /// ```
    /// use inekf_client::feed::Feeder;
    /// use inekf_shared::topic::Instance;
    ///
    /// # let root = tempfile::tempdir_in("/tmp")?;
    /// # let prefix = root.path().file_name().expect("a name");
    /// # // SAFETY: this process has no other thread.
    /// # unsafe {
    /// #     std::env::set_var("INEKF_IPC_ROOT", root.path());
    /// #     std::env::set_var("INEKF_IPC_PREFIX", prefix);
    /// # }
    /// // Where the daemon looks too, which may come later.
    /// let feeder = Feeder::open(&Instance::new("car")?)?;
    /// assert_eq!(feeder.reattached(), 0);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn open(instance: &Instance) -> Result<Self, TransportError> {
        Self::open_on(transport::open_node(NODE)?, instance)
    }

    /// The same on a node of one's own.
    ///
    /// # Errors
    /// [`TransportError`], naming the service and the remedy.
    ///
    /// ```
    /// use inekf_client::feed::Feeder;
    /// use inekf_shared::message::ImuSample;
    /// use inekf_shared::topic::Instance;
    /// use inekf_shared::transport;
    ///
    /// # let root = tempfile::tempdir_in("/tmp")?;
    /// # let prefix = root.path().file_name().and_then(|name| name.to_str());
    /// # let config = transport::config(root.path().to_str(), prefix)?;
    /// # let node = || transport::open_node_with("doc", &config);
    /// let car = Instance::new("car")?;
    /// let feeder = Feeder::open_on(node()?, &car)?;
    /// let daemon = node()?;
    /// assert_eq!(transport::input::<ImuSample>(&daemon, &car)?.publisher_count(), 1);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn open_on(node: Node, instance: &Instance) -> Result<Self, TransportError> {
        Ok(Self {
            ports: Attached::open(node, NODE, instance, Ports::open)?,
            numbering: Numbering::new(monotonic_ns()),
        })
    }

    /// How often it attached anew because its files had been removed.
    ///
    /// ```
    /// use inekf_client::feed::Feeder;
    /// use inekf_shared::topic::Instance;
    /// use inekf_shared::transport;
    ///
    /// # let root = tempfile::tempdir_in("/tmp")?;
    /// # let prefix = root.path().file_name().and_then(|name| name.to_str());
    /// # let config = transport::config(root.path().to_str(), prefix)?;
    /// # let node = || transport::open_node_with("doc", &config);
    /// let feeder = Feeder::open_on(node()?, &Instance::new("car")?)?;
    /// // Nobody has removed a file of theirs yet.
    /// assert_eq!(feeder.reattached(), 0);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn reattached(&self) -> u64 {
        self.ports.times()
    }

    /// Sends a row of any kind.
    ///
    /// # Errors
    /// [`SendError`].
    ///
    /// ```
    /// use inekf_client::dataset::{Event, HeadingRow};
    /// use inekf_client::feed::Feeder;
    /// # use inekf_shared::topic::Instance;
    /// # use inekf_shared::transport;
    ///
    /// # let root = tempfile::tempdir_in("/tmp")?;
    /// # let prefix = root.path().file_name().and_then(|name| name.to_str());
    /// # let config = transport::config(root.path().to_str(), prefix)?;
    /// # let node = || transport::open_node_with("doc", &config);
    /// let mut feeder = Feeder::open_on(node()?, &Instance::new("car")?)?;
    /// let row = HeadingRow { stamp_ns: 5, source: 0, heading_rad: 0.3, sigma_rad: 0.1 };
    /// // No daemon listens: nobody gets it, and that is no error.
    /// assert_eq!(feeder.send(&Event::Heading(row))?, 0);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn send(&mut self, event: &Event) -> Result<usize, SendError> {
        match event {
            Event::Imu(row) => self.imu(row),
            Event::Odometry2d(row) => self.odometry2d(row),
            Event::Odometry3d(row) => self.odometry3d(row),
            Event::Position(row) => self.position(row),
            Event::Velocity(row) => self.velocity(row),
            Event::Heading(row) => self.heading(row),
        }
    }

    /// Sends an IMU sample.
    ///
    /// # Errors
    /// [`SendError`].
    ///
    /// ```
    /// # use inekf_client::dataset::ImuRow;
    /// # use inekf_client::feed::Feeder;
    /// # use inekf_shared::message::ImuSample;
    /// # use inekf_shared::topic::Instance;
    /// # use inekf_shared::transport;
    /// # let root = tempfile::tempdir_in("/tmp")?;
    /// # let prefix = root.path().file_name().and_then(|name| name.to_str());
    /// # let config = transport::config(root.path().to_str(), prefix)?;
    /// # let node = || transport::open_node_with("doc", &config);
    /// # let (instance, daemon) = (Instance::new("car")?, node()?);
    /// # let inputs = transport::input::<ImuSample>(&daemon, &instance)?.subscriber()?;
    /// # let mut feeder = Feeder::open_on(node()?, &instance)?;
    /// let row = ImuRow { stamp_ns: 5, gyro_rps: [0.0, 0.0, 0.1], accel_mps2: [0.0, 0.0, 9.81] };
    /// assert_eq!(feeder.imu(&row)?, 1);
    /// assert_eq!(inputs.receive()?.expect("sent").gyro_rps, row.gyro_rps);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn imu(&mut self, row: &ImuRow) -> Result<usize, SendError> {
        let message = self.numbering.imu(row, monotonic_ns());
        send(&mut self.ports, |ports| &mut ports.imu, &message, "imu")
    }

    /// Sends a planar odometry increment.
    ///
    /// # Errors
    /// [`SendError`].
    ///
    /// ```
    /// # use inekf_client::dataset::Odometry2dRow;
    /// # use inekf_client::feed::Feeder;
    /// # use inekf_shared::message::Odometry2d;
    /// # use inekf_shared::topic::Instance;
    /// # use inekf_shared::transport;
    /// # let root = tempfile::tempdir_in("/tmp")?;
    /// # let prefix = root.path().file_name().and_then(|name| name.to_str());
    /// # let config = transport::config(root.path().to_str(), prefix)?;
    /// # let node = || transport::open_node_with("doc", &config);
    /// # let (instance, daemon) = (Instance::new("car")?, node()?);
    /// # let inputs = transport::input::<Odometry2d>(&daemon, &instance)?.subscriber()?;
    /// # let mut feeder = Feeder::open_on(node()?, &instance)?;
    /// let row = Odometry2dRow { stamp_ns: 5, dtheta_rad: 0.01, translation_m: [0.1, 0.0] };
    /// assert_eq!(feeder.odometry2d(&row)?, 1);
    /// assert_eq!(inputs.receive()?.expect("sent").translation_m, [0.1, 0.0]);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn odometry2d(&mut self, row: &Odometry2dRow) -> Result<usize, SendError> {
        let message = self.numbering.odometry2d(row, monotonic_ns());
        send(
            &mut self.ports,
            |ports| &mut ports.odometry2d,
            &message,
            "odometry2d",
        )
    }

    /// Sends a spatial odometry increment.
    ///
    /// # Errors
    /// [`SendError`].
    ///
    /// ```
    /// # use inekf_client::dataset::Odometry3dRow;
    /// # use inekf_client::feed::Feeder;
    /// # use inekf_shared::message::Odometry3d;
    /// # use inekf_shared::topic::Instance;
    /// # use inekf_shared::transport;
    /// # let root = tempfile::tempdir_in("/tmp")?;
    /// # let prefix = root.path().file_name().and_then(|name| name.to_str());
    /// # let config = transport::config(root.path().to_str(), prefix)?;
    /// # let node = || transport::open_node_with("doc", &config);
    /// # let (instance, daemon) = (Instance::new("car")?, node()?);
    /// # let inputs = transport::input::<Odometry3d>(&daemon, &instance)?.subscriber()?;
    /// # let mut feeder = Feeder::open_on(node()?, &instance)?;
    /// let row = Odometry3dRow { stamp_ns: 5, rotation_rad: [0.0, 0.0, 0.01], translation_m: [0.1, 0.0, 0.0] };
    /// assert_eq!(feeder.odometry3d(&row)?, 1);
    /// assert_eq!(inputs.receive()?.expect("sent").rotation_rad[2], 0.01);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn odometry3d(&mut self, row: &Odometry3dRow) -> Result<usize, SendError> {
        let message = self.numbering.odometry3d(row, monotonic_ns());
        send(
            &mut self.ports,
            |ports| &mut ports.odometry3d,
            &message,
            "odometry3d",
        )
    }

    /// Sends a position fix.
    ///
    /// # Errors
    /// [`SendError`].
    ///
    /// ```
    /// # use inekf_client::dataset::PositionRow;
    /// # use inekf_client::feed::Feeder;
    /// # use inekf_shared::message::PositionFix;
    /// # use inekf_shared::topic::Instance;
    /// # use inekf_shared::transport;
    /// # let root = tempfile::tempdir_in("/tmp")?;
    /// # let prefix = root.path().file_name().and_then(|name| name.to_str());
    /// # let config = transport::config(root.path().to_str(), prefix)?;
    /// # let node = || transport::open_node_with("doc", &config);
    /// # let (instance, daemon) = (Instance::new("car")?, node()?);
    /// # let inputs = transport::input::<PositionFix>(&daemon, &instance)?.subscriber()?;
    /// # let mut feeder = Feeder::open_on(node()?, &instance)?;
    /// let row = PositionRow {
    ///     stamp_ns: 5,
    ///     source: 1,
    ///     dimension: 3,
    ///     position_w_m: [10.0, 20.0, 1.0],
    ///     sigma_m: [2.0; 3],
    /// };
    /// assert_eq!(feeder.position(&row)?, 1);
    /// // The deviations cross as a covariance.
    /// assert_eq!(inputs.receive()?.expect("sent").covariance_w_m2[4], 4.0);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn position(&mut self, row: &PositionRow) -> Result<usize, SendError> {
        let message = self.numbering.position(row, monotonic_ns());
        send(
            &mut self.ports,
            |ports| &mut ports.position,
            &message,
            "position",
        )
    }

    /// Sends a velocity fix.
    ///
    /// # Errors
    /// [`SendError`].
    ///
    /// ```
    /// # use inekf_client::dataset::VelocityRow;
    /// # use inekf_client::feed::Feeder;
    /// # use inekf_shared::message::VelocityFix;
    /// # use inekf_shared::topic::Instance;
    /// # use inekf_shared::transport;
    /// # let root = tempfile::tempdir_in("/tmp")?;
    /// # let prefix = root.path().file_name().and_then(|name| name.to_str());
    /// # let config = transport::config(root.path().to_str(), prefix)?;
    /// # let node = || transport::open_node_with("doc", &config);
    /// # let (instance, daemon) = (Instance::new("car")?, node()?);
    /// # let inputs = transport::input::<VelocityFix>(&daemon, &instance)?.subscriber()?;
    /// # let mut feeder = Feeder::open_on(node()?, &instance)?;
    /// let row = VelocityRow { stamp_ns: 5, source: 0, velocity_w_mps: [3.0, 0.0, 0.0], sigma_mps: [0.1; 3] };
    /// assert_eq!(feeder.velocity(&row)?, 1);
    /// assert_eq!(inputs.receive()?.expect("sent").velocity_w_mps[0], 3.0);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn velocity(&mut self, row: &VelocityRow) -> Result<usize, SendError> {
        let message = self.numbering.velocity(row, monotonic_ns());
        send(
            &mut self.ports,
            |ports| &mut ports.velocity,
            &message,
            "velocity",
        )
    }

    /// Sends a heading fix.
    ///
    /// # Errors
    /// [`SendError`].
    ///
    /// ```
    /// # use inekf_client::dataset::HeadingRow;
    /// # use inekf_client::feed::Feeder;
    /// # use inekf_shared::message::HeadingFix;
    /// # use inekf_shared::topic::Instance;
    /// # use inekf_shared::transport;
    /// # let root = tempfile::tempdir_in("/tmp")?;
    /// # let prefix = root.path().file_name().and_then(|name| name.to_str());
    /// # let config = transport::config(root.path().to_str(), prefix)?;
    /// # let node = || transport::open_node_with("doc", &config);
    /// # let (instance, daemon) = (Instance::new("car")?, node()?);
    /// # let inputs = transport::input::<HeadingFix>(&daemon, &instance)?.subscriber()?;
    /// # let mut feeder = Feeder::open_on(node()?, &instance)?;
    /// let row = HeadingRow { stamp_ns: 5, source: 0, heading_rad: 0.3, sigma_rad: 0.02 };
    /// assert_eq!(feeder.heading(&row)?, 1);
    /// assert_eq!(inputs.receive()?.expect("sent").sigma_rad, 0.02);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn heading(&mut self, row: &HeadingRow) -> Result<usize, SendError> {
        let message = self.numbering.heading(row, monotonic_ns());
        send(
            &mut self.ports,
            |ports| &mut ports.heading,
            &message,
            "heading",
        )
    }
}

/// One slot ready for the next message: its sender loans the one after while this is on its way.
fn ready<M: Message>(publisher: Publisher<M>) -> Outlet<M> {
    Outlet::new(publisher, 1)
}

fn send<M: InputMessage>(
    ports: &mut Attached<Ports>,
    outlet: impl Fn(&mut Ports) -> &mut Outlet<M>,
    message: &M,
    topic: &'static str,
) -> Result<usize, SendError> {
    let mut receivers = 0;
    if let Some(live) = ports.ports() {
        let sent = outlet(live).send(message);
        receivers = sent.map_err(|error| SendError {
            topic,
            cause: error.to_string(),
        })?;
        // A daemon that cannot be woken looks by itself within the bound of its wait.
        let _ = live.wake.notify();
        outlet(live).restock();
    }
    if receivers == 0 {
        ports.look(message.header().sent_ns);
    }
    Ok(receivers)
}
