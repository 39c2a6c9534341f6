//! Too little of what a process needs: shared memory, file descriptors; files removed under its feet.

use std::fs;
use std::path::Path;
use std::process::Command;
use std::time::Instant;

use inekf_shared::clock::monotonic_ns;
use rustix::process::Signal;

use super::kills::{kill, killed, lives};
use super::scene::{CONFIG, INSTANCE, Scene};
use super::{Outcome, Plan};
use crate::link;
use crate::process::{Ended, Running, config_file, eventually};
use crate::programs::programs;

/// Runs in a mount namespace of its own with `$1` of space in `/dev/shm`: starts a daemon, feeds it for a moment and
/// stops it. Ends as the daemon ended at its start, with 91 if only the feeder failed.
const SMALL: &str = r#"
mount -t tmpfs -o size="$1" tmpfs /dev/shm || exit 90
"$SERVICE" --config "$CONFIG" --instance car & daemon=$!
for i in $(seq 100); do
    kill -0 $daemon 2>/dev/null || break
    [ "$(ls /dev/shm | grep -c data)" -ge 3 ] && break
    sleep 0.02
done
sleep 0.1
if kill -0 $daemon 2>/dev/null; then
    timeout 20 "$PARTY" feed --instance car --rate 1000 --count 1000
    fed=$?
    kill -TERM $daemon
    wait $daemon || exit 92
    [ $fed = 0 ] || exit 91
    exit 0
fi
wait $daemon
"#;

/// The same, but the space runs out once the daemon is ready: the next feeder says so, and the daemon goes on.
const FILLING: &str = r#"
mount -t tmpfs -o size=64m tmpfs /dev/shm || exit 90
"$SERVICE" --config "$CONFIG" --instance car > "$OUT" & daemon=$!
until grep -q ready "$OUT"; do kill -0 $daemon || exit 92; sleep 0.01; done
"$PARTY" feed --instance car --rate 1000 --count 3000000 & early=$!
sleep 0.3
dd if=/dev/zero of=/dev/shm/filler bs=4k 2>/dev/null
"$PARTY" feed --instance car --rate 1000 --count 100
late=$?
sleep 0.3
kill -0 $early || exit 93
kill -0 $daemon || exit 94
kill -TERM $early
kill -TERM $daemon
wait $daemon || exit 95
exit $late
"#;

/// A shell in a mount namespace of its own.
fn in_namespace(scene: &Scene, plan: &Plan, script: &str, size: &str) -> Option<Ended> {
    let (folder, file) = config_file(CONFIG);
    let mut command = scene.memory.command(Path::new("unshare"));
    command
        .args(["--mount", "sh", "-c", script, "sh", size])
        .env("SERVICE", &programs().service)
        .env("PARTY", &plan.party)
        .env("OUT", folder.path().join("out"))
        .env("CONFIG", &file);
    let ended = Running::start(command).wait();
    (ended.status.code() != Some(90)).then_some(ended)
}

/// Whether mount namespaces are permitted.
fn namespaces() -> bool {
    let mut command = Command::new("unshare");
    command.args(["--mount", "true"]);
    command.output().is_ok_and(|output| output.status.success())
}

/// From a page to more than enough: a daemon that does not find enough says so at its start, in one line; one that
/// starts is never killed by SIGBUS.
pub fn shared_memory_full(plan: &Plan) -> Outcome {
    if !namespaces() {
        return Outcome::skipped("mount namespaces are not permitted here");
    }
    let mut moments = plan.moments("shm");
    let rounds = plan.at_most(60);
    let (mut refused, mut unfed, mut started, mut after) = (0, 0, 0, 0);
    for round in 0..rounds {
        // From 4 KiB to 32 MiB, evenly in the logarithm.
        let kib = (4.0 * 2_f64.powf(13.0 * f64::from(round) / f64::from(rounds.max(2) - 1))) as u64;
        let kib = kib + moments.below(4);
        let scene = Scene::new();
        let Some(ended) = in_namespace(&scene, plan, SMALL, &format!("{kib}k")) else {
            return Outcome::skipped("a tmpfs cannot be mounted here");
        };
        match ended.status.code() {
            Some(0) => started += 1,
            Some(1) => {
                let line = ended.failed_with_one_line(1);
                assert!(line.contains("/dev/shm is too full"), "{kib} KiB: {line}");
                refused += 1;
            }
            Some(91) => {
                let said = |line: &str| line.contains("/dev/shm is too full");
                assert!(ended.stderr.lines().any(said), "{kib} KiB: {ended:#?}");
                unfed += 1;
            }
            _ => panic!("{kib} KiB: {ended:#?}"),
        }
        after = after.max(scene.cleared());
    }
    assert!(refused > 0 && started > 0, "{refused} {started}");
    Outcome {
        count: rounds,
        survivors: "-",
        files: Some((0, after)),
        note: format!(
            "4 KiB to 32 MiB: {refused} refused at start in one line, {unfed} had no room for a feeder, which said so, \
             {started} ran; no SIGBUS"
        ),
        ..Outcome::default()
    }
}

/// The space runs out while a daemon and a feeder run: they go on, and a new feeder is refused with a plain error.
pub fn shared_memory_fills_up(plan: &Plan) -> Outcome {
    if !namespaces() {
        return Outcome::skipped("mount namespaces are not permitted here");
    }
    let rounds = plan.at_most(10);
    for _ in 0..rounds {
        let scene = Scene::new();
        let Some(ended) = in_namespace(&scene, plan, FILLING, "-") else {
            return Outcome::skipped("a tmpfs cannot be mounted here");
        };
        assert_eq!(ended.status.code(), Some(1), "{ended:#?}");
        assert!(ended.stderr.contains("/dev/shm is too full"), "{ended:#?}");
    }
    Outcome {
        count: rounds,
        survivors: "daemon, feeder",
        note: "a new feeder is refused in one line".to_owned(),
        ..Outcome::default()
    }
}

