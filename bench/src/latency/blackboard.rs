//! A newest-value slot in each direction, written on one side and looked at on the other: an
//! `EstimateSe2` there (the smallest message the slot takes) and an `EstimateSe23` back.

use std::process::Stdio;
use std::time::Instant;

use anyhow::Context;
use inekf_client::daemon::private_instance;
use inekf_shared::clock::monotonic_ns;
use inekf_shared::message::{EstimateMessage, EstimateSe2, EstimateSe23, Zero};
use inekf_shared::topic::Instance;
use inekf_shared::transport::{self, LatestReader, LatestWriter, Node};

use super::mechanism::{Mechanism, Wait};
use super::partner::{PATIENCE, Partner, RoundTrip, STOP, end_with_parent, still_patient};
use crate::pin;

/// A process that answers what it finds in its slot, and the slots of both sides.
pub struct Blackboard {
    question: LatestWriter<EstimateSe2>,
    answer: LatestReader<EstimateSe23>,
    next: u64,
    partner: Partner,
    _node: Node,
}

impl Blackboard {
    /// Starts the partner on processor `cpu`.
    ///
    /// # Errors
    /// It cannot be started, or makes no slot.
    pub fn start(cpu: usize) -> anyhow::Result<Self> {
        let instance = private_instance("blackboard")?;
        let node = transport::open_node("inekf-bench")?;
        let question = transport::latest(&node, &instance, EstimateSe2::ZERO)?.writer()?;
        let partner = Partner::start(
            Mechanism::Blackboard,
            Wait::Spin,
            instance.as_str(),
            cpu,
            Stdio::null(),
        )?;
        let answers = answers_to(&instance)?;
        let started = Instant::now();
        let answer = loop {
            match transport::open_latest::<EstimateSe23>(&node, &answers) {
                Ok(slot) => break slot.reader()?,
                Err(error) if started.elapsed() > PATIENCE => return Err(error.into()),
                Err(_) => {}
            }
        };
        Ok(Self {
            question,
            answer,
            next: 0,
            partner,
            _node: node,
        })
    }

    fn ask(&self, seq: u64) -> anyhow::Result<()> {
        write(&self.question, seq)
    }
}

impl RoundTrip for Blackboard {
    fn round(&mut self) -> anyhow::Result<u64> {
        self.next += 1;
        let sent_ns = monotonic_ns();
        self.ask(self.next)?;
        while self.answer.read().head.seq != self.next {
            still_patient(sent_ns, "the process at the blackboard")?;
            std::hint::spin_loop();
        }
        Ok(monotonic_ns() - sent_ns)
    }

    fn process(&self) -> Option<u32> {
        Some(self.partner.id())
    }
}

impl Drop for Blackboard {
    fn drop(&mut self) {
        if self.ask(STOP).is_ok() {
            self.partner.await_end();
        }
    }
}

/// The instance with the slot of the answers.
fn answers_to(instance: &Instance) -> anyhow::Result<Instance> {
    Ok(Instance::new(&format!("{instance}-answers"))?)
}

fn write<E: EstimateMessage>(slot: &LatestWriter<E>, seq: u64) -> anyhow::Result<()> {
    let mut message = E::ZERO;
    message.head_mut().seq = seq;
    let written = slot.write(message);
    written.then_some(()).context("the slot has another writer")
}

/// The process at the blackboard: answers every new number with the same, until the last.
///
/// # Errors
/// A slot fails.
pub fn serve(instance: &Instance, cpu: usize) -> anyhow::Result<()> {
    end_with_parent()?;
    pin::pin(None, cpu)?;
    let node = transport::open_node("inekf-blackboard")?;
    let question = transport::open_latest::<EstimateSe2>(&node, instance)?.reader()?;
    let answer = transport::latest(&node, &answers_to(instance)?, EstimateSe23::ZERO)?.writer()?;
    let mut answered = 0;
    loop {
        let seq = question.read().head.seq;
        if seq == STOP {
            return Ok(());
        }
        if seq != answered {
            write(&answer, seq)?;
            answered = seq;
        }
        std::hint::spin_loop();
    }
}
