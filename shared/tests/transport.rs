//! Every topic through real shared memory, both sides in one process.

mod common;

use std::time::Duration;

use common::Isolated;
use inekf_shared::clock::monotonic_ns;
use inekf_shared::message::*;
use inekf_shared::topic::Instance;
use inekf_shared::transport::{self, InputMessage, Node, PubSub};

fn instance() -> Instance {
    Instance::new("round-trip").unwrap()
}

fn header(seq: u64) -> Header {
    Header {
        stamp_ns: 1_000_000 * seq,
        seq,
        sent_ns: monotonic_ns(),
        epoch: 42,
    }
}

/// Sends each message on one side and takes it on the other, in order and whole, then finds the topic empty.
fn passes<M: Message>(sender: &PubSub<M>, receiver: &PubSub<M>, messages: &[M]) {
    let subscriber = receiver.subscriber().unwrap();
    let publisher = sender.publisher().unwrap();
    for message in messages {
        let sample = publisher.loan_uninit().unwrap().write_payload(*message);
        assert_eq!(sample.send().unwrap(), 1);
    }
    for message in messages {
        let sample = subscriber.receive().unwrap().unwrap();
        assert_eq!(&*sample, message);
        assert_eq!(sample.origin(), publisher.id());
    }
    assert!(subscriber.receive().unwrap().is_none());
}

fn input_passes<M: InputMessage>(client: &Node, daemon: &Node, messages: &[M]) {
    passes(
        &transport::input::<M>(client, &instance()).unwrap(),
        &transport::input::<M>(daemon, &instance()).unwrap(),
        messages,
    );
}

fn estimate_passes<E: EstimateMessage>(messages: &[E]) {
    let memory = Isolated::new();
    let (daemon, client) = (memory.node(), memory.node());
    assert_eq!(
        transport::estimate_model(&client, &instance()).unwrap(),
        None
    );
    let ours = transport::estimate::<E>(&daemon, &instance()).unwrap();
    assert_eq!(
        transport::estimate_model(&client, &instance()).unwrap(),
        Some(E::MODEL)
    );
    let theirs = transport::estimate::<E>(&client, &instance()).unwrap();
    passes(&ours, &theirs, messages);
}

fn se23(seq: u64) -> EstimateSe23 {
    EstimateSe23 {
        head: EstimateHead {
            seq,
            nis: [2.5; MAX_SOURCES],
            ..EstimateHead::UNSTARTED
        },
        q_wb: [0.0, 0.0, 0.6, 0.8],
        v_w_mps: [1.0, 2.0, 3.0],
        p_w_m: [seq as f64, -2.0, 0.5],
        gyro_bias_rps: [1e-3, 2e-3, 3e-3],
        accel_bias_mps2: [0.1, 0.2, 0.3],
        covariance: core::array::from_fn(|index| index as f64),
    }
}

#[test]
fn every_input_passes() {
    let memory = Isolated::new();
    let (client, daemon) = (memory.node(), memory.node());
    let imu = |seq| ImuSample {
        header: header(seq),
        gyro_rps: [0.1, 0.2, seq as f64],
        accel_mps2: [0.0, 0.0, 9.81],
    };
    input_passes(&client, &daemon, &[imu(1), imu(2), imu(3)]);
    let planar = Odometry2d {
        header: header(1),
        dtheta_rad: 0.01,
        translation_m: [0.5, -0.1],
    };
    input_passes(&client, &daemon, &[planar]);
    let spatial = Odometry3d {
        header: header(1),
        rotation_rad: [0.1, 0.2, 0.3],
        translation_m: [1.0, 2.0, 3.0],
    };
    input_passes(&client, &daemon, &[spatial]);
    let position = PositionFix {
        header: header(1),
        source: 2,
        dimension: 3,
        position_w_m: [1.0, 2.0, 3.0],
        covariance_w_m2: [9.0, 0.0, 0.0, 0.0, 9.0, 0.0, 0.0, 0.0, 25.0],
    };
    input_passes(&client, &daemon, &[position]);
    let velocity = VelocityFix {
        header: header(1),
        source: 1,
        flags: 0,
        velocity_w_mps: [1.0, 2.0, 3.0],
        covariance_w: [0.1; 9],
    };
    input_passes(&client, &daemon, &[velocity]);
    let heading = HeadingFix {
        header: header(1),
        source: 0,
        flags: 0,
        heading_rad: 1.5,
        sigma_rad: 0.1,
    };
    input_passes(&client, &daemon, &[heading]);
}

