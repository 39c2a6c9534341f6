//! A process that holds every port is killed: the next one gets its places, and in the end nothing is left.

mod common;

use std::env;
use std::io::{BufRead, BufReader};
use std::process::{Child, Command, Stdio};
use std::time::{Duration, SystemTime};

use common::Isolated;
use inekf_shared::message::*;
use inekf_shared::topic::Instance;
use inekf_shared::transport::{
    self, ControlServer, IPC_PREFIX_VARIABLE, IPC_ROOT_VARIABLE, LatestWriter, Node, Publisher,
    Subscriber, TransportError, WakeListener,
};

const READY: &str = "all ports open";

/// The ports of a daemon.
struct Daemon {
    _imu: Subscriber<ImuSample>,
    estimate: Publisher<EstimateSe23>,
    latest: LatestWriter<EstimateSe23>,
    _health: Publisher<Health>,
    _server: ControlServer,
    _listener: WakeListener,
}

fn open_daemon(node: &Node) -> Result<Daemon, TransportError> {
    let instance = Instance::default();
    Ok(Daemon {
        _server: transport::control(node, &instance)?.server()?,
        _imu: transport::input(node, &instance)?.subscriber()?,
        estimate: transport::estimate(node, &instance)?.publisher()?,
        latest: transport::latest(node, &instance, EstimateSe23::ZERO)?.writer()?,
        _health: transport::health(node, &instance)?.publisher()?,
        _listener: transport::wake(node, &instance)?.listener()?,
    })
}

/// Run by the test below in a process of its own; without the environment it does nothing.
#[test]
#[ignore = "the other process of the test below, which runs it: cargo test -p inekf-shared --test killed"]
fn child() {
    if env::var_os(IPC_ROOT_VARIABLE).is_none() {
        return;
    }
    let node = transport::open_node("child").unwrap();
    let daemon = open_daemon(&node).unwrap();
    daemon.estimate.send_copy(EstimateSe23::ZERO).unwrap();
    assert!(daemon.latest.write(EstimateSe23::ZERO));
    println!("{READY}");
    loop {
        std::thread::park();
    }
}

fn start_child(memory: &Isolated) -> Child {
    let mut child = Command::new(env::current_exe().unwrap())
        .args(["--ignored", "--exact", "child", "--nocapture"])
        .env(IPC_ROOT_VARIABLE, memory.root.path())
        .env(IPC_PREFIX_VARIABLE, &memory.prefix)
        .stdout(Stdio::piped())
        .spawn()
        .unwrap();
    let lines = BufReader::new(child.stdout.take().unwrap()).lines();
    let ready = lines.map_while(Result::ok).any(|line| line.contains(READY));
    assert!(ready, "the child ended early");
    child
}

#[test]
fn the_places_of_a_killed_daemon_are_free_for_the_next() {
    let memory = Isolated::new();
    let node = memory.node();
    let instance = Instance::default();
    // A reader that stays keeps the services alive across the daemons.
    let control = transport::control(&node, &instance).unwrap();
    let estimates = transport::estimate::<EstimateSe23>(&node, &instance)
        .unwrap()
        .subscriber()
        .unwrap();
    let mut latest = None;
    for _ in 0..3 {
        let mut child = start_child(&memory);
        assert_eq!(control.server_pids(), [child.id()]);
        let Err(TransportError::Full { holders, .. }) = open_daemon(&node) else {
            panic!("a second daemon was let in");
        };
        assert_eq!(holders, [child.id()]);
        assert!(estimates.receive().unwrap().is_some());
        latest.get_or_insert_with(|| {
            transport::open_latest::<EstimateSe23>(&node, &instance)
                .unwrap()
                .reader()
                .unwrap()
        });
        child.kill().unwrap();
        child.wait().unwrap();

        let next = open_daemon(&node).unwrap();
        assert_eq!(control.server_pids(), [std::process::id()]);
        let mut estimate = EstimateSe23::ZERO;
        estimate.head.seq = 9;
        assert_eq!(next.estimate.send_copy(estimate).unwrap(), 1);
        assert_eq!(estimates.receive().unwrap().unwrap().head.seq, 9);
        assert!(next.latest.write(estimate));
        assert_eq!(latest.as_ref().unwrap().read().head.seq, 9);
    }
    drop((latest, estimates, control, node));
    memory.assert_no_file_is_left();
}

/// Whoever cleans up after a killed process may be killed as well: after it has removed the lock, and nothing else.
#[test]
fn what_a_killed_cleaner_left_half_removed_is_swept() {
    let memory = Isolated::new();
    let mut child = start_child(&memory);
    child.kill().unwrap();
    child.wait().unwrap();
    let locks = memory.root_files();
    let locks = locks.iter().filter(|path| path.ends_with("_owner_lock"));
    let mut removed = 0;
    for lock in locks {
        std::fs::remove_file(lock).unwrap();
        removed += 1;
    }
    assert_eq!(removed, 1);
    // What is younger than two seconds may be in the making.
    let long_ago = SystemTime::now() - Duration::from_secs(10);
    let nodes = memory.root.path().join("nodes");
    for entry in std::fs::read_dir(nodes).unwrap() {
        let file = std::fs::File::open(entry.unwrap().path());
        file.unwrap().set_modified(long_ago).unwrap();
    }
    drop(memory.node());
    memory.assert_no_file_is_left();
}
