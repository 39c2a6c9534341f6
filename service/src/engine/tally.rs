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
    first_seq: u64,
    next_seq: u64,
    /// Count of all messages when it was last heard of; 0 for a free place.
    heard: u64,
    /// Bit i: the message with the number `next_seq - 1 - i` was heard.
    recent: Recent,
}

/// The last numbers of a sender, of which messages may still come: fixes are taken in the order of their stamps.
const RECENT: u64 = 1024;
const WORD: u64 = u64::BITS as u64;

/// Which of the last numbers were heard.
#[derive(Clone, Copy, Debug, Default)]
struct Recent([u64; (RECENT / WORD) as usize]);

impl Recent {
    /// Only the last number was heard.
    fn only_last() -> Self {
        let mut recent = Self::default();
        recent.0[0] = 1;
        recent
    }

    /// Goes on by `steps` numbers, the last of which is heard.
    fn advance(&mut self, steps: u64) {
        if steps >= RECENT {
            self.0 = Default::default();
        } else {
            let (words, bits) = ((steps / WORD) as usize, steps % WORD);
            for index in (0..self.0.len()).rev() {
                let from = |index: Option<usize>| index.map_or(0, |index| self.0[index]);
                let (near, far) = (
                    from(index.checked_sub(words)),
                    from(index.checked_sub(words + 1)),
                );
                self.0[index] = match bits {
                    0 => near,
                    bits => near << bits | far >> (WORD - bits),
                };
            }
        }
        self.0[0] |= 1;
    }

    /// Notes the number `back` before the last one; true if it had not been heard and still counts as lost.
    fn hear(&mut self, back: u64) -> bool {
        let Some(word) = self.0.get_mut((back / WORD) as usize) else {
            return false;
        };
        let bit = 1 << (back % WORD);
        let is_new = *word & bit == 0;
        *word |= bit;
        is_new
    }
}

/// What a message's number says.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Heard {
    /// Messages of its sender missing before it.
    pub lost: u64,
    /// Whether this number was heard, or counted as lost, before.
    pub repeated: bool,
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
    /// Messages of any topic that were noted; tells which sender was heard of last.
    announced: u64,
    numbering: [[Numbering; SENDERS]; INPUTS],
}

impl Tally {
    /// Counts a message of `input` (an `INPUT_*` index) and those missing before it, and says what its number tells.
    /// Each epoch is a sender with a numbering of its own, so several may share a topic.
    pub fn receive(&mut self, input: usize, header: &Header) -> Heard {
        self.received[input] += 1;
        self.announce(input, header)
    }

    /// The same for a message that has come, but is not to be counted as received yet.
    pub fn announce(&mut self, input: usize, header: &Header) -> Heard {
        self.announced += 1;
        let heard = self.announced;
        let senders = &mut self.numbering[input];
        let known = senders
            .iter_mut()
            .find(|sender| sender.heard > 0 && sender.epoch == header.epoch);
        if let Some(sender) = known {
            sender.heard = heard;
            let Some(missing) = header.seq.checked_sub(sender.next_seq) else {
                // Behind later ones: it was counted as lost, unless it is a copy or from before the first one heard.
                let back = sender.next_seq - 1 - header.seq;
                if header.seq >= sender.first_seq && sender.recent.hear(back) {
                    self.counters.lost = self.counters.lost.saturating_sub(1);
                }
                return Heard {
                    lost: 0,
                    repeated: true,
                };
            };
            self.counters.lost = self.counters.lost.saturating_add(missing);
            sender.next_seq = header.seq.wrapping_add(1);
            sender.recent.advance(missing.saturating_add(1));
            return Heard {
                lost: missing,
                repeated: false,
            };
        } else if let Some(forgotten) = senders.iter_mut().min_by_key(|sender| sender.heard) {
            *forgotten = Numbering {
                epoch: header.epoch,
                first_seq: header.seq,
                next_seq: header.seq.wrapping_add(1),
                heard,
                recent: Recent::only_last(),
            };
        }
        Heard {
            lost: 0,
            repeated: false,
        }
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

#[cfg(test)]
mod tests {
    use inekf_shared::message::{INPUT_POSITION, Zero};

    use super::*;

    fn hear(tally: &mut Tally, seq: u64) -> Heard {
        let header = Header {
            seq,
            epoch: 1,
            ..Header::ZERO
        };
        tally.receive(INPUT_POSITION, &header)
    }

    #[test]
    fn what_comes_behind_later_ones_is_not_lost_and_a_copy_changes_nothing() {
        let mut tally = Tally::default();
        for (seq, lost, repeated, in_all) in [
            (5, 0, false, 0),
            (9, 3, false, 3),
            (7, 0, true, 2),
            (7, 0, true, 2),
            (9, 0, true, 2),
            // From before the first one that was heard.
            (4, 0, true, 2),
            (80, 70, false, 72),
            (6, 0, true, 71),
            (8, 0, true, 70),
            (5, 0, true, 70),
            (10, 0, true, 69),
            (79, 0, true, 68),
        ] {
            assert_eq!(hear(&mut tally, seq), Heard { lost, repeated }, "{seq}");
            assert_eq!(tally.counters.lost, in_all, "{seq}");
        }
    }

    #[test]
    fn what_is_too_long_ago_stays_lost() {
        let mut tally = Tally::default();
        hear(&mut tally, 0);
        hear(&mut tally, 2000);
        assert_eq!(tally.counters.lost, 1999);
        hear(&mut tally, 900);
        assert_eq!(tally.counters.lost, 1999);
        // The oldest that is still known.
        hear(&mut tally, 2000 - 1023);
        assert_eq!(tally.counters.lost, 1998);
    }

    #[test]
    fn every_order_of_the_same_numbers_loses_none() {
        // Multiplying by an odd number permutes the numbers below a power of two.
        for step in [1, 3, 77, 511] {
            let mut tally = Tally::default();
            hear(&mut tally, 0);
            for index in 1..512 {
                hear(&mut tally, index * step % 512);
            }
            assert_eq!(tally.counters.lost, 0, "{step}");
        }
    }
}
