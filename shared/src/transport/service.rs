//! Open services, and the ports that are made from them.

use core::fmt::Debug;
use core::marker::PhantomData;
use core::time::Duration;

use iceoryx2::identifiers::UniqueNodeId;
use iceoryx2::port::client::Client;
use iceoryx2::port::listener::{Listener, ListenerCreateError, ListenerWaitError};
use iceoryx2::port::notifier::{Notifier, NotifierCreateError};
use iceoryx2::port::publisher::PublisherCreateError;
use iceoryx2::port::reader::{EntryHandle, Reader, ReaderCreateError};
use iceoryx2::port::server::Server;
use iceoryx2::port::subscriber::SubscriberCreateError;
use iceoryx2::port::writer::{EntryHandleMutError, Writer, WriterCreateError};
use iceoryx2::prelude::{BackpressureStrategy, CallbackProgression, PortFactory, ipc};
use iceoryx2::service::port_factory::client::ClientCreateError;
use iceoryx2::service::port_factory::server::ServerCreateError;
use iceoryx2::service::port_factory::{blackboard, event, publish_subscribe, request_response};

use super::reserve::{LEAST_FREE, require_shared_memory, reserve_segment_of};
use super::{Config, TransportError};
use crate::message::{ControlRequest, ControlResponse, EstimateMessage, Message};
use crate::qos::{self, PubSubQos};

/// Sends messages.
pub type Publisher<M> = iceoryx2::port::publisher::Publisher<ipc::Service, M, ()>;
/// Receives messages.
pub type Subscriber<M> = iceoryx2::port::subscriber::Subscriber<ipc::Service, M, ()>;
/// A message in shared memory, held until it is dropped.
pub type Received<M> = iceoryx2::sample::Sample<ipc::Service, M, ()>;
/// Receives requests and answers them.
pub type ControlServer = Server<ipc::Service, ControlRequest, (), ControlResponse, ()>;
/// Sends requests.
pub type ControlClient = Client<ipc::Service, ControlRequest, (), ControlResponse, ()>;
/// Wakes.
pub type WakeNotifier = Notifier<ipc::Service>;

/// Bytes that iceoryx2 adds to each message, with its share of the list of free slots; a little more than measured.
const SLOT_HEADER: usize = 64;

/// An open publish-subscribe topic.
///
/// ```
/// use inekf_shared::message::{HeadingFix, Zero};
/// use inekf_shared::topic::Instance;
/// use inekf_shared::transport;
///
/// # let root = tempfile::tempdir_in("/tmp")?;
/// # let prefix = root.path().file_name().and_then(|name| name.to_str());
/// # let config = transport::config(root.path().to_str(), prefix)?;
/// # let node = transport::open_node_with("doc", &config)?;
/// let topic = transport::input::<HeadingFix>(&node, &Instance::new("car")?)?;
/// let (sender, receiver) = (topic.publisher()?, topic.subscriber()?);
/// assert_eq!((topic.publisher_count(), topic.subscriber_count()), (1, 1));
/// // Of a topic that overflows the oldest are dropped; nobody waits.
/// for number in 0..1030 {
///     let mut fix = HeadingFix::ZERO;
///     fix.header.seq = number;
///     sender.send_copy(fix)?;
/// }
/// assert_eq!(receiver.receive()?.map(|fix| fix.header.seq), Some(6));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug)]
pub struct PubSub<M: Message> {
    service: String,
    qos: PubSubQos,
    config: Config,
    factory: publish_subscribe::PortFactory<ipc::Service, M, ()>,
}

impl<M: Message> PubSub<M> {
    pub(super) fn new(
        service: String,
        qos: PubSubQos,
        config: Config,
        factory: publish_subscribe::PortFactory<ipc::Service, M, ()>,
    ) -> Self {
        Self {
            service,
            qos,
            config,
            factory,
        }
    }

