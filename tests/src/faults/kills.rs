//! SIGKILL at random moments: the others go on, what was killed is started again and attaches, nothing is left.

use std::time::Duration;

use inekf_shared::message::INPUT_IMU;
use rustix::process::Signal;

use super::scene::{CONFIG, INSTANCE, Observer, Scene};
use super::{Balance, Outcome, Plan};
use crate::link::Link;
use crate::process::{Ended, Running, config_file, eventually, service};

/// Rate of the feeders that are killed, Hz.
const RATE_HZ: u32 = 500;
/// A process is killed up to this long after it was seen at work.
const AT_WORK: Duration = Duration::from_millis(60);

/// The daemon.
pub fn daemon(plan: &Plan) -> Outcome {
    let mut moments = plan.moments("daemon");
    let scene = Scene::new();
    let mut daemon = scene.daemon();
    let mut observer = scene.observer();
    let mut feeder = scene.feeder(plan, RATE_HZ);
    let mut reader = scene.reader(plan);
    observer.wait();
    let before = scene.files();
    let mut times = Vec::new();
    for round in 0..plan.rounds {
        // The reader in its own process has seen this daemon too.
        wait_for_lives(&reader, round as usize + 1);
        observer.watch_for(moments.up_to(AT_WORK));
        killed(daemon.stop_with(Signal::KILL));
        let (next, time) = observer.back_after(|| scene.daemon());
        daemon = next;
        times.push(time);
    }
    assert!(feeder.is_running(), "{}", feeder.stderr());
    assert!(reader.is_running(), "{}", reader.stderr());
    killed(kill(feeder));
    let answer = Link::open(&scene.memory, INSTANCE).controller.barrier();
    assert_eq!(answer.expect("the daemon answers").counters.lost, 0);
    observer.look();
    let balance = Balance {
        sent: observer.sent(),
        received: observer.answers,
        lost: observer.sent() - observer.answers,
    };
    killed(kill(reader));
    daemon.stop();
    drop(observer);
    let after = scene.files_after_doctor();
    assert_eq!(after, 0);
    Outcome {
        count: plan.rounds,
        survivors: "feeder, readers",
        times,
        balance: Some(balance.checked()),
        files: Some((before, after)),
        note: "received: answered; lost: sent while no daemon ran".to_owned(),
    }
}

/// The feeder.
pub fn feeder(plan: &Plan) -> Outcome {
    let mut moments = plan.moments("feeder");
    let scene = Scene::new();
    let daemon = scene.daemon();
    let mut observer = scene.observer();
    let mut feeder = scene.feeder(plan, RATE_HZ);
    let reader = scene.reader(plan);
    observer.wait();
    let before = scene.files();
    let mut times = Vec::new();
    for _ in 0..plan.rounds {
        observer.watch_for(moments.up_to(AT_WORK));
        killed(kill(feeder));
        // What it sent in its last moment is answered before the next one starts.
        observer.watch_for(Duration::from_millis(20));
        let (next, time) = observer.back_after(|| scene.feeder(plan, RATE_HZ));
        feeder = next;
        times.push(time);
    }
    killed(kill(feeder));
    let (balance, resets) = settled(&scene, &mut observer);
    assert_eq!(resets, 0, "the estimate went on through every change");
    assert_eq!(lives(&reader), 1, "{}", reader.stderr());
    killed(kill(reader));
    daemon.stop();
    drop(observer);
    let after = scene.files_after_doctor();
    assert_eq!(after, 0);
    Outcome {
        count: plan.rounds,
        survivors: "daemon, readers",
        times,
        balance: Some(balance),
        files: Some((before, after)),
        note: "the estimate is continued, never reset".to_owned(),
    }
}

/// A reader.
pub fn reader(plan: &Plan) -> Outcome {
    let mut moments = plan.moments("reader");
    let scene = Scene::new();
    let daemon = scene.daemon();
    let mut observer = scene.observer();
    let feeder = scene.feeder(plan, RATE_HZ);
    let mut reader = scene.reader(plan);
    observer.wait();
    wait_for_lives(&reader, 1);
    let before = scene.files();
    let mut times = Vec::new();
    for _ in 0..plan.rounds {
        observer.watch_for(moments.up_to(AT_WORK));
        killed(kill(reader));
        let started = std::time::Instant::now();
        reader = scene.reader(plan);
        eventually("an estimate at the new reader", || {
            observer.look();
            (lives(&reader) == 1).then_some(())
        });
        times.push(started.elapsed());
    }
    killed(kill(feeder));
    let (balance, resets) = settled(&scene, &mut observer);
    assert_eq!((resets, balance.lost), (0, 0));
    killed(kill(reader));
    daemon.stop();
    drop(observer);
    let after = scene.files_after_doctor();
    assert_eq!(after, 0);
    Outcome {
        count: plan.rounds,
        survivors: "daemon, feeder, other readers",
        times,
        balance: Some(balance),
        files: Some((before, after)),
        note: String::new(),
    }
}

