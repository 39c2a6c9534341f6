//! Opens the services of an instance, each with its type and its limits.
//!
//! All but the newest estimate are opened or created by whoever comes first, so daemon and clients start in any
//! order. The newest estimate is created by the daemon alone.
//!
//! Open no service twice on one node: if somebody removes its description in between, iceoryx2 0.10 creates it anew, finds
//! it registered already, and panics.

use iceoryx2::prelude::{MessagingPattern, Service, ServiceName, ipc};
use iceoryx2::service::builder::blackboard::{BlackboardCreateError, BlackboardOpenError};
use iceoryx2::service::port_factory::blackboard;
use iceoryx2::service::static_config::message_type_details::TypeDetail;
use iceoryx2::service::static_config::messaging_pattern::MessagingPattern as StaticPattern;

use super::classify::{BlackboardError, Classify, explain, retry};
use super::service::{Control, Latest, PubSub, Wake};
use super::{Node, TransportError};
use crate::message::{
    ControlRequest, ControlResponse, EstimateMessage, EstimateSe2, EstimateSe3, EstimateSe23,
    Header, HeadingFix, Health, ImuSample, JournalEntry, Message, Odometry2d, Odometry3d,
    PositionFix, SmoothedState, VelocityFix,
};
use crate::qos::{self, PubSubQos};
use crate::topic::{Instance, Topic};

/// A message that clients send to the daemon.
///
/// ```
/// use inekf_shared::message::{HeadingFix, Zero};
/// use inekf_shared::topic::Topic;
/// use inekf_shared::transport::InputMessage;
///
/// /// Whatever the sensor.
/// fn stamp_ns<M: InputMessage>(message: &M) -> u64 {
///     message.header().stamp_ns
/// }
///
/// assert_eq!(stamp_ns(&HeadingFix::ZERO), 0);
/// assert_eq!(HeadingFix::TOPIC, Topic::Heading);
/// ```
pub trait InputMessage: Message {
    /// The topic it is sent on.
    const TOPIC: Topic;

    /// When it was measured, and which one it is.
    fn header(&self) -> &Header;

    /// Its topic among all inputs.
    fn topic_of(inputs: &Inputs) -> &PubSub<Self>;
}

macro_rules! input_message {
    ($($message:ty => $topic:ident, $field:ident;)+) => {
        $(impl InputMessage for $message {
            const TOPIC: Topic = Topic::$topic;

            fn header(&self) -> &Header {
                &self.header
            }

            fn topic_of(inputs: &Inputs) -> &PubSub<Self> {
                &inputs.$field
            }
        })+
    };
}

input_message! {
    ImuSample => Imu, imu;
    Odometry2d => Odometry2d, odometry2d;
    Odometry3d => Odometry3d, odometry3d;
    PositionFix => Position, position;
    VelocityFix => Velocity, velocity;
    HeadingFix => Heading, heading;
}

/// All inputs of an instance.
///
/// ```
/// use inekf_shared::topic::Instance;
/// use inekf_shared::transport;
///
/// # let root = tempfile::tempdir_in("/tmp")?;
/// # let prefix = root.path().file_name().and_then(|name| name.to_str());
/// # let config = transport::config(root.path().to_str(), prefix)?;
/// # let node = transport::open_node_with("doc", &config)?;
/// let inputs = transport::inputs(&node, &Instance::new("car")?)?;
/// let daemon = inputs.velocity.subscriber()?;
/// // Each input has ports of its own.
/// assert_eq!((inputs.velocity.subscriber_count(), inputs.imu.subscriber_count()), (1, 0));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug)]
pub struct Inputs {
    /// Inertial samples.
    pub imu: PubSub<ImuSample>,
    /// Planar odometry.
    pub odometry2d: PubSub<Odometry2d>,
    /// Spatial odometry.
    pub odometry3d: PubSub<Odometry3d>,
    /// Position fixes.
    pub position: PubSub<PositionFix>,
    /// Velocity fixes.
    pub velocity: PubSub<VelocityFix>,
    /// Heading fixes.
    pub heading: PubSub<HeadingFix>,
}