    /// Makes a publisher. Its `send` never waits for a subscriber, and finds its memory backed.
    ///
    /// # Errors
    /// [`TransportError::Full`] if there are as many as there may be, [`TransportError::Space`] if there is too little
    /// shared memory, [`TransportError::Internal`] otherwise.
    pub fn publisher(&self) -> Result<Publisher<M>, TransportError> {
        // Before it is made, because iceoryx2 writes to the new segment at once, and would be killed by SIGBUS.
        require_shared_memory(self.segment_bytes() + LEAST_FREE)?;
        let create = || {
            self.factory
                .publisher_builder()
                .max_loaned_samples(qos::MAX_LOANED)
                .backpressure_strategy(BackpressureStrategy::DiscardData)
                .create()
        };
        let port = Port {
            service: &self.service,
            kind: "publisher",
            limit: self.qos.publishers,
            full: PublisherCreateError::ExceedsMaxSupportedPublishers,
        };
        let publisher = port.make(&self.factory, create, || {
            let mut nodes = Vec::new();
            self.factory.dynamic_config().list_publishers(|details| {
                nodes.push(details.node_id);
                CallbackProgression::Continue
            });
            nodes
        })?;
        reserve_segment_of(&self.config, publisher.id().value())?;
        Ok(publisher)
    }

    /// Size of a publisher's segment: a slot for every message that subscribers may have waiting or in hand, and for
    /// those on loan.
    fn segment_bytes(&self) -> u64 {
        let of_subscribers = self.qos.subscribers * (self.qos.buffer + qos::MAX_BORROWED);
        let slots = of_subscribers + self.qos.history + qos::MAX_LOANED + 1;
        (slots * (size_of::<M>() + SLOT_HEADER)) as u64
    }

    /// Makes a subscriber with the topic's whole buffer. It gets what is sent from now on, and the topic's history.
    ///
    /// # Errors
    /// As [`PubSub::publisher`].
    ///
    /// ```
    /// use inekf_shared::message::ImuSample;
    /// use inekf_shared::topic::Instance;
    /// use inekf_shared::transport::{self, TransportError};
    ///
    /// # let root = tempfile::tempdir_in("/tmp")?;
    /// # let prefix = root.path().file_name().and_then(|name| name.to_str());
    /// # let config = transport::config(root.path().to_str(), prefix)?;
    /// # let node = transport::open_node_with("doc", &config)?;
    /// let imu = transport::input::<ImuSample>(&node, &Instance::new("car")?)?;
    /// let held: Result<Vec<_>, _> = (0..4).map(|_| imu.subscriber()).collect();
    /// assert!(matches!(imu.subscriber(), Err(TransportError::Full { limit: 4, .. })));
    /// # drop(held?);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn subscriber(&self) -> Result<Subscriber<M>, TransportError> {
        let create = || {
            self.factory
                .subscriber_builder()
                .buffer_size(self.qos.buffer)
                .create()
        };
        let port = Port {
            service: &self.service,
            kind: "subscriber",
            limit: self.qos.subscribers,
            full: SubscriberCreateError::ExceedsMaxSupportedSubscribers,
        };
        port.make(&self.factory, create, || {
            let mut nodes = Vec::new();
            self.factory.dynamic_config().list_subscribers(|details| {
                nodes.push(details.node_id);
                CallbackProgression::Continue
            });
            nodes
        })
    }

    /// Subscribers at this moment.
    #[must_use]
    pub fn subscriber_count(&self) -> usize {
        self.factory.dynamic_config().number_of_subscribers()
    }

    /// Publishers at this moment.
    #[must_use]
    pub fn publisher_count(&self) -> usize {
        self.factory.dynamic_config().number_of_publishers()
    }
}

/// The open control topic.
///
/// ```
/// use inekf_shared::topic::Instance;
/// use inekf_shared::transport;
///
/// # let root = tempfile::tempdir_in("/tmp")?;
/// # let prefix = root.path().file_name().and_then(|name| name.to_str());
/// # let config = transport::config(root.path().to_str(), prefix)?;
/// # let node = transport::open_node_with("doc", &config)?;
/// let control = transport::control(&node, &Instance::new("car")?)?;
/// assert!(control.server_pids().is_empty());
/// let server = control.server()?;
/// // Whose daemon it is.
/// assert_eq!(control.server_pids(), [std::process::id()]);
/// # drop(server);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug)]
pub struct Control {
    service: String,
    factory: request_response::PortFactory<ipc::Service, ControlRequest, (), ControlResponse, ()>,
}

