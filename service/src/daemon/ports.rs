//! Every shared-memory port of the daemon, opened before it says that it is ready.

use std::rc::Rc;

use inekf_shared::clock::monotonic_ns;
use inekf_shared::message::{
    EstimateHead, EstimateMessage, HeadingFix, Health, INPUT_IMU, INPUT_ODOMETRY_2D,
    INPUT_ODOMETRY_3D, ImuSample, JournalEntry, Odometry2d, Odometry3d, PositionFix, VelocityFix,
    Zero,
};
use inekf_shared::topic::Instance;
use inekf_shared::transport::{
    self, ControlServer, InputMessage, LatestWriter, Node, Outlet, PubSub, Publisher, Subscriber,
    TransportError, WakeListener,
};

use super::fix_port::FixPort;
use super::journal::JournalPort;
use super::smoothed::SmoothedPort;
use crate::config::{Config, Motion, WaitMode};
use crate::engine::{Model, Outbox};

/// The input ports of a daemon whose motion samples are S.
#[derive(Debug)]
pub struct Inputs<S: InputMessage> {
    /// What moves the state.
    pub samples: Subscriber<S>,
    /// Position fixes.
    pub position: FixPort<PositionFix>,
    /// Velocity fixes.
    pub velocity: FixPort<VelocityFix>,
    /// Heading fixes.
    pub heading: FixPort<HeadingFix>,
    /// Motion samples of the other models, received to be counted as refused.
    pub foreign: Foreign,
}

/// The motion samples that the model does not use.
#[derive(Debug)]
pub struct Foreign {
    imu: Option<Subscriber<ImuSample>>,
    odometry2d: Option<Subscriber<Odometry2d>>,
    odometry3d: Option<Subscriber<Odometry3d>>,
}

impl Foreign {
    /// Hands every sample that has come to `refuser`, with its `INPUT_*` index.
    pub fn drain(&self, refuser: &mut impl Refuser) {
        drain(&self.imu, INPUT_IMU, refuser);
        drain(&self.odometry2d, INPUT_ODOMETRY_2D, refuser);
        drain(&self.odometry3d, INPUT_ODOMETRY_3D, refuser);
    }
}

/// Who refuses the motion samples of other models.
pub trait Refuser {
    /// Refuses a sample of the topic with the `INPUT_*` index `input`.
    fn refuse<S: InputMessage>(&mut self, input: usize, sample: &S);
}

fn drain<S: InputMessage>(port: &Option<Subscriber<S>>, input: usize, refuser: &mut impl Refuser) {
    let Some(port) = port else { return };
    while let Ok(Some(sample)) = port.receive() {
        refuser.refuse(input, sample.payload());
    }
}

/// A port for a topic that is not the model's own.
fn foreign<M: Model, S: InputMessage>(
    topic: &PubSub<S>,
    input: usize,
) -> Result<Option<Subscriber<S>>, TransportError> {
    if input == M::INPUT {
        return Ok(None);
    }
    topic.subscriber().map(Some)
}

/// Slots kept loaned for estimates to come: one for the sample, one for a fix with it.
const LOANED_AHEAD: usize = 2;

/// Where estimates leave: the topic, and the slot with the newest one.
pub struct EstimatePort<E: EstimateMessage> {
    topic: Outlet<E>,
    latest: LatestWriter<E>,
    /// Estimates that could not be published; the watch reports them.
    pub failures: u64,
}

impl<E: EstimateMessage> EstimatePort<E> {
    fn new(publisher: Publisher<E>, latest: LatestWriter<E>) -> Self {
        Self {
            topic: Outlet::new(publisher, LOANED_AHEAD),
            latest,
            failures: 0,
        }
    }
}

impl<E: EstimateMessage> Outbox<E> for EstimatePort<E> {
    fn publish(&mut self, estimate: &mut E) {
        estimate.head_mut().published_ns = monotonic_ns();
        let sent = self.topic.send(estimate).is_ok();
        // Who reads the topic has it by now; the rest is done while it is on its way.
        let written = self.latest.write(*estimate);
        if !(sent && written) {
            self.failures += 1;
        }
        self.topic.restock();
    }
}

