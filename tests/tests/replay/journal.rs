//! `inekf-client record` and the replay of what it has recorded: every estimate comes again, bit for bit, whatever
//! happened; and one bit that is not the same is found.

use std::fs;
use std::path::{Path, PathBuf};
use std::time::Duration;

use inekf_client::dataset::{Dataset, Event};
use inekf_client::model::Estimate;
use inekf_client::noise;
use inekf_client::recording::{Entry, Item, Reader, Writer};
use inekf_client::simulate::{PlanarOptions, simulate_planar};
use inekf_shared::codec::{self, FRAME_ENTRY};
use inekf_shared::message::{
    ESTIMATE_REPLAYED, EstimateSe2, EstimateSe23, ImuSample, JOURNAL_CONTROL, JOURNAL_IMU,
    JOURNAL_POSITION, JOURNAL_RESUME, JOURNAL_SETTLE, JournalEntry, Message, Odometry2d,
};
use inekf_tests::drive::{CONFIG, config, drive};
use inekf_tests::link::{Link, RawFeeder};
use inekf_tests::memory::Memory;
use inekf_tests::process::{
    Daemon, Ended, Running, client, eventually, project_config, start_client,
};
use inekf_tests::score::SECOND_NS;
use rustix::process::Signal;
use tempfile::TempDir;

const JOURNAL: &str = "[journal]\npublish = true\n";

/// A daemon that is recorded.
struct Recorded {
    memory: Memory,
    folder: TempDir,
    recorder: Running,
    daemon: Daemon,
}

impl Recorded {
    /// Starts both, the recorder first, so that it hears everything.
    fn start(config: &str) -> Self {
        let (memory, folder) = (Memory::new(), TempDir::new().expect("a folder"));
        let recorder = start_recorder(&memory, &folder);
        let daemon = Daemon::start(&memory, "car", &format!("{config}\n{JOURNAL}"));
        let recorded = Self {
            memory,
            folder,
            recorder,
            daemon,
        };
        recorded.wait_for_head();
        recorded
    }

    /// Waits until the recorder has begun.
    fn wait_for_head(&self) {
        eventually("the beginning of the recording", || {
            let file = fs::metadata(self.folder.path().join("car.rec")).ok()?;
            (file.len() > 0).then_some(())
        });
    }

    /// Ends both, and gives the recording.
    fn finish(self) -> Recording {
        self.recorder.signal(Signal::TERM);
        let ended = self.recorder.wait().succeeded();
        assert!(!ended.stdout.contains("missed"), "{ended:?}");
        self.daemon.stop();
        self.memory.assert_nothing_left();
        Recording {
            path: self.folder.path().join("car.rec"),
            _folder: self.folder,
        }
    }
}

fn start_recorder(memory: &Memory, folder: &TempDir) -> Running {
    let out = folder.path().join("car.rec");
    let out = out.to_str().expect("a path of text");
    start_client(memory, ["record", "--instance", "car", "--out", out])
}

struct Recording {
    path: PathBuf,
    _folder: TempDir,
}

impl Recording {
    fn replay(&self) -> Ended {
        replay(&self.path)
    }

    /// Replays it; everything has to be equal. The number of estimates.
    fn assert_equal(&self, name: &str) -> u64 {
        let ended = self.replay();
        let line = ended.stdout.lines().nth(1).unwrap_or_default();
        println!("{name}: {line}");
        assert!(ended.status.success(), "{name}: {ended:?}");
        let (count, rest) = line.split_once(' ').expect("a number of estimates");
        assert_eq!(rest, "estimates, bit for bit equal", "{name}: {ended:?}");
        count.parse().expect("a number")
    }

    fn items<E: Estimate>(&self) -> (Vec<Entry>, Vec<E>) {
        let mut reader = Reader::open(&self.path).expect("a recording");
        let (mut entries, mut estimates) = (Vec::new(), Vec::new());
        while let Some(item) = reader.next_item::<E>().expect("it can be read") {
            match item {
                Item::Entry(entry) => entries.push(entry),
                Item::Estimate(estimate) => estimates.push(estimate),
            }
        }
        assert_eq!(reader.damage(), Default::default());
        (entries, estimates)
    }

