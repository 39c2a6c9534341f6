//! What is measured: every mechanism, how its far side waits, and at what pace it is used.

use clap::ValueEnum;
use inekf_shared::topic::Instance;

use super::partner::RoundTrip;
use super::{blackboard, cache_line, echo, estimate, futex, socket};

/// A way from a sample to an answer.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Mechanism {
    /// One cache line between two threads: the floor of whatever spins.
    CacheLine,
    /// A thread asleep on a futex, woken: the floor of whatever is woken.
    Futex,
    /// A newest-value slot in each direction.
    Blackboard,
    /// iceoryx2 with slots loaned ahead on both sides.
    PreLoanedEcho,
    /// iceoryx2 with slots loaned at send, as its own examples do.
    Echo,
    /// The daemon: IMU sample to estimate, 15 states.
    Filter15,
    /// The daemon: IMU sample to estimate, 9 states.
    Filter9,
    /// The same as [`Self::Filter15`] with a position fix every 200 samples.
    Aided15,
    /// The same as [`Self::Aided15`] with the smoother, window 50, in place of the filter.
    Smoother15,
    /// The daemon: planar odometry to estimate, linearly constrained filter.
    LcInekf,
    /// The same with a position fix beside each sample, to the estimate that holds both.
    LcInekfFix,
    /// Datagrams over a pair of Unix-domain sockets.
    UnixSocket,
    /// Datagrams over UDP on the loopback interface.
    UdpSocket,
}

impl Mechanism {
    /// Name of its rows.
    pub fn name(self) -> &'static str {
        match self {
            Self::CacheLine => "raw cache line",
            Self::Futex => "raw futex wake-up",
            Self::Blackboard => "iceoryx2 blackboard",
            Self::PreLoanedEcho => "pre-loaned iceoryx2 echo",
            Self::Echo => "plain iceoryx2 echo",
            Self::Filter15 => "estimate, 15 states",
            Self::Filter9 => "estimate, 9 states",
            Self::Aided15 => "estimate, 15 states, fixes",
            Self::Smoother15 => "smoother, 15 states, fixes",
            Self::LcInekf => "LC-InEKF, odometry2d",
            Self::LcInekfFix => "LC-InEKF, odometry2d + fix",
            Self::UnixSocket => "Unix-domain socket",
            Self::UdpSocket => "UDP socket",
        }
    }
}

/// How the far side waits for the sample.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Wait {
    /// Awake, looking all the time.
    Spin,
    /// Asleep until woken. This side still spins for the answer, as a control loop that waits for
    /// it would; a socket blocks on both sides, as one uses it.
    Event,
}

impl Wait {
    /// Its name in the report.
    pub fn name(self) -> &'static str {
        match self {
            Self::Spin => "spin",
            Self::Event => "event",
        }
    }
}

/// When the next round begins.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Pace {
    /// At once: saturation.
    Saturated,
    /// At fixed times, so many a second. A time that passes during a round is left out and counted.
    Hz(u32),
}

/// Every pace, in the order they are measured.
pub const PACES: [Pace; 4] = [
    Pace::Saturated,
    Pace::Hz(200),
    Pace::Hz(1000),
    Pace::Hz(8000),
];

impl Pace {
    /// Its name in the report.
    pub fn name(self) -> String {
        match self {
            Self::Saturated => "saturation".to_owned(),
            Self::Hz(rate) => format!("{rate} Hz"),
        }
    }
}

/// A mechanism with a way to wait.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Case {
    /// The mechanism.
    pub mechanism: Mechanism,
    /// How its far side waits.
    pub wait: Wait,
}

const fn spin(mechanism: Mechanism) -> Case {
    let wait = Wait::Spin;
    Case { mechanism, wait }
}

const fn event(mechanism: Mechanism) -> Case {
    let wait = Wait::Event;
    Case { mechanism, wait }
}

/// Every case, in the order of each turn: what is compared most stands side by side.
pub const CASES: [Case; 19] = [
    spin(Mechanism::CacheLine),
    spin(Mechanism::Blackboard),
    spin(Mechanism::PreLoanedEcho),
    spin(Mechanism::Echo),
    spin(Mechanism::Filter15),
    spin(Mechanism::Filter9),
    spin(Mechanism::Aided15),
    spin(Mechanism::Smoother15),
    spin(Mechanism::LcInekf),
    spin(Mechanism::LcInekfFix),
    spin(Mechanism::UnixSocket),
    spin(Mechanism::UdpSocket),
    event(Mechanism::Futex),
    event(Mechanism::Echo),
    event(Mechanism::Filter15),
    event(Mechanism::Filter9),
    event(Mechanism::LcInekf),
    event(Mechanism::UnixSocket),
    event(Mechanism::UdpSocket),
];

impl Case {
    /// Starts the far side on processor `cpu`.
    ///
    /// # Errors
    /// It cannot be started, or does not answer.
    pub fn start(self, cpu: usize) -> anyhow::Result<Box<dyn RoundTrip>> {
        let Self { mechanism, wait } = self;
        Ok(match mechanism {
            Mechanism::CacheLine => Box::new(cache_line::CacheLine::start(cpu)),
            Mechanism::Futex => Box::new(futex::Futex::start(cpu)),
            Mechanism::Blackboard => Box::new(blackboard::Blackboard::start(cpu)?),
            Mechanism::PreLoanedEcho | Mechanism::Echo => {
                Box::new(echo::Echo::start(mechanism, wait, cpu)?)
            }
            Mechanism::Filter15 => Box::new(estimate::imu(true, wait, cpu)?),
            Mechanism::Filter9 => Box::new(estimate::imu(false, wait, cpu)?),
            Mechanism::Aided15 => Box::new(estimate::aided(false, wait, cpu)?),
            Mechanism::Smoother15 => Box::new(estimate::aided(true, wait, cpu)?),
            Mechanism::LcInekf => Box::new(estimate::odometry(false, wait, cpu)?),
            Mechanism::LcInekfFix => Box::new(estimate::odometry(true, wait, cpu)?),
            Mechanism::UnixSocket | Mechanism::UdpSocket => {
                Box::new(socket::Socket::start(mechanism, wait, cpu)?)
            }
        })
    }
}

/// The partner process of a mechanism that has one: answers until it is told to stop.
///
/// # Errors
/// A port or socket fails, or the mechanism has no such process.
pub fn serve(
    mechanism: Mechanism,
    wait: Wait,
    instance: &Instance,
    cpu: usize,
) -> anyhow::Result<()> {
    match mechanism {
        Mechanism::PreLoanedEcho | Mechanism::Echo => echo::serve(mechanism, wait, instance, cpu),
        Mechanism::Blackboard => blackboard::serve(instance, cpu),
        Mechanism::UnixSocket | Mechanism::UdpSocket => socket::serve(cpu),
        _ => anyhow::bail!("{} has no partner process", mechanism.name()),
    }
}
