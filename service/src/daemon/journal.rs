//! The journal: what the engine took, published in that order.
//!
//! An entry is published once the engine is done with it, so that no estimate waits for it. Slots are loaned ahead, as
//! those of estimates are.

use inekf_shared::message::{ControlRequest, StateVector};
use inekf_shared::message::{
    JOURNAL_CONTROL, JOURNAL_RESUME, JOURNAL_SETTLE, JournalEntry, Message,
};
use inekf_shared::topic::Instance;
use inekf_shared::transport::{self, Node, Outlet, TransportError};

/// The topic, if the journal is asked for.
pub struct JournalPort {
    topic: Option<Outlet<JournalEntry>>,
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
        let topic = match publish {
            true => Some(Outlet::new(
                transport::journal(node, instance)?.publisher()?,
                1,
            )),
            false => None,
        };
        Ok(Self {
            topic,
            next: 0,
            failures: 0,
        })
    }

    /// Whether entries are published.
    pub fn is_on(&self) -> bool {
        self.topic.is_some()
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
        let Some(topic) = &mut self.topic else {
            return;
        };
        let entry = JournalEntry::new(self.next, estimates, kind, message);
        self.next += 1;
        if topic.send(&entry).is_err() {
            self.failures += 1;
        }
        topic.restock();
    }
}
