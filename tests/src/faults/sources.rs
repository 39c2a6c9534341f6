//! Position sources that freeze, lie or come late, and more fixes than a smoother can take.

use inekf_client::dataset::{Dataset, Event, Truth};
use inekf_client::simulate::SimulationOptions;
use inekf_shared::message::{
    ControlResponse, EstimateSe23, INPUT_IMU, INPUT_POSITION, REASON_BUFFER_FULL,
};

use super::scene::{INSTANCE, Scene, at_origin, rest};
use super::{Balance, Outcome, Plan};
use crate::drive::{CONFIG, drive, options, simulated};
use crate::link::Link;
use crate::score::SECOND_NS;

/// What a daemon made of a dataset.
struct Run {
    estimates: Vec<EstimateSe23>,
    answer: ControlResponse,
    balance: Balance,
    files: (usize, usize),
}

/// Feeds events to a daemon, in their order, and stops it.
fn run(config: &str, events: impl IntoIterator<Item = Event>) -> Run {
    let scene = Scene::with_config(config);
    let daemon = scene.daemon();
    let mut link = Link::open(&scene.memory, INSTANCE);
    let mut sent = 0;
    let events = events.into_iter().inspect(|event| {
        sent += u64::from(matches!(event, Event::Imu(_)));
    });
    let estimates = link.feed(events);
    let answer = link.controller.barrier().expect("the daemon answers");
    let balance = Balance {
        sent,
        received: answer.received[INPUT_IMU],
        lost: answer.counters.lost,
    };
    let before = scene.files();
    drop(link);
    daemon.stop();
    let after = scene.cleared();
    Run {
        estimates,
        answer,
        balance: balance.checked(),
        files: (before, after),
    }
}

/// A drive with positions only, so that nothing else holds the estimate.
fn positions_only(seed: u64, duration_s: f64) -> Dataset {
    simulated(&SimulationOptions {
        velocity: None,
        heading: None,
        ..options(seed, duration_s)
    })
}

/// How far the last estimate is off, m.
fn last_error_m(dataset: &Dataset, estimates: &[EstimateSe23]) -> f64 {
    let Truth::Spatial(rows) = &dataset.truth else {
        panic!("the truth is spatial");
    };
    let last = estimates.last().expect("an estimate");
    let row = rows
        .iter()
        .find(|row| row.stamp_ns == last.head.stamp_ns)
        .expect("the truth of the last estimate");
    let apart = [0, 1, 2].map(|i| row.p_w_m[i] - last.p_w_m[i]);
    apart.iter().map(|x| x * x).sum::<f64>().sqrt()
}

/// For ten seconds the source repeats one position. It is gated; since it never stops, it is believed in the end; and
/// when it moves again the estimate comes back.
pub fn frozen(plan: &Plan) -> Outcome {
    let rounds = plan.at_most(5);
    let mut notes = (0, 0.0_f64);
    let (mut balance, mut files) = (Balance::default(), None);
    for round in 0..rounds {
        let mut dataset = positions_only(100 + u64::from(round), 60.0);
        let frozen = dataset
            .position
            .iter()
            .find(|row| row.stamp_ns >= 20 * SECOND_NS)
            .copied()
            .expect("a fix");
        for row in &mut dataset.position {
            if (20 * SECOND_NS..30 * SECOND_NS).contains(&row.stamp_ns) {
                row.position_w_m = frozen.position_w_m;
            }
        }
        let run = run(CONFIG, dataset.events());
        assert!(run.answer.counters.gated > 0);
        let error_m = last_error_m(&dataset, &run.estimates);
        // Thirty seconds of fixes with 1 m of noise: ten times that would be a filter that is lost.
        assert!(error_m < 10.0, "{error_m} m");
        notes = (notes.0 + run.answer.counters.gated, notes.1.max(error_m));
        balance = sum(balance, run.balance);
        files = Some(run.files);
    }
    Outcome {
        count: rounds,
        survivors: "daemon, feeder, reader",
        balance: Some(balance),
        files,
        note: format!(
            "{} fixes gated; 30 s later at most {:.1} m off",
            notes.0, notes.1
        ),
        ..Outcome::default()
    }
}

/// Every seventh fix lies by a kilometre: all of these are gated, and the estimates are those without them, bit for
/// bit.
pub fn lying(plan: &Plan) -> Outcome {
    let rounds = plan.at_most(5);
    let (mut gated, mut balance, mut files) = (0, Balance::default(), None);
    for round in 0..rounds {
        let dataset = drive(200 + u64::from(round), 20.0);
        // Once the first fixes have been fused, and away from the first one, which starts the estimate.
        let lies = |index: usize| index > 20 && index % 7 == 3;
        let mut lying = dataset.clone();
        let mut honest = dataset.clone();
        honest.position = Vec::new();
        for (index, row) in dataset.position.iter().enumerate() {
            if lies(index) {
                lying.position[index].position_w_m[index % 3] += 1000.0;
            } else {
                honest.position.push(*row);
            }
        }
        let injected = (dataset.position.len() - honest.position.len()) as u64;
        let with = run(CONFIG, lying.events());
        let without = run(CONFIG, honest.events());
        assert_eq!(
            with.answer.counters.gated - without.answer.counters.gated,
            injected
        );
        assert_eq!(with.estimates.len(), without.estimates.len());
        for (one, other) in with.estimates.iter().zip(&without.estimates) {
            assert_eq!(one.p_w_m.map(f64::to_bits), other.p_w_m.map(f64::to_bits));
            assert_eq!(one.q_wb.map(f64::to_bits), other.q_wb.map(f64::to_bits));
        }
        gated += injected;
        balance = sum(balance, with.balance);
        files = Some(with.files);
    }
    Outcome {
        count: u32::try_from(gated).unwrap_or(u32::MAX),
        survivors: "daemon, feeder, reader",
        balance: Some(balance),
        files,
        note: "all gated; estimates equal bit for bit to those without the lies".to_owned(),
        ..Outcome::default()
    }
}