/// Opens all inputs of an instance.
///
/// # Errors
/// As [`input`], for the first that fails.
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
/// let inputs = transport::inputs(&node, &Instance::new("car")?)?;
/// let (sender, receiver) = (inputs.heading.publisher()?, inputs.heading.subscriber()?);
/// assert_eq!(sender.send_copy(HeadingFix { heading_rad: 0.5, ..HeadingFix::ZERO })?, 1);
/// assert_eq!(receiver.receive()?.expect("sent").heading_rad, 0.5);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn inputs(node: &Node, instance: &Instance) -> Result<Inputs, TransportError> {
    Ok(Inputs {
        imu: input(node, instance)?,
        odometry2d: input(node, instance)?,
        odometry3d: input(node, instance)?,
        position: input(node, instance)?,
        velocity: input(node, instance)?,
        heading: input(node, instance)?,
    })
}

/// Opens one input of an instance.
///
/// # Errors
/// [`TransportError`], naming the service.
///
/// ```
/// use inekf_shared::message::{ImuSample, Zero};
/// use inekf_shared::topic::Instance;
/// use inekf_shared::transport;
///
/// # let root = tempfile::tempdir_in("/tmp")?;
/// # let prefix = root.path().file_name().and_then(|name| name.to_str());
/// # let config = transport::config(root.path().to_str(), prefix)?;
/// # let node = transport::open_node_with("doc", &config)?;
/// let imu = transport::input::<ImuSample>(&node, &Instance::new("car")?)?;
/// // Nobody listens yet: it goes to nobody, and that is no error.
/// assert_eq!(imu.publisher()?.send_copy(ImuSample::ZERO)?, 0);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn input<M: InputMessage>(
    node: &Node,
    instance: &Instance,
) -> Result<PubSub<M>, TransportError> {
    pub_sub(node, instance, M::TOPIC)
}

/// Opens the estimates of an instance. `E` must be the payload of the daemon's model ([`estimate_model`]).
///
/// # Errors
/// [`TransportError::Incompatible`] if the instance uses another model, else as [`input`].
///
/// ```
/// use inekf_shared::message::{EstimateSe2, EstimateSe23};
/// use inekf_shared::topic::Instance;
/// use inekf_shared::transport::{self, TransportError};
///
/// # let root = tempfile::tempdir_in("/tmp")?;
/// # let prefix = root.path().file_name().and_then(|name| name.to_str());
/// # let config = transport::config(root.path().to_str(), prefix)?;
/// # let node = transport::open_node_with("doc", &config)?;
/// let instance = Instance::new("cart")?;
/// let planar = transport::estimate::<EstimateSe2>(&node, &instance)?;
/// // Of one model, and both sides are told which.
/// let other = transport::estimate::<EstimateSe23>(&node, &instance);
/// assert!(matches!(other, Err(TransportError::Incompatible { .. })));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn estimate<E: EstimateMessage>(
    node: &Node,
    instance: &Instance,
) -> Result<PubSub<E>, TransportError> {
    pub_sub(node, instance, Topic::Estimate)
}

/// Opens the smoothed states of an instance.
///
/// # Errors
/// As [`input`].
///
/// ```
/// use inekf_shared::message::{SmoothedState, Zero};
/// use inekf_shared::topic::Instance;
/// use inekf_shared::transport;
///
/// # let root = tempfile::tempdir_in("/tmp")?;
/// # let prefix = root.path().file_name().and_then(|name| name.to_str());
/// # let config = transport::config(root.path().to_str(), prefix)?;
/// # let node = transport::open_node_with("doc", &config)?;
/// let states = transport::smoothed(&node, &Instance::new("car")?)?;
/// let reader = states.subscriber()?;
/// states.publisher()?.send_copy(SmoothedState { index: 3, ..SmoothedState::ZERO })?;
/// // Sent by one that has gone before its counterpart had connected: it is lost.
/// assert!(reader.receive()?.is_none());
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn smoothed(node: &Node, instance: &Instance) -> Result<PubSub<SmoothedState>, TransportError> {
    pub_sub(node, instance, Topic::Smoothed)
}

