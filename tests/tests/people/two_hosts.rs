//! Beyond one machine: iceoryx2's own tunnel over zenoh between two network namespaces, which stand for two hosts.
//!
//! On the first host a daemon estimates and a feeder feeds it; on the second a reader attaches to
//! `inekf/car/estimate`, which the tunnel has made there. They share neither shared memory (each has a root and a prefix of
//! its own) nor a network but a cable, a pair of virtual ones.
//!
//! The tunnel is no part of the project, for zenoh is large: `INEKF_TUNNEL` names the program
//! `iox2-link-tunnel-zenoh`, or it is on the path (`cargo install iceoryx2-integrations-zenoh-link-tunnel-cli --version
//! 0.10.0`). Without it, or where nobody may make namespaces, the tests say that they skip; the one over a slow cable also
//! where the kernel cannot emulate one (`tc` with netem).

use std::env;
use std::ffi::OsString;
use std::fs;
use std::path::Path;
use std::process::Command;
use std::thread::sleep;
use std::time::{Duration, Instant};

use inekf_client::read::EstimateReader;
use inekf_shared::clock::monotonic_ns;
use inekf_shared::message::EstimateSe23;
use inekf_tests::folder::Folder;
use inekf_tests::link::instance;
use inekf_tests::memory::Memory;
use inekf_tests::process::{PATIENCE, Running, config_file, eventually};
use inekf_tests::programs::programs;
use inekf_tests::tools;
use rustix::process::Signal;

/// Environment variable: the tunnel's program.
const TUNNEL: &str = "INEKF_TUNNEL";

const CONFIG: &str = "\
model = 'imu'
[noise]
gyro_density = 2.5e-4
accel_density = 1.2e-3
[initial]
level_sigma_deg = 10.0
[[position_source]]
id = 0
lever_arm_m = [-0.3, 0.0, 0.5]
";

/// Two hosts at the ends of a cable, in a network and a user namespace of their own; a tunnel on
/// each, until it is told to stop. What leaves the first host suffers `$NETEM`, if that is not empty.
const TWO_HOSTS: &str = r#"
mount -t tmpfs none /run
for host in one two; do ip netns add $host; done
ip link add eth1 netns one type veth peer name eth2 netns two
ip -n one address add 10.77.0.1/24 dev eth1
ip -n two address add 10.77.0.2/24 dev eth2
for host in one two; do ip -n $host link set lo up; done
ip -n one link set eth1 up
ip -n two link set eth2 up
[ -z "$NETEM" ] || tc -n one qdisc add dev eth1 root netem $NETEM
trap 'kill $(jobs -p) 2> /dev/null; wait' EXIT
trap 'exit 0' TERM
(cd one; exec ip netns exec one $TUNNEL --zenoh-config zenoh.json5 --allow 'inekf/*/estimate' --reactive --poll 10) > one.log 2>&1 &
(cd two; exec ip netns exec two $TUNNEL --zenoh-config zenoh.json5 --allow 'inekf/*/estimate' --reactive --poll 10) > two.log 2>&1 &
wait
"#;

/// The tunnel's program; `None`, and a line that says so, if there is none or no namespaces can be made.
fn tunnel() -> Option<OsString> {
    let program = env::var_os(TUNNEL).unwrap_or_else(|| "iox2-link-tunnel-zenoh".into());
    let runs = |command: &mut Command| command.output().is_ok_and(|output| output.status.success());
    if !runs(Command::new(&program).arg("--version")) {
        println!(
            "skipped: {} does not run; {TUNNEL} names the tunnel",
            program.display()
        );
        return None;
    }
    if !works("true") {
        println!("skipped: no namespaces can be made here");
        return None;
    }
    Some(program)
}

/// Whether a host of one's own can be made in a namespace, and what is done to it there.
fn works(on_it: &str) -> bool {
    Command::new("unshare")
        .args([
            "--user",
            "--map-root-user",
            "--net",
            "--mount",
            "sh",
            "-euc",
        ])
        .arg(format!(
            "mount -t tmpfs none /run; ip netns add one; {on_it}"
        ))
        .output()
        .is_ok_and(|output| output.status.success())
}

/// What the tunnel has to know of a host: where its shared memory is, and how it is reached.
fn configure(folder: &Path, memory: &Memory, zenoh: &str) {
    let config = folder.join("config");
    fs::create_dir_all(&config).unwrap();
    let global = format!(
        "[global]\nroot-path = '{}'\nprefix = '{}'\n",
        memory.root().display(),
        memory.prefix()
    );
    // The limits of the topic are not carried over: the guide's, which have to be the daemon's.
    let guide = concat!(
        env!("CARGO_MANIFEST_DIR"),
        "/../docs/guides/several-machines.md"
    );
    let guide = fs::read_to_string(guide).expect("the guide");
    let limits = guide
        .split("```toml\n")
        .nth(1)
        .and_then(|rest| rest.split("```").next());
    let limits = limits.expect("the guide shows the limits");
    fs::write(config.join("iceoryx2.toml"), global + limits).unwrap();
    let scouting = "scouting: { multicast: { enabled: false } }";
    fs::write(
        folder.join("zenoh.json5"),
        format!("{{ mode: 'peer', {zenoh}, {scouting} }}"),
    )
    .unwrap();
}