    /// The same recording with other items.
    fn with<E: Estimate>(&self, entries: &[Entry], estimates: &[E]) -> Recording {
        let folder = TempDir::new().expect("a folder");
        let path = folder.path().join("other.rec");
        let head = Reader::open(&self.path)
            .expect("a recording")
            .head()
            .clone();
        let mut writer = Writer::create(&path, &head).expect("a recording");
        for Entry {
            index,
            estimates,
            kind,
            message,
        } in entries
        {
            let entry = JournalEntry::new(*index, *estimates, *kind, message);
            writer.entry(&entry).expect("it can be written");
        }
        for estimate in estimates {
            writer.estimate(estimate).expect("it can be written");
        }
        writer.finish().expect("it can be written");
        Recording {
            path,
            _folder: folder,
        }
    }
}

fn replay(path: &Path) -> Ended {
    let memory = Memory::new();
    let out = TempDir::new().expect("a folder");
    let csv = out.path().join("again.csv");
    let arguments = [
        "replay".as_ref(),
        path.as_os_str(),
        "--out".as_ref(),
        csv.as_os_str(),
    ];
    let ended = client(&memory, arguments);
    memory.assert_nothing_left();
    ended
}

/// The rows of a dataset, every third position late by so much and every eleventh far away.
fn lively(dataset: &Dataset, late_ns: u64) -> Vec<Event> {
    let mut rows: Vec<(u64, Event)> = Vec::new();
    let mut positions = 0;
    for mut event in dataset.events() {
        let mut sent_ns = event.stamp_ns();
        if let Event::Position(row) = &mut event {
            positions += 1;
            if positions % 11 == 5 {
                row.position_w_m[0] += 300.0;
            }
            if positions % 3 == 0 {
                sent_ns += late_ns;
            }
        }
        rows.push((sent_ns, event));
    }
    rows.sort_by_key(|(sent_ns, _)| *sent_ns);
    rows.into_iter().map(|(_, event)| event).collect()
}

/// Feeds rows in bursts of different lengths, so that the daemon finds now one sample waiting and now many.
fn feed_in_bursts(link: &mut Link, rows: &[Event], bursts: &[usize]) -> Vec<EstimateSe23> {
    let mut estimates = Vec::new();
    let (mut rest, mut lengths) = (rows, bursts.iter().cycle());
    while !rest.is_empty() {
        let length = (*lengths.next().expect("a length")).min(rest.len());
        let (burst, others) = rest.split_at(length);
        for row in burst {
            link.feeder.send(row).expect("it can be sent");
        }
        std::thread::sleep(Duration::from_micros(300));
        link.settle(&mut estimates);
        rest = others;
    }
    estimates
}

