//! Every shared-memory port of the daemon, opened before it says that it is ready.

use core::mem::MaybeUninit;

use anyhow::Context;
use iceoryx2::prelude::ipc;
use iceoryx2::sample_mut_uninit::SampleMutUninit;
use inekf_shared::clock::monotonic_ns;
use inekf_shared::message::{
    EstimateHead, EstimateSe23, HeadingFix, Health, ImuSample, Odometry2d, Odometry3d, PositionFix,
    VelocityFix, Zero,
};
use inekf_shared::topic::Instance;
use inekf_shared::transport::{
    self, ControlServer, InputMessage, LatestWriter, Node, Publisher, Subscriber, TransportError,
    WakeListener,
};

use crate::config::WaitMode;
use crate::engine::{MAX_AHEAD_NS, Outbox};

/// An aiding topic, read in step with the samples: a fix that is ahead of them is held back, and
/// those behind it stay in the queue.
#[derive(Debug)]
pub struct FixPort<M: InputMessage> {
    subscriber: Subscriber<M>,
    held: Option<M>,
}

impl<M: InputMessage + Copy> FixPort<M> {
    fn new(subscriber: Subscriber<M>) -> Self {
        Self {
            subscriber,
            held: None,
        }
    }

    /// The next fix with a stamp up to `horizon_ns`, or one so far ahead that its clock cannot be
    /// right (the engine refuses it; holding it would block the topic).
    ///
    /// # Errors
    /// The port failed.
    pub fn next_until(&mut self, horizon_ns: u64) -> anyhow::Result<Option<M>> {
        let next = match self.held.take() {
            Some(held) => Some(held),
            None => self
                .subscriber
                .receive()
                .with_context(|| format!("receiving from {:?}", M::TOPIC))?
                .map(|sample| *sample),
        };
        let ahead_ns = |fix: &M| fix.header().stamp_ns.saturating_sub(horizon_ns);
        match next {
            Some(fix) if (1..=MAX_AHEAD_NS).contains(&ahead_ns(&fix)) => {
                self.held = Some(fix);
                Ok(None)
            }
            next => Ok(next),
        }
    }
}

/// The input ports.
#[derive(Debug)]
pub struct Inputs {
    /// IMU samples.
    pub imu: Subscriber<ImuSample>,
    /// Position fixes.
    pub position: FixPort<PositionFix>,
    /// Velocity fixes.
    pub velocity: FixPort<VelocityFix>,
    /// Heading fixes.
    pub heading: FixPort<HeadingFix>,
    /// Planar odometry: not an input of this model, received to be counted as refused.
    pub odometry2d: Subscriber<Odometry2d>,
    /// Spatial odometry: likewise.
    pub odometry3d: Subscriber<Odometry3d>,
}

/// Slots kept loaned for estimates to come: one for the sample, one for a fix with it.
const LOANED_AHEAD: usize = 2;

type Slot = SampleMutUninit<ipc::Service, MaybeUninit<EstimateSe23>, ()>;

/// Where estimates leave: the topic, and the slot with the newest one.
///
/// Loaning allocates inside iceoryx2, so it is done ahead, away from the path of a sample.
pub struct EstimatePort {
    publisher: Publisher<EstimateSe23>,
    ahead: Vec<Slot>,
    latest: LatestWriter<EstimateSe23>,
    /// Estimates that could not be published; the watch reports them.
    pub failures: u64,
}

impl EstimatePort {
    fn new(publisher: Publisher<EstimateSe23>, latest: LatestWriter<EstimateSe23>) -> Self {
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

impl Outbox for EstimatePort {
    fn publish(&mut self, estimate: &EstimateSe23) {
        let mut stamped = *estimate;
        stamped.head.published_ns = monotonic_ns();
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
pub struct Ports {
    /// What comes in.
    pub inputs: Inputs,
    /// What goes out.
    pub estimates: EstimatePort,
    /// Health, about once a second.
    pub health: Publisher<Health>,
    /// Requests.
    pub control: ControlServer,
    /// Woken by feeders in event mode; without a listener their notifications cost nothing.
    pub wake: Option<WakeListener>,
    node: Node,
}

impl Ports {
    /// Opens every port of `instance` that waiting in this mode needs.
    ///
    /// # Errors
    /// [`TransportError`], naming the service and the remedy. If a daemon of this instance is
    /// running, the error names its process id.
    pub fn open(instance: &Instance, wait: WaitMode) -> Result<Self, TransportError> {
        let node = transport::open_node("inekf-service")?;
        // First of all: there is one server per instance, so a second daemon stops here.
        let control = transport::control(&node, instance)?.server()?;
        let inputs = transport::inputs(&node, instance)?;
        let estimates = transport::estimate::<EstimateSe23>(&node, instance)?.publisher()?;
        let nothing_yet = EstimateSe23 {
            head: EstimateHead::UNSTARTED,
            ..EstimateSe23::ZERO
        };
        let latest = transport::latest(&node, instance, nothing_yet)?.writer()?;
        let wake = transport::wake(&node, instance)?;
        let wake = match wait {
            WaitMode::Event => Some(wake.listener()?),
            WaitMode::Spin => None,
        };
        let ports = Self {
            inputs: Inputs {
                imu: inputs.imu.subscriber()?,
                position: FixPort::new(inputs.position.subscriber()?),
                velocity: FixPort::new(inputs.velocity.subscriber()?),
                heading: FixPort::new(inputs.heading.subscriber()?),
                odometry2d: inputs.odometry2d.subscriber()?,
                odometry3d: inputs.odometry3d.subscriber()?,
            },
            estimates: EstimatePort::new(estimates, latest),
            health: transport::health(&node, instance)?.publisher()?,
            control,
            wake,
            node,
        };
        // Better an error now than a SIGBUS at some later send.
        transport::reserve_shared_memory(&ports.node)?;
        Ok(ports)
    }
}