impl Control {
    pub(super) fn new(
        service: String,
        factory: request_response::PortFactory<
            ipc::Service,
            ControlRequest,
            (),
            ControlResponse,
            (),
        >,
    ) -> Self {
        Self { service, factory }
    }

    /// Makes the server, for the daemon. Sending a response never waits for the client.
    ///
    /// # Errors
    /// [`TransportError::Full`], with the process id of the other, if a daemon already serves this instance.
    pub fn server(&self) -> Result<ControlServer, TransportError> {
        let create = || {
            self.factory
                .server_builder()
                .backpressure_strategy(BackpressureStrategy::DiscardData)
                .create()
        };
        let port = Port {
            service: &self.service,
            kind: "server",
            limit: qos::CONTROL_SERVERS,
            full: ServerCreateError::ExceedsMaxSupportedServers,
        };
        port.make(&self.factory, create, || self.server_nodes())
    }

    /// Makes a client.
    ///
    /// # Errors
    /// [`TransportError::Full`] if there are as many as there may be, [`TransportError::Internal`] otherwise.
    pub fn client(&self) -> Result<ControlClient, TransportError> {
        let create = || {
            self.factory
                .client_builder()
                .backpressure_strategy(BackpressureStrategy::DiscardData)
                .create()
        };
        let port = Port {
            service: &self.service,
            kind: "client",
            limit: qos::CONTROL_CLIENTS,
            full: ClientCreateError::ExceedsMaxSupportedClients,
        };
        port.make(&self.factory, create, || {
            let mut nodes = Vec::new();
            self.factory.dynamic_config().list_clients(|details| {
                nodes.push(details.node_id);
                CallbackProgression::Continue
            });
            nodes
        })
    }

    /// Process ids of the daemon that serves this instance: one or none. One that was killed counts until it has been
    /// cleaned up.
    #[must_use]
    pub fn server_pids(&self) -> Vec<u32> {
        process_ids(self.server_nodes())
    }

    fn server_nodes(&self) -> Vec<UniqueNodeId> {
        let mut nodes = Vec::new();
        self.factory.dynamic_config().list_servers(|details| {
            nodes.push(details.node_id);
            CallbackProgression::Continue
        });
        nodes
    }
}

/// The open newest estimate.
#[derive(Debug)]
pub struct Latest<E: EstimateMessage> {
    service: String,
    factory: blackboard::PortFactory<ipc::Service, u32>,
    payload: PhantomData<E>,
}

impl<E: EstimateMessage> Latest<E> {
    pub(super) fn new(
        service: String,
        factory: blackboard::PortFactory<ipc::Service, u32>,
    ) -> Self {
        Self {
            service,
            factory,
            payload: PhantomData,
        }
    }

    /// Makes the writer, for the daemon.
    ///
    /// # Errors
    /// [`TransportError::Full`] if there is one; if an earlier daemon's readers keep its estimate,
    /// [`TransportError::Incompatible`] if that is of another model and [`TransportError::Locked`] if that daemon was
    /// killed in the middle of a write; [`TransportError::Internal`] otherwise.
    pub fn writer(&self) -> Result<LatestWriter<E>, TransportError> {
        let port = Port {
            service: &self.service,
            kind: "writer",
            limit: 1,
            full: WriterCreateError::ExceedsMaxSupportedWriters,
        };
        let writer = port.make(
            &self.factory,
            || self.factory.writer_builder().create(),
            || {
                let mut nodes = Vec::new();
                self.factory.dynamic_config().list_writers(|details| {
                    nodes.push(details.node_id);
                    CallbackProgression::Continue
                });
                nodes
            },
        )?;
        match writer.entry::<E>(&qos::LATEST_KEY) {
            Ok(_) => Ok(LatestWriter {
                writer,
                payload: PhantomData,
            }),
            Err(EntryHandleMutError::EntryDoesNotExist) => Err(self.incompatible()),
            Err(EntryHandleMutError::HandleAlreadyExists) => Err(TransportError::Locked {
                service: self.service.clone(),
                holders: process_ids(self.reader_nodes()),
            }),
        }
    }

