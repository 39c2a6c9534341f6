//! The floor: one cache line bounced between two processors.

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::thread::JoinHandle;

use inekf_shared::clock::monotonic_ns;

use super::RoundTrip;
use crate::pin;

/// Name of the row.
pub const NAME: &str = "raw cache line";
const STOP: u64 = u64::MAX;

/// A line of its own, so that nothing else shares it.
#[repr(align(128))]
#[derive(Debug, Default)]
struct Line(AtomicU64);

/// A thread on the other processor that answers every odd number with the next even one.
#[derive(Debug)]
pub struct CacheLine {
    line: Arc<Line>,
    next: u64,
    partner: Option<JoinHandle<()>>,
}

impl CacheLine {
    /// Starts the partner on processor `cpu`.
    pub fn start(cpu: usize) -> Self {
        let line = Arc::new(Line::default());
        let shared = Arc::clone(&line);
        let partner = std::thread::spawn(move || {
            // Unpinned it still answers; the row then shows the scheduler's choice.
            let _ = pin::pin(None, cpu);
            loop {
                let value = shared.0.load(Ordering::Acquire);
                if value == STOP {
                    break;
                }
                if value % 2 == 1 {
                    shared.0.store(value + 1, Ordering::Release);
                }
                std::hint::spin_loop();
            }
        });
        Self {
            line,
            next: 1,
            partner: Some(partner),
        }
    }
}

impl RoundTrip for CacheLine {
    fn name(&self) -> &'static str {
        NAME
    }

    fn round(&mut self) -> anyhow::Result<u64> {
        let sent_ns = monotonic_ns();
        self.line.0.store(self.next, Ordering::Release);
        while self.line.0.load(Ordering::Acquire) != self.next + 1 {
            std::hint::spin_loop();
        }
        self.next += 2;
        Ok(monotonic_ns() - sent_ns)
    }
}

impl Drop for CacheLine {
    fn drop(&mut self) {
        self.line.0.store(STOP, Ordering::Release);
        if let Some(partner) = self.partner.take() {
            // A partner that panicked has nothing more to say.
            let _ = partner.join();
        }
    }
}
