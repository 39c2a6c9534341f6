//! The limits of each topic are in force, and running into one is a clear error.

mod common;

use std::fs::{self, OpenOptions};
use std::os::unix::fs::OpenOptionsExt;
use std::time::Duration;

use common::Isolated;
use iceoryx2::prelude::{PortFactory, ServiceName};
use inekf_shared::message::*;
use inekf_shared::qos;
use inekf_shared::topic::{Instance, Topic};
use inekf_shared::transport::{self, Node, PubSub, TransportError};

fn instance() -> Instance {
    Instance::new("limits").unwrap()
}

fn imu(seq: u64) -> ImuSample {
    ImuSample {
        header: Header {
            seq,
            ..Header::default()
        },
        ..ImuSample::default()
    }
}

/// Fills the buffer and three more: exactly the newest `buffer` messages are there, and no send waited or failed.
fn overflows<M: Message>(topic: &PubSub<M>, buffer: u64, make: fn(u64) -> M, seq: fn(&M) -> u64) {
    let subscriber = topic.subscriber().unwrap();
    assert_eq!(subscriber.buffer_size() as u64, buffer);
    let publisher = topic.publisher().unwrap();
    for number in 0..buffer + 3 {
        assert_eq!(publisher.send_copy(make(number)).unwrap(), 1);
    }
    for number in 3..buffer + 3 {
        assert_eq!(seq(&subscriber.receive().unwrap().unwrap()), number);
    }
    assert!(subscriber.receive().unwrap().is_none());
}

#[test]
fn a_full_buffer_drops_the_oldest_and_never_blocks() {
    let memory = Isolated::new();
    let node = memory.node();
    let inputs = transport::inputs(&node, &instance()).unwrap();
    overflows(&inputs.imu, 4096, imu, |sample| sample.header.seq);
    overflows(
        &inputs.position,
        1024,
        |source| PositionFix {
            source: source as u32,
            ..PositionFix::default()
        },
        |fix| u64::from(fix.source),
    );
    overflows(
        &transport::health(&node, &instance()).unwrap(),
        8,
        |uptime_ns| Health {
            uptime_ns,
            ..Health::default()
        },
        |health| health.uptime_ns,
    );
    let estimates = transport::estimate::<EstimateSe2>(&node, &instance()).unwrap();
    overflows(
        &estimates,
        1024,
        |seq| EstimateSe2 {
            head: EstimateHead {
                seq,
                ..EstimateHead::ZERO
            },
            ..EstimateSe2::ZERO
        },
        |estimate| estimate.head.seq,
    );
}

#[test]
fn a_reader_that_never_reads_does_not_hinder_one_that_does() {
    let memory = Isolated::new();
    let node = memory.node();
    let topic = transport::estimate::<EstimateSe2>(&node, &instance()).unwrap();
    let _asleep: Vec<_> = (1..qos::ESTIMATE.subscribers)
        .map(|_| topic.subscriber().unwrap())
        .collect();
    let awake = topic.subscriber().unwrap();
    let publisher = topic.publisher().unwrap();
    for seq in 0..3000 {
        let mut estimate = EstimateSe2::ZERO;
        estimate.head.seq = seq;
        assert_eq!(publisher.send_copy(estimate).unwrap(), 8);
        assert_eq!(awake.receive().unwrap().unwrap().head.seq, seq);
    }
}

#[test]
fn every_topic_is_created_with_its_limits() {
    let memory = Isolated::new();
    let node = memory.node();
    let inputs = transport::inputs(&node, &instance()).unwrap();
    let health = transport::health(&node, &instance()).unwrap();
    let smoothed = transport::smoothed(&node, &instance()).unwrap();
    let journal = transport::journal(&node, &instance()).unwrap();
    let estimate = transport::estimate::<EstimateSe23>(&node, &instance()).unwrap();
    // (buffer, publishers, subscribers, history), as the contract has them.
    check_limits::<ImuSample>(&node, Topic::Imu, [4096, 8, 4, 0]);
    check_limits::<Odometry2d>(&node, Topic::Odometry2d, [4096, 8, 4, 0]);
    check_limits::<Odometry3d>(&node, Topic::Odometry3d, [4096, 8, 4, 0]);
    check_limits::<PositionFix>(&node, Topic::Position, [1024, 8, 4, 0]);
    check_limits::<VelocityFix>(&node, Topic::Velocity, [1024, 8, 4, 0]);
    check_limits::<HeadingFix>(&node, Topic::Heading, [1024, 8, 4, 0]);
    check_limits::<EstimateSe23>(&node, Topic::Estimate, [1024, 2, 8, 0]);
    check_limits::<SmoothedState>(&node, Topic::Smoothed, [2048, 2, 8, 0]);
    check_limits::<JournalEntry>(&node, Topic::Journal, [4096, 2, 2, 0]);
    check_limits::<Health>(&node, Topic::Health, [8, 2, 8, 1]);
    drop((inputs, health, smoothed, journal, estimate));
}

