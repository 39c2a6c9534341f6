//! What the system refuses to a daemon that asks for real-time priority and for memory that is never paged out: both
//! are said with their remedy, and the daemon estimates without them.

use std::path::Path;
use std::process::Command;

use rustix::process::geteuid;

use super::kills::{kill, killed};
use super::scene::{CONFIG, INSTANCE, Scene};
use super::{Outcome, Plan};
use crate::process::Daemon;
use crate::programs::programs;

/// Takes away what a privileged user may: the capabilities that stand above the limits.
const WITHOUT_CAPABILITIES: [&str; 4] = [
    "--bounding-set",
    "-sys_nice,-ipc_lock",
    "--inh-caps",
    "-sys_nice,-ipc_lock",
];
/// The limits of an ordinary user who was granted nothing.
const LIMITS: [&str; 2] = ["--rtprio=0", "--memlock=0"];

/// The programs and arguments that run another without either right; `None` if that cannot be had here.
fn wrapper() -> Option<Vec<&'static str>> {
    let mut words = Vec::new();
    if geteuid().is_root() {
        words.push("setpriv");
        words.extend(WITHOUT_CAPABILITIES);
    }
    words.push("prlimit");
    words.extend(LIMITS);
    let mut command = Command::new(words[0]);
    command.args(&words[1..]).arg("true");
    let works = command.output().is_ok_and(|output| output.status.success());
    works.then_some(words)
}

/// Priority and memory lock refused, asleep and spinning.
pub fn refused(plan: &Plan) -> Outcome {
    let Some(wrapper) = wrapper() else {
        return Outcome::skipped(
            "the programs prlimit and (to a privileged user) setpriv cannot take the rights away here",
        );
    };
    let rounds = plan.at_most(20);
    let (mut times, mut after) = (Vec::new(), 0);
    for round in 0..rounds {
        let wait = ["event", "spin"][round as usize % 2];
        let config =
            format!("{CONFIG}[runtime]\nwait = '{wait}'\npriority = 50\nlock_memory = true\n");
        let scene = Scene::with_config(&config);
        let mut command = scene.memory.command(Path::new(wrapper[0]));
        command.args(&wrapper[1..]).arg(&programs().service);
        let mut observer = scene.observer();
        let ((daemon, feeder), time) = observer.back_after(|| {
            let daemon = Daemon::start_as(command, INSTANCE, &config);
            (daemon, scene.feeder(plan, 200))
        });
        times.push(time);
        let said = daemon.stderr();
        for (what, remedy) in [
            ("refused: SCHED_FIFO with priority 50", "RLIMIT_RTPRIO"),
            ("refused: memory locked", "RLIMIT_MEMLOCK"),
        ] {
            let line = said.lines().find(|line| line.contains(what));
            assert!(line.is_some_and(|line| line.contains(remedy)), "{said}");
        }
        for _ in 0..10 {
            observer.wait();
        }
        killed(kill(feeder));
        after = after.max(scene.end(daemon, observer));
    }
    Outcome {
        count: rounds,
        survivors: "daemon, feeder, reader",
        times,
        files: Some((0, after)),
        note: format!(
            "by {}; both refusals are said in the log with their remedy; time: until the first estimate",
            if wrapper[0] == "setpriv" {
                "limits of 0 and without the capabilities"
            } else {
                "limits of 0"
            }
        ),
        ..Outcome::default()
    }
}
