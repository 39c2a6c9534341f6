//! SIGKILL at random moments: the others go on, what was killed is started again and attaches, nothing is left.

use std::time::{Duration, Instant};

use inekf_shared::message::INPUT_IMU;
use rustix::process::Signal;

use super::scene::{CONFIG, INSTANCE, Observer, Scene};
use super::{Balance, Outcome, Plan};
use crate::link::Link;
use crate::process::{Daemon, Ended, Running, config_file, eventually, service};

/// Rate of the feeders that are killed, Hz.
const RATE_HZ: u32 = 500;
/// A process is killed up to this long after it was seen at work.
const AT_WORK: Duration = Duration::from_millis(60);

/// A daemon, a feeder and a reader in processes of their own, seen at work by an observer in this one.
struct Company {
    scene: Scene,
    daemon: Daemon,
    feeder: Running,
    reader: Running,
    observer: Observer,
    /// Files while all are at work.
    files: usize,
}

impl Company {
    fn at_work(plan: &Plan) -> Self {
        let scene = Scene::new();
        let daemon = scene.daemon();
        let mut observer = scene.observer();
        let feeder = scene.feeder(plan, RATE_HZ);
        let reader = scene.reader(plan);
        observer.wait();
        wait_for_lives(&reader, 1);
        Self {
            files: scene.files(),
            scene,
            daemon,
            feeder,
            reader,
            observer,
        }
    }

    /// Sends all home, the feeder first: once it sends no more, `balance` says what became of its samples.
    fn end(
        self,
        outcome: Outcome,
        balance: impl FnOnce(&Scene, &mut Observer) -> Balance,
    ) -> Outcome {
        let Self {
            scene,
            daemon,
            feeder,
            reader,
            mut observer,
            files,
        } = self;
        killed(kill(feeder));
        let balance = balance(&scene, &mut observer).checked();
        killed(kill(reader));
        Outcome {
            balance: Some(balance),
            files: Some((files, scene.end(daemon, observer))),
            ..outcome
        }
    }
}

/// The balance of several daemons, one after the other: what was sent while none ran is lost.
fn answered(scene: &Scene, observer: &mut Observer) -> Balance {
    let answer = Link::open(&scene.memory, INSTANCE).controller.barrier();
    assert_eq!(answer.expect("the daemon answers").counters.lost, 0);
    observer.look();
    Balance {
        sent: observer.sent(),
        received: observer.answers,
        lost: observer.sent() - observer.answers,
    }
}

/// The balance of one daemon, once every sample has been answered; its estimate went on through every change.
pub(super) fn unbroken(scene: &Scene, observer: &mut Observer) -> Balance {
    let answer = Link::open(&scene.memory, INSTANCE)
        .controller
        .barrier()
        .expect("the daemon answers");
    let last = observer.look().expect("an estimate");
    assert_eq!(last.head.reset_count, 0, "it was never reset");
    let balance = Balance {
        sent: observer.sent(),
        received: answer.received[INPUT_IMU],
        lost: answer.counters.lost,
    };
    balance.checked()
}

/// The daemon.
pub fn daemon(plan: &Plan) -> Outcome {
    let mut moments = plan.moments("daemon");
    let mut all = Company::at_work(plan);
    let mut times = Vec::new();
    for round in 0..plan.rounds {
        // The reader in its own process has seen this daemon too.
        wait_for_lives(&all.reader, round as usize + 1);
        all.observer.watch_for(moments.up_to(AT_WORK));
        killed(all.daemon.stop_with(Signal::KILL));
        let (next, time) = all.observer.back_after(|| all.scene.daemon());
        all.daemon = next;
        times.push(time);
    }
    for party in [&mut all.feeder, &mut all.reader] {
        assert!(party.is_running(), "{}", party.stderr());
    }
    let outcome = Outcome {
        count: plan.rounds,
        survivors: "feeder, readers",
        times,
        note: "received: answered; lost: sent while no daemon ran".to_owned(),
        ..Outcome::default()
    };
    all.end(outcome, answered)
}

/// The feeder.
pub fn feeder(plan: &Plan) -> Outcome {
    let mut moments = plan.moments("feeder");
    let mut all = Company::at_work(plan);
    let mut times = Vec::new();
    for _ in 0..plan.rounds {
        all.observer.watch_for(moments.up_to(AT_WORK));
        killed(kill(all.feeder));
        // What it sent in its last moment is answered before the next one starts.
        all.observer.watch_for(Duration::from_millis(20));
        let (next, time) = all.observer.back_after(|| all.scene.feeder(plan, RATE_HZ));
        all.feeder = next;
        times.push(time);
    }
    assert_eq!(lives(&all.reader), 1, "{}", all.reader.stderr());
    let outcome = Outcome {
        count: plan.rounds,
        survivors: "daemon, readers",
        times,
        note: "the estimate is continued, never reset".to_owned(),
        ..Outcome::default()
    };
    all.end(outcome, unbroken)
}

/// A reader.
pub fn reader(plan: &Plan) -> Outcome {
    let mut moments = plan.moments("reader");
    let mut all = Company::at_work(plan);
    let mut times = Vec::new();
    for _ in 0..plan.rounds {
        all.observer.watch_for(moments.up_to(AT_WORK));
        killed(kill(all.reader));
        let started = Instant::now();
        all.reader = all.scene.reader(plan);
        eventually("an estimate at the new reader", || {
            all.observer.look();
            (lives(&all.reader) == 1).then_some(())
        });
        times.push(started.elapsed());
    }
    let outcome = Outcome {
        count: plan.rounds,
        survivors: "daemon, feeder, other readers",
        times,
        ..Outcome::default()
    };
    all.end(outcome, |scene, observer| {
        let balance = unbroken(scene, observer);
        assert_eq!(balance.lost, 0);
        balance
    })
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
    let rounds = plan.at_most(100);
    let (mut before, mut after) = (0, 0);
    for _ in 0..rounds {
        let mut all = Company::at_work(plan);
        all.observer.watch_for(moments.up_to(AT_WORK));
        drop(all.observer);
        for party in [&all.feeder, &all.reader] {
            party.signal(Signal::KILL);
        }
        killed(all.daemon.stop_with(Signal::KILL));
        killed(all.feeder.wait());
        killed(all.reader.wait());
        let scene = all.scene;
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
    let balance = unbroken(&scene, &mut observer);
    assert_eq!(balance.lost, 0);
    let after = scene.end(daemon, observer);
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