fn check_limits<M: Message>(node: &Node, topic: Topic, expected: [usize; 4]) {
    let service = node
        .service_builder(&service_name(topic))
        .publish_subscribe::<M>()
        .open()
        .unwrap();
    let config = service.static_config();
    let found = [
        config.subscriber_max_buffer_size(),
        config.max_publishers(),
        config.max_subscribers(),
        config.history_size(),
    ];
    assert_eq!(found, expected, "{topic:?}");
    assert!(config.has_safe_overflow());
    assert_eq!(config.max_nodes(), 32);
}

fn service_name(topic: Topic) -> ServiceName {
    ServiceName::new(&topic.service_name(&instance())).unwrap()
}

#[test]
fn a_second_server_is_refused_and_told_the_process_of_the_first() {
    let memory = Isolated::new();
    let (first, second) = (memory.node(), memory.node());
    let serving = transport::control(&first, &instance()).unwrap();
    assert_eq!(serving.server_pids(), []);
    let server = serving.server().unwrap();
    let control = transport::control(&second, &instance()).unwrap();
    let own = std::process::id();
    assert_eq!(control.server_pids(), [own]);
    let error = control.server().unwrap_err();
    assert_eq!(
        error,
        TransportError::Full {
            service: "inekf/limits/control".to_owned(),
            port: "server",
            limit: 1,
            holders: vec![own],
        }
    );
    let text = error.to_string();
    assert!(text.contains(&format!("process {own}")), "{text}");
    drop(server);
    control.server().unwrap();
}

#[test]
fn each_kind_of_port_has_its_limit_and_a_place_that_is_given_back_is_free_again() {
    fn fills<T>(limit: usize, make: impl Fn() -> Result<T, TransportError>, kind: &str) {
        let mut ports: Vec<T> = (0..limit).map(|_| make().unwrap()).collect();
        let Err(error) = make() else {
            panic!("more than {limit} of {kind}");
        };
        assert!(
            matches!(&error, TransportError::Full { port, limit: at, .. } if *port == kind && *at == limit),
            "{error:?}"
        );
        ports.pop();
        make().unwrap();
    }
    let memory = Isolated::new();
    let node = memory.node();
    let imu = transport::input::<ImuSample>(&node, &instance()).unwrap();
    fills(8, || imu.publisher(), "publisher");
    fills(4, || imu.subscriber(), "subscriber");
    let control = transport::control(&node, &instance()).unwrap();
    fills(8, || control.client(), "client");
    let latest = transport::latest(&node, &instance(), EstimateSe2::ZERO).unwrap();
    fills(1, || latest.writer(), "writer");
    fills(16, || latest.reader(), "reader");
    let wake = transport::wake(&node, &instance()).unwrap();
    fills(32, || wake.notifier(), "notifier");
    fills(2, || wake.listener(), "listener");
}

#[test]
fn the_33rd_process_is_refused() {
    let memory = Isolated::new();
    let open = || transport::input::<ImuSample>(&memory.node(), &instance());
    let _held: Vec<_> = (0..32).map(|_| open().unwrap()).collect();
    let error = open().unwrap_err();
    assert_eq!(
        error,
        TransportError::Full {
            service: "inekf/limits/imu".to_owned(),
            port: "process",
            limit: 32,
            holders: vec![std::process::id()],
        }
    );
}

#[test]
fn too_many_unanswered_requests_are_an_error_and_none_is_lost() {
    let memory = Isolated::new();
    let node = memory.node();
    let control = transport::control(&node, &instance()).unwrap();
    let (server, client) = (control.server().unwrap(), control.client().unwrap());
    let request = |request_id| ControlRequest {
        request_id,
        ..ControlRequest::default()
    };
    let pending: Vec<_> = (0..4)
        .map(|id| client.send_copy(request(id)).unwrap())
        .collect();
    assert!(client.send_copy(request(4)).is_err());
    for (id, pending) in pending.iter().enumerate() {
        let active = server.receive().unwrap().unwrap();
        assert_eq!(active.request_id, id as u64);
        let response = ControlResponse {
            request_id: active.request_id,
            ..ControlResponse::default()
        };
        active.send_copy(response).unwrap();
        assert_eq!(pending.receive().unwrap().unwrap().request_id, id as u64);
    }
}

