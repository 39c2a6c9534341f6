//! One vehicle: an engine between its ports, and everything that is done with them.
//!
//! Motion samples come first; before each, the fixes that are due by its stamp and were sent before
//! it, while later ones stay in their queue (so what a sender gets does not depend on how far ahead
//! it is). Everything else is a chore: late fixes that came alone, requests (each after every input
//! sent before it), checkpoint, health. A loop that spins does one chore between some looks at the
//! samples, so that none of them finds it busy with more than that.

use core::time::Duration;
use std::rc::Rc;

use anyhow::Context;
use inekf_shared::clock::monotonic_ns;
use inekf_shared::message::{
    CONTROL_REFUSED, EstimateMessage, HEALTH_NOT_RESUMED, HEALTH_RESUMED, INPUT_HEADING,
    INPUT_POSITION, INPUT_VELOCITY, Message, REASON_WRONG_MODEL,
};
use inekf_shared::topic::Instance;
use inekf_shared::transport::{InputMessage, Node};

use super::control::{answer, take};
use super::journal::JournalPort;
use super::ports::{Ports, Refuser};
use super::run::{Closed, StillClosed, Turn, Work};
use super::watch::{Moment, Watch};
use crate::checkpoint::Keeper;
use crate::config::Config;
use crate::engine::resume::Resumption;
use crate::engine::tally::Refusal;
use crate::engine::{Engine, History, Model};

/// Looks at the samples of a loop that spins between two chores: a sample rarely finds it at one, and every chore has
/// its turn within microseconds.
const LOOKS_PER_CHORE: usize = 4;

/// What a vehicle is told once.
///
/// ```
#[doc = include_str!("../engine/example.txt")]
/// use inekf_service::daemon::{SmoothedPort, Terms, answer};
///
/// # let config = Config::from_toml_str(CONFIG, "example")?;
/// let terms = Terms { config: &config, config_text: CONFIG, stepped: false, unused_checkpoint: false };
/// // What a client is told that asks for the configuration.
/// let request = ControlRequest { kind: CONTROL_CONFIG, ..ControlRequest::ZERO };
/// let response = answer(&mut engine, &request, &terms, &mut estimates, &mut SmoothedPort::closed());
/// assert!(CONFIG.starts_with(response.reason()) && !response.reason().is_empty());
/// # Ok::<(), inekf_service::config::ConfigFaults>(())
/// ```
#[derive(Clone, Copy, Debug)]
pub struct Terms<'a> {
    /// The configuration.
    pub config: &'a Config,
    /// Its text.
    pub config_text: &'a str,
    /// Whether inputs come as entries of a journal, and their own topics are not read.
    pub stepped: bool,
    /// Whether there was a checkpoint that was of no use from the outset.
    pub unused_checkpoint: bool,
}

/// An engine between its ports.
///
/// ```
#[doc = include_str!("example.txt")]
/// let ports = Ports::open_on(Rc::clone(&node), &car, &config, false)?;
/// let mut vehicles = [Box::new(Vehicle::new(engine, ports, terms, None))];
/// // A loop does the rest.
/// let (guard, stop) = (Guard::of(Watched::of(&node)?), AtomicBool::new(true));
/// assert_eq!(run(&mut vehicles, &config.runtime, &guard, &stop)?, Ended::Stopped);
/// # Ok::<(), anyhow::Error>(())
/// ```
pub struct Vehicle<'a, M: Model, H> {
    engine: Engine<M, H>,
    ports: Ports<M>,
    terms: Terms<'a>,
    keeper: Option<Keeper>,
    watch: Watch,
    /// Looks so far: whose turn it is.
    turns: usize,
}

/// An engine without ports.
struct ClosedVehicle<'a, M: Model, H> {
    engine: Engine<M, H>,
    terms: Terms<'a>,
    keeper: Option<Keeper>,
}

