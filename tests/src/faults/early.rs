//! SIGKILL in the first 25 ms of a process, while it makes nodes, services and ports: the moment sweeps over the whole
//! time, and on a slow machine over as much longer as a start takes there. Every next start works without a hand.

use std::thread::sleep;
use std::time::{Duration, Instant};

use inekf_shared::clock::monotonic_ns;
use rustix::process::Signal;

use super::kills::{kill, killed, lives};
use super::scene::{CONFIG, INSTANCE, Scene};
use super::{Outcome, Plan};
use crate::process::{Running, config_file, eventually};
use crate::programs::programs;

/// The moments sweep from 0 to here, or to the end of a start.
const SWEPT: Duration = Duration::from_millis(25);

fn moment(round: u32, rounds: u32, start: Duration) -> Duration {
    SWEPT.max(start) * round / rounds.max(1)
}

/// The daemon; in every other round a reader is there and keeps the services.
pub fn daemon(plan: &Plan) -> Outcome {
    let scene = Scene::new();
    let (_folder, file) = config_file(CONFIG);
    let started = Instant::now();
    scene.daemon().stop();
    let start = started.elapsed();
    let mut times = Vec::new();
    let (mut most, mut unready) = (0, 0);
    for round in 0..plan.rounds {
        let observer = (round % 2 == 1).then(|| scene.observer());
        let mut command = scene.memory.command(&programs().service);
        command
            .arg("--config")
            .arg(&file)
            .args(["--instance", INSTANCE]);
        let victim = Running::start(command);
        sleep(moment(round, plan.rounds, start));
        unready += u32::from(victim.stdout().is_empty());
        victim.signal(Signal::KILL);
        killed(victim.wait());
        most = most.max(scene.files());
        let started = Instant::now();
        let next = scene.daemon();
        times.push(started.elapsed());
        drop(observer);
        next.stop();
    }
    let after = scene.cleared();
    Outcome {
        count: plan.rounds,
        survivors: "a reader",
        times,
        files: Some((most, after)),
        note: format!(
            "killed 0 to {:.0} ms after their start, {unready} before they were ready; time: until the next daemon is \
             ready",
            SWEPT.max(start).as_secs_f64() * 1e3
        ),
        ..Outcome::default()
    }
}

/// The feeder, beside a daemon that runs.
pub fn feeder(plan: &Plan) -> Outcome {
    beside_a_daemon(
        plan,
        "daemon, reader",
        |scene| scene.feeder(plan, 500),
        |_| true,
    )
}

/// A reader, beside a daemon that runs and a feeder.
pub fn reader(plan: &Plan) -> Outcome {
    beside_a_daemon(
        plan,
        "daemon, feeder",
        |scene| scene.reader(plan),
        |reader| lives(reader) == 1,
    )
}

fn beside_a_daemon(
    plan: &Plan,
    survivors: &'static str,
    start: impl Fn(&Scene) -> Running,
    works: impl Fn(&Running) -> bool,
) -> Outcome {
    let scene = Scene::new();
    let daemon = scene.daemon();
    let mut observer = scene.observer();
    let feeds = survivors.contains("feeder");
    let feeder = feeds.then(|| scene.feeder(plan, 500));
    let before = scene.files();
    let mut at_work = || {
        let (started, start_ns) = (Instant::now(), monotonic_ns());
        let next = start(&scene);
        eventually("the next one at work", || works(&next).then_some(()));
        observer.wait_since(start_ns);
        let time = started.elapsed();
        killed(kill(next));
        time
    };
    let first = at_work();
    let mut times = Vec::new();
    for round in 0..plan.rounds {
        let victim = start(&scene);
        sleep(moment(round, plan.rounds, first));
        killed(kill(victim));
        times.push(at_work());
    }
    if let Some(feeder) = feeder {
        killed(kill(feeder));
    }
    let after = scene.end(daemon, observer);
    Outcome {
        count: plan.rounds,
        survivors,
        times,
        files: Some((before, after)),
        note: format!(
            "killed 0 to {:.0} ms after their start; time: until the next one is at work",
            SWEPT.max(first).as_secs_f64() * 1e3
        ),
        ..Outcome::default()
    }
}