/// Opens the health of an instance.
///
/// # Errors
/// As [`input`].
///
/// ```
/// use inekf_shared::message::{Health, Zero};
/// use inekf_shared::topic::Instance;
/// use inekf_shared::transport;
///
/// # let root = tempfile::tempdir_in("/tmp")?;
/// # let prefix = root.path().file_name().and_then(|name| name.to_str());
/// # let config = transport::config(root.path().to_str(), prefix)?;
/// # let node = transport::open_node_with("doc", &config)?;
/// let health = transport::health(&node, &Instance::new("car")?)?;
/// let daemon = health.publisher()?;
/// daemon.send_copy(Health { uptime_ns: 7, ..Health::ZERO })?;
/// // Who comes later gets the last one too, as soon as the daemon sends again.
/// let late = health.subscriber()?;
/// daemon.send_copy(Health { uptime_ns: 8, ..Health::ZERO })?;
/// assert_eq!(late.receive()?.map(|health| health.uptime_ns), Some(7));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn health(node: &Node, instance: &Instance) -> Result<PubSub<Health>, TransportError> {
    pub_sub(node, instance, Topic::Health)
}

/// Opens the journal of an instance.
///
/// # Errors
/// As [`input`].
///
/// ```
/// use inekf_shared::message::{JOURNAL_SETTLE, JournalEntry};
/// use inekf_shared::topic::Instance;
/// use inekf_shared::transport;
///
/// # let root = tempfile::tempdir_in("/tmp")?;
/// # let prefix = root.path().file_name().and_then(|name| name.to_str());
/// # let config = transport::config(root.path().to_str(), prefix)?;
/// # let node = transport::open_node_with("doc", &config)?;
/// let journal = transport::journal(&node, &Instance::new("car")?)?;
/// let (recorder, daemon) = (journal.subscriber()?, journal.publisher()?);
/// for index in 0..3 {
///     daemon.send_copy(JournalEntry::new(index, 0, JOURNAL_SETTLE, &[]))?;
/// }
/// assert_eq!(recorder.receive()?.map(|entry| entry.index), Some(0));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn journal(node: &Node, instance: &Instance) -> Result<PubSub<JournalEntry>, TransportError> {
    pub_sub(node, instance, Topic::Journal)
}

/// The `MODEL_*` code whose estimates the instance carries; `None` if nobody has opened them yet, or if their type is
/// none of this version.
///
/// # Errors
/// [`TransportError::Internal`] if the service's description cannot be read.
///
/// ```
/// use inekf_shared::message::{EstimateSe2, MODEL_ODOMETRY_2D};
/// use inekf_shared::topic::Instance;
/// use inekf_shared::transport;
///
/// # let root = tempfile::tempdir_in("/tmp")?;
/// # let prefix = root.path().file_name().and_then(|name| name.to_str());
/// # let config = transport::config(root.path().to_str(), prefix)?;
/// # let node = transport::open_node_with("doc", &config)?;
/// let instance = Instance::new("cart")?;
/// assert_eq!(transport::estimate_model(&node, &instance)?, None);
/// let estimates = transport::estimate::<EstimateSe2>(&node, &instance)?;
/// assert_eq!(transport::estimate_model(&node, &instance)?, Some(MODEL_ODOMETRY_2D));
/// # drop(estimates);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn estimate_model(node: &Node, instance: &Instance) -> Result<Option<u32>, TransportError> {
    let service = Topic::Estimate.service_name(instance);
    let name = service_name(&service)?;
    let details = ipc::Service::details(&name, node.config(), MessagingPattern::PublishSubscribe)
        .map_err(|error| TransportError::Internal {
        service,
        cause: format!("{error:?}"),
    })?;
    let Some(details) = details else {
        return Ok(None);
    };
    let StaticPattern::PublishSubscribe(config) = details.static_details.messaging_pattern() else {
        return Ok(None);
    };
    Ok(
        match config
            .message_type_details()
            .payload
            .type_name()
            .to_string()
            .as_str()
        {
            EstimateSe23::TYPE_NAME => Some(EstimateSe23::MODEL),
            EstimateSe3::TYPE_NAME => Some(EstimateSe3::MODEL),
            EstimateSe2::TYPE_NAME => Some(EstimateSe2::MODEL),
            _ => None,
        },
    )
}