impl<'a, M: Model + 'static, H: History<M> + 'static> Closed<'a> for ClosedVehicle<'a, M, H> {
    fn open(
        self: Box<Self>,
        node: Rc<Node>,
        instance: &Instance,
    ) -> Result<Box<dyn Work<'a> + 'a>, StillClosed<'a>> {
        match Ports::open_on(node, instance, self.terms.config, self.terms.stepped) {
            Ok(ports) => {
                let Self {
                    engine,
                    terms,
                    keeper,
                } = *self;
                Ok(Box::new(Vehicle::new(engine, ports, terms, keeper)))
            }
            Err(error) => Err((self, error.into())),
        }
    }

    fn finish(self: Box<Self>) {
        if let Some(keeper) = self.keeper {
            keeper.finish(self.engine.snapshot());
        }
    }
}

/// A watch that begins now.
fn watch<M: Model, H: History<M>>(engine: &Engine<M, H>, config: &Config) -> Watch {
    Watch::new(
        monotonic_ns(),
        engine.tally().received[M::INPUT],
        config.health.period_ns(),
        config.health.stale_after_ns(),
    )
}

/// A topic of fixes.
#[derive(Clone, Copy)]
enum Aid {
    Position,
    Velocity,
    Heading,
}

/// What there is to do beside samples.
#[derive(Clone, Copy)]
enum Chore {
    /// Fixes that came after the samples they belong to.
    Late(Aid),
    /// What the engine has put off so as not to hold up a sample.
    Settle,
    Requests,
    /// What the clock asks for: checkpoint and health.
    Clock,
}

const AIDS: [Aid; 3] = [Aid::Position, Aid::Velocity, Aid::Heading];
const CHORES: [Chore; 6] = [
    Chore::Late(Aid::Position),
    Chore::Late(Aid::Velocity),
    Chore::Late(Aid::Heading),
    Chore::Settle,
    Chore::Requests,
    Chore::Clock,
];

impl<'a, M: Model, H: History<M>> Vehicle<'a, M, H> {
    /// A vehicle that is ready for its first sample. Checkpoints go to `keeper`.
    ///
    /// ```
    #[doc = include_str!("example.txt")]
    /// use inekf_shared::transport::inspect;
    ///
    /// let ports = Ports::open_on(node, &car, &config, false)?;
    /// let vehicle = Vehicle::new(engine, ports, terms, None);
    /// assert!(!inspect::shared_memory_files(&memory)?.is_empty());
    /// // With it goes all that is its own in shared memory, for the node is its own by now.
    /// drop(vehicle);
    /// assert!(inspect::shared_memory_files(&memory)?.is_empty());
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn new(
        engine: Engine<M, H>,
        ports: Ports<M>,
        terms: Terms<'a>,
        keeper: Option<Keeper>,
    ) -> Self {
        Self {
            watch: watch(&engine, terms.config),
            engine,
            ports,
            terms,
            keeper,
            turns: 0,
        }
    }

    /// Takes the samples that have arrived, each after the fixes due by it. True if there were any.
    fn take_samples(&mut self) -> anyhow::Result<bool> {
        let mut any = false;
        while let Some(sample) = self
            .ports
            .inputs
            .samples
            .receive()
            .context("receiving samples")?
        {
            let received_ns = monotonic_ns();
            self.take_fixes(sample.payload().header().stamp_ns)?;
            self.engine
                .sample(&sample, received_ns, &mut self.ports.estimates);
            let estimates = self.engine.estimates();
            self.ports
                .journal
                .input(estimates, M::INPUT, sample.payload().as_bytes());
            self.ports.smoothed.publish_left(&mut self.engine);
            self.watch
                .arrival(received_ns, sample.payload().header().sent_ns);
            any = true;
        }
        Ok(any)
    }

    /// Does one chore. Before the first sample no fix is due.
    fn attend(&mut self, chore: Chore) -> anyhow::Result<()> {
        match (chore, self.engine.last_sample_ns()) {
            (Chore::Late(aid), Some(now_ns)) if !self.terms.stepped => self.take(aid, now_ns)?,
            (Chore::Settle, Some(_)) if !self.terms.stepped => self.settle(),
            (Chore::Late(_) | Chore::Settle, _) => {}
            (Chore::Requests, _) => self.answer_requests()?,
            (Chore::Clock, _) => self.look_at_clock(),
        }
        Ok(())
    }

