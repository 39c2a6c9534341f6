//! The estimation loop: one thread, bounded waits, no allocation between a sample and its estimate.
//!
//! Motion samples come first; before each, the fixes that are due by its stamp and were sent before
//! it, while later ones stay in their queue (so what a sender gets does not depend on how far ahead
//! it is). Everything else is a chore: late fixes that came alone, requests (each after every input
//! sent before it), health. A spinning loop does one chore between two looks at the samples, so
//! that none of them finds the loop busy with more than that.

use core::sync::atomic::{AtomicBool, Ordering};
use core::time::Duration;

use anyhow::Context;
use inekf_shared::clock::monotonic_ns;
use inekf_shared::message::{EstimateMessage, REASON_WRONG_MODEL};
use inekf_shared::transport::InputMessage;

use super::control::answer;
use super::ports::{EstimatePort, Inputs, Ports};
use super::watch::{Moment, Watch};
use crate::config::Config;
use crate::engine::tally::Refusal;
use crate::engine::{Engine, History, Model};

/// A topic of fixes.
#[derive(Clone, Copy)]
enum Aid {
    Position,
    Velocity,
    Heading,
}

/// What there is to do beside samples, in turn.
#[derive(Clone, Copy)]
enum Chore {
    /// Fixes that came after the samples they belong to.
    Late(Aid),
    /// What the engine has put off so as not to hold up a sample.
    Settle,
    Requests,
    Health,
}

const AIDS: [Aid; 3] = [Aid::Position, Aid::Velocity, Aid::Heading];
const CHORES: [Chore; 6] = [
    Chore::Late(Aid::Position),
    Chore::Late(Aid::Velocity),
    Chore::Late(Aid::Heading),
    Chore::Settle,
    Chore::Requests,
    Chore::Health,
];

/// Runs until `stop` is set.
///
/// # Errors
/// A port that fails for good. What a sender wrote is never an error.
pub fn run<M: Model, H: History<M>>(
    engine: &mut Engine<M, H>,
    ports: &mut Ports<M>,
    config: &Config,
    stop: &AtomicBool,
) -> anyhow::Result<()> {
    let mut watch = Watch::new(
        monotonic_ns(),
        config.health.period_ns(),
        config.health.stale_after_ns(),
    );
    let bound = config.runtime.event_timeout();
    let mut turns = CHORES.into_iter().cycle();
    while !stop.load(Ordering::Relaxed) {
        let newest_ns = take_samples(engine, ports)?;
        if let Some(received_ns) = newest_ns {
            watch.arrival(received_ns);
        }
        match &ports.wake {
            None => {
                if let Some(chore) = turns.next() {
                    attend(chore, engine, ports, &mut watch)?;
                }
                core::hint::spin_loop();
            }
            Some(_) => {
                for chore in CHORES {
                    attend(chore, engine, ports, &mut watch)?;
                }
                if newest_ns.is_none() {
                    sleep(ports, bound)?;
                }
            }
        }
    }
    Ok(())
}

/// Takes the samples that have arrived, each after the fixes due by it. Returns when the last one
/// was received, if any was.
fn take_samples<M: Model, H: History<M>>(
    engine: &mut Engine<M, H>,
    ports: &mut Ports<M>,
) -> anyhow::Result<Option<u64>> {
    let (inputs, outbox) = (&mut ports.inputs, &mut ports.estimates);
    let mut last_ns = None;
    while let Some(sample) = inputs.samples.receive().context("receiving samples")? {
        let received_ns = monotonic_ns();
        take_fixes(engine, inputs, sample.payload().header().stamp_ns, outbox)?;
        engine.sample(&sample, received_ns, outbox);
        ports.smoothed.publish_left(engine);
        last_ns = Some(received_ns);
    }
    Ok(last_ns)
}

/// Does one chore. Before the first sample no fix is due.
fn attend<M: Model, H: History<M>>(
    chore: Chore,
    engine: &mut Engine<M, H>,
    ports: &mut Ports<M>,
    watch: &mut Watch,
) -> anyhow::Result<()> {
    match (chore, engine.last_sample_ns()) {
        (Chore::Late(aid), Some(now_ns)) => {
            take(aid, engine, &mut ports.inputs, now_ns, &mut ports.estimates)?;
        }
        (Chore::Settle, Some(_)) => {
            engine.settle(&mut ports.estimates);
            ports.smoothed.publish_left(engine);
        }
        (Chore::Late(_) | Chore::Settle, None) => {}
        (Chore::Requests, _) => answer_requests(engine, ports)?,
        (Chore::Health, _) => {
            let now_ns = monotonic_ns();
            if watch.is_due(now_ns) {
                report(engine, ports, watch, now_ns);
            }
        }
    }
    Ok(())
}

/// Takes the fixes up to `horizon_ns`.
fn take_fixes<M: Model, H: History<M>>(
    engine: &mut Engine<M, H>,
    inputs: &mut Inputs<M::Sample>,
    horizon_ns: u64,
    outbox: &mut EstimatePort<M::Estimate>,
) -> anyhow::Result<()> {
    for aid in AIDS {
        take(aid, engine, inputs, horizon_ns, outbox)?;
    }
    Ok(())
}

/// Takes those of one topic.
fn take<M: Model, H: History<M>>(
    aid: Aid,
    engine: &mut Engine<M, H>,
    inputs: &mut Inputs<M::Sample>,
    horizon_ns: u64,
    outbox: &mut EstimatePort<M::Estimate>,
) -> anyhow::Result<()> {
    match aid {
        Aid::Position => {
            while let Some(fix) = inputs.position.next_until(horizon_ns)? {
                engine.position(&fix, outbox);
            }
        }
        Aid::Velocity => {
            while let Some(fix) = inputs.velocity.next_until(horizon_ns)? {
                engine.velocity(&fix, outbox);
            }
        }
        Aid::Heading => {
            while let Some(fix) = inputs.heading.next_until(horizon_ns)? {
                engine.heading(&fix, outbox);
            }
        }
    }
    Ok(())
}

fn answer_requests<M: Model, H: History<M>>(
    engine: &mut Engine<M, H>,
    ports: &mut Ports<M>,
) -> anyhow::Result<()> {
    while let Some(request) = ports.control.receive().context("receiving a request")? {
        take_samples(engine, ports)?;
        if let Some(now_ns) = engine.last_sample_ns() {
            take_fixes(engine, &mut ports.inputs, now_ns, &mut ports.estimates)?;
            engine.settle(&mut ports.estimates);
            ports.smoothed.publish_left(engine);
        }
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

/// Sleeps until woken, but never longer than `bound`. Every sleep is followed by a look at all
/// inputs, so a lost wake-up costs at most the bound.
fn sleep<M: Model>(ports: &Ports<M>, bound: Duration) -> anyhow::Result<()> {
    if let Some(listener) = &ports.wake {
        listener.wait(bound).context("waiting for a wake-up")?;
    }
    Ok(())
}
