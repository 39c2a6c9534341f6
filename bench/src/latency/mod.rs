//! Round trips between two pinned processes, one at a time: a sample sent, its estimate read, and
//! beside it what else one could do.
//!
//! Every case of [`mechanism`] runs in turns, so that a change of the machine's speed meets all of
//! them alike. In its turn a partner is started and measured at every pace, a chunk of rounds each.
//! Before and after every chunk the partner is held and a raw cache-line ping-pong is made between
//! the same two processors: it tells the [`placement`] of the chunk and is what the chunk is
//! compared with. [`row`] adds the chunks up and marks what is noise, [`report`] and [`figure`]
//! show it. What matters are the ratios.

pub mod blackboard;
pub mod cache_line;
pub mod echo;
pub mod estimate;
pub mod figure;
pub mod futex;
pub mod machine;
pub mod mechanism;
pub mod neighbour;
pub mod partner;
pub mod placement;
pub mod preemption;
pub mod report;
pub mod row;
pub mod socket;

use anyhow::{Context, bail, ensure};
use clap::Args;
use hdrhistogram::Histogram;
use indicatif::ProgressBar;
use inekf_shared::clock::monotonic_ns;

use machine::Machine;
use mechanism::{CASES, Case, PACES, Pace, Wait};
use partner::RoundTrip;
use placement::{Placement, ping_pong};
use report::Report;
use row::{Chunk, Row, histogram};

use crate::pin;
use crate::progress::progress;

/// A wake-up takes so many times longer than a look: rows that wait asleep make fewer rounds.
const EVENT_SHARE: u64 = 20;
/// Rounds of a chunk that do not count: one to make so many.
const WARM_UP_SHARE: u64 = 20;
/// And these at least, or a paced chunk would begin with what the pause left cold.
const WARM_UP: u64 = 20;

/// What to measure.
#[derive(Args, Clone, Debug)]
pub struct LatencyOptions {
    /// Only the rows whose names contain this, e.g. "15 states"; may be given several times. The ratio at the end wants
    /// "plain iceoryx2 echo" and "estimate, 15 states".
    #[arg(long, value_name = "TEXT")]
    pub only: Vec<String>,
    /// Round trips per row at saturation; a twentieth for rows that are woken.
    #[arg(long, default_value_t = 200_000)]
    pub rounds: u64,
    /// Turns that the rows take: each is divided into so many chunks.
    #[arg(long, default_value_t = 4)]
    pub turns: u64,
    /// Length of each paced row, seconds, all turns together. At 200 Hz the default is 60 rounds:
    /// enough for a median; for p99.9 take 60.
    #[arg(long, default_value_t = 0.3)]
    pub seconds: f64,
    /// The two processors are threads of one core if the median of the raw cache-line ping-pong is
    /// below this, ns.
    #[arg(long, default_value_t = 220, value_name = "NS")]
    pub sibling_below_ns: u64,
    /// Measure everything a second time beside a busy neighbour: a process that streams through memory on every
    /// processor, at the lowest priority.
    #[arg(long)]
    pub neighbour: bool,
}

impl LatencyOptions {
    /// The cases that [`LatencyOptions::only`] lets through.
    fn cases(&self) -> anyhow::Result<Vec<Case>> {
        let is_wanted = |case: &Case| {
            let name = case.mechanism.name();
            self.only.is_empty() || self.only.iter().any(|text| name.contains(text))
        };
        let cases: Vec<Case> = CASES.into_iter().filter(is_wanted).collect();
        if cases.is_empty() {
            let names = CASES.map(|case| case.mechanism.name()).join("\n  ");
            bail!("--only lets no row through; there are\n  {names}");
        }
        Ok(cases)
    }
}

/// Measures every row, with a progress bar on standard error.
///
/// # Errors
/// An option is out of range, a partner process cannot be started or stops answering, or there is
/// one processor only.
pub fn measure(options: &LatencyOptions) -> anyhow::Result<Report> {
    ensure!(options.turns > 0, "--turns has to be 1 or more");
    ensure!(
        options.rounds >= options.turns,
        "--rounds has to be as many as --turns, or more"
    );
    ensure!(
        options.seconds > 0.0 && options.seconds <= 1e6,
        "--seconds has to be positive, and at most a million"
    );
    let processors = pin::processors()?;
    let [here, there, ..] = processors[..] else {
        bail!("two processors are needed: one for each of two spinning processes");
    };
    let mut machine = Machine::describe(processors.len(), [here, there]);
    pin::pin(None, here)?;
    let mut rows: Vec<Row> = options
        .cases()?
        .into_iter()
        .flat_map(|case| PACES.map(|pace| Row::new(case, pace)))
        .collect();
    let bar = progress("chunks", options.turns * rows.len() as u64);
    for _ in 0..options.turns {
        for rows in rows.chunks_mut(PACES.len()) {
            measure_case(rows, there, options, &bar)?;
        }
    }
    bar.finish_and_clear();
    pin::unpin(&processors)?;
    machine.finish();
    Ok(Report {
        rows,
        machine,
        options: options.clone(),
    })
}