    /// Takes the fixes up to `horizon_ns` of the topics that can have any; what comes on the others is refused as a
    /// chore.
    fn take_fixes(&mut self, horizon_ns: u64) -> anyhow::Result<()> {
        for aid in AIDS {
            let inputs = &self.ports.inputs;
            let is_used = match aid {
                Aid::Position => inputs.position.is_used(),
                Aid::Velocity => inputs.velocity.is_used(),
                Aid::Heading => inputs.heading.is_used(),
            };
            if is_used {
                self.take(aid, horizon_ns)?;
            }
        }
        Ok(())
    }

    /// Takes those of one topic.
    fn take(&mut self, aid: Aid, horizon_ns: u64) -> anyhow::Result<()> {
        let Self {
            engine,
            ports,
            watch,
            ..
        } = self;
        let (inputs, outbox, journal) =
            (&mut ports.inputs, &mut ports.estimates, &mut ports.journal);
        match aid {
            Aid::Position => {
                while let Some(fix) = inputs
                    .position
                    .next_until(horizon_ns, |header| engine.announce(INPUT_POSITION, header))?
                {
                    watch.delivery(INPUT_POSITION, fix.source, monotonic_ns());
                    engine.position(&fix, outbox);
                    journal.input(engine.estimates(), INPUT_POSITION, fix.as_bytes());
                }
            }
            Aid::Velocity => {
                while let Some(fix) = inputs
                    .velocity
                    .next_until(horizon_ns, |header| engine.announce(INPUT_VELOCITY, header))?
                {
                    watch.delivery(INPUT_VELOCITY, fix.source, monotonic_ns());
                    engine.velocity(&fix, outbox);
                    journal.input(engine.estimates(), INPUT_VELOCITY, fix.as_bytes());
                }
            }
            Aid::Heading => {
                while let Some(fix) = inputs
                    .heading
                    .next_until(horizon_ns, |header| engine.announce(INPUT_HEADING, header))?
                {
                    watch.delivery(INPUT_HEADING, fix.source, monotonic_ns());
                    engine.heading(&fix, outbox);
                    journal.input(engine.estimates(), INPUT_HEADING, fix.as_bytes());
                }
            }
        }
        Ok(())
    }

    /// Takes in the fixes that were put off.
    fn settle(&mut self) {
        let Self { engine, ports, .. } = self;
        if ports.journal.is_on() {
            let waiting = engine.waiting();
            engine.settle(&mut ports.estimates);
            if engine.waiting() != waiting {
                ports.journal.settled(engine.estimates());
            }
        } else {
            engine.settle(&mut ports.estimates);
        }
        ports.smoothed.publish_left(engine);
    }

