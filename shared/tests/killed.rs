//! A process that holds every port is killed: the next one gets its places, and in the end nothing is left.

mod common;

use std::env;
use std::fs::{File, Permissions};
use std::io::{BufRead, BufReader};
use std::os::unix::fs::PermissionsExt;
use std::process::{Child, Command, Stdio};
use std::sync::mpsc::channel;
use std::time::{Duration, SystemTime};

use common::Isolated;
use inekf_shared::message::*;
use inekf_shared::topic::Instance;
use inekf_shared::transport::{
    self, ControlServer, IPC_PREFIX_VARIABLE, IPC_ROOT_VARIABLE, LatestWriter, Node, Publisher,
    Subscriber, TransportError, WakeListener, Watched,
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

/// Runs it on a thread of its own, for it may never come back.
fn within_a_while<T: Send + 'static>(what: &str, run: impl FnOnce() -> T + Send + 'static) -> T {
    let (tell, told) = channel();
    std::thread::spawn(move || tell.send(run()));
    told.recv_timeout(Duration::from_secs(30))
        .unwrap_or_else(|_| panic!("waited in vain for {what}"))
}

/// Leaves a segment as a process that was killed over its making does: write-only, and with this size.
fn leave_half_made(name: &str, bytes: u64) {
    let path = format!("/dev/shm/{name}");
    let _ = std::fs::remove_file(&path);
    let file = File::create_new(&path).unwrap();
    file.set_len(bytes).unwrap();
    file.set_permissions(Permissions::from_mode(0o200)).unwrap();
}

#[test]
fn a_count_of_nodes_that_was_left_half_made_keeps_no_node_from_being_made() {
    let memory = Isolated::new();
    let node = memory.node();
    let files = memory.shared_memory_files();
    let counts = files.iter().filter(|name| name.ends_with(".global_mgmt"));
    let [count] = counts.collect::<Vec<_>>()[..] else {
        panic!("{files:?}");
    };
    drop(node);
    memory.assert_no_file_is_left();
    for bytes in [0, 16] {
        leave_half_made(count, bytes);
        let config = memory.config.clone();
        within_a_while("a node", move || {
            drop(transport::open_node_with("test", &config).unwrap());
        });
        memory.assert_no_file_is_left();
    }
}

#[test]
fn a_service_that_was_left_half_made_is_made_anew_beside_those_who_have_it_open() {
    for bytes in [0, 4096] {
        let memory = Isolated::new();
        let node = memory.node();
        let instance = Instance::default();
        let before = memory.shared_memory_files();
        let _estimates = transport::estimate::<EstimateSe23>(&node, &instance).unwrap();
        let watched = Watched::services_of(&node).unwrap();
        assert!(watched.is_intact());
        let mut made = memory.shared_memory_files();
        made.retain(|name| name.ends_with(".dynamic") && !before.contains(name));
        let [dynamic] = &made[..] else {
            panic!("{made:?}");
        };
        leave_half_made(dynamic, bytes);
        let config = memory.config.clone();
        let other = within_a_while("a service", move || {
            let node = transport::open_node_with("other", &config).unwrap();
            let opened = transport::estimate::<EstimateSe23>(&node, &Instance::default());
            let watched = Watched::services_of(&node).unwrap();
            opened.map(|_| watched.is_intact())
        });
        assert!(other.unwrap());
        // Who had it open learns that it is alone.
        assert!(!watched.is_intact());
    }
}

#[test]
fn what_a_killed_process_left_half_made_is_swept() {
    for bytes in [0, 4096] {
        let memory = Isolated::new();
        let mut child = start_child(&memory);
        child.kill().unwrap();
        child.wait().unwrap();
        let files = memory.shared_memory_files();
        let dynamic = files.iter().find(|name| name.ends_with(".dynamic"));
        leave_half_made(dynamic.unwrap_or_else(|| panic!("{files:?}")), bytes);
        let config = memory.config.clone();
        within_a_while("a node", move || {
            drop(transport::open_node_with("next", &config).unwrap());
        });
        memory.assert_no_file_is_left();
    }
}

/// Others may remove or replace what a process has just opened before it first looks.
#[test]
fn what_went_before_it_was_first_looked_at_counts_as_gone() {
    let memory = Isolated::new();
    let node = memory.node();
    let instance = Instance::default();
    let _estimates = transport::estimate::<EstimateSe23>(&node, &instance).unwrap();
    let is_intact = || Watched::services_of(&node).unwrap().is_intact();
    assert!(is_intact());
    let files = memory.root_files();
    let description = files.iter().find(|path| path.ends_with(".service"));
    let description = description.unwrap_or_else(|| panic!("{files:?}"));
    let text = std::fs::read_to_string(description).unwrap();
    std::fs::remove_file(description).unwrap();
    assert!(!is_intact());
    // Another service of the same name, whose file may have been given the number of the removed one.
    let mut lines: Vec<String> = text.lines().map(str::to_owned).collect();
    let id = lines
        .iter_mut()
        .find(|line| line.starts_with("unique_value"));
    *id.unwrap_or_else(|| panic!("{text}")) = "unique_value = 12345".to_owned();
    let other = lines.join("\n");
    std::fs::write(description, &other).unwrap();
    assert!(!is_intact());
    std::fs::write(description, &text).unwrap();
    let watched = Watched::services_of(&node).unwrap();
    assert!(watched.is_intact());
    std::fs::remove_file(description).unwrap();
    std::fs::write(description, &other).unwrap();
    assert!(!watched.is_intact());
    std::fs::remove_file(description).unwrap();
    std::fs::write(description, &text).unwrap();
    assert!(is_intact());
    // Another process makes one anew, whole.
    std::fs::remove_file(description).unwrap();
    let other = memory.node();
    let anew = transport::estimate::<EstimateSe23>(&other, &instance).unwrap();
    assert!(Watched::services_of(&other).unwrap().is_intact());
    assert!(!watched.is_intact() && !is_intact());
    drop((anew, other));
    std::fs::write(description, &text).unwrap();
    assert!(is_intact());
    // Its shared part.
    let files = memory.shared_memory_files();
    let dynamic = files.iter().find(|name| name.ends_with(".dynamic"));
    let dynamic = dynamic.unwrap_or_else(|| panic!("{files:?}"));
    std::fs::remove_file(format!("/dev/shm/{dynamic}")).unwrap();
    assert!(!is_intact());
}
