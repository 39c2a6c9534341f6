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
    pub fn open(instance: &Instance) -> Result<Self, TransportError> {
        Self::open_on(transport::open_node(NODE)?, instance)
    }

    /// The same on a node of one's own.
    ///
    /// # Errors
    /// [`TransportError`], naming the service and the remedy.
    pub fn open_on(node: Node, instance: &Instance) -> Result<Self, TransportError> {
        Ok(Self {
            ports: Attached::open(node, NODE, instance, Ports::open)?,
            numbering: Numbering::new(monotonic_ns()),
        })
    }

    /// How often it attached anew because its files had been removed.
    pub fn reattached(&self) -> u64 {
        self.ports.times()
    }

    /// Sends a row of any kind.
    ///
    /// # Errors
    /// [`SendError`].
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
    pub fn imu(&mut self, row: &ImuRow) -> Result<usize, SendError> {
        let message = self.numbering.imu(row, monotonic_ns());
        send(&mut self.ports, |ports| &mut ports.imu, &message, "imu")
    }

    /// Sends a planar odometry increment.
    ///
    /// # Errors
    /// [`SendError`].
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