#[test]
fn a_filter_with_everything_that_can_happen_to_it_comes_again_bit_for_bit() {
    let recorded = Recorded::start(CONFIG);
    let mut link = Link::open(&recorded.memory, "car");
    let dataset = drive(31, 12.0);
    let rows = lively(&dataset, SECOND_NS / 2);
    let mut parts = rows.chunks(rows.len().div_ceil(6));
    let mut next =
        |link: &mut Link| feed_in_bursts(link, parts.next().expect("a part"), &[1, 7, 60, 2, 150]);
    let mut estimates = next(&mut link);
    let state = link.controller.snapshot().expect("a state");
    estimates.extend(next(&mut link));
    link.controller.reset().expect("a reset");
    estimates.extend(next(&mut link));
    // A state older than the last sample is refused, then as now.
    assert!(link.controller.set_state(state).is_err());
    let mut now = link.controller.snapshot().expect("a state");
    now.p_w_m[0] += 3.0;
    link.controller.set_state(now).expect("a state");
    estimates.extend(next(&mut link));
    link.controller.pause().expect("a pause");
    estimates.extend(next(&mut link));
    link.controller.unpause().expect("its end");
    let noise =
        noise::parse("[noise]\ngyro_density = 1e-3\naccel_density = 1e-2\n").expect("noise");
    link.controller.reload_noise(noise).expect("other noise");
    estimates.extend(next(&mut link));
    let counters = link.controller.barrier().expect("an answer").counters;
    assert!(counters.gated > 0 && counters.rejected > 0, "{counters:?}");
    let replayed = estimates
        .iter()
        .filter(|e| e.head.flags & ESTIMATE_REPLAYED != 0);
    assert!(replayed.count() > 3);
    assert_eq!(estimates.last().expect("estimates").head.reset_count, 2);
    drop(link);

    let recording = recorded.finish();
    let (entries, recorded) = recording.items::<EstimateSe23>();
    assert_eq!(recorded.len(), estimates.len());
    assert_eq!(entries[0].index, 0);
    let indices: Vec<u64> = entries.iter().map(|entry| entry.index).collect();
    assert_eq!(indices, (0..entries.len() as u64).collect::<Vec<_>>());
    let inputs = |kind| entries.iter().filter(move |entry| entry.kind == kind);
    assert_eq!(inputs(JOURNAL_IMU).count(), dataset.imu.len());
    assert_eq!(inputs(JOURNAL_POSITION).count(), dataset.position.len());
    assert_eq!(
        inputs(JOURNAL_SETTLE).count(),
        0,
        "a filter puts nothing off"
    );
    assert!(inputs(JOURNAL_CONTROL).count() > 7);
    assert_eq!(recording.assert_equal("a filter"), estimates.len() as u64);
    differences_are_found(&recording, &entries, &recorded);
    what_is_missing_is_said(&recording, &entries, &recorded);
}

/// One bit of one estimate, one bit of one input, or an entry that is not there, and the replay is another.
fn differences_are_found(recording: &Recording, entries: &[Entry], estimates: &[EstimateSe23]) {
    let index = estimates.len() / 3;
    let mut others = estimates.to_vec();
    let x = &mut others[index].p_w_m[0];
    *x = f64::from_bits(x.to_bits() ^ 1);
    let ended = recording.with(entries, &others).replay();
    let line = ended.failed_with_one_line(1);
    let number = format!(
        "the estimate {} differs",
        estimates[index].head.estimate_seq
    );
    assert!(line.contains(&number), "{line}");

    let mut others = entries.to_vec();
    let middle = others.len() / 3;
    let sample = others[middle..]
        .iter_mut()
        .find(|entry| entry.kind == JOURNAL_IMU);
    let sample = sample.expect("a sample");
    let mut message = ImuSample::from_bytes(&sample.message).expect("a sample");
    message.gyro_rps[1] += 1e-6;
    sample.message = message.as_bytes().to_vec();
    let ended = recording.with(&others, estimates).replay();
    assert!(
        ended.failed_with_one_line(1).contains("differs"),
        "{ended:?}"
    );
}