#[test]
fn a_request_is_done_even_if_its_client_has_gone() {
    let memory = Isolated::new();
    let node = memory.node();
    let control = transport::control(&node, &instance()).unwrap();
    let server = control.server().unwrap();
    {
        let client = control.client().unwrap();
        // The server connects to a new client when it next looks for requests.
        assert!(server.receive().unwrap().is_none());
        drop(client.send_copy(ControlRequest::default()).unwrap());
    }
    let active = server.receive().unwrap().unwrap();
    // Answering nobody neither fails nor waits.
    active.send_copy(ControlResponse::default()).unwrap();
}

#[test]
fn another_model_is_a_clear_error_with_both_types() {
    let memory = Isolated::new();
    let node = memory.node();
    let _daemon = transport::estimate::<EstimateSe23>(&node, &instance()).unwrap();
    let error = transport::estimate::<EstimateSe3>(&node, &instance()).unwrap_err();
    assert_eq!(
        error,
        TransportError::Incompatible {
            service: "inekf/limits/estimate".to_owned(),
            ours: "inekf.EstimateSe3.v2 (520 bytes, aligned to 8)".to_owned(),
            theirs: "inekf.EstimateSe23.v2 (1288 bytes, aligned to 8)".to_owned(),
        }
    );

    let latest = transport::latest(&node, &instance(), EstimateSe23::ZERO).unwrap();
    let _writer = latest.writer().unwrap();
    let other = transport::open_latest::<EstimateSe2>(&node, &instance()).unwrap();
    assert!(matches!(
        other.reader(),
        Err(TransportError::Incompatible { .. })
    ));
}

#[test]
fn another_layout_under_the_same_name_is_a_clear_error() {
    let memory = Isolated::new();
    let node = memory.node();
    let _foreign = node
        .service_builder(&service_name(Topic::Imu))
        .publish_subscribe::<HeadingFix>()
        .create()
        .unwrap();
    let text = transport::input::<ImuSample>(&node, &instance())
        .unwrap_err()
        .to_string();
    for part in [
        "inekf/limits/imu",
        "inekf.ImuSample.v1 (80 bytes",
        "inekf.HeadingFix.v1 (56 bytes",
    ] {
        assert!(text.contains(part), "{text}");
    }

    let _foreign = node
        .service_builder(&service_name(Topic::Control))
        .request_response::<ControlRequest, Health>()
        .create()
        .unwrap();
    let text = transport::control(&node, &instance())
        .unwrap_err()
        .to_string();
    for part in ["inekf.ControlResponse.v5", "inekf.Health.v4 (720 bytes"] {
        assert!(text.contains(part), "{text}");
    }
}

#[test]
fn a_service_with_smaller_limits_is_a_clear_error() {
    let memory = Isolated::new();
    let node = memory.node();
    let _small = node
        .service_builder(&service_name(Topic::Imu))
        .publish_subscribe::<ImuSample>()
        .create()
        .unwrap();
    let error = transport::input::<ImuSample>(&node, &instance()).unwrap_err();
    assert!(
        matches!(&error, TransportError::Limits { service, .. } if service == "inekf/limits/imu"),
        "{error:?}"
    );
}

#[test]
fn without_a_daemon_there_is_no_newest_estimate() {
    let memory = Isolated::new();
    let node = memory.node();
    let error = transport::open_latest::<EstimateSe23>(&node, &instance()).unwrap_err();
    assert_eq!(
        error,
        TransportError::Missing {
            service: "inekf/limits/latest".to_owned()
        }
    );
}

#[test]
fn a_new_daemon_takes_over_the_newest_estimate_that_a_reader_has_kept() {
    let memory = Isolated::new();
    let user = memory.node();
    let estimate = |seq| {
        let mut estimate = EstimateSe2::ZERO;
        estimate.head.seq = seq;
        estimate
    };
    let reader = {
        let daemon = memory.node();
        let latest = transport::latest(&daemon, &instance(), estimate(0)).unwrap();
        let reader = transport::open_latest::<EstimateSe2>(&user, &instance())
            .unwrap()
            .reader()
            .unwrap();
        assert!(latest.writer().unwrap().write(estimate(7)));
        reader
    };
    assert_eq!(reader.read().head.seq, 7);
    let daemon = memory.node();
    let writer = transport::latest(&daemon, &instance(), estimate(0))
        .unwrap()
        .writer()
        .unwrap();
    assert_eq!(reader.read().head.seq, 7);
    assert!(writer.write(estimate(8)));
    assert_eq!(reader.read().head.seq, 8);

    drop((writer, daemon));
    let daemon = memory.node();
    let other_model = transport::latest(&daemon, &instance(), EstimateSe3::ZERO).unwrap();
    assert!(matches!(
        other_model.writer(),
        Err(TransportError::Incompatible { .. })
    ));
}