/// Everybody at once; the next daemon works and takes away what they left.
pub fn all_then_start(plan: &Plan) -> Outcome {
    all(plan, "all", |scene| {
        scene.daemon().stop();
        scene.files_after_doctor()
    })
}

/// Everybody at once; `doctor` takes away what they left.
pub fn all_then_doctor(plan: &Plan) -> Outcome {
    all(plan, "doctor", Scene::files_after_doctor)
}

fn all(plan: &Plan, name: &str, clean: impl Fn(&Scene) -> usize) -> Outcome {
    let mut moments = plan.moments(name);
    let scene = Scene::new();
    let rounds = plan.at_most(100);
    let (mut before, mut after) = (0, 0);
    for _ in 0..rounds {
        let daemon = scene.daemon();
        let mut observer = scene.observer();
        let feeder = scene.feeder(plan, RATE_HZ);
        let reader = scene.reader(plan);
        observer.wait();
        observer.watch_for(moments.up_to(AT_WORK));
        drop(observer);
        for party in [&feeder, &reader] {
            party.signal(Signal::KILL);
        }
        killed(daemon.stop_with(Signal::KILL));
        killed(feeder.wait());
        killed(reader.wait());
        before = before.max(scene.files());
        assert!(before > 0, "killed processes leave files");
        after = clean(&scene);
        assert_eq!(after, 0);
    }
    Outcome {
        count: rounds,
        survivors: "nobody",
        files: Some((before, after)),
        note: "files: left by the dead, and after the cleaning".to_owned(),
        ..Outcome::default()
    }
}

/// A second daemon is refused with the first one's process id, and the first does not notice.
pub fn second_daemon(plan: &Plan) -> Outcome {
    let scene = Scene::new();
    let daemon = scene.daemon();
    let mut observer = scene.observer();
    let feeder = scene.feeder(plan, RATE_HZ);
    observer.wait();
    let before = scene.files();
    let (_folder, file) = config_file(CONFIG);
    let file = file.display().to_string();
    let rounds = plan.at_most(100);
    for _ in 0..rounds {
        let second = service(&scene.memory, ["--config", &file, "--instance", INSTANCE]);
        let line = second.failed_with_one_line(1);
        assert!(line.contains(&daemon.id().to_string()), "{line}");
        observer.wait();
    }
    killed(kill(feeder));
    let (balance, resets) = settled(&scene, &mut observer);
    assert_eq!((resets, balance.lost), (0, 0));
    daemon.stop();
    drop(observer);
    let after = scene.files_after_doctor();
    assert_eq!(after, 0);
    Outcome {
        count: rounds,
        survivors: "daemon, feeder, reader",
        balance: Some(balance),
        files: Some((before, after)),
        note: "refused with the process id of the first".to_owned(),
        ..Outcome::default()
    }
}

/// Asserts that it was the signal that ended it.
pub(super) fn killed(ended: Ended) {
    use std::os::unix::process::ExitStatusExt;
    assert_eq!(ended.status.signal(), Some(9), "{ended:#?}");
}

/// Kills a party.
pub(super) fn kill(party: Running) -> Ended {
    party.signal(Signal::KILL);
    party.wait()
}

/// How many daemons a reader has seen.
pub(super) fn lives(reader: &Running) -> usize {
    reader.stdout().lines().count()
}

fn wait_for_lives(reader: &Running, count: usize) {
    eventually("the reader's next daemon", || {
        (lives(reader) >= count).then_some(())
    });
}

/// The balance of a daemon that was never killed, once every sample has been answered, and its resets.
pub(super) fn settled(scene: &Scene, observer: &mut Observer) -> (Balance, u64) {
    let answer = Link::open(&scene.memory, INSTANCE)
        .controller
        .barrier()
        .expect("the daemon answers");
    let last = observer.look().expect("an estimate");
    let balance = Balance {
        sent: observer.sent(),
        received: answer.received[INPUT_IMU],
        lost: answer.counters.lost,
    };
    (balance.checked(), last.head.reset_count)
}