    /// Makes a reader.
    ///
    /// # Errors
    /// [`TransportError::Incompatible`] if the instance uses another model, [`TransportError::Full`] if there are as
    /// many readers as there may be, [`TransportError::Internal`] otherwise.
    pub fn reader(&self) -> Result<LatestReader<E>, TransportError> {
        let port = Port {
            service: &self.service,
            kind: "reader",
            limit: qos::LATEST_READERS,
            full: ReaderCreateError::ExceedsMaxSupportedReaders,
        };
        let reader = port.make(
            &self.factory,
            || self.factory.reader_builder().create(),
            || self.reader_nodes(),
        )?;
        let entry = reader
            .entry::<E>(&qos::LATEST_KEY)
            .map_err(|_| self.incompatible())?;
        Ok(LatestReader {
            entry,
            _reader: reader,
        })
    }

    fn reader_nodes(&self) -> Vec<UniqueNodeId> {
        let mut nodes = Vec::new();
        self.factory.dynamic_config().list_readers(|details| {
            nodes.push(details.node_id);
            CallbackProgression::Continue
        });
        nodes
    }

    /// iceoryx2 does not say which type a blackboard holds, only that it is not ours.
    fn incompatible(&self) -> TransportError {
        TransportError::Incompatible {
            service: self.service.clone(),
            ours: E::TYPE_NAME.to_owned(),
            theirs: "the estimate of another model".to_owned(),
        }
    }
}

/// Writes the newest estimate.
///
/// iceoryx2 locks an entry while somebody may write it, and never unlocks it for a writer that was killed: the entry
/// would stay locked for as long as any reader keeps it. So the lock is taken for each write and no longer.
pub struct LatestWriter<E: EstimateMessage> {
    writer: Writer<ipc::Service, u32>,
    payload: PhantomData<E>,
}

impl<E: EstimateMessage> LatestWriter<E> {
    /// Replaces the newest estimate. Never waits for a reader, nor allocates; a reader sees either the old estimate or
    /// the new one, whole.
    ///
    /// Returns whether it was written. It always is, unless another writer came into being by force.
    #[must_use]
    pub fn write(&self, estimate: E) -> bool {
        match self.writer.entry::<E>(&qos::LATEST_KEY) {
            Ok(entry) => {
                entry.update_with_copy(estimate);
                true
            }
            Err(_) => false,
        }
    }
}

/// Reads the newest estimate.
pub struct LatestReader<E: EstimateMessage> {
    entry: EntryHandle<ipc::Service, u32, E>,
    _reader: Reader<ipc::Service, u32>,
}

impl<E: EstimateMessage> LatestReader<E> {
    /// A copy of the newest estimate. Before the first it is what the daemon set initially.
    #[must_use]
    pub fn read(&self) -> E {
        *self.entry.get()
    }
}

/// What wakes the daemon, open.
#[derive(Debug)]
pub struct Wake {
    service: String,
    factory: event::PortFactory<ipc::Service>,
}

impl Wake {
    pub(super) fn new(service: String, factory: event::PortFactory<ipc::Service>) -> Self {
        Self { service, factory }
    }

    /// Makes a listener, for the daemon.
    ///
    /// # Errors
    /// [`TransportError::Full`] if there are as many as there may be, [`TransportError::Internal`] otherwise.
    pub fn listener(&self) -> Result<WakeListener, TransportError> {
        let port = Port {
            service: &self.service,
            kind: "listener",
            limit: qos::WAKE_LISTENERS,
            full: ListenerCreateError::ExceedsMaxSupportedListeners,
        };
        let listener = port.make(
            &self.factory,
            || self.factory.listener_builder().create(),
            || {
                let mut nodes = Vec::new();
                self.factory.dynamic_config().list_listeners(|details| {
                    nodes.push(details.node_id);
                    CallbackProgression::Continue
                });
                nodes
            },
        )?;
        Ok(WakeListener {
            service: self.service.clone(),
            listener,
        })
    }