/// Somebody removes what lies in shared memory. The daemon notices, opens its ports anew and keeps its state; the feeder
/// and the readers, in processes of their own and in this one, attach again by themselves, and so do new ones.
pub fn files_deleted(plan: &Plan) -> Outcome {
    let rounds = plan.at_most(100);
    let mut times = Vec::new();
    let (mut before, mut after) = (0, 0);
    let mut noticed = Vec::new();
    for round in 0..rounds {
        let scene = Scene::new();
        let daemon = scene.daemon();
        let mut feeder = scene.feeder(plan, 500);
        let mut reader = scene.reader(plan);
        let mut observer = scene.observer();
        let latest = {
            observer.wait();
            link::latest(&scene.memory, INSTANCE)
        };
        eventually("an estimate at the reader", || {
            observer.look();
            (lives(&reader) == 1).then_some(())
        });
        let last = observer.wait();
        before = before.max(scene.files());
        match round % 3 {
            0 => remove(&scene.memory.shared_paths()),
            1 => remove(&scene.memory.root_files()),
            _ => {
                remove(&scene.memory.shared_paths());
                remove(&scene.memory.root_files());
            }
        }
        let started = Instant::now();
        eventually("the daemon's notice", || {
            observer.look_with_losses();
            daemon.stderr().contains("opening them anew").then_some(())
        });
        noticed.push(started.elapsed());
        let at_ns = monotonic_ns();
        // Of a sample that was sent later than the daemon noticed: daemon, feeder and reader have found each other again.
        let estimate = eventually("an estimate that goes through all of them again", || {
            // A controller's reader of the newest estimate attaches beside it.
            latest.read();
            observer
                .look_with_losses()
                .filter(|estimate| estimate.head.sent_ns > at_ns)
        });
        times.push(started.elapsed());
        // The same estimate goes on: it was neither restarted nor reset.
        assert_eq!(estimate.head.reset_count, last.head.reset_count);
        assert!(estimate.head.estimate_seq > last.head.estimate_seq);
        eventually("the newest estimate where a controller reads it", || {
            observer.look_with_losses();
            (latest.read().head.sent_ns > at_ns).then_some(())
        });
        eventually("estimates at the reader of another process", || {
            observer.look_with_losses();
            (lives(&reader) >= 2).then_some(())
        });
        for party in [&mut feeder, &mut reader] {
            assert!(party.is_running(), "{}", party.stderr());
        }
        assert!(observer.reattached() > 0);
        // Who comes now attaches too.
        let newcomer = scene.reader(plan);
        eventually("an estimate at a new reader", || {
            observer.look_with_losses();
            (lives(&newcomer) == 1).then_some(())
        });
        for party in [feeder, reader, newcomer] {
            killed(kill(party));
        }
        after = after.max(scene.end(daemon, (observer, latest)));
    }
    noticed.sort_unstable();
    let longest = noticed.last().copied().unwrap_or_default();
    Outcome {
        count: rounds,
        survivors: "daemon, feeder, readers",
        times,
        files: Some((before, after)),
        note: format!(
            "in /dev/shm, of nodes and services, or both; the daemon notices within {:.0} ms and keeps its state; feeder \
             and readers attach by themselves; time: from the removal until an estimate goes through all of them again",
            longest.as_secs_f64() * 1e3
        ),
        ..Outcome::default()
    }
}

fn remove(paths: &[String]) {
    for path in paths {
        // Some go by themselves.
        let _ = fs::remove_file(path);
    }
}

/// From enough file descriptors down to almost none: a plain error at the start, or a daemon that works.
pub fn descriptors(plan: &Plan) -> Outcome {
    let rounds = plan.at_most(60);
    let (_folder, file) = config_file(CONFIG);
    let (mut refused, mut started, mut after) = (0, 0, 0);
    for round in 0..rounds {
        let limit = 4 + 250 * round / rounds.max(2);
        let scene = Scene::new();
        let mut command = scene.memory.command(Path::new("sh"));
        command
            .args(["-c", r#"ulimit -n "$1" && exec "$2" --config "$3""#, "sh"])
            .arg(limit.to_string())
            .arg(&programs().service)
            .arg(&file);
        let mut running = Running::start(command);
        let ready = eventually("an end or a ready line", || {
            let ready = running.stdout().starts_with("ready");
            (ready || !running.is_running()).then_some(ready)
        });
        if ready {
            running.signal(Signal::TERM);
            running.wait().succeeded();
            started += 1;
        } else {
            let ended = running.wait();
            let lines: Vec<&str> = ended.stderr.lines().collect();
            assert!(!ended.stderr.contains("panicked"), "{limit}: {ended:#?}");
            // So few that the program cannot be loaded is the system's affair (127).
            if ended.status.code() != Some(127) {
                assert_eq!(ended.status.code(), Some(1), "{limit}: {ended:#?}");
                assert_eq!(lines.len(), 1, "{limit}: {ended:#?}");
                assert!(
                    lines[0].contains("file descriptors"),
                    "{limit}: {}",
                    lines[0]
                );
            }
            refused += 1;
        }
        after = after.max(scene.cleared());
    }
    Outcome {
        count: rounds,
        survivors: "-",
        files: Some((0, after)),
        note: format!("limits of 4 to 250: {refused} refused at start in one line, {started} ran"),
        ..Outcome::default()
    }
}
