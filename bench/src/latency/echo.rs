//! What shared memory alone costs: a plain iceoryx2 echo with the service's own payload sizes,
//! loaned at send as iceoryx2's own examples do.

use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use anyhow::{Context, bail};
use inekf_client::daemon::private_instance;
use inekf_shared::clock::monotonic_ns;
use inekf_shared::message::{EstimateSe23, ImuSample, Zero};
use inekf_shared::topic::Instance;
use inekf_shared::transport::{self, Publisher, Subscriber};

use super::RoundTrip;
use crate::pin;

/// Name of the row.
pub const NAME: &str = "plain iceoryx2 echo";
/// How long the partner may take for one answer.
const ANSWER_WITHIN: Duration = Duration::from_secs(5);

/// An echo process, and the ports to it.
pub struct Echo {
    partner: Child,
    samples: Publisher<ImuSample>,
    answers: Subscriber<EstimateSe23>,
    next: u64,
}

impl Echo {
    /// Starts the partner on processor `cpu`.
    ///
    /// # Errors
    /// It cannot be started, or does not answer.
    pub fn start(cpu: usize) -> anyhow::Result<Self> {
        let instance = private_instance("echo")?;
        let node = transport::open_node("inekf-bench")?;
        let samples = transport::input::<ImuSample>(&node, &instance)?.publisher()?;
        let answers = transport::estimate::<EstimateSe23>(&node, &instance)?.subscriber()?;
        let partner = Command::new(std::env::current_exe()?)
            .args(["echo", instance.as_str(), &cpu.to_string()])
            .stdin(Stdio::null())
            .spawn()
            .context("starting the echo process")?;
        let mut echo = Self {
            partner,
            samples,
            answers,
            next: 1,
        };
        let started = Instant::now();
        while echo.send()? == 0 {
            if started.elapsed() > ANSWER_WITHIN {
                bail!("the echo process does not listen");
            }
            std::thread::sleep(Duration::from_millis(1));
        }
        Ok(echo)
    }

    fn send(&mut self) -> anyhow::Result<usize> {
        let mut sample = ImuSample::ZERO;
        sample.header.seq = self.next;
        Ok(self.samples.loan_uninit()?.write_payload(sample).send()?)
    }
}

impl RoundTrip for Echo {
    fn name(&self) -> &'static str {
        NAME
    }

    fn round(&mut self) -> anyhow::Result<u64> {
        self.next += 1;
        let sent_ns = monotonic_ns();
        self.send()?;
        loop {
            // Answers to the start's own sends may still be on their way.
            if let Some(answer) = self.answers.receive()?
                && answer.head.seq == self.next
            {
                return Ok(monotonic_ns() - sent_ns);
            }
            if monotonic_ns() - sent_ns > 5_000_000_000 {
                bail!("the echo process does not answer");
            }
            std::hint::spin_loop();
        }
    }
}

impl Drop for Echo {
    fn drop(&mut self) {
        let mut stop = ImuSample::ZERO;
        stop.header.seq = u64::MAX;
        if let Ok(slot) = self.samples.loan_uninit() {
            let _ = slot.write_payload(stop).send();
        }
        let started = Instant::now();
        while started.elapsed() < ANSWER_WITHIN {
            if !matches!(self.partner.try_wait(), Ok(None)) {
                return;
            }
            std::thread::sleep(Duration::from_millis(1));
        }
        let _ = self.partner.kill();
        let _ = self.partner.wait();
    }
}

/// The echo process: answers every sample with an estimate of the same number, until the last.
///
/// # Errors
/// A port fails.
pub fn serve(instance: &Instance, cpu: usize) -> anyhow::Result<()> {
    pin::pin(None, cpu)?;
    let node = transport::open_node("inekf-echo")?;
    let answers = transport::estimate::<EstimateSe23>(&node, instance)?.publisher()?;
    let samples = transport::input::<ImuSample>(&node, instance)?.subscriber()?;
    loop {
        let Some(sample) = samples.receive()? else {
            std::hint::spin_loop();
            continue;
        };
        if sample.header.seq == u64::MAX {
            return Ok(());
        }
        let mut answer = EstimateSe23::ZERO;
        answer.head.seq = sample.header.seq;
        answers.loan_uninit()?.write_payload(answer).send()?;
    }
}
