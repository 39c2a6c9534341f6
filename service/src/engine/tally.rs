//! What became of every input: nothing is refused or missed without being counted.

use inekf_shared::message::{Counters, Header, INPUTS, REASONS};

/// Why an input was refused; the code is that of `inekf_shared::message::REASON_*`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Refusal(pub u32);

/// Senders of one topic whose numbering is followed at one time; a topic has at most this many.
const SENDERS: usize = 8;

/// The numbering of one sender, from which losses are counted.
#[derive(Clone, Copy, Debug, Default)]
struct Numbering {
    epoch: u64,
    next_seq: u64,
    /// Count of the topic's messages when it was last heard of; 0 for a free place.
    heard: u64,
}

/// All counters of the engine.
#[derive(Clone, Copy, Debug, Default)]
pub struct Tally {
    /// The counters that estimates and health carry.
    pub counters: Counters,
    /// Refused inputs by reason.
    pub rejected_by_reason: [u64; REASONS],
    /// Messages received by topic.
    pub received: [u64; INPUTS],
    numbering: [[Numbering; SENDERS]; INPUTS],
}

impl Tally {
    /// Counts a message of `input` (an `INPUT_*` index) and those missing before it, and says how many these are.
    /// Each epoch is a sender with a numbering of its own, so several may share a topic.
    pub fn receive(&mut self, input: usize, header: &Header) -> u64 {
        self.received[input] += 1;
        let heard = self.received[input];
        let senders = &mut self.numbering[input];
        let known = senders
            .iter_mut()
            .find(|sender| sender.heard > 0 && sender.epoch == header.epoch);
        if let Some(sender) = known {
            sender.heard = heard;
            if let Some(missing) = header.seq.checked_sub(sender.next_seq) {
                self.counters.lost = self.counters.lost.saturating_add(missing);
                sender.next_seq = header.seq.wrapping_add(1);
                return missing;
            }
        } else if let Some(forgotten) = senders.iter_mut().min_by_key(|sender| sender.heard) {
            *forgotten = Numbering {
                epoch: header.epoch,
                next_seq: header.seq.wrapping_add(1),
                heard,
            };
        }
        0
    }

    /// Counts a refusal.
    pub fn refuse(&mut self, refusal: Refusal) {
        self.refuse_all(refusal, 1);
    }

    /// Counts the refusal of so many messages.
    pub fn refuse_all(&mut self, refusal: Refusal, messages: u64) {
        self.counters.rejected += messages;
        if let Some(count) = self.rejected_by_reason.get_mut(refusal.0 as usize) {
            *count += messages;
        }
    }
}
