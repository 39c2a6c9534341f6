//! A publisher with slots loaned ahead.
//!
//! Loaning a slot looks through what readers gave back and allocates inside iceoryx2. Done when a
//! message is ready it is part of that message's latency; done after the one before, it is not.

use core::mem::MaybeUninit;

use iceoryx2::port::SendError;
use iceoryx2::prelude::ipc;
use iceoryx2::sample_mut_uninit::SampleMutUninit;

use super::service::Publisher;
use crate::message::Message;
use crate::qos;

type Slot<M> = SampleMutUninit<ipc::Service, MaybeUninit<M>, ()>;

/// Sends the messages of one topic from slots loaned ahead.
pub struct Outlet<M: Message> {
    publisher: Publisher<M>,
    depth: usize,
    ahead: Vec<Slot<M>>,
}

impl<M: Message> Outlet<M> {
    /// An outlet that keeps `depth` slots ready, at most [`qos::MAX_LOANED`] less one; with 0 it loans when it sends.
    pub fn new(publisher: Publisher<M>, depth: usize) -> Self {
        let depth = depth.min(qos::MAX_LOANED - 1);
        let mut outlet = Self {
            publisher,
            depth,
            ahead: Vec::with_capacity(depth),
        };
        outlet.restock();
        outlet
    }

    /// Sends a copy of `message`, and says how many subscribers got it. Never waits for any of them, and does not
    /// allocate while a slot is ready.
    ///
    /// # Errors
    /// iceoryx2's: a full `/dev/shm`, or a connection that is broken.
    pub fn send(&mut self, message: &M) -> Result<usize, SendError> {
        let slot = match self.ahead.pop() {
            Some(slot) => slot,
            None => self.publisher.loan_uninit()?,
        };
        slot.write_payload(*message).send()
    }

    /// Loans the slots for the messages to come. Call it when nothing waits for a message; what cannot be loaned now
    /// is loaned by [`Outlet::send`], which then says why not.
    pub fn restock(&mut self) {
        while self.ahead.len() < self.depth {
            match self.publisher.loan_uninit() {
                Ok(slot) => self.ahead.push(slot),
                Err(_) => break,
            }
        }
    }
}
