//! The estimation loop: one thread, bounded waits, no allocation between a sample and its estimate.
//!
//! Order of work: motion samples first; before each, the fixes that are due by its stamp and were
//! sent before it, while later ones stay in their queue (so what a sender gets does not depend on
//! how far ahead it is); then late fixes that came alone; then requests, each after every input
//! sent before it; then health.

use core::sync::atomic::{AtomicBool, Ordering};
use core::time::Duration;

use anyhow::Context;
use inekf_shared::clock::monotonic_ns;
use inekf_shared::message::{
    EstimateMessage, HEALTH_NOT_RESUMED, HEALTH_RESUMED, INPUT_HEADING, INPUT_POSITION,
    INPUT_VELOCITY, Message, REASON_WRONG_MODEL,
};
use inekf_shared::transport::{InputMessage, WakeListener};

use super::control::answer;
use super::journal::JournalPort;
use super::ports::{EstimatePort, Inputs, Ports, Refuser};
use super::watch::{Moment, Watch};
use crate::checkpoint::Keeper;
use crate::config::Config;
use crate::engine::resume::Resumption;
use crate::engine::tally::Refusal;
use crate::engine::{Engine, History, Model};

/// Empty looks at the inputs between two looks at the clock in spin mode.
const SPINS_PER_LOOK: u32 = 64;

/// What the loop is told once.
#[derive(Clone, Copy, Debug)]
pub struct Terms<'a> {
    /// The configuration.
    pub config: &'a Config,
    /// Its text.
    pub config_text: &'a str,
    /// Whether inputs come in requests, one by one, and the topics are not read.
    pub stepped: bool,
    /// Whether there was a checkpoint that was of no use from the outset.
    pub unused_checkpoint: bool,
}

/// Runs until `stop` is set. Checkpoints go to `keeper`.
///
/// # Errors
/// A port that fails for good. What a sender wrote is never an error.
pub fn run<M: Model, H: History<M>>(
    engine: &mut Engine<M, H>,
    ports: &mut Ports<M>,
    terms: &Terms<'_>,
    mut keeper: Option<&mut Keeper>,
    stop: &AtomicBool,
) -> anyhow::Result<()> {
    let config = terms.config;
    let mut watch = Watch::new(
        monotonic_ns(),
        config.health.period_ns(),
        config.health.stale_after_ns(),
    );
    let bound = config.runtime.event_timeout();
    while !stop.load(Ordering::Relaxed) {
        let samples = match terms.stepped {
            true => 0,
            false => take_inputs(engine, ports)?,
        };
        let now_ns = monotonic_ns();
        if samples > 0 {
            watch.arrival(now_ns);
        }
        answer_requests(engine, ports, terms)?;
        if let Some(keeper) = &mut keeper {
            keeper.keep(now_ns, || engine.snapshot());
        }
        if watch.is_due(now_ns) {
            let written = keeper.as_ref().map_or((0, 0), |keeper| keeper.counts());
            report(engine, ports, terms, written, &mut watch, now_ns);
        }
        if samples == 0 {
            wait(ports.wake.as_ref(), bound)?;
        }
    }
    Ok(())
}

/// Takes everything that has arrived and is due. Returns the number of motion samples.
fn take_inputs<M: Model, H: History<M>>(
    engine: &mut Engine<M, H>,
    ports: &mut Ports<M>,
) -> anyhow::Result<u32> {
    let (inputs, outbox, journal) = (&mut ports.inputs, &mut ports.estimates, &mut ports.journal);
    let mut samples = 0;
    while let Some(sample) = inputs.samples.receive().context("receiving samples")? {
        let received_ns = monotonic_ns();
        let stamp_ns = sample.payload().header().stamp_ns;
        take_fixes(engine, inputs, stamp_ns, outbox, journal)?;
        engine.sample(&sample, received_ns, outbox);
        journal.input(engine.estimates(), M::INPUT, sample.payload().as_bytes());
        ports.smoothed.publish_left(engine);
        samples += 1;
    }
    // Fixes that came after the samples they belong to; before the first sample none is due.
    if let Some(now_ns) = engine.last_sample_ns() {
        take_fixes(engine, inputs, now_ns, outbox, journal)?;
        settle(engine, outbox, journal);
        ports.smoothed.publish_left(engine);
    }
    Ok(samples)
}

