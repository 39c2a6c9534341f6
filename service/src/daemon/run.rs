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
    EstimateMessage, INPUT_HEADING, INPUT_POSITION, INPUT_VELOCITY, REASON_WRONG_MODEL,
};
use inekf_shared::transport::{InputMessage, WakeListener};

use super::control::answer;
use super::ports::{EstimatePort, Inputs, Ports};
use super::watch::{Moment, Watch};
use crate::config::Config;
use crate::engine::tally::Refusal;
use crate::engine::{Engine, History, Model};

/// Empty looks at the inputs between two looks at the clock in spin mode.
const SPINS_PER_LOOK: u32 = 64;

/// Why the loop ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Ended {
    /// It was asked to stop.
    Stopped,
    /// Somebody has removed files of the ports: what is attached goes on, but nobody can attach any more. The ports
    /// have to be opened anew.
    FilesGone,
}

/// Runs until `stop` is set, or until the ports have to be opened anew.
///
/// # Errors
/// A port that fails for good. What a sender wrote is never an error.
pub fn run<M: Model, H: History<M>>(
    engine: &mut Engine<M, H>,
    ports: &mut Ports<M>,
    config: &Config,
    stop: &AtomicBool,
) -> anyhow::Result<Ended> {
    let mut watch = Watch::new(
        monotonic_ns(),
        engine.tally().received[M::INPUT],
        config.health.period_ns(),
        config.health.stale_after_ns(),
    );
    let bound = config.runtime.event_timeout();
    while !stop.load(Ordering::Relaxed) {
        if ports.have_lost_files() {
            return Ok(Ended::FilesGone);
        }
        let samples = take_inputs(engine, ports)?;
        let now_ns = monotonic_ns();
        if samples > 0 {
            watch.arrival(now_ns);
        }
        answer_requests(engine, ports)?;
        if watch.is_due(now_ns) {
            report(engine, ports, &mut watch, now_ns);
        }
        if samples == 0 {
            wait(ports.wake.as_ref(), bound)?;
        }
    }
    // What waits for samples that will not come is counted too.
    take_inputs(engine, ports)?;
    take_fixes(engine, &mut ports.inputs, u64::MAX, &mut ports.estimates)?;
    engine.finish(&mut ports.estimates);
    report(engine, ports, &mut watch, monotonic_ns());
    Ok(Ended::Stopped)
}

/// Takes everything that has arrived and is due. Returns the number of motion samples.
fn take_inputs<M: Model, H: History<M>>(
    engine: &mut Engine<M, H>,
    ports: &mut Ports<M>,
) -> anyhow::Result<u32> {
    let (inputs, outbox) = (&mut ports.inputs, &mut ports.estimates);
    let mut samples = 0;
    while let Some(sample) = inputs.samples.receive().context("receiving samples")? {
        let received_ns = monotonic_ns();
        take_fixes(engine, inputs, sample.payload().header().stamp_ns, outbox)?;
        engine.sample(&sample, received_ns, outbox);
        ports.smoothed.publish_left(engine);
        samples += 1;
    }
    // Fixes that came after the samples they belong to; before the first sample none is due.
    if let Some(now_ns) = engine.last_sample_ns() {
        take_fixes(engine, inputs, now_ns, outbox)?;
        engine.settle(outbox);
        ports.smoothed.publish_left(engine);
    }
    Ok(samples)
}

/// Takes the fixes up to `horizon_ns`.
fn take_fixes<M: Model, H: History<M>>(
    engine: &mut Engine<M, H>,
    inputs: &mut Inputs<M::Sample>,
    horizon_ns: u64,
    outbox: &mut EstimatePort<M::Estimate>,
) -> anyhow::Result<()> {
    while let Some(fix) = inputs
        .position
        .next_until(horizon_ns, |header| engine.announce(INPUT_POSITION, header))?
    {
        engine.position(&fix, outbox);
    }
    while let Some(fix) = inputs
        .velocity
        .next_until(horizon_ns, |header| engine.announce(INPUT_VELOCITY, header))?
    {
        engine.velocity(&fix, outbox);
    }
    while let Some(fix) = inputs
        .heading
        .next_until(horizon_ns, |header| engine.announce(INPUT_HEADING, header))?
    {
        engine.heading(&fix, outbox);
    }
    Ok(())
}

fn answer_requests<M: Model, H: History<M>>(
    engine: &mut Engine<M, H>,
    ports: &mut Ports<M>,
) -> anyhow::Result<()> {
    while let Some(request) = ports.control.receive().context("receiving a request")? {
        take_inputs(engine, ports)?;
        let response = answer(engine, &request, &mut ports.smoothed);
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
    watch: &mut Watch,
    now_ns: u64,
) {
    ports.inputs.foreign.drain(|input, header| {
        engine.refuse(input, header, Refusal(REASON_WRONG_MODEL));
    });
    let moment = Moment {
        now_ns,
        model: M::Estimate::MODEL,
        state: engine.state(),
        last_sample_ns: engine.last_sample_ns().unwrap_or(0),
        failures: ports.estimates.failures + ports.smoothed.failures,
    };
    let arrivals = engine.tally().received[M::INPUT];
    let health = watch.report(&moment, arrivals, engine.tally());
    if let Ok(sample) = ports.health.loan_uninit() {
        // Nobody has to listen.
        let _ = sample.write_payload(health).send();
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