/// Gaps, a beginning in the middle, a torn end: the rest is compared, and what is missing is named.
fn what_is_missing_is_said(recording: &Recording, entries: &[Entry], estimates: &[EstimateSe23]) {
    let all = estimates.len() as u64;
    // From the middle of the first part on, before the reset.
    let late = recording.with(&entries[40..], estimates);
    let equal = late.assert_equal("from the middle on");
    assert!(equal > all / 2 && equal < all, "{equal} of {all}");
    let ended = late.replay();
    assert!(ended.stdout.contains("skipped "), "{ended:?}");

    // Behind every entry that fixes the state, nothing is left to compare.
    let last_fix = entries
        .iter()
        .rposition(|entry| entry.kind == JOURNAL_CONTROL && matches!(entry.message[0], 1 | 2));
    let behind = recording.with(&entries[last_fix.expect("a fix") + 1..], estimates);
    let ended = behind.replay();
    assert!(
        ended
            .failed_with_one_line(1)
            .contains("nothing could be compared")
    );

    // A gap before the reset, and estimates that the recorder missed.
    let mut gapped = entries.to_vec();
    gapped.drain(50..53);
    let ended = recording.with(&gapped, &estimates[10..]).replay();
    let first = entries[49].index;
    assert!(ended.status.success(), "{ended:?}");
    let line = format!("missing  3 entries after entry {first}\n");
    assert!(ended.stdout.contains(&line), "{ended:?}");
    assert!(ended.stdout.contains("estimates, bit for bit equal\n"));

    // A recorder that was killed in the middle of a frame.
    let bytes = fs::read(&recording.path).expect("a recording");
    let torn = recording.path.with_extension("torn");
    fs::write(&torn, &bytes[..bytes.len() * 2 / 3]).expect("a recording");
    let ended = replay(&torn);
    assert!(ended.status.success(), "{ended:?}");
    assert!(
        ended.stdout.contains("estimates, bit for bit equal\n"),
        "{ended:?}"
    );
    // And one whose disk lost a byte.
    let mut bytes = bytes;
    let frame = codec::encode(FRAME_ENTRY, &entries[60]).expect("a frame");
    let at = bytes
        .windows(frame.len())
        .position(|window| window == frame);
    bytes[at.expect("the frame") + frame.len() / 2] ^= 0x40;
    fs::write(&torn, &bytes).expect("a recording");
    let ended = replay(&torn);
    assert!(ended.status.success(), "{ended:?}");
    assert!(
        ended
            .stdout
            .contains(&format!("damaged  {} bytes in 1 places\n", frame.len()))
    );
    assert!(ended.stdout.contains(&format!(
        "missing  1 entries after entry {}\n",
        entries[59].index
    )));
}

#[test]
fn a_smoother_comes_again_bit_for_bit_however_its_fixes_met_its_samples() {
    for wait in ["event", "spin"] {
        let config = config("estimator = 'smoother'", wait);
        let config = config.replace("[[heading_source]]\nid = 0\n", "[smoother]\nwindow = 7\n");
        let recorded = Recorded::start(&config);
        let mut link = Link::open(&recorded.memory, "car");
        // Behind the next sample or the one after it, but not behind the next fix.
        let rows = lively(&drive(32, 8.0), 12_000_000);
        let (first, second) = rows.split_at(rows.len() / 2);
        let mut estimates = feed_in_bursts(&mut link, first, &[1, 1, 30, 1, 1, 1]);
        link.controller.reset().expect("a reset");
        estimates.extend(feed_in_bursts(&mut link, second, &[1]));
        link.controller.smoothed().expect("a window");
        drop(link);
        let recording = recorded.finish();
        let (entries, _) = recording.items::<EstimateSe23>();
        let settled = entries.iter().filter(|entry| entry.kind == JOURNAL_SETTLE);
        let settled = settled.count();
        assert!(settled > 3, "{settled} of {}", entries.len());
        println!("{settled} of {} entries settle", entries.len());
        assert_eq!(recording.assert_equal(wait), estimates.len() as u64);
    }
}

#[test]
fn odometry_with_adaptive_mismatches_and_samples_of_another_model_comes_again() {
    let recorded = Recorded::start(&project_config("planar_mismatch_adaptive"));
    let mut link = Link::<EstimateSe2>::open_model(&recorded.memory, "car");
    let dataset = simulate_planar(&PlanarOptions::default()).expect("a drive");
    let foreign = RawFeeder::<ImuSample>::open(&recorded.memory, "car");
    let mut estimates = Vec::new();
    for (number, row) in dataset
        .events_for(EstimateSe2::KIND)
        .expect("rows")
        .enumerate()
    {
        link.feeder.send(&row).expect("it can be sent");
        if number % 50 == 0 {
            foreign.send(ImuSample::default());
            link.settle(&mut estimates);
        }
    }
    // The next health message counts those.
    eventually("the foreign samples", || {
        let answer = link.settle(&mut estimates);
        (answer.counters.rejected > 5).then_some(())
    });
    drop((link, foreign));
    let recording = recorded.finish();
    let (entries, _) = recording.items::<EstimateSe2>();
    assert!(entries.iter().any(|entry| entry.kind == JOURNAL_IMU));
    assert!(
        entries
            .iter()
            .any(|entry| Odometry2d::from_bytes(&entry.message).is_some())
    );
    assert_eq!(recording.assert_equal("odometry"), estimates.len() as u64);
}