/// One turn of a case: its rows are those of every pace, in order.
fn measure_case(
    rows: &mut [Row],
    cpu: usize,
    options: &LatencyOptions,
    bar: &ProgressBar,
) -> anyhow::Result<()> {
    let Some(case) = rows.first().map(|row| row.case) else {
        return Ok(());
    };
    let name = case.mechanism.name();
    let mut partner = case
        .start(cpu)
        .with_context(|| format!("measuring {name}"))?;
    let mut before = ping_pong(&mut *partner, cpu)?;
    for row in rows {
        let preempted = preemption::count(partner.process());
        let mut lengths = Lengths::new()?;
        let missed = match row.pace {
            Pace::Saturated => {
                let rounds = rounds_of(case.wait, options);
                saturated(&mut *partner, rounds, &mut lengths)?;
                0
            }
            Pace::Hz(rate) => {
                let seconds = options.seconds / options.turns as f64;
                paced(&mut *partner, rate, seconds, &mut lengths)?
            }
        };
        let preempted = preemption::count(partner.process()).saturating_sub(preempted);
        let after = ping_pong(&mut *partner, cpu)?;
        let placement = Placement::between(&before, &after, options.sibling_below_ns);
        let mut pings = before;
        pings.add(&after)?;
        let chunk = Chunk {
            rounds: lengths.rounds,
            inside: lengths.inside,
            missed,
            preempted,
            pings,
        };
        row.add(placement, &chunk)?;
        before = after;
        bar.inc(1);
    }
    Ok(())
}

/// Rounds of a chunk at saturation.
fn rounds_of(wait: Wait, options: &LatencyOptions) -> u64 {
    let share = match wait {
        Wait::Spin => 1,
        Wait::Event => EVENT_SHARE,
    };
    (options.rounds / options.turns / share).max(1)
}

fn warm_up(partner: &mut dyn RoundTrip, rounds: u64) -> anyhow::Result<()> {
    for _ in 0..WARM_UP.max(rounds / WARM_UP_SHARE) {
        partner.round()?;
    }
    Ok(())
}

/// What the rounds of a chunk took.
struct Lengths {
    rounds: Histogram<u64>,
    inside: Histogram<u64>,
}

impl Lengths {
    fn new() -> anyhow::Result<Self> {
        Ok(Self {
            rounds: histogram()?,
            inside: histogram()?,
        })
    }

    fn add_round(&mut self, partner: &mut dyn RoundTrip) -> anyhow::Result<()> {
        self.rounds.saturating_record(partner.round()?);
        if let Some(inside_ns) = partner.inside() {
            self.inside.saturating_record(inside_ns);
        }
        Ok(())
    }
}

/// One round after the other.
fn saturated(
    partner: &mut dyn RoundTrip,
    rounds: u64,
    lengths: &mut Lengths,
) -> anyhow::Result<()> {
    warm_up(partner, rounds)?;
    for _ in 0..rounds {
        lengths.add_round(partner)?;
    }
    Ok(())
}

/// Rounds at `rate` a second, for `seconds`. Returns how many times for one passed during another. This
/// side waits awake, so that what is measured is how the partner gets on with the pause.
fn paced(
    partner: &mut dyn RoundTrip,
    rate: u32,
    seconds: f64,
    lengths: &mut Lengths,
) -> anyhow::Result<u64> {
    warm_up(partner, 0)?;
    let period_ns = 1_000_000_000 / u64::from(rate);
    let times = ((seconds * f64::from(rate)) as u64).max(1);
    let start_ns = monotonic_ns();
    let mut missed = 0;
    for time in 1..=times {
        let due_ns = start_ns + time * period_ns;
        // Its time is over: the next is due already.
        if monotonic_ns() > due_ns + period_ns {
            missed += 1;
            continue;
        }
        while monotonic_ns() < due_ns {
            std::hint::spin_loop();
        }
        lengths.add_round(partner)?;
    }
    Ok(missed)
}
