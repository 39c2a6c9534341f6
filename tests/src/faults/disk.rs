//! A disk that fills up or becomes read-only under a daemon that keeps a checkpoint, and a recorder: the estimate goes
//! on, both say what fails, and both write again when they can.
//!
//! The disk is a small tmpfs, mounted in a mount namespace of the program's own (by an ordinary user in a user namespace
//! as well) and reached from here through `/proc/PID/root`. Where namespaces are not permitted an ordinary user's
//! read-only folder stands for the read-only disk, and the full one is skipped.

use std::fs::{self, File};
use std::io::Read;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::{Duration, Instant};

use rustix::process::{Signal, geteuid};
use tempfile::TempDir;

use super::kills::{kill, killed};
use super::scene::{CONFIG, INSTANCE, Scene};
use super::{Outcome, Plan};
use crate::link::{HealthReader, Link};
use crate::process::{Daemon, Running, client, eventually};
use crate::programs::programs;

/// Mounts the disk `$1` of size `$2`, and becomes the program.
const ON_A_DISK: &str = r#"
mount -t tmpfs -o size="$2" tmpfs "$1" || exit 90
shift 2
exec "$@"
"#;
/// Room for minutes of checkpoints, and for some seconds of a recording.
const SIZE: &str = "4m";
/// Rate of the samples, Hz.
const RATE_HZ: u32 = 200;

/// How a program gets a disk of its own.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Means {
    /// A mount namespace.
    Mount,
    /// A mount namespace in a user namespace.
    UserMount,
    /// None: an ordinary user's folder.
    Folder,
}

impl Means {
    /// The first that works here.
    fn here() -> Self {
        let works = |means: Self| {
            let folder = TempDir::new().expect("a folder");
            let mut command = Command::new("unshare");
            command.args(means.arguments());
            command.args(["sh", "-c", ON_A_DISK, "sh"]);
            command.arg(folder.path()).args([SIZE, "true"]);
            command.output().is_ok_and(|output| output.status.success())
        };
        [Self::Mount, Self::UserMount]
            .into_iter()
            .find(|means| works(*means))
            .unwrap_or(Self::Folder)
    }

    fn arguments(self) -> &'static [&'static str] {
        match self {
            Self::UserMount => &["--user", "--map-root-user", "--mount"],
            Self::Mount | Self::Folder => &["--mount"],
        }
    }

    fn in_words(self) -> &'static str {
        match self {
            Self::Mount => "a mounted tmpfs",
            Self::UserMount => "a tmpfs mounted in a user namespace",
            Self::Folder => "a folder without the right to write",
        }
    }
}

/// The folder that is a disk to one program.
struct Disk {
    means: Means,
    folder: TempDir,
}

impl Disk {
    fn new(means: Means) -> Self {
        let folder = TempDir::new().expect("a folder for a disk");
        Self { means, folder }
    }

    fn path(&self) -> &Path {
        self.folder.path()
    }

    /// A command that becomes `program` with the disk in its place.
    fn command(&self, scene: &Scene, program: &Path) -> Command {
        if self.means == Means::Folder {
            return scene.memory.command(program);
        }
        let mut command = scene.memory.command(Path::new("unshare"));
        command.args(self.means.arguments());
        command.args(["sh", "-c", ON_A_DISK, "sh"]);
        command.arg(self.path()).arg(SIZE).arg(program);
        command
    }

    /// Where `name` on the disk of the process `id` is to be found from here.
    fn outside(&self, id: u32, name: &str) -> PathBuf {
        let path = self.path().join(name);
        if self.means == Means::Folder {
            return path;
        }
        let inside = path.strip_prefix("/").expect("an absolute path");
        Path::new("/proc")
            .join(id.to_string())
            .join("root")
            .join(inside)
    }

    /// Leaves no byte on it.
    fn fill(&self, id: u32) {
        let filler = self.outside(id, "filler");
        let written = fs::write(&filler, vec![0; 64 << 20]);
        assert!(written.is_err(), "the disk is smaller than that");
    }

