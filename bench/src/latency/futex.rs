//! The floor of whatever is woken: a thread asleep on a futex of the other processor is woken and
//! answers through memory. On a virtual machine it is mostly the hypervisor that is measured.

use std::sync::Arc;
use std::sync::atomic::{AtomicU32, Ordering};
use std::thread::JoinHandle;

use inekf_shared::clock::monotonic_ns;
use rustix::thread::futex::{self, Flags};

use super::partner::{RoundTrip, still_patient};
use crate::pin;

/// The value that ends the partner.
const STOP: u32 = u32::MAX;

/// A line of its own, so that nothing else shares it.
#[repr(align(128))]
#[derive(Debug, Default)]
struct Line(AtomicU32);

#[derive(Debug, Default)]
struct Shared {
    question: Line,
    answer: Line,
}

/// A thread on the other processor that sleeps until woken, and answers with the same number.
#[derive(Debug)]
pub struct Futex {
    shared: Arc<Shared>,
    next: u32,
    partner: Option<JoinHandle<()>>,
}

impl Futex {
    /// Starts the partner on processor `cpu`.
    pub fn start(cpu: usize) -> Self {
        let shared = Arc::new(Shared::default());
        let of_partner = Arc::clone(&shared);
        Self {
            shared,
            next: 0,
            partner: Some(std::thread::spawn(move || answer(&of_partner, cpu))),
        }
    }

    fn ask(&self, question: u32) {
        self.shared.question.0.store(question, Ordering::Release);
        // Nobody asleep is no failure: the partner looks before it sleeps.
        let _ = futex::wake(&self.shared.question.0, Flags::PRIVATE, 1);
    }
}

fn answer(shared: &Shared, cpu: usize) {
    // Unpinned it still answers; the row then shows the scheduler's choice.
    let _ = pin::pin(None, cpu);
    let mut answered = 0;
    loop {
        // Returns at once if the value is no longer the one answered.
        let _ = futex::wait(&shared.question.0, Flags::PRIVATE, answered, None);
        answered = shared.question.0.load(Ordering::Acquire);
        if answered == STOP {
            break;
        }
        shared.answer.0.store(answered, Ordering::Release);
    }
}

impl RoundTrip for Futex {
    fn round(&mut self) -> anyhow::Result<u64> {
        // Neither zero, from which the partner starts, nor the end.
        self.next = self.next % (STOP - 1) + 1;
        let sent_ns = monotonic_ns();
        self.ask(self.next);
        while self.shared.answer.0.load(Ordering::Acquire) != self.next {
            still_patient(sent_ns, "the thread on the futex")?;
            std::hint::spin_loop();
        }
        Ok(monotonic_ns() - sent_ns)
    }

    /// A thread; between rounds it sleeps and needs no pause.
    fn process(&self) -> Option<u32> {
        None
    }
}

impl Drop for Futex {
    fn drop(&mut self) {
        self.ask(STOP);
        if let Some(partner) = self.partner.take() {
            // A partner that panicked has nothing more to say.
            let _ = partner.join();
        }
    }
}