#[test]
fn an_estimate_is_read_on_another_host() {
    let Some(tunnel) = tunnel() else { return };
    read_on_another_host(&tunnel, "");
}

/// Zenoh's link is TCP: what a bad cable loses comes again, later, and in its place.
#[test]
fn over_a_slow_cable_that_loses_packets_estimates_come_in_order_and_later() {
    let Some(tunnel) = tunnel() else { return };
    if !works("tc -n one qdisc add dev lo root netem delay 1ms") {
        println!("skipped: `tc` with netem is not to be had here (a module of the kernel)");
        return;
    }
    let delays_us = read_on_another_host(&tunnel, "delay 20ms loss 1%");
    // None is faster than the cable, whatever the machine does besides.
    assert!(delays_us[0] >= 20e3, "{} us", delays_us[0]);
}

/// Reads some hundred estimates of one host on the other, over a cable with this disturbance, and returns how long each
/// took from its publication to its reader, us, the shortest first. They come in order and make sense.
fn read_on_another_host(tunnel: &OsString, netem: &str) -> Vec<f64> {
    let (one, two) = (Memory::new(), Memory::new());
    let folder = Folder::new();
    configure(
        &folder.file("one"),
        &one,
        "listen: { endpoints: ['tcp/10.77.0.1:7447'] }",
    );
    configure(
        &folder.file("two"),
        &two,
        "connect: { endpoints: ['tcp/10.77.0.1:7447'] }",
    );

    let (_config, file) = config_file(CONFIG);
    let mut daemon = one.command(&programs().service);
    daemon.arg("--config").arg(file).args(["--instance", "car"]);
    let daemon = Running::start(daemon);
    eventually("the daemon is ready", || {
        daemon.stdout().starts_with("ready").then_some(())
    });
    // With the environment of the first host's memory, which ends what a failed test leaves.
    let mut cable = one.command(Path::new("unshare"));
    cable
        .args(["--user", "--map-root-user", "--net", "--mount"])
        .args(["bash", "-euc", TWO_HOSTS])
        .env("TUNNEL", tunnel)
        .env("NETEM", netem)
        .current_dir(folder.path());
    let cable = Running::start(cable);
    let mut feeder = one.command(&programs().client);
    feeder.args([
        "simulate",
        "road-circuit",
        "--instance",
        "car",
        "--duration",
        "60",
    ]);
    let feeder = Running::start(feeder);

    let logs = || ["one.log", "two.log"].map(|log| fs::read_to_string(folder.file(log)));
    let started = Instant::now();
    let mut reader: EstimateReader<EstimateSe23> = loop {
        match EstimateReader::open_on(two.node(), &instance("car")) {
            Ok(reader) => break reader,
            Err(error) => assert!(
                started.elapsed() < PATIENCE,
                "{error}; {cable:?} {} {:#?}",
                cable.stderr(),
                logs()
            ),
        }
        sleep(Duration::from_millis(50));
    };
    // For a second or two, as they come.
    let mut taken: Vec<(EstimateSe23, u64)> = Vec::new();
    eventually("four hundred estimates from the other host", || {
        while let Some(estimate) = reader.next_estimate().expect("it can be read") {
            taken.push((estimate, monotonic_ns()));
        }
        (taken.len() >= 400).then_some(())
    });
    let first = taken[0].0.head.estimate_seq;
    let last = taken[taken.len() - 1].0.head.estimate_seq;
    let lost = last - first + 1 - taken.len() as u64;
    // Both ends have one clock here: this is one machine.
    let mut delays_us: Vec<f64> = taken
        .iter()
        .map(|(estimate, at_ns)| at_ns.saturating_sub(estimate.head.published_ns) as f64 * 1e-3)
        .collect();
    delays_us.sort_by(f64::total_cmp);
    println!(
        "{} estimates, {lost} lost; published to read: median {:.0} us, at most {:.0} us",
        taken.len(),
        delays_us[delays_us.len() / 2],
        delays_us[delays_us.len() - 1]
    );
    for pair in taken.windows(2) {
        assert!(pair[0].0.head.estimate_seq < pair[1].0.head.estimate_seq);
    }
    // What came is what was sent: a state that makes sense, of this daemon.
    let (newest, _) = taken[taken.len() - 1];
    let length = newest.q_wb.iter().map(|q| q * q).sum::<f64>();
    assert!((length - 1.0).abs() < 1e-9 && newest.head.dimension == 15);
    assert!(newest.covariance[..15].iter().all(|p| p.is_finite()));

    cable.signal(Signal::TERM);
    tools::finish(cable);
    drop(feeder);
    daemon.signal(Signal::TERM);
    tools::finish(daemon).succeeded();
    delays_us
}