#[test]
fn all_inputs_open_at_once_on_both_sides() {
    let memory = Isolated::new();
    let (client, daemon) = (memory.node(), memory.node());
    let feeding = transport::inputs(&client, &instance()).unwrap();
    let fed = transport::inputs(&daemon, &instance()).unwrap();
    let subscriber = fed.heading.subscriber().unwrap();
    assert_eq!(feeding.heading.subscriber_count(), 1);
    assert_eq!(feeding.imu.subscriber_count(), 0);
    let publisher = feeding.heading.publisher().unwrap();
    assert_eq!(fed.heading.publisher_count(), 1);
    assert_eq!(publisher.send_copy(HeadingFix::default()).unwrap(), 1);
    assert!(subscriber.receive().unwrap().is_some());
}

#[test]
fn the_estimate_of_every_model_passes() {
    estimate_passes(&[se23(1), se23(2)]);
    estimate_passes(&[EstimateSe3 {
        head: EstimateHead {
            nis: [0.0; MAX_SOURCES],
            ..EstimateHead::UNSTARTED
        },
        q_wb: [0.0, 0.0, 0.0, 1.0],
        p_w_m: [1.0, 2.0, 3.0],
        covariance: [0.5; SE3_TRI],
        mismatch: [0.1, 0.2, f64::MAX, 0.0, -0.0, -1.0],
        mismatch_sigma: [1.0; 6],
    }]);
    estimate_passes(&[EstimateSe2 {
        head: EstimateHead {
            nis: [0.0; MAX_SOURCES],
            ..EstimateHead::UNSTARTED
        },
        theta_rad: 0.3,
        p_w_m: [1.0, 2.0],
        covariance: [0.5; SE2_TRI],
        mismatch: [0.1, 0.2, f64::MAX, 0.0, -0.0, -1.0],
        mismatch_sigma: [1.0; 6],
    }]);
}

#[test]
fn a_sample_loaned_ahead_is_sent_later() {
    let memory = Isolated::new();
    let node = memory.node();
    let topic = transport::estimate::<EstimateSe23>(&node, &instance()).unwrap();
    let subscriber = topic.subscriber().unwrap();
    let publisher = topic.publisher().unwrap();
    let mut ahead = publisher.loan_uninit().unwrap();
    for seq in 0..5000 {
        let sample = ahead.write_payload(se23(seq));
        ahead = publisher.loan_uninit().unwrap();
        sample.send().unwrap();
        assert_eq!(subscriber.receive().unwrap().unwrap().head.seq, seq);
    }
}

#[test]
fn a_late_subscriber_gets_the_last_health() {
    let memory = Isolated::new();
    let (daemon, client) = (memory.node(), memory.node());
    let publisher = transport::health(&daemon, &instance())
        .unwrap()
        .publisher()
        .unwrap();
    for uptime_ns in [1, 2, 3] {
        publisher
            .send_copy(Health {
                uptime_ns,
                ..Health::default()
            })
            .unwrap();
    }
    let subscriber = transport::health(&client, &instance())
        .unwrap()
        .subscriber()
        .unwrap();
    // The publisher hands its history over when it next acts.
    assert!(subscriber.receive().unwrap().is_none());
    publisher
        .send_copy(Health {
            uptime_ns: 4,
            ..Health::default()
        })
        .unwrap();
    let received: Vec<u64> =
        core::iter::from_fn(|| subscriber.receive().unwrap().map(|sample| sample.uptime_ns))
            .collect();
    assert_eq!(received, [3, 4]);
}

#[test]
fn a_request_gets_its_response() {
    let memory = Isolated::new();
    let (daemon, user) = (memory.node(), memory.node());
    let server = transport::control(&daemon, &instance())
        .unwrap()
        .server()
        .unwrap();
    let client = transport::control(&user, &instance())
        .unwrap()
        .client()
        .unwrap();

    let request = |request_id| ControlRequest {
        kind: CONTROL_SNAPSHOT,
        request_id,
        ..ControlRequest::default()
    };
    let first = client.send_copy(request(1)).unwrap();
    let second = client.send_copy(request(2)).unwrap();
    assert_eq!(first.number_of_server_connections(), 1);
    assert!(first.receive().unwrap().is_none());

    for request_id in [1, 2] {
        let active = server.receive().unwrap().unwrap();
        assert_eq!(*active, request(request_id));
        let mut response = ControlResponse {
            request_id,
            status: CONTROL_REFUSED,
            state: StateVector {
                p_w_m: [request_id as f64, 0.0, 0.0],
                ..StateVector::default()
            },
            ..ControlResponse::default()
        };
        response.set_reason("not initialised");
        active.send_copy(response).unwrap();
    }
    assert!(server.receive().unwrap().is_none());

    for (pending, request_id) in [(second, 2), (first, 1)] {
        let response = pending.receive().unwrap().unwrap();
        assert_eq!(response.request_id, request_id);
        assert_eq!(response.reason(), "not initialised");
        assert_eq!(response.state.p_w_m[0], request_id as f64);
    }
}