fn pub_sub<M: Message>(
    node: &Node,
    instance: &Instance,
    topic: Topic,
) -> Result<PubSub<M>, TransportError> {
    let service = topic.service_name(instance);
    let name = service_name(&service)?;
    let Some(qos) = qos::pub_sub(topic) else {
        return Err(TransportError::Internal {
            service,
            cause: "not a publish-subscribe topic".to_owned(),
        });
    };
    let PubSubQos {
        buffer,
        publishers,
        subscribers,
        history,
    } = qos;
    let open = || {
        node.service_builder(&name)
            .publish_subscribe::<M>()
            .subscriber_max_buffer_size(buffer)
            .subscriber_max_borrowed_samples(qos::MAX_BORROWED)
            .max_publishers(publishers)
            .max_subscribers(subscribers)
            .history_size(history)
            .max_nodes(qos::MAX_NODES)
            .enable_safe_overflow(true)
            .open_or_create()
    };
    let factory = retry(node.config(), open).map_err(|error| {
        refuse(
            node,
            error,
            &name,
            MessagingPattern::PublishSubscribe,
            || describe::<M>(),
        )
    })?;
    node.note(&factory);
    Ok(PubSub::new(service, qos, node.config().clone(), factory))
}

/// Opens the control of an instance.
///
/// # Errors
/// As [`input`].
///
/// ```
/// use inekf_shared::message::{CONTROL_SNAPSHOT, ControlRequest, ControlResponse};
/// use inekf_shared::topic::Instance;
/// use inekf_shared::transport::{self, TransportError};
///
/// # let root = tempfile::tempdir_in("/tmp")?;
/// # let prefix = root.path().file_name().and_then(|name| name.to_str());
/// # let config = transport::config(root.path().to_str(), prefix)?;
/// # let node = transport::open_node_with("doc", &config)?;
/// let control = transport::control(&node, &Instance::new("car")?)?;
/// let (server, client) = (control.server()?, control.client()?);
/// let pending = client.send_copy(ControlRequest { kind: CONTROL_SNAPSHOT, request_id: 5, ..Default::default() })?;
/// // What a daemon does:
/// let request = server.receive()?.expect("asked");
/// request.send_copy(ControlResponse { request_id: request.request_id, ..Default::default() })?;
/// assert_eq!(pending.receive()?.expect("answered").request_id, 5);
/// // A second daemon of the instance is found out, and told whose place it wants.
/// assert!(matches!(control.server(), Err(TransportError::Full { holders, .. }) if holders == [std::process::id()]));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn control(node: &Node, instance: &Instance) -> Result<Control, TransportError> {
    let service = Topic::Control.service_name(instance);
    let name = service_name(&service)?;
    let open = || {
        node.service_builder(&name)
            .request_response::<ControlRequest, ControlResponse>()
            .max_servers(qos::CONTROL_SERVERS)
            .max_clients(qos::CONTROL_CLIENTS)
            .max_active_requests_per_client(qos::CONTROL_PENDING)
            .max_loaned_requests(qos::CONTROL_PENDING)
            .max_response_buffer_size(1)
            .max_borrowed_responses_per_pending_response(1)
            .max_nodes(qos::MAX_NODES)
            // A client that has as many requests unanswered gets an error; none is dropped.
            .enable_safe_overflow_for_requests(false)
            .enable_safe_overflow_for_responses(false)
            // A request is done even if its client has gone.
            .enable_fire_and_forget_requests(true)
            .open_or_create()
    };
    let factory = retry(node.config(), open).map_err(|error| {
        refuse(
            node,
            error,
            &name,
            MessagingPattern::RequestResponse,
            || {
                format!(
                    "{} and {}",
                    describe::<ControlRequest>(),
                    describe::<ControlResponse>()
                )
            },
        )
    })?;
    node.note(&factory);
    Ok(Control::new(service, factory))
}

