//! What shared memory alone costs: an iceoryx2 echo with the service's own messages, an `ImuSample`
//! there and an `EstimateSe23` back; slots loaned at send as iceoryx2's own examples do, or ahead.

use std::process::Stdio;
use std::time::{Duration, Instant};

use anyhow::bail;
use inekf_client::daemon::private_instance;
use inekf_shared::clock::monotonic_ns;
use inekf_shared::message::{EstimateSe23, ImuSample, Zero};
use inekf_shared::topic::Instance;
use inekf_shared::transport::{self, Node, Outlet, Subscriber, WakeNotifier};

use super::mechanism::{Mechanism, Wait};
use super::partner::{
    LONGEST_SLEEP, PATIENCE, Partner, RoundTrip, STOP, end_with_parent, still_patient,
};
use crate::pin;

/// Slots loaned ahead: none where they are loaned at send.
fn depth(mechanism: Mechanism) -> usize {
    usize::from(mechanism == Mechanism::PreLoanedEcho)
}

/// An echo process, and the ports to it.
pub struct Echo {
    samples: Outlet<ImuSample>,
    answers: Subscriber<EstimateSe23>,
    wake: Option<WakeNotifier>,
    next: u64,
    partner: Partner,
    _node: Node,
}

impl Echo {
    /// Starts the partner on processor `cpu`.
    ///
    /// # Errors
    /// It cannot be started, or does not answer.
    pub fn start(mechanism: Mechanism, wait: Wait, cpu: usize) -> anyhow::Result<Self> {
        let instance = private_instance("echo")?;
        let node = transport::open_node("inekf-bench")?;
        let samples = transport::input::<ImuSample>(&node, &instance)?.publisher()?;
        let answers = transport::estimate::<EstimateSe23>(&node, &instance)?.subscriber()?;
        let wake = match wait {
            Wait::Spin => None,
            Wait::Event => Some(transport::wake(&node, &instance)?.notifier()?),
        };
        let partner = Partner::start(mechanism, wait, instance.as_str(), cpu, Stdio::null())?;
        let mut echo = Self {
            samples: Outlet::new(samples, depth(mechanism)),
            answers,
            wake,
            next: 1,
            partner,
            _node: node,
        };
        let started = Instant::now();
        while echo.send(1)? == 0 {
            if started.elapsed() > PATIENCE {
                bail!("the echo process does not listen");
            }
            std::thread::sleep(Duration::from_millis(1));
        }
        echo.samples.restock();
        Ok(echo)
    }

    fn send(&mut self, seq: u64) -> anyhow::Result<usize> {
        let mut sample = ImuSample::ZERO;
        sample.header.seq = seq;
        let receivers = self.samples.send(&sample)?;
        if let Some(wake) = &self.wake {
            // A partner that cannot be woken looks by itself.
            let _ = wake.notify();
        }
        Ok(receivers)
    }
}

impl RoundTrip for Echo {
    fn round(&mut self) -> anyhow::Result<u64> {
        self.next += 1;
        let sent_ns = monotonic_ns();
        self.send(self.next)?;
        loop {
            // Answers to the start's own sends may still be on their way.
            if let Some(answer) = self.answers.receive()?
                && answer.head.seq == self.next
            {
                let round_ns = monotonic_ns() - sent_ns;
                self.samples.restock();
                return Ok(round_ns);
            }
            still_patient(sent_ns, "the echo process")?;
            std::hint::spin_loop();
        }
    }

    fn process(&self) -> Option<u32> {
        Some(self.partner.id())
    }
}

impl Drop for Echo {
    fn drop(&mut self) {
        if self.send(STOP).is_ok() {
            self.partner.await_end();
        }
    }
}

/// The echo process: answers every sample with an estimate of the same number, until the last.
///
/// # Errors
/// A port fails.
pub fn serve(
    mechanism: Mechanism,
    wait: Wait,
    instance: &Instance,
    cpu: usize,
) -> anyhow::Result<()> {
    end_with_parent()?;
    pin::pin(None, cpu)?;
    let node = transport::open_node("inekf-echo")?;
    let answers = transport::estimate::<EstimateSe23>(&node, instance)?.publisher()?;
    let mut answers = Outlet::new(answers, depth(mechanism));
    let listener = match wait {
        Wait::Spin => None,
        Wait::Event => Some(transport::wake(&node, instance)?.listener()?),
    };
    let samples = transport::input::<ImuSample>(&node, instance)?.subscriber()?;
    loop {
        let Some(sample) = samples.receive()? else {
            match &listener {
                None => std::hint::spin_loop(),
                Some(listener) => drop(listener.wait(LONGEST_SLEEP)?),
            }
            continue;
        };
        if sample.header.seq == STOP {
            return Ok(());
        }
        let mut answer = EstimateSe23::ZERO;
        answer.head.seq = sample.header.seq;
        answers.send(&answer)?;
        answers.restock();
    }
}