#[test]
fn the_newest_estimate_is_read_as_often_as_wanted() {
    let memory = Isolated::new();
    let (daemon, user) = (memory.node(), memory.node());
    let writer = transport::latest(&daemon, &instance(), se23(0))
        .unwrap()
        .writer()
        .unwrap();
    let open = transport::open_latest::<EstimateSe23>(&user, &instance()).unwrap();
    let (one, other) = (open.reader().unwrap(), open.reader().unwrap());
    assert_eq!(one.read(), se23(0));
    for seq in 1..100 {
        assert!(writer.write(se23(seq)));
        assert_eq!(one.read(), se23(seq));
        assert_eq!(one.read(), se23(seq));
    }
    assert_eq!(other.read(), se23(99));
}

#[test]
fn the_newest_estimate_is_never_torn() {
    let memory = Isolated::new();
    let filled = |value: u64| EstimateSe23 {
        head: EstimateHead {
            seq: value,
            ..EstimateHead::ZERO
        },
        p_w_m: [value as f64; 3],
        covariance: [value as f64; NAV_TRI],
        ..EstimateSe23::ZERO
    };
    let node = memory.node();
    let latest = transport::latest(&node, &instance(), filled(0)).unwrap();
    let writer = latest.writer().unwrap();
    let last = 200_000;
    std::thread::scope(|scope| {
        let reading = scope.spawn(|| {
            let node = memory.node();
            let reader = transport::open_latest::<EstimateSe23>(&node, &instance())
                .unwrap()
                .reader()
                .unwrap();
            let mut newest = 0;
            while newest < last {
                let estimate = reader.read();
                assert!(estimate.head.seq >= newest, "went back");
                newest = estimate.head.seq;
                assert_eq!(estimate, filled(newest), "torn");
            }
        });
        for value in 1..last {
            assert!(writer.write(filled(value)));
        }
        assert!(writer.write(filled(last)));
        reading.join().unwrap();
    });
}

#[test]
fn a_notification_wakes_and_is_gone_once_taken() {
    let memory = Isolated::new();
    let (daemon, client) = (memory.node(), memory.node());
    let listener = transport::wake(&daemon, &instance())
        .unwrap()
        .listener()
        .unwrap();
    let notifier = transport::wake(&client, &instance())
        .unwrap()
        .notifier()
        .unwrap();
    let moment = Duration::from_millis(1);
    assert!(!listener.wait(moment).unwrap());
    assert_eq!(notifier.notify().unwrap(), 1);
    assert_eq!(notifier.notify().unwrap(), 1);
    // Two notifications before one wait are one wake-up: nobody may count messages by them.
    assert!(listener.wait(Duration::from_secs(10)).unwrap());
    assert!(!listener.wait(moment).unwrap());
    // No time at all is a look, not a wait for ever.
    for none in [Duration::ZERO, Duration::from_nanos(1)] {
        assert!(!listener.wait(none).unwrap());
        notifier.notify().unwrap();
        assert!(listener.wait(none).unwrap());
    }
}

#[test]
fn a_sleeping_listener_is_woken_from_another_thread() {
    let memory = Isolated::new();
    let node = memory.node();
    let listener = transport::wake(&node, &instance())
        .unwrap()
        .listener()
        .unwrap();
    std::thread::scope(|scope| {
        scope.spawn(|| {
            let node = memory.node();
            let notifier = transport::wake(&node, &instance())
                .unwrap()
                .notifier()
                .unwrap();
            std::thread::sleep(Duration::from_millis(20));
            notifier.notify().unwrap();
        });
        // A wait may come back early and empty-handed.
        while !listener.wait(Duration::from_secs(60)).unwrap() {}
    });
}