/// All ports of one daemon. They live on the thread that made them.
///
/// ```
#[doc = include_str!("example.txt")]
/// let ports = Ports::open_on(Rc::clone(&node), &car, &config, false)?;
/// let vehicle = Vehicle::new(engine, ports, terms, None);
/// // The ports go with their vehicle: the next one can have them.
/// drop(vehicle);
/// # use inekf_service::engine::Inertial;
/// assert!(Ports::<Inertial<NavState, Left, 15>>::open_on(node, &car, &config, false).is_ok());
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub struct Ports<M: Model> {
    /// What comes in.
    pub(super) inputs: Inputs<M::Sample>,
    /// What goes out.
    pub(super) estimates: EstimatePort<M::Estimate>,
    /// Smoothed states.
    pub(super) smoothed: SmoothedPort,
    /// What the engine takes.
    pub(super) journal: JournalPort,
    /// What the engine is to take, in a daemon that is fed entry by entry.
    pub(super) entries: Option<Subscriber<JournalEntry>>,
    /// Health, about once a second.
    pub(super) health: Publisher<Health>,
    /// Requests.
    pub(super) control: ControlServer,
    /// Woken by feeders in event mode; without a listener their notifications cost nothing.
    pub(super) wake: Option<WakeListener>,
    // Kept until the ports are gone; the vehicles of a thread share one.
    _node: Rc<Node>,
}

impl<M: Model> Ports<M> {
    /// Opens every port of `instance` that this configuration needs; a `stepped` daemon publishes no journal, but
    /// takes one. The memory behind them is still to be asked for ([`transport::reserve_shared_memory`]).
    ///
    /// # Errors
    /// [`TransportError`], naming the service and the remedy. If a daemon of this instance is
    /// running, the error names its process id.
    ///
    /// ```
    #[doc = include_str!("example.txt")]
    /// use inekf_service::engine::Inertial;
    ///
    /// type OfCar = Ports<Inertial<NavState, Left, 15>>;
    /// let first = OfCar::open_on(Rc::clone(&node), &car, &config, false)?;
    /// // A second daemon of the same name would fight with the first about every estimate.
    /// let second = OfCar::open_on(node, &car, &config, false);
    /// let process = std::process::id().to_string();
    /// assert!(second.is_err_and(|reason| reason.to_string().contains(&process)));
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn open_on(
        node: Rc<Node>,
        instance: &Instance,
        config: &Config,
        stepped: bool,
    ) -> Result<Self, TransportError> {
        let publish_journal = config.journal.publish && !stepped;
        // First of all: there is one server per instance, so a second daemon stops here.
        let control = transport::control(&node, instance)?.server()?;
        let inputs = transport::inputs(&node, instance)?;
        let estimates = transport::estimate::<M::Estimate>(&node, instance)?.publisher()?;
        let mut nothing_yet = M::Estimate::ZERO;
        *nothing_yet.head_mut() = EstimateHead::UNSTARTED;
        let latest = transport::latest(&node, instance, nothing_yet)?.writer()?;
        let wake = transport::wake(&node, instance)?;
        let wake = match config.runtime.wait {
            WaitMode::Event => Some(wake.listener()?),
            WaitMode::Spin => None,
        };
        let uses_position = !config.position_sources.is_empty();
        let (uses_velocity, uses_heading) = match &config.motion {
            Motion::Inertial(inertial) => (
                !inertial.velocity_sources.is_empty(),
                !inertial.heading_sources.is_empty(),
            ),
            Motion::Odometry(_) => (false, false),
        };
        let foreign = Foreign {
            imu: foreign::<M, _>(&inputs.imu, INPUT_IMU)?,
            odometry2d: foreign::<M, _>(&inputs.odometry2d, INPUT_ODOMETRY_2D)?,
            odometry3d: foreign::<M, _>(&inputs.odometry3d, INPUT_ODOMETRY_3D)?,
        };
        Ok(Self {
            inputs: Inputs {
                samples: M::Sample::topic_of(&inputs).subscriber()?,
                position: FixPort::new(inputs.position.subscriber()?, uses_position),
                velocity: FixPort::new(inputs.velocity.subscriber()?, uses_velocity),
                heading: FixPort::new(inputs.heading.subscriber()?, uses_heading),
                foreign,
            },
            estimates: EstimatePort::new(estimates, latest),
            smoothed: SmoothedPort::open(&node, instance, config.smoother.is_some())?,
            journal: JournalPort::open(&node, instance, publish_journal)?,
            entries: match stepped {
                true => Some(transport::journal(&node, instance)?.subscriber()?),
                false => None,
            },
            health: transport::health(&node, instance)?.publisher()?,
            control,
            wake,
            _node: node,
        })
    }
}