#[test]
fn a_daemon_that_was_resumed_comes_again_from_the_state_it_was_resumed_with() {
    let folder = TempDir::new().expect("a folder");
    let path = folder.path().join("car.checkpoint");
    let config = format!("{CONFIG}\n[checkpoint]\npath = '{}'\n", path.display());
    let dataset = drive(33, 6.0);
    let rows: Vec<Event> = dataset.events().collect();
    let (first, second) = rows.split_at(rows.len() / 2);
    let memory = Memory::new();
    let daemon = Daemon::start(&memory, "car", &config);
    let mut link = Link::open(&memory, "car");
    link.feed(first.iter().copied());
    drop(link);
    daemon.stop();

    let recorded = Recorded::start(&config);
    let mut link = Link::open(&recorded.memory, "car");
    let estimates = link.feed(second.iter().copied());
    drop(link);
    let before = fs::read(&path).expect("a checkpoint");
    let recording = recorded.finish();
    let (entries, _) = recording.items::<EstimateSe23>();
    assert_eq!((entries[0].index, entries[0].kind), (0, JOURNAL_RESUME));
    let written = fs::read(&path).expect("a checkpoint");
    assert!(written != before, "the daemon has written its last state");
    assert_eq!(recording.assert_equal("resumed"), estimates.len() as u64);
    assert!(
        fs::read(&path).expect("a checkpoint") == written,
        "the replay has not"
    );
}

#[test]
fn the_recording_of_a_daemon_that_is_killed_ends_with_the_next_and_comes_again() {
    let Recorded {
        memory,
        folder,
        recorder,
        daemon,
    } = Recorded::start(CONFIG);
    let rows: Vec<Event> = drive(34, 3.0).events().collect();
    let mut link = Link::open(&memory, "car");
    let estimates = link.feed(rows.iter().copied());
    drop(link);
    assert!(!daemon.stop_with(Signal::KILL).status.success());
    let daemon = Daemon::start(&memory, "car", &format!("{CONFIG}\n{JOURNAL}"));
    let mut link = Link::open(&memory, "car");
    link.feed(rows.iter().copied());
    let ended = recorder.wait().succeeded();
    assert!(
        ended.stdout.contains("the daemon was started anew"),
        "{ended:?}"
    );
    drop(link);
    daemon.stop();
    memory.assert_nothing_left();
    let recording = Recording {
        path: folder.path().join("car.rec"),
        _folder: folder,
    };
    assert_eq!(recording.assert_equal("killed"), estimates.len() as u64);
}

#[test]
fn a_recorder_that_cannot_record_says_why() {
    let (memory, folder) = (Memory::new(), TempDir::new().expect("a folder"));
    let daemon = Daemon::start(&memory, "car", CONFIG);
    let ended = start_recorder(&memory, &folder).wait();
    assert!(
        ended
            .failed_with_one_line(1)
            .contains("publishes no journal"),
        "{ended:?}"
    );
    daemon.stop();

    let daemon = Daemon::start(&memory, "car", &format!("{CONFIG}\n{JOURNAL}"));
    fs::write(folder.path().join("car.rec"), "something dear").expect("a file");
    let ended = start_recorder(&memory, &folder).wait();
    assert!(
        ended.failed_with_one_line(1).contains("car.rec"),
        "{ended:?}"
    );
    let kept = fs::read_to_string(folder.path().join("car.rec")).expect("a file");
    assert_eq!(kept, "something dear");
    daemon.stop();

    let ended = replay(&folder.path().join("car.rec"));
    assert!(
        ended
            .failed_with_one_line(1)
            .contains("this is no recording"),
        "{ended:?}"
    );
    memory.assert_nothing_left();
}