#[test]
fn what_was_sent_outlives_its_publisher_only_if_the_subscriber_had_connected() {
    let memory = Isolated::new();
    let node = memory.node();
    let topic = transport::input::<ImuSample>(&node, &instance()).unwrap();
    let subscriber = topic.subscriber().unwrap();

    let publisher = topic.publisher().unwrap();
    // A subscriber connects to a new publisher when it next looks for messages.
    assert!(subscriber.receive().unwrap().is_none());
    for _ in 0..3 {
        assert_eq!(publisher.send_copy(ImuSample::default()).unwrap(), 1);
    }
    drop(publisher);
    for _ in 0..3 {
        assert!(subscriber.receive().unwrap().is_some());
    }

    // Never connected: lost, although the send counted one receiver. A feeder has to stay until it was heard.
    let publisher = topic.publisher().unwrap();
    assert_eq!(publisher.send_copy(ImuSample::default()).unwrap(), 1);
    drop(publisher);
    assert!(subscriber.receive().unwrap().is_none());
}

#[test]
fn two_instances_do_not_hear_each_other() {
    let memory = Isolated::new();
    let node = memory.node();
    let of =
        |name: &str| transport::input::<ImuSample>(&node, &Instance::new(name).unwrap()).unwrap();
    let (one, other) = (of("one"), of("other"));
    let (hears_one, hears_other) = (one.subscriber().unwrap(), other.subscriber().unwrap());
    let publisher = one.publisher().unwrap();
    assert_eq!(publisher.send_copy(ImuSample::default()).unwrap(), 1);
    assert!(hears_one.receive().unwrap().is_some());
    assert!(hears_other.receive().unwrap().is_none());
}

#[test]
fn no_file_is_left_when_all_have_gone() {
    let memory = Isolated::new();
    {
        let (daemon, client) = (memory.node(), memory.node());
        let fed = transport::inputs(&daemon, &instance()).unwrap();
        let feeding = transport::inputs(&client, &instance()).unwrap();
        let _imu = (
            fed.imu.subscriber().unwrap(),
            feeding.imu.publisher().unwrap(),
        );
        feeding
            .imu
            .publisher()
            .unwrap()
            .send_copy(ImuSample::default())
            .unwrap();
        let estimates = transport::estimate::<EstimateSe23>(&daemon, &instance()).unwrap();
        let _estimate = (
            estimates.publisher().unwrap(),
            estimates.subscriber().unwrap(),
        );
        let health = transport::health(&daemon, &instance()).unwrap();
        let _health = (health.publisher().unwrap(), health.subscriber().unwrap());
        let control = transport::control(&daemon, &instance()).unwrap();
        let (server, user) = (control.server().unwrap(), control.client().unwrap());
        let _pending = user.send_copy(ControlRequest::default()).unwrap();
        let _active = server.receive().unwrap().unwrap();
        let latest = transport::latest(&daemon, &instance(), EstimateSe23::ZERO).unwrap();
        let _latest = (latest.writer().unwrap(), latest.reader().unwrap());
        let wake = transport::wake(&daemon, &instance()).unwrap();
        let _wake = (wake.listener().unwrap(), wake.notifier().unwrap());
        assert!(!memory.shared_memory_files().is_empty());
        assert!(!memory.root_files().is_empty());
    }
    memory.assert_no_file_is_left();
}

#[test]
fn reserved_memory_is_backed_before_it_is_written() {
    use std::os::unix::fs::MetadataExt;
    let memory = Isolated::new();
    let node = memory.node();
    let topic = transport::estimate::<EstimateSe23>(&node, &instance()).unwrap();
    let publisher = topic.publisher().unwrap();
    let sizes = || {
        let mut sizes: Vec<(u64, u64)> = memory
            .shared_memory_files()
            .iter()
            .filter(|name| !name.ends_with(".global_mgmt"))
            .map(|name| {
                let data = std::fs::metadata(format!("/dev/shm/{name}")).unwrap();
                (data.len(), data.blocks() * 512)
            })
            .collect();
        sizes.sort_unstable();
        sizes
    };
    // Eight readers that each may keep a full buffer make the largest file.
    let largest = *sizes().last().unwrap();
    assert!(largest.0 > 8 * 1024 * 1288);
    // Its publisher has backed it as a whole; the others are still to be backed.
    assert!(largest.1 >= largest.0);
    let total = transport::reserve_shared_memory(node.config()).unwrap();
    assert!(sizes().iter().all(|(len, backed)| backed >= len));
    assert_eq!(total, sizes().iter().map(|(len, _)| len).sum::<u64>());
    publisher.send_copy(EstimateSe23::ZERO).unwrap();
}