/// Opens what wakes the daemon of an instance.
///
/// # Errors
/// As [`input`].
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
/// let wake = transport::wake(&node, &Instance::new("car")?)?;
/// let (daemon, feeder) = (wake.listener()?, wake.notifier()?);
/// assert!(!daemon.wait(Duration::ZERO)?);
/// feeder.notify()?;
/// feeder.notify()?;
/// // One wake-up may stand for many messages.
/// assert!(daemon.wait(Duration::from_secs(5))?);
/// assert!(!daemon.wait(Duration::ZERO)?);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn wake(node: &Node, instance: &Instance) -> Result<Wake, TransportError> {
    let service = Topic::Wake.service_name(instance);
    let name = service_name(&service)?;
    let open = || {
        node.service_builder(&name)
            .event()
            .max_notifiers(qos::WAKE_NOTIFIERS)
            .max_listeners(qos::WAKE_LISTENERS)
            .event_id_max_value(qos::WAKE_MAX_EVENT)
            .max_nodes(qos::MAX_NODES)
            .disable_deadline()
            .disable_notifier_created_event()
            .disable_notifier_dropped_event()
            .disable_notifier_dead_event()
            .open_or_create()
    };
    let factory = retry(node.config(), open)
        .map_err(|error| refuse(node, error, &name, MessagingPattern::Event, String::new))?;
    node.note(&factory);
    Ok(Wake::new(service, factory))
}

/// Creates the newest estimate of an instance, for the daemon. `initial` is what a reader finds before the first
/// estimate. If readers have kept it from an earlier daemon, it is taken over; it then holds that daemon's last estimate
/// until the next write.
///
/// # Errors
/// As [`input`].
///
/// ```
/// use inekf_shared::message::{EstimateSe2, Zero};
/// use inekf_shared::topic::Instance;
/// use inekf_shared::transport;
///
/// # let root = tempfile::tempdir_in("/tmp")?;
/// # let prefix = root.path().file_name().and_then(|name| name.to_str());
/// # let config = transport::config(root.path().to_str(), prefix)?;
/// # let node = transport::open_node_with("doc", &config)?;
/// let instance = Instance::new("cart")?;
/// let latest = transport::latest(&node, &instance, EstimateSe2::ZERO)?;
/// let (writer, reader) = (latest.writer()?, latest.reader()?);
/// assert!(writer.write(EstimateSe2 { theta_rad: 0.1, ..EstimateSe2::ZERO }));
/// assert!(writer.write(EstimateSe2 { theta_rad: 0.2, ..EstimateSe2::ZERO }));
/// // The newest, whole; and again, as often as it is asked for.
/// assert_eq!((reader.read().theta_rad, reader.read().theta_rad), (0.2, 0.2));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn latest<E: EstimateMessage>(
    node: &Node,
    instance: &Instance,
    initial: E,
) -> Result<Latest<E>, TransportError> {
    let service = Topic::Latest.service_name(instance);
    let name = service_name(&service)?;
    let create = || {
        node.service_builder(&name)
            .blackboard_creator::<u32>()
            .add(qos::LATEST_KEY, initial)
            .max_readers(qos::LATEST_READERS)
            .max_nodes(qos::MAX_NODES)
            .create()
    };
    let open = || open_blackboard(node, &name);
    // Whoever keeps it from an earlier daemon may leave between the two attempts.
    let attempt = || match create() {
        Err(BlackboardCreateError::AlreadyExists) => open().map_err(BlackboardError::Open),
        created => created.map_err(BlackboardError::Create),
    };
    let factory = retry(node.config(), attempt).map_err(|error| {
        refuse(node, error, &name, MessagingPattern::Blackboard, || {
            describe::<E>()
        })
    })?;
    node.note(&factory);
    Ok(Latest::new(service, factory))
}

fn open_blackboard(
    node: &Node,
    name: &ServiceName,
) -> Result<blackboard::PortFactory<ipc::Service, u32>, BlackboardOpenError> {
    node.service_builder(name)
        .blackboard_opener::<u32>()
        .max_readers(qos::LATEST_READERS)
        .max_nodes(qos::MAX_NODES)
        .open()
}

