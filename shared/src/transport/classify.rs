//! Sorts iceoryx2's many errors into what a user can do about them, and tries again what passes by itself.

use core::fmt::Debug;
use std::thread::sleep;
use std::time::{Duration, Instant};

use iceoryx2::service::builder::blackboard::{BlackboardCreateError, BlackboardOpenError};
use iceoryx2::service::builder::event::{EventCreateError, EventOpenError, EventOpenOrCreateError};
use iceoryx2::service::builder::publish_subscribe::{
    PublishSubscribeCreateError, PublishSubscribeOpenError, PublishSubscribeOpenOrCreateError,
};
use iceoryx2::service::builder::request_response::{
    RequestResponseCreateError, RequestResponseOpenError, RequestResponseOpenOrCreateError,
};

use super::sweep::ABANDONED_AFTER;
use super::{Config, TransportError, sweep};

/// How long a failure that may pass by itself is tried again. Races between processes that create, open and remove a
/// service last milliseconds.
const RETRY_FOR: Duration = Duration::from_millis(500);
const RETRY_EVERY: Duration = Duration::from_millis(5);

/// What a failure comes down to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Cause {
    /// Somebody creates or removes the service at this moment.
    Race,
    Missing,
    Types,
    Limits,
    HalfCreated,
    Corrupted,
    Permissions,
    Nodes,
    Version,
    Internal,
}

pub(super) trait Classify: Copy + Debug {
    fn cause(self) -> Cause;
}

macro_rules! open_error {
    ($name:ident, types: [$($types:ident),*]) => {
        impl Classify for $name {
            fn cause(self) -> Cause {
                match self {
                    Self::DoesNotExist => Cause::Missing,
                    Self::Interrupt | Self::IsMarkedForDestruction => Cause::Race,
                    Self::ServiceInCorruptedState => Cause::Corrupted,
                    Self::HangsInCreation => Cause::HalfCreated,
                    Self::InsufficientPermissions => Cause::Permissions,
                    Self::ExceedsMaxNumberOfNodes => Cause::Nodes,
                    Self::VersionMismatch => Cause::Version,
                    $(Self::$types => Cause::Types,)*
                    Self::InternalFailure | Self::UnableToCreateServiceTag => Cause::Internal,
                    // Every error that is left names a limit of the service that does not suffice.
                    _ => Cause::Limits,
                }
            }
        }
    };
}

open_error!(PublishSubscribeOpenError, types: [IncompatibleTypes]);
open_error!(RequestResponseOpenError, types: [IncompatibleRequestOrResponseType]);
open_error!(BlackboardOpenError, types: [IncompatibleKeys]);
open_error!(EventOpenError, types: []);

macro_rules! create_error {
    ($name:ident, half_created: [$($half:ident),*]) => {
        impl Classify for $name {
            fn cause(self) -> Cause {
                match self {
                    Self::AlreadyExists
                    | Self::IsBeingCreatedByAnotherInstance
                    | Self::Interrupt => Cause::Race,
                    Self::ServiceInCorruptedState => Cause::Corrupted,
                    Self::InsufficientPermissions => Cause::Permissions,
                    $(Self::$half => Cause::HalfCreated,)*
                    _ => Cause::Internal,
                }
            }
        }
    };
}

create_error!(PublishSubscribeCreateError, half_created: [HangsInCreation]);
create_error!(RequestResponseCreateError, half_created: [HangsInCreation]);
create_error!(BlackboardCreateError, half_created: [HangsInCreation]);
create_error!(EventCreateError, half_created: []);

macro_rules! open_or_create_error {
    ($name:ident, $open:ident, $create:ident) => {
        impl Classify for $name {
            fn cause(self) -> Cause {
                match self {
                    Self::$open(error) => error.cause(),
                    Self::$create(error) => error.cause(),
                    Self::SystemInFlux => Cause::Race,
                }
            }
        }
    };
}

open_or_create_error!(
    PublishSubscribeOpenOrCreateError,
    PublishSubscribeOpenError,
    PublishSubscribeCreateError
);
open_or_create_error!(
    RequestResponseOpenOrCreateError,
    RequestResponseOpenError,
    RequestResponseCreateError
);
open_or_create_error!(EventOpenOrCreateError, EventOpenError, EventCreateError);

/// A blackboard could be neither created nor opened.
#[derive(Clone, Copy, Debug)]
pub(super) enum BlackboardError {
    Create(BlackboardCreateError),
    Open(BlackboardOpenError),
}

impl Classify for BlackboardError {
    fn cause(self) -> Cause {
        match self {
            Self::Create(error) => error.cause(),
            Self::Open(error) => error.cause(),
        }
    }
}

/// Tries until it succeeds, fails for good, or a passing failure has lasted for [`RETRY_FOR`]. If it then looks like
/// what a killed process left, sweeps and tries as long once more; what is half made only counts as left after a time,
/// so until then again.
pub(super) fn retry<T, E: Classify>(
    config: &Config,
    mut attempt: impl FnMut() -> Result<T, E>,
) -> Result<T, E> {
    let started = Instant::now();
    let mut outcome = try_for_a_while(&mut attempt);
    loop {
        let is_old = started.elapsed() > ABANDONED_AFTER;
        match outcome {
            Err(error) if error.cause().may_be_swept() => {
                // If it cannot be swept, the next failure is the one to report.
                let _ = sweep(config);
                outcome = try_for_a_while(&mut attempt);
                match outcome {
                    Err(error) if error.cause() == Cause::HalfCreated && !is_old => {}
                    outcome => return outcome,
                }
            }
            outcome => return outcome,
        }
    }
}

fn try_for_a_while<T, E: Classify>(attempt: &mut impl FnMut() -> Result<T, E>) -> Result<T, E> {
    let started = Instant::now();
    loop {
        match attempt() {
            Err(error) if error.cause().may_pass() && started.elapsed() < RETRY_FOR => {
                sleep(RETRY_EVERY);
            }
            done => return done,
        }
    }
}

impl Cause {
    /// Whether it may pass by itself.
    const fn may_pass(self) -> bool {
        matches!(self, Self::Race | Self::Missing | Self::Corrupted)
    }

    /// Whether a process that was killed at the wrong moment may be behind it.
    const fn may_be_swept(self) -> bool {
        matches!(
            self,
            Self::Race | Self::Corrupted | Self::HalfCreated | Self::Internal
        )
    }
}

/// The error for the user. `types` gives our type and theirs; it is asked only if they differ.
pub(super) fn explain<E: Classify>(
    error: E,
    service: String,
    types: impl FnOnce() -> (String, String),
    holders: impl FnOnce() -> Vec<u32>,
) -> TransportError {
    let cause = format!("{error:?}");
    match error.cause() {
        Cause::Missing => TransportError::Missing { service },
        Cause::Race | Cause::Corrupted => TransportError::Unsettled { service, cause },
        Cause::Types => {
            let (ours, theirs) = types();
            TransportError::Incompatible {
                service,
                ours,
                theirs,
            }
        }
        Cause::Limits => TransportError::Limits { service, cause },
        Cause::HalfCreated => TransportError::HalfCreated { service },
        Cause::Permissions => TransportError::Permissions { service },
        Cause::Nodes => TransportError::Full {
            service,
            port: "process",
            limit: crate::qos::MAX_NODES,
            holders: holders(),
        },
        Cause::Version => TransportError::Version { service },
        Cause::Internal => TransportError::Internal { service, cause },
    }
}