    /// Takes the entries of a journal that were sent before a request; why the first that is none is none.
    fn take_entries(&mut self) -> anyhow::Result<Option<&'static str>> {
        let Self {
            engine,
            ports,
            terms,
            ..
        } = self;
        let mut fault = None;
        let Some(entries) = &ports.entries else {
            return Ok(fault);
        };
        while let Some(entry) = entries.receive().context("receiving an entry")? {
            let estimates = &mut ports.estimates;
            if let Err(reason) = take(engine, entry.kind, entry.message(), terms, estimates) {
                fault = fault.or(Some(reason));
            }
            ports.smoothed.publish_left(engine);
        }
        Ok(fault)
    }

    fn answer_requests(&mut self) -> anyhow::Result<()> {
        while let Some(request) = self
            .ports
            .control
            .receive()
            .context("receiving a request")?
        {
            let mut fault = None;
            if self.terms.stepped {
                fault = self.take_entries()?;
            } else {
                self.take_samples()?;
                if let Some(now_ns) = self.engine.last_sample_ns() {
                    for aid in AIDS {
                        self.take(aid, now_ns)?;
                    }
                    self.settle();
                }
            }
            let Self { engine, ports, .. } = self;
            let mut response = answer(
                engine,
                &request,
                &self.terms,
                &mut ports.estimates,
                &mut ports.smoothed,
            );
            if let Some(reason) = fault {
                response.status = CONTROL_REFUSED;
                response.set_reason(reason);
            }
            ports.journal.request(engine.estimates(), &request);
            // A client that is gone by now has nobody to be answered.
            let _ = request.send_copy(response);
            // A window that a request has ended.
            ports.smoothed.publish_left(engine);
        }
        Ok(())
    }

    fn look_at_clock(&mut self) {
        let now_ns = monotonic_ns();
        if let Some(keeper) = &mut self.keeper {
            keeper.keep(now_ns, || self.engine.snapshot());
        }
        if self.watch.is_due(now_ns) {
            self.report(now_ns);
        }
    }

    /// Publishes health, and counts what nobody else looks at: the samples of other models.
    fn report(&mut self, now_ns: u64) {
        let Self { engine, ports, .. } = self;
        ports.inputs.foreign.drain(&mut Foreigners {
            engine,
            journal: &mut ports.journal,
        });
        let (checkpoints, checkpoint_failures) =
            self.keeper.as_ref().map_or((0, 0), Keeper::counts);
        let moment = Moment {
            now_ns,
            model: M::Estimate::MODEL,
            state: engine.state(),
            last_sample_ns: engine.last_sample_ns().unwrap_or(0),
            failures: ports.estimates.failures + ports.smoothed.failures,
            flags: match engine.resumption() {
                Resumption::Resumed { .. } => HEALTH_RESUMED,
                Resumption::None | Resumption::Waiting if !self.terms.unused_checkpoint => 0,
                _ => HEALTH_NOT_RESUMED,
            },
            resumption: engine.resumption(),
            checkpoints,
            checkpoint_failures,
            journal_failures: ports.journal.failures,
        };
        let arrivals = engine.tally().received[M::INPUT];
        let health = self.watch.report(&moment, arrivals, engine.tally());
        if let Ok(sample) = ports.health.loan_uninit() {
            // Nobody has to listen.
            let _ = sample.write_payload(health).send();
        }
    }
}

impl<'a, M: Model + 'static, H: History<M> + 'static> Work<'a> for Vehicle<'a, M, H> {
    fn turn(&mut self) -> anyhow::Result<Turn> {
        let any = !self.terms.stepped && self.take_samples()?;
        self.turns = (self.turns + 1) % (CHORES.len() * LOOKS_PER_CHORE);
        if self.turns.is_multiple_of(LOOKS_PER_CHORE) {
            self.attend(CHORES[self.turns / LOOKS_PER_CHORE])?;
        }
        Ok(if any { Turn::Busy } else { Turn::Idle })
    }

    fn round(&mut self) -> anyhow::Result<Turn> {
        let any = !self.terms.stepped && self.take_samples()?;
        for chore in CHORES {
            self.attend(chore)?;
        }
        Ok(if any { Turn::Busy } else { Turn::Idle })
    }

    fn sleep(&mut self, bound: Duration) -> anyhow::Result<()> {
        if let Some(listener) = &self.ports.wake {
            let was_woken = listener.wait(bound).context("waiting for a wake-up")?;
            self.watch.slept(was_woken);
        }
        Ok(())
    }

    fn close(self: Box<Self>) -> Box<dyn Closed<'a> + 'a> {
        let Self {
            engine,
            terms,
            keeper,
            ..
        } = *self;
        Box::new(ClosedVehicle {
            engine,
            terms,
            keeper,
        })
    }

    fn finish(mut self: Box<Self>) -> anyhow::Result<()> {
        let state = self.engine.snapshot();
        if !self.terms.stepped {
            // What waits for samples that will not come is counted too.
            self.take_samples()?;
            for aid in AIDS {
                self.take(aid, u64::MAX)?;
            }
            self.engine.finish(&mut self.ports.estimates);
        }
        self.report(monotonic_ns());
        if let Some(keeper) = self.keeper {
            keeper.finish(self.engine.snapshot().or(state));
        }
        Ok(())
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