    /// Makes a notifier, for feeders: notify after a send.
    ///
    /// # Errors
    /// As [`Wake::listener`].
    pub fn notifier(&self) -> Result<WakeNotifier, TransportError> {
        let port = Port {
            service: &self.service,
            kind: "notifier",
            limit: qos::WAKE_NOTIFIERS,
            full: NotifierCreateError::ExceedsMaxSupportedNotifiers,
        };
        port.make(
            &self.factory,
            || self.factory.notifier_builder().create(),
            || {
                let mut nodes = Vec::new();
                self.factory.dynamic_config().list_notifiers(|details| {
                    nodes.push(details.node_id);
                    CallbackProgression::Continue
                });
                nodes
            },
        )
    }
}

/// Waits to be woken.
///
/// ```
/// use std::time::Duration;
///
/// use inekf_shared::topic::Instance;
/// use inekf_shared::transport;
///
/// # let root = tempfile::tempdir_in("/tmp")?;
/// # let prefix = root.path().file_name().and_then(|name| name.to_str());
/// # let config = transport::config(root.path().to_str(), prefix)?;
/// # let node = transport::open_node_with("doc", &config)?;
/// let listener = transport::wake(&node, &Instance::new("car")?)?.listener()?;
/// // Nobody has notified: it ends by its time-out, and says so.
/// assert!(!listener.wait(Duration::from_millis(1))?);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug)]
pub struct WakeListener {
    service: String,
    listener: Listener<ipc::Service>,
}

impl WakeListener {
    /// Sleeps until woken, at most for `timeout`, and takes all notifications there are. Returns whether there were any.
    /// With a zero `timeout` it only looks.
    ///
    /// The time-out ends at the kernel's next timer tick or the one after, some milliseconds late; a wake-up is not
    /// delayed by it. Look at the inputs afterwards in any case: a notification may stand for many messages, a wait may
    /// end early, and a feeder need not notify.
    ///
    /// # Errors
    /// [`TransportError::Internal`] if waiting is not possible, and then without having slept.
    pub fn wait(&self, timeout: Duration) -> Result<bool, TransportError> {
        let waited = if timeout.is_zero() {
            self.listener.try_wait(|_| {})
        } else {
            // What is below a microsecond would become zero, which the socket beneath takes as for ever.
            self.listener
                .timed_wait(|_| {}, timeout.max(Duration::from_micros(1)))
        };
        match waited {
            Ok(notifications) => Ok(notifications > 0),
            Err(ListenerWaitError::InterruptSignal) => Ok(false),
            Err(error) => Err(TransportError::Internal {
                service: self.service.clone(),
                cause: format!("{error:?}"),
            }),
        }
    }
}

/// A port to be made, and how to speak of it if that fails.
struct Port<'a, E> {
    service: &'a str,
    kind: &'static str,
    limit: usize,
    full: E,
}

impl<E: Debug + PartialEq> Port<'_, E> {
    /// Makes the port. If every place is taken, sweeps out the processes that died and tries once more.
    fn make<T>(
        self,
        factory: &impl PortFactory,
        create: impl Fn() -> Result<T, E>,
        nodes: impl FnOnce() -> Vec<UniqueNodeId>,
    ) -> Result<T, TransportError> {
        let made = create().or_else(|error| {
            if error != self.full {
                return Err(error);
            }
            factory.try_cleanup_dead_nodes();
            create()
        });
        made.map_err(|error| {
            let service = self.service.to_owned();
            if error == self.full {
                TransportError::Full {
                    service,
                    port: self.kind,
                    limit: self.limit,
                    holders: process_ids(nodes()),
                }
            } else {
                TransportError::Internal {
                    service,
                    cause: format!("{error:?}"),
                }
            }
        })
    }
}

/// Ids of the processes of these nodes, each once, in ascending order.
pub(super) fn process_ids(nodes: impl IntoIterator<Item = UniqueNodeId>) -> Vec<u32> {
    let mut ids: Vec<u32> = nodes
        .into_iter()
        .filter_map(|node| node.pid::<ipc::Service>().ok())
        .filter_map(|pid| u32::try_from(pid.value()).ok())
        .collect();
    ids.sort_unstable();
    ids.dedup();
    ids
}