/// Opens the newest estimate of an instance, for readers.
///
/// # Errors
/// [`TransportError::Missing`] if no daemon of the instance has started yet, else as [`input`].
///
/// ```
/// use inekf_shared::message::{EstimateSe2, Zero};
/// use inekf_shared::topic::Instance;
/// use inekf_shared::transport;
///
/// # let root = tempfile::tempdir_in("/tmp")?;
/// # let prefix = root.path().file_name().and_then(|name| name.to_str());
/// # let config = transport::config(root.path().to_str(), prefix)?;
/// # let node = transport::open_node_with("doc", &config)?;
/// let instance = Instance::new("cart")?;
/// // The daemon makes it, nobody else.
/// let early = transport::open_latest::<EstimateSe2>(&node, &instance);
/// assert!(matches!(early, Err(transport::TransportError::Missing { .. })));
/// let daemon = transport::latest(&node, &instance, EstimateSe2::ZERO)?;
/// let reader = transport::open_latest::<EstimateSe2>(&node, &instance)?.reader()?;
/// assert_eq!(reader.read(), EstimateSe2::ZERO);
/// # drop(daemon);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn open_latest<E: EstimateMessage>(
    node: &Node,
    instance: &Instance,
) -> Result<Latest<E>, TransportError> {
    let service = Topic::Latest.service_name(instance);
    let name = service_name(&service)?;
    let open = || open_blackboard(node, &name);
    let factory = retry(node.config(), open).map_err(|error| {
        refuse(node, error, &name, MessagingPattern::Blackboard, || {
            describe::<E>()
        })
    })?;
    node.note(&factory);
    Ok(Latest::new(service, factory))
}

fn service_name(service: &str) -> Result<ServiceName, TransportError> {
    ServiceName::new(service).map_err(|error| TransportError::Internal {
        service: service.to_owned(),
        cause: format!("{error:?}"),
    })
}

fn refuse<E: Classify>(
    node: &Node,
    error: E,
    name: &ServiceName,
    pattern: MessagingPattern,
    ours: impl FnOnce() -> String,
) -> TransportError {
    explain(
        error,
        name.to_string(),
        || (ours(), describe_existing(node, name, pattern)),
        || holders(node, name, pattern),
    )
}

/// Name, size and alignment of our message, in the form of [`describe_type`].
fn describe<M: Message>() -> String {
    format!(
        "{} ({} bytes, aligned to {})",
        M::TYPE_NAME,
        size_of::<M>(),
        align_of::<M>()
    )
}

fn describe_type(detail: &TypeDetail) -> String {
    format!(
        "{} ({} bytes, aligned to {})",
        detail.type_name(),
        detail.size(),
        detail.alignment()
    )
}

fn describe_existing(node: &Node, name: &ServiceName, pattern: MessagingPattern) -> String {
    let Ok(Some(details)) = ipc::Service::details(name, node.config(), pattern) else {
        return "a type that could not be read".to_owned();
    };
    match details.static_details.messaging_pattern() {
        StaticPattern::PublishSubscribe(config) => {
            describe_type(&config.message_type_details().payload)
        }
        StaticPattern::RequestResponse(config) => format!(
            "{} and {}",
            describe_type(&config.request_message_type_details().payload),
            describe_type(&config.response_message_type_details().payload)
        ),
        StaticPattern::Blackboard(config) => {
            format!("the key {}", describe_type(config.type_details()))
        }
        _ => "no type".to_owned(),
    }
}

/// Ids of the processes that have the service open.
fn holders(node: &Node, name: &ServiceName, pattern: MessagingPattern) -> Vec<u32> {
    let Ok(Some(details)) = ipc::Service::details(name, node.config(), pattern) else {
        return Vec::new();
    };
    let nodes = details
        .dynamic_details
        .map(|dynamic| dynamic.nodes)
        .unwrap_or_default();
    let ids = nodes.iter().map(|state| *state.node_id());
    super::service::process_ids(ids)
}
