//! The journal: what the engine took, published in that order.
//!
//! An entry is published once the engine is done with it, so that no estimate waits for it. Slots are loaned ahead, as
//! those of estimates are.

use core::mem::MaybeUninit;

use iceoryx2::prelude::ipc;
use iceoryx2::sample_mut_uninit::SampleMutUninit;
use inekf_shared::message::{ControlRequest, StateVector};
use inekf_shared::message::{
    JOURNAL_CONTROL, JOURNAL_RESUME, JOURNAL_SETTLE, JournalEntry, Message,
};
use inekf_shared::topic::Instance;
use inekf_shared::transport::{self, Node, Publisher, TransportError};

type Slot = SampleMutUninit<ipc::Service, MaybeUninit<JournalEntry>, ()>;

/// The topic, if the journal is asked for.
pub struct JournalPort {
    publisher: Option<Publisher<JournalEntry>>,
    ahead: Option<Slot>,
    next: u64,
    /// Entries that could not be published; the watch reports them.
    pub failures: u64,
}

impl JournalPort {
    /// Opens the topic if the journal is to be published.
    ///
    /// # Errors
    /// [`TransportError`], naming the service and the remedy.
    pub fn open(node: &Node, instance: &Instance, publish: bool) -> Result<Self, TransportError> {
        let publisher = match publish {
            true => Some(transport::journal(node, instance)?.publisher()?),
            false => None,
        };
        let mut port = Self {
            publisher,
            ahead: None,
            next: 0,
            failures: 0,
        };
        port.loan_ahead();
        Ok(port)
    }

    /// Whether entries are published.
    pub fn is_on(&self) -> bool {
        self.publisher.is_some()
    }

    /// Notes an input of the topic with the `INPUT_*` index `input`; `estimates` have been published by now.
    pub fn input(&mut self, estimates: u64, input: usize, message: &[u8]) {
        self.note(estimates, input as u32 + 1, message);
    }

    /// Notes a request that has been answered.
    pub fn request(&mut self, estimates: u64, request: &ControlRequest) {
        self.note(estimates, JOURNAL_CONTROL, request.as_bytes());
    }

    /// Notes that the fixes that had been put off were taken in.
    pub fn settled(&mut self, estimates: u64) {
        self.note(estimates, JOURNAL_SETTLE, &[]);
    }

    /// Notes the state of an earlier life that the engine was given.
    pub fn resumed(&mut self, state: &StateVector) {
        self.note(0, JOURNAL_RESUME, state.as_bytes());
    }

    fn note(&mut self, estimates: u64, kind: u32, message: &[u8]) {
        let Some(publisher) = &self.publisher else {
            return;
        };
        let entry = JournalEntry::new(self.next, estimates, kind, message);
        self.next += 1;
        let slot = self.ahead.take().or_else(|| publisher.loan_uninit().ok());
        let sent = slot.is_some_and(|slot| slot.write_payload(entry).send().is_ok());
        if !sent {
            self.failures += 1;
        }
        self.loan_ahead();
    }

    /// Loans the slot for the next entry.
    fn loan_ahead(&mut self) {
        if let Some(publisher) = &self.publisher {
            self.ahead = publisher.loan_uninit().ok();
        }
    }
}