/// Every fix comes 2 s after its time: fused by replay where the window holds them, so that the last estimate is that
/// of fixes on time; counted as late where it does not.
pub fn late(plan: &Plan) -> Outcome {
    let rounds = plan.at_most(5);
    let (mut balance, mut files, mut fixes) = (Balance::default(), None, 0);
    for round in 0..rounds {
        let dataset = positions_only(300 + u64::from(round), 20.0);
        let first = dataset.position.first().map_or(0, |row| row.stamp_ns);
        let due_ns = |event: &Event| match event {
            // The first starts the estimate.
            Event::Position(row) if row.stamp_ns > first => row.stamp_ns + 2 * SECOND_NS,
            event => event.stamp_ns(),
        };
        let mut delayed: Vec<Event> = dataset.events().collect();
        delayed.sort_by_key(due_ns);
        let wide = format!("{CONFIG}\n[late]\nwindow_s = 3.0\n");
        let on_time = run(&wide, dataset.events());
        let replayed = run(&wide, delayed.iter().copied());
        let last = |run: &Run| {
            let last = run.estimates.last().expect("an estimate");
            (last.head.stamp_ns, last.p_w_m.map(f64::to_bits))
        };
        assert_eq!(last(&on_time), last(&replayed));
        assert_eq!(replayed.answer.counters.late, 0);
        let narrow = run(CONFIG, delayed);
        let counters = narrow.answer.counters;
        assert_eq!(
            narrow.answer.received[INPUT_POSITION],
            counters.late + counters.accepted + counters.gated + counters.rejected
        );
        assert!(counters.late > 0);
        fixes += dataset.position.len() - 1;
        balance = sum(balance, narrow.balance);
        files = Some(replayed.files);
    }
    Outcome {
        count: u32::try_from(fixes).unwrap_or(u32::MAX),
        survivors: "daemon, feeder, reader",
        balance: Some(balance),
        files,
        note: "in a window of 3 s: the last estimate equal bit for bit to that of fixes on time; of 1 s: counted late"
            .to_owned(),
        ..Outcome::default()
    }
}

/// A second source stamps its fixes 30 s ahead. The first one's are fused all the same, each at its time.
pub fn fast_clock(_plan: &Plan) -> Outcome {
    let dataset = positions_only(400, 20.0);
    let config = format!("{CONFIG}\n[[position_source]]\nid = 1\n");
    let mut events = Vec::new();
    for event in dataset.events() {
        if let Event::Position(row) = event {
            events.push(Event::Position(at_origin(row.stamp_ns + 30 * SECOND_NS, 1)));
        }
        events.push(event);
    }
    let alone = run(&config, dataset.events());
    let beside = run(&config, events);
    assert_eq!(
        alone.answer.counters.accepted,
        beside.answer.counters.accepted
    );
    let last = |run: &Run| {
        run.estimates
            .last()
            .map(|last| last.p_w_m.map(f64::to_bits))
    };
    assert_eq!(last(&alone), last(&beside));
    Outcome {
        count: u32::try_from(dataset.position.len()).unwrap_or(u32::MAX),
        survivors: "daemon, feeder, reader",
        balance: Some(beside.balance),
        files: Some(beside.files),
        note: "the good source's fixes all fused, each at its time".to_owned(),
        ..Outcome::default()
    }
}

/// A fix with every sample, for a smoother of 100 states, as fast as they can be sent: samples come first, and what
/// cannot be taken is counted.
pub fn smoother_overload(plan: &Plan) -> Outcome {
    let rounds = plan.at_most(3);
    let config = format!(
        "{}\n[smoother]\nwindow = 100\n",
        super::scene::CONFIG.replace("model = 'imu'", "model = 'imu'\nestimator = 'smoother'")
    );
    let (mut balance, mut files, mut note) = (Balance::default(), None, String::new());
    for _ in 0..rounds {
        let events = (1..=600).flat_map(|index| {
            let stamp_ns = SECOND_NS + index * 10_000_000;
            [
                Event::Imu(rest(stamp_ns)),
                Event::Position(at_origin(stamp_ns, 0)),
            ]
        });
        let run = run(&config, events);
        let answer = &run.answer;
        let counters = answer.counters;
        assert_eq!(run.balance.lost, 0);
        let judged = counters.accepted
            + counters.gated
            + counters.late
            + answer.rejected_by_reason.iter().sum::<u64>();
        assert_eq!(answer.received[INPUT_POSITION], judged);
        note = format!(
            "{} fixes: {} fused, {} refused for want of room, {} late",
            answer.received[INPUT_POSITION],
            counters.accepted,
            answer.rejected_by_reason[REASON_BUFFER_FULL as usize],
            counters.late
        );
        balance = sum(balance, run.balance);
        files = Some(run.files);
    }
    Outcome {
        count: rounds,
        survivors: "daemon, feeder, reader",
        balance: Some(balance),
        files,
        note,
        ..Outcome::default()
    }
}

fn sum(one: Balance, other: Balance) -> Balance {
    Balance {
        sent: one.sent + other.sent,
        received: one.received + other.received,
        lost: one.lost + other.lost,
    }
}