    fn free(&self, id: u32) {
        fs::remove_file(self.outside(id, "filler")).expect("the filler");
    }

    /// Allows or forbids to write.
    fn set_writable(&self, id: u32, writable: bool) {
        if self.means == Means::Folder {
            use std::os::unix::fs::PermissionsExt;
            let mode = if writable { 0o755 } else { 0o555 };
            fs::set_permissions(self.path(), fs::Permissions::from_mode(mode)).expect("the mode");
            return;
        }
        let target = id.to_string();
        // While a checkpoint is being written the disk is busy.
        eventually("the disk to be mounted anew", || {
            let mut command = Command::new("nsenter");
            command.args(["--target", &target, "--mount"]);
            if self.means == Means::UserMount {
                command.args(["--user", "--preserve-credentials"]);
            }
            command.args(["mount", "-o"]);
            command.arg(if writable { "remount,rw" } else { "remount,ro" });
            let output = command.arg(self.path()).output().expect("nsenter");
            output.status.success().then_some(())
        });
    }
}

/// A daemon whose checkpoint is on a disk.
struct OnDisk {
    disk: Disk,
    scene: Scene,
    daemon: Daemon,
    health: HealthReader,
}

impl OnDisk {
    fn start(means: Means) -> Self {
        let disk = Disk::new(means);
        let config = format!(
            "{CONFIG}[checkpoint]\npath = '{}'\nperiod_s = 0.02\n[journal]\npublish = true\n",
            disk.path().join("car.checkpoint").display()
        );
        let scene = Scene::with_config(&config);
        let command = disk.command(&scene, &programs().service);
        let daemon = Daemon::start_as(command, INSTANCE, &config);
        let health = HealthReader::open(&scene.memory, INSTANCE);
        Self {
            disk,
            scene,
            daemon,
            health,
        }
    }
}

/// Waits until checkpoints fail, again and again, and then until they succeed after `repair`; says how long that took.
fn checkpoints_fail_and_return(
    health: &HealthReader,
    daemon: &Daemon,
    repair: impl FnOnce(),
) -> Duration {
    let before = health.wait_until("health", |_| true);
    let failing = health.wait_until("failures", |health| {
        health.checkpoint_failures >= before.checkpoint_failures + 2
    });
    let said = daemon.stderr();
    assert!(
        said.contains("checkpoints cannot be written, the estimate goes on"),
        "{said}"
    );
    let started = Instant::now();
    repair();
    health.wait_until("checkpoints", |health| {
        health.checkpoints > failing.checkpoints
    });
    let time = started.elapsed();
    eventually("the daemon says so", || {
        daemon
            .stderr()
            .contains("checkpoints are written again")
            .then_some(())
    });
    time
}

