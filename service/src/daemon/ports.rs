//! Every shared-memory port of the daemon, opened before it says that it is ready.

use core::mem::MaybeUninit;

use iceoryx2::prelude::ipc;
use iceoryx2::sample_mut_uninit::SampleMutUninit;
use inekf_shared::clock::monotonic_ns;
use inekf_shared::message::{
    EstimateHead, EstimateMessage, Header, HeadingFix, Health, INPUT_IMU, INPUT_ODOMETRY_2D,
    INPUT_ODOMETRY_3D, ImuSample, Odometry2d, Odometry3d, PositionFix, VelocityFix, Zero,
};
use inekf_shared::topic::Instance;
use inekf_shared::transport::{
    self, ControlServer, InputMessage, LatestWriter, Node, PubSub, Publisher, Subscriber,
    TransportError, WakeListener, Watched,
};

use super::fix_port::FixPort;
use super::guard::Guard;
use super::smoothed::SmoothedPort;
use crate::config::WaitMode;
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
    /// Hands every sample that has come to `refuse`, with its `INPUT_*` index.
    pub fn drain(&self, mut refuse: impl FnMut(usize, &Header)) {
        drain(&self.imu, INPUT_IMU, &mut refuse);
        drain(&self.odometry2d, INPUT_ODOMETRY_2D, &mut refuse);
        drain(&self.odometry3d, INPUT_ODOMETRY_3D, &mut refuse);
    }
}

fn drain<M: InputMessage>(
    port: &Option<Subscriber<M>>,
    input: usize,
    refuse: &mut impl FnMut(usize, &Header),
) {
    let Some(port) = port else { return };
    while let Ok(Some(sample)) = port.receive() {
        refuse(input, sample.payload().header());
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

type Slot<E> = SampleMutUninit<ipc::Service, MaybeUninit<E>, ()>;

/// Where estimates leave: the topic, and the slot with the newest one.
///
/// Loaning allocates inside iceoryx2, so it is done ahead, away from the path of a sample.
pub struct EstimatePort<E: EstimateMessage> {
    publisher: Publisher<E>,
    ahead: Vec<Slot<E>>,
    latest: LatestWriter<E>,
    /// Estimates that could not be published; the watch reports them.
    pub failures: u64,
}

impl<E: EstimateMessage> EstimatePort<E> {
    fn new(publisher: Publisher<E>, latest: LatestWriter<E>) -> Self {
        let mut port = Self {
            publisher,
            ahead: Vec::with_capacity(LOANED_AHEAD),
            latest,
            failures: 0,
        };
        port.loan_ahead();
        port
    }

    /// Loans slots for the next estimates.
    fn loan_ahead(&mut self) {
        while self.ahead.len() < LOANED_AHEAD {
            match self.publisher.loan_uninit() {
                Ok(slot) => self.ahead.push(slot),
                Err(_) => break,
            }
        }
    }
}

impl<E: EstimateMessage> Outbox<E> for EstimatePort<E> {
    fn publish(&mut self, estimate: &E) {
        let mut stamped = *estimate;
        stamped.head_mut().published_ns = monotonic_ns();
        let slot = self
            .ahead
            .pop()
            .or_else(|| self.publisher.loan_uninit().ok());
        let sent = slot.is_some_and(|slot| slot.write_payload(stamped).send().is_ok());
        let written = self.latest.write(stamped);
        if !(sent && written) {
            self.failures += 1;
        }
        self.loan_ahead();
    }
}

/// All ports of one daemon. They live on the thread that made them.
pub struct Ports<M: Model> {
    /// What comes in.
    pub inputs: Inputs<M::Sample>,
    /// What goes out.
    pub estimates: EstimatePort<M::Estimate>,
    /// Smoothed states.
    pub smoothed: SmoothedPort,
    /// Health, about once a second.
    pub health: Publisher<Health>,
    /// Requests.
    pub control: ControlServer,
    /// Woken by feeders in event mode; without a listener their notifications cost nothing.
    pub wake: Option<WakeListener>,
    guard: Guard,
    node: Node,
}

impl<M: Model> Ports<M> {
    /// Opens every port of `instance` that waiting in this mode needs, and that of smoothed states for a smoother.
    ///
    /// # Errors
    /// [`TransportError`], naming the service and the remedy. If a daemon of this instance is
    /// running, the error names its process id.
    pub fn open(
        instance: &Instance,
        wait: WaitMode,
        smooths: bool,
    ) -> Result<Self, TransportError> {
        let mut ports = Self::open_all(instance, wait, smooths)?;
        // Once nothing is open any more that is closed again.
        ports.guard = Guard::of(Watched::of(&ports.node)?);
        Ok(ports)
    }

    fn open_all(
        instance: &Instance,
        wait: WaitMode,
        smooths: bool,
    ) -> Result<Self, TransportError> {
        let node = transport::open_node("inekf-service")?;
        // First of all: there is one server per instance, so a second daemon stops here.
        let control = transport::control(&node, instance)?.server()?;
        let inputs = transport::inputs(&node, instance)?;
        let estimates = transport::estimate::<M::Estimate>(&node, instance)?.publisher()?;
        let mut nothing_yet = M::Estimate::ZERO;
        *nothing_yet.head_mut() = EstimateHead::UNSTARTED;
        let latest = transport::latest(&node, instance, nothing_yet)?.writer()?;
        let wake = transport::wake(&node, instance)?;
        let wake = match wait {
            WaitMode::Event => Some(wake.listener()?),
            WaitMode::Spin => None,
        };
        let foreign = Foreign {
            imu: foreign::<M, _>(&inputs.imu, INPUT_IMU)?,
            odometry2d: foreign::<M, _>(&inputs.odometry2d, INPUT_ODOMETRY_2D)?,
            odometry3d: foreign::<M, _>(&inputs.odometry3d, INPUT_ODOMETRY_3D)?,
        };
        let ports = Self {
            inputs: Inputs {
                samples: transport::input::<M::Sample>(&node, instance)?.subscriber()?,
                position: FixPort::new(inputs.position.subscriber()?),
                velocity: FixPort::new(inputs.velocity.subscriber()?),
                heading: FixPort::new(inputs.heading.subscriber()?),
                foreign,
            },
            estimates: EstimatePort::new(estimates, latest),
            smoothed: SmoothedPort::open(&node, instance, smooths)?,
            health: transport::health(&node, instance)?.publisher()?,
            control,
            wake,
            guard: Guard::default(),
            node,
        };
        // Better an error now than a SIGBUS at some later send.
        transport::reserve_shared_memory(&ports.node)?;
        Ok(ports)
    }

    /// Whether somebody has removed files that others need in order to attach.
    pub fn have_lost_files(&self) -> bool {
        self.guard.has_lost()
    }
}
