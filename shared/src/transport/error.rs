//! What can go wrong while opening, named by service, with its remedy.

/// A node, a service or a port could not be opened.
///
/// ```
/// use inekf_shared::transport::TransportError;
///
/// // Every error names the thing and the remedy.
/// let error = TransportError::Full {
///     service: "inekf/car/control".to_owned(),
///     port: "server",
///     limit: 1,
///     holders: vec![4711],
/// };
/// assert_eq!(
///     error.to_string(),
///     "inekf/car/control has no place for another server: 1 at a time, held by process 4711; stop one of them"
/// );
/// ```
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum TransportError {
    /// An environment variable holds what cannot be used.
    #[error("{variable} = {value:?} {fault}")]
    Setting {
        /// Name of the variable.
        variable: &'static str,
        /// Its value.
        value: String,
        /// What is wrong with it.
        fault: &'static str,
    },

    /// The node could not be created.
    #[error(
        "the shared-memory node {node:?} could not be created ({cause}); is {root} writable, and is there space in it \
         and in /dev/shm?"
    )]
    Node {
        /// Name of the node.
        node: String,
        /// Directory of its files.
        root: String,
        /// iceoryx2's word for it.
        cause: String,
    },

    /// The service does not exist, and this side does not create it.
    #[error("{service} does not exist; start the daemon of this instance first")]
    Missing {
        /// Name of the service.
        service: String,
    },

    /// The service exists with another type of message.
    #[error(
        "{service} carries {theirs}, but this process speaks {ours}; daemon and clients must be of one version and \
         use one model, and all of them must have left before it changes"
    )]
    Incompatible {
        /// Name of the service.
        service: String,
        /// The type of this side: name, size, alignment.
        ours: String,
        /// The type of the service.
        theirs: String,
    },

    /// The service exists with smaller limits than this version asks for.
    #[error(
        "{service} was created with other limits ({cause}); stop every process of this instance, then start them with \
         one version"
    )]
    Limits {
        /// Name of the service.
        service: String,
        /// iceoryx2's word for it.
        cause: String,
    },

    /// The service was created by another version of iceoryx2.
    #[error(
        "{service} was created by another version of iceoryx2; stop every process of this instance, then start them \
         with one version"
    )]
    Version {
        /// Name of the service.
        service: String,
    },

    /// A process died while it created the service.
    #[error(
        "{service} was left half created by a process that died; run `inekf-service doctor` to sweep it away, then \
         start again"
    )]
    HalfCreated {
        /// Name of the service.
        service: String,
    },

    /// The service's files are damaged, or others keep creating and removing it.
    #[error(
        "{service} is damaged or keeps changing ({cause}); run `inekf-service doctor`, then start again"
    )]
    Unsettled {
        /// Name of the service.
        service: String,
        /// iceoryx2's word for it.
        cause: String,
    },

    /// The files belong to somebody else.
    #[error(
        "{service} may not be accessed by this user; run daemon and clients as one user, or set INEKF_IPC_ROOT and \
         INEKF_IPC_PREFIX to separate them"
    )]
    Permissions {
        /// Name of the service.
        service: String,
    },

    /// Every place on the service is taken.
    #[error(
        "{service} has no place for another {port}: {limit} at a time, held by {}; stop one of them",
        processes(holders)
    )]
    Full {
        /// Name of the service.
        service: String,
        /// Kind of port.
        port: &'static str,
        /// How many there may be.
        limit: usize,
        /// Ids of the processes that hold the places.
        holders: Vec<u32>,
    },

    /// A daemon was killed in the middle of a write, and readers keep what it wrote to.
    #[error(
        "{service} was left locked by a daemon that was killed in the middle of a write; stop its readers ({}), then \
         start again",
        processes(holders)
    )]
    Locked {
        /// Name of the service.
        service: String,
        /// Ids of the processes that keep it.
        holders: Vec<u32>,
    },

    /// There is too little shared memory.
    #[error(
        "/dev/shm is too full: {needed} more bytes are needed and {free} are free; enlarge it (mount -o \
         remount,size=..., or a container's --shm-size) or remove what lies there"
    )]
    Space {
        /// Bytes that were asked for.
        needed: u64,
        /// Bytes that are free.
        free: u64,
    },

    /// This process may open too few files.
    #[error(
        "this process may have {allowed} file descriptors, and needs {needed}; raise the limit (ulimit -n, or \
         LimitNOFILE= of systemd)"
    )]
    Descriptors {
        /// File descriptors that are needed.
        needed: u64,
        /// File descriptors that it may have.
        allowed: u64,
    },

    /// Shared memory cannot be backed ahead of time.
    #[error("the space of {path} could not be reserved ({cause}); does it belong to another user?")]
    Reserve {
        /// The file.
        path: String,
        /// The system's word for it.
        cause: String,
    },

    /// Anything else.
    #[error(
        "{service} could not be opened ({cause}); is there space in /dev/shm, and are there file descriptors left?"
    )]
    Internal {
        /// Name of the service.
        service: String,
        /// iceoryx2's word for it.
        cause: String,
    },
}

fn processes(ids: &[u32]) -> String {
    let list = |ids: &[u32]| {
        let ids: Vec<String> = ids.iter().map(u32::to_string).collect();
        ids.join(", ")
    };
    match ids {
        [] => "processes unknown".to_owned(),
        [id] => format!("process {id}"),
        _ => format!("processes {}", list(ids)),
    }
}
