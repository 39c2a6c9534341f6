//! Round trips between two pinned, spinning processes, one at a time (saturation).
//!
//! Every mechanism runs in chunks that take turns, so that a change of the machine's speed or
//! placement meets all of them alike; each chunk of turns begins with a raw cache-line ping-pong
//! between the same two processors. What matters are the ratios.

pub mod cache_line;
pub mod echo;
pub mod estimate;
pub mod report;

use anyhow::bail;
use hdrhistogram::Histogram;

pub use report::Row;

use crate::pin;

/// What to measure.
#[derive(Clone, Copy, Debug)]
pub struct LatencyOptions {
    /// Round trips per row.
    pub rounds: u64,
    /// Turns they are divided into.
    pub turns: u64,
}

/// Something that answers, measured from this process.
pub trait RoundTrip {
    /// Name of the row.
    fn name(&self) -> &'static str;

    /// One round trip; returns its length, ns.
    ///
    /// # Errors
    /// The other side does not answer.
    fn round(&mut self) -> anyhow::Result<u64>;
}

/// Measures every row.
///
/// # Errors
/// A partner process cannot be started or stops answering, or there is one processor only.
pub fn measure(options: &LatencyOptions) -> anyhow::Result<Vec<Row>> {
    let processors = pin::processors()?;
    let [here, there, ..] = processors[..] else {
        bail!("two processors are needed: one for each of two spinning processes");
    };
    pin::pin(None, here)?;
    // One partner runs at a time: the others would take its processor.
    let mut rows = Vec::new();
    let per_turn = (options.rounds / options.turns).max(1);
    let names: [&'static str; 4] = [
        cache_line::NAME,
        echo::NAME,
        estimate::NAME_9,
        estimate::NAME_15,
    ];
    let mut histograms = Vec::new();
    for _ in names {
        histograms.push(Histogram::<u64>::new_with_bounds(1, 10_000_000_000, 3)?);
    }
    for _ in 0..options.turns {
        for (name, histogram) in names.into_iter().zip(&mut histograms) {
            let mut partner: Box<dyn RoundTrip> = match name {
                cache_line::NAME => Box::new(cache_line::CacheLine::start(there)),
                echo::NAME => Box::new(echo::Echo::start(there)?),
                estimate::NAME_9 => Box::new(estimate::Estimate::start(there, false)?),
                _ => Box::new(estimate::Estimate::start(there, true)?),
            };
            for _ in 0..per_turn / 20 {
                partner.round()?;
            }
            for _ in 0..per_turn {
                histogram.saturating_record(partner.round()?);
            }
        }
    }
    for (name, histogram) in names.into_iter().zip(histograms) {
        rows.push(Row { name, histogram });
    }
    Ok(rows)
}
