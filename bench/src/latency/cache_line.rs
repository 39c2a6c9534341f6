//! The floor of whatever spins: one cache line bounced between two processors.

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::thread::JoinHandle;

use inekf_shared::clock::monotonic_ns;

use super::partner::{RoundTrip, STOP};
use crate::pin;

/// A line of its own, so that nothing else shares it.
#[repr(align(128))]
#[derive(Debug, Default)]
struct Line(AtomicU64);

/// A thread on the other processor that answers every odd number with the next even one.
#[derive(Debug)]
pub struct CacheLine {
    cpu: usize,
    line: Arc<Line>,
    next: u64,
    partner: Option<JoinHandle<()>>,
}

impl CacheLine {
    /// Starts the partner on processor `cpu`.
    pub fn start(cpu: usize) -> Self {
        let mut line = Self {
            cpu,
            line: Arc::default(),
            next: 1,
            partner: None,
        };
        line.start_partner();
        line
    }

    fn start_partner(&mut self) {
        let line = Arc::new(Line::default());
        self.line = Arc::clone(&line);
        self.next = 1;
        let cpu = self.cpu;
        self.partner = Some(std::thread::spawn(move || answer(&line, cpu)));
    }

    fn stop_partner(&mut self) {
        self.line.0.store(STOP, Ordering::Release);
        if let Some(partner) = self.partner.take() {
            // A partner that panicked has nothing more to say.
            let _ = partner.join();
        }
    }
}

fn answer(line: &Line, cpu: usize) {
    // Unpinned it still answers; the row then shows the scheduler's choice.
    let _ = pin::pin(None, cpu);
    loop {
        let value = line.0.load(Ordering::Acquire);
        if value == STOP {
            break;
        }
        if value % 2 == 1 {
            line.0.store(value + 1, Ordering::Release);
        }
        std::hint::spin_loop();
    }
}

impl RoundTrip for CacheLine {
    fn round(&mut self) -> anyhow::Result<u64> {
        let sent_ns = monotonic_ns();
        self.line.0.store(self.next, Ordering::Release);
        while self.line.0.load(Ordering::Acquire) != self.next + 1 {
            std::hint::spin_loop();
        }
        self.next += 2;
        Ok(monotonic_ns() - sent_ns)
    }

    fn process(&self) -> Option<u32> {
        None
    }

    fn pause(&mut self) -> anyhow::Result<()> {
        self.stop_partner();
        Ok(())
    }

    fn resume(&mut self) -> anyhow::Result<()> {
        self.start_partner();
        Ok(())
    }
}

impl Drop for CacheLine {
    fn drop(&mut self) {
        self.stop_partner();
    }
}