/// Takes in the fixes that were put off.
fn settle<M: Model, H: History<M>>(
    engine: &mut Engine<M, H>,
    outbox: &mut EstimatePort<M::Estimate>,
    journal: &mut JournalPort,
) {
    if !journal.is_on() {
        return engine.settle(outbox);
    }
    let waiting = engine.waiting();
    engine.settle(outbox);
    if engine.waiting() != waiting {
        journal.settled(engine.estimates());
    }
}

/// Takes the fixes up to `horizon_ns`.
fn take_fixes<M: Model, H: History<M>>(
    engine: &mut Engine<M, H>,
    inputs: &mut Inputs<M::Sample>,
    horizon_ns: u64,
    outbox: &mut EstimatePort<M::Estimate>,
    journal: &mut JournalPort,
) -> anyhow::Result<()> {
    while let Some(fix) = inputs.position.next_until(horizon_ns)? {
        engine.position(&fix, outbox);
        journal.input(engine.estimates(), INPUT_POSITION, fix.as_bytes());
    }
    while let Some(fix) = inputs.velocity.next_until(horizon_ns)? {
        engine.velocity(&fix, outbox);
        journal.input(engine.estimates(), INPUT_VELOCITY, fix.as_bytes());
    }
    while let Some(fix) = inputs.heading.next_until(horizon_ns)? {
        engine.heading(&fix, outbox);
        journal.input(engine.estimates(), INPUT_HEADING, fix.as_bytes());
    }
    Ok(())
}

fn answer_requests<M: Model, H: History<M>>(
    engine: &mut Engine<M, H>,
    ports: &mut Ports<M>,
    terms: &Terms<'_>,
) -> anyhow::Result<()> {
    while let Some(request) = ports.control.receive().context("receiving a request")? {
        if !terms.stepped {
            take_inputs(engine, ports)?;
        }
        let response = answer(
            engine,
            &request,
            terms,
            &mut ports.estimates,
            &mut ports.smoothed,
        );
        ports.journal.request(engine.estimates(), &request);
        // A client that is gone by now has nobody to be answered.
        let _ = request.send_copy(response);
        // A window that a request has ended.
        ports.smoothed.publish_left(engine);
    }
    Ok(())
}

/// Publishes health, and counts what no other loop looks at: the samples of other models.
fn report<M: Model, H: History<M>>(
    engine: &mut Engine<M, H>,
    ports: &mut Ports<M>,
    terms: &Terms<'_>,
    (checkpoints, checkpoint_failures): (u64, u64),
    watch: &mut Watch,
    now_ns: u64,
) {
    ports.inputs.foreign.drain(&mut Foreigners {
        engine,
        journal: &mut ports.journal,
    });
    let moment = Moment {
        now_ns,
        model: M::Estimate::MODEL,
        state: engine.state(),
        last_sample_ns: engine.last_sample_ns().unwrap_or(0),
        failures: ports.estimates.failures + ports.smoothed.failures,
        flags: match engine.resumption() {
            Resumption::Resumed { .. } => HEALTH_RESUMED,
            Resumption::None | Resumption::Waiting if !terms.unused_checkpoint => 0,
            _ => HEALTH_NOT_RESUMED,
        },
        resumption: engine.resumption(),
        checkpoints,
        checkpoint_failures,
        journal_failures: ports.journal.failures,
    };
    let arrivals = engine.tally().received[M::INPUT];
    let health = watch.report(&moment, arrivals, engine.tally());
    if let Ok(sample) = ports.health.loan_uninit() {
        // Nobody has to listen.
        let _ = sample.write_payload(health).send();
    }
}

/// Refuses and notes the motion samples of other models.
struct Foreigners<'a, M: Model, H> {
    engine: &'a mut Engine<M, H>,
    journal: &'a mut JournalPort,
}

impl<M: Model, H: History<M>> Refuser for Foreigners<'_, M, H> {
    fn refuse<S: InputMessage>(&mut self, input: usize, sample: &S) {
        self.engine
            .refuse(input, sample.header(), Refusal(REASON_WRONG_MODEL));
        self.journal
            .input(self.engine.estimates(), input, sample.as_bytes());
    }
}

/// Waits for work: spinning, or for a wake-up but never longer than `bound`. Every wait is
/// followed by a look at all inputs, so a lost wake-up costs at most the bound.
fn wait(wake: Option<&WakeListener>, bound: Duration) -> anyhow::Result<()> {
    match wake {
        None => {
            for _ in 0..SPINS_PER_LOOK {
                core::hint::spin_loop();
            }
        }
        Some(listener) => {
            listener.wait(bound).context("waiting for a wake-up")?;
        }
    }
    Ok(())
}