#[test]
fn a_half_created_service_is_swept_away_by_whoever_opens_it_next() {
    let mut memory = Isolated::new();
    memory.config.global.creation_timeout = Duration::from_millis(50);
    let services = memory.root.path().join("services");
    let file = {
        let node = memory.node();
        let _open = transport::input::<ImuSample>(&node, &instance()).unwrap();
        let files: Vec<_> = fs::read_dir(&services)
            .unwrap()
            .map(|entry| entry.unwrap().path())
            .filter(|path| path.extension().is_some_and(|end| end == "service"))
            .collect();
        assert_eq!(files.len(), 1);
        files[0].clone()
    };
    assert!(!file.exists());
    // What a process leaves that dies before it has written the description: an empty file still open for writing.
    let half_created = || {
        OpenOptions::new()
            .write(true)
            .create_new(true)
            .mode(0o600)
            .open(&file)
            .unwrap();
    };
    half_created();
    {
        // Before the node is there,
        let node = memory.node();
        assert!(!file.exists());
        transport::input::<ImuSample>(&node, &instance()).unwrap();
    }
    // and while it is.
    let node = memory.node();
    half_created();
    transport::input::<ImuSample>(&node, &instance()).unwrap();
}

#[test]
fn settings_that_cannot_be_used_are_refused_by_name() {
    for (root, prefix, variable) in [
        (Some("relative/path"), None, "INEKF_IPC_ROOT"),
        (Some(""), None, "INEKF_IPC_ROOT"),
        (Some("/a\0b"), None, "INEKF_IPC_ROOT"),
        (None, Some(""), "INEKF_IPC_PREFIX"),
        (None, Some("a/b"), "INEKF_IPC_PREFIX"),
        (None, Some(".."), "INEKF_IPC_PREFIX"),
    ] {
        let error = transport::config(root, prefix).unwrap_err();
        assert!(
            matches!(&error, TransportError::Setting { variable: named, .. } if *named == variable),
            "{root:?} {prefix:?}: {error:?}"
        );
    }
    let (root, prefix) = (format!("/{}", "x".repeat(40)), "y".repeat(20));
    transport::config(Some(&root), Some(&prefix)).unwrap();
    for (root, prefix) in [
        (Some(format!("{root}x")), Some(prefix.clone())),
        (Some(root), Some(format!("{prefix}y"))),
        (Some(format!("/{}", "x".repeat(500))), None),
        (None, Some("y".repeat(500))),
    ] {
        let error = transport::config(root.as_deref(), prefix.as_deref()).unwrap_err();
        assert!(error.to_string().contains("too long"), "{error}");
    }
    assert_eq!(
        transport::config(None, None).unwrap(),
        transport::Config::default()
    );
}

#[test]
fn the_longest_root_and_prefix_serve_every_topic() {
    let directory = tempfile::tempdir_in("/tmp").unwrap();
    let mut root = format!("{}/", directory.path().display());
    while root.len() < 35 {
        root.push('r');
    }
    let mut prefix = format!("inekf_test_{}_long_", std::process::id());
    while root.len() + prefix.len() < transport::IPC_ROOT_AND_PREFIX_MAX_LEN {
        prefix.push('p');
    }
    let mut memory = Isolated::new();
    memory.config = transport::config(Some(&root), Some(&prefix)).unwrap();
    memory.prefix = prefix;
    let node = memory.node();
    let inputs = transport::inputs(&node, &instance()).unwrap();
    let (_publisher, _subscriber) = (
        inputs.odometry2d.publisher().unwrap(),
        inputs.odometry2d.subscriber().unwrap(),
    );
    let control = transport::control(&node, &instance()).unwrap();
    let (server, client) = (control.server().unwrap(), control.client().unwrap());
    let _pending = client.send_copy(ControlRequest::default()).unwrap();
    assert!(server.receive().unwrap().is_some());
    let latest = transport::latest(&node, &instance(), EstimateSe2::ZERO).unwrap();
    let _latest = (latest.writer().unwrap(), latest.reader().unwrap());
    let wake = transport::wake(&node, &instance()).unwrap();
    let (_listener, notifier) = (wake.listener().unwrap(), wake.notifier().unwrap());
    assert_eq!(notifier.notify().unwrap(), 1);
}

#[test]
fn a_root_that_cannot_be_written_is_a_clear_error() {
    let config = transport::config(Some("/proc/nowhere"), None).unwrap();
    let error = transport::open_node_with("test", &config).unwrap_err();
    let text = error.to_string();
    assert!(text.contains("/proc/nowhere"), "{text}");
    assert!(text.contains("\"test\""), "{text}");
}