/// The disk has not a byte left, for the daemon's checkpoint and for the recorder.
pub fn full(plan: &Plan) -> Outcome {
    let means = Means::here();
    if means == Means::Folder {
        return Outcome::skipped("a disk cannot be mounted here, in no namespace");
    }
    let rounds = plan.at_most(30);
    let (mut times, mut after) = (Vec::new(), 0);
    for _ in 0..rounds {
        let OnDisk {
            disk,
            scene,
            daemon,
            health,
        } = OnDisk::start(means);
        let recording = disk.path().join("flight.rec");
        let mut command = disk.command(&scene, &programs().client);
        command.args(["record", "--instance", INSTANCE, "--out"]);
        let recorder = Running::start({
            command.arg(&recording);
            command
        });
        let recorded = disk.outside(recorder.id(), "flight.rec");
        let mut recorded = eventually("a recording", || File::open(&recorded).ok());
        let feeder = scene.feeder(plan, RATE_HZ);
        let mut observer = scene.observer();
        let last = observer.wait();
        health.wait_until("a checkpoint", |health| health.checkpoints > 0);

        disk.fill(daemon.id());
        disk.fill(recorder.id());
        eventually("the recorder says so", || {
            recorder
                .stderr()
                .contains("cannot be written")
                .then_some(())
        });
        times.push(checkpoints_fail_and_return(&health, &daemon, || {
            // The estimate goes on.
            let during = observer.wait();
            assert!(during.head.estimate_seq > last.head.estimate_seq);
            disk.free(daemon.id());
            disk.free(recorder.id());
        }));
        eventually("the recorder writes again", || {
            recorder.stderr().contains("is written again").then_some(())
        });
        killed(kill(feeder));
        let mut link: Link = Link::open(&scene.memory, INSTANCE);
        let answer = link.controller.barrier().expect("the daemon answers");
        assert_eq!(answer.counters.lost, 0);
        drop(link);
        observer.wait_for_silence();
        recorder.signal(Signal::TERM);
        let ended = recorder.wait().succeeded();
        // Nothing is missing: what came meanwhile was kept.
        assert!(!ended.stdout.contains("lost "), "{ended:#?}");
        let kept = TempDir::new().expect("a folder");
        let copy = kept.path().join("flight.rec");
        let mut bytes = Vec::new();
        recorded.read_to_end(&mut bytes).expect("the recording");
        fs::write(&copy, &bytes).expect("a copy");
        let again = client(
            &scene.memory,
            [
                "replay".as_ref(),
                copy.as_os_str(),
                "--out".as_ref(),
                kept.path().join("again.csv").as_os_str(),
            ],
        )
        .succeeded();
        assert!(again.stdout.contains("bit for bit equal"), "{again:#?}");
        assert!(!again.stdout.contains("missing"), "{again:#?}");
        after = after.max(scene.end(daemon, (observer, health)));
    }
    Outcome {
        count: rounds,
        survivors: "daemon, feeder, reader, recorder",
        times,
        files: Some((0, after)),
        note: format!(
            "{}; failures are counted and said; the recording has no gap; time: from room on the disk to a checkpoint",
            means.in_words()
        ),
        ..Outcome::default()
    }
}

/// The disk becomes read-only under the daemon; a recorder that begins there is refused in one line.
pub fn read_only(plan: &Plan) -> Outcome {
    let means = Means::here();
    if means == Means::Folder && geteuid().is_root() {
        return Outcome::skipped(
            "a disk cannot be mounted here, and to this user no folder is read-only",
        );
    }
    let rounds = plan.at_most(30);
    let (mut times, mut after) = (Vec::new(), 0);
    for _ in 0..rounds {
        let OnDisk {
            disk,
            scene,
            daemon,
            health,
        } = OnDisk::start(means);
        let feeder = scene.feeder(plan, RATE_HZ);
        let mut observer = scene.observer();
        let last = observer.wait();
        health.wait_until("a checkpoint", |health| health.checkpoints > 0);

        disk.set_writable(daemon.id(), false);
        let out = disk.outside(daemon.id(), "flight.rec");
        let refused = client(
            &scene.memory,
            [
                "record".as_ref(),
                "--instance".as_ref(),
                INSTANCE.as_ref(),
                "--out".as_ref(),
                out.as_os_str(),
            ],
        );
        let line = refused.failed_with_one_line(1);
        assert!(
            line.contains("flight.rec") && (line.contains("Read-only") || line.contains("denied")),
            "{line}"
        );
        times.push(checkpoints_fail_and_return(&health, &daemon, || {
            let during = observer.wait();
            assert!(during.head.estimate_seq > last.head.estimate_seq);
            disk.set_writable(daemon.id(), true);
        }));
        observer.wait();
        killed(kill(feeder));
        after = after.max(scene.end(daemon, (observer, health)));
    }
    Outcome {
        count: rounds,
        survivors: "daemon, feeder, reader",
        times,
        files: Some((0, after)),
        note: format!(
            "{}; failures are counted and said; a new recorder is refused in one line; time: from the right to write to \
             a checkpoint",
            means.in_words()
        ),
        ..Outcome::default()
    }
}
