//! What became of every input: nothing is refused or missed without being counted.
//!
//! ```
//! use inekf_service::engine::tally::Tally;
//!
//! assert_eq!(Tally::default().counters.rejected, 0);
//! ```

use inekf_shared::message::{Counters, Header, INPUTS, REASONS, SOURCES, source_index};

/// Why an input was refused; the code is that of `inekf_shared::message::REASON_*`.
///
/// ```
/// use inekf::filter::Left;
/// use inekf::model::NavState;
/// use inekf_service::config::Config;
/// use inekf_service::engine::tally::Refusal;
/// use inekf_service::engine::{InertialEngine, Settings};
/// use inekf_shared::message::{Header, INPUT_ODOMETRY_2D, REASON_WRONG_MODEL, Zero};
///
/// # let text = "model = 'imu'\n[noise]\ngyro_density = 3e-4\naccel_density = 2e-2\n";
/// # let config = Config::from_toml_str(text, "example")?;
/// let mut engine = InertialEngine::<NavState, Left, 15>::new(Settings::new(&config));
/// // A row of odometry has come, and this is an engine for an IMU.
/// engine.refuse(INPUT_ODOMETRY_2D, &Header::ZERO, Refusal(REASON_WRONG_MODEL));
/// assert_eq!(engine.tally().rejected_by_reason[REASON_WRONG_MODEL as usize], 1);
/// # Ok::<(), inekf_service::config::ConfigFaults>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Refusal(pub u32);

/// Senders of one topic whose numbering is followed at one time; a topic has at most this many.
const SENDERS: usize = 8;

/// The numbering of one sender, from which losses are counted.
#[derive(Clone, Copy, Debug, Default)]
struct Numbering {
    epoch: u64,
    next_seq: u64,
    /// Count of all messages when it was last heard of; 0 for a free place.
    heard: u64,
}

/// What a message's number says.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Heard {
    /// Messages of its sender missing before it.
    pub(super) lost: u64,
    /// Whether this number was heard, or counted as lost, before.
    pub(super) repeated: bool,
}

/// All counters of the engine.
///
/// ```
/// use inekf::filter::Left;
/// use inekf::model::NavState;
/// use inekf_service::config::Config;
/// use inekf_service::engine::{InertialEngine, Settings};
/// use inekf_shared::message::{INPUT_IMU, ImuSample, Zero};
///
/// # let text = "model = 'imu'\n[noise]\ngyro_density = 3e-4\naccel_density = 2e-2\n";
/// # let config = Config::from_toml_str(text, "example")?;
/// let mut engine = InertialEngine::<NavState, Left, 15>::new(Settings::new(&config));
/// let mut estimates = Vec::new();
/// for (epoch, seq) in [(1, 0), (1, 1), (2, 0), (2, 5)] {
///     let mut sample = ImuSample { accel_mps2: [0.0, 0.0, 9.80665], ..ImuSample::ZERO };
///     (sample.header.epoch, sample.header.seq) = (epoch, seq);
///     engine.sample(&sample, 0, &mut estimates);
/// }
/// // A sender that has started anew counts anew.
/// let tally = engine.tally();
/// assert_eq!((tally.received[INPUT_IMU], tally.counters.lost), (4, 4));
/// # Ok::<(), inekf_service::config::ConfigFaults>(())
/// ```
#[derive(Clone, Copy, Debug, Default)]
pub struct Tally {
    /// The counters that estimates and health carry.
    pub counters: Counters,
    /// Refused inputs by reason.
    pub rejected_by_reason: [u64; REASONS],
    /// Messages received by topic.
    pub received: [u64; INPUTS],
    /// Stamp of the newest fix fused since the state was last set, of any source; 0 if none was.
    pub last_fix_stamp_ns: u64,
    /// The same of each source, by [`source_index`].
    pub fused_stamp_ns: [u64; SOURCES],
    /// Messages of any topic that were noted; tells which sender was heard of last.
    announced: u64,
    numbering: [[Numbering; SENDERS]; INPUTS],
}

impl Tally {
    /// Counts a message of `input` (an `INPUT_*` index) and those missing before it, and says what its number tells.
    /// Each epoch is a sender with a numbering of its own, so several may share a topic.
    pub(super) fn receive(&mut self, input: usize, header: &Header) -> Heard {
        self.received[input] += 1;
        self.announce(input, header)
    }

    /// The same for a message that has come, but is not to be counted as received yet.
    pub(super) fn announce(&mut self, input: usize, header: &Header) -> Heard {
        self.announced += 1;
        let heard = self.announced;
        let senders = &mut self.numbering[input];
        let known = senders
            .iter_mut()
            .find(|sender| sender.heard > 0 && sender.epoch == header.epoch);
        if let Some(sender) = known {
            sender.heard = heard;
            let missing = header.seq.checked_sub(sender.next_seq);
            if let Some(missing) = missing {
                self.counters.lost = self.counters.lost.saturating_add(missing);
                sender.next_seq = header.seq.wrapping_add(1);
            }
            return Heard {
                lost: missing.unwrap_or(0),
                repeated: missing.is_none(),
            };
        } else if let Some(forgotten) = senders.iter_mut().min_by_key(|sender| sender.heard) {
            *forgotten = Numbering {
                epoch: header.epoch,
                next_seq: header.seq.wrapping_add(1),
                heard,
            };
        }
        Heard {
            lost: 0,
            repeated: false,
        }
    }

    /// Notes that a fix of this time, topic and source was fused.
    pub(super) fn fused(&mut self, input: usize, source: u32, stamp_ns: u64) {
        self.last_fix_stamp_ns = self.last_fix_stamp_ns.max(stamp_ns);
        if let Some(newest) =
            source_index(input, source).and_then(|at| self.fused_stamp_ns.get_mut(at))
        {
            *newest = (*newest).max(stamp_ns);
        }
    }

    /// Forgets which fixes were fused: the state has been set anew, and there may be another clock.
    pub(super) fn forget_fused(&mut self) {
        self.last_fix_stamp_ns = 0;
        self.fused_stamp_ns = [0; SOURCES];
    }

    /// Counts a refusal.
    pub(super) fn refuse(&mut self, refusal: Refusal) {
        self.refuse_all(refusal, 1);
    }

    /// Counts the refusal of so many messages.
    pub(super) fn refuse_all(&mut self, refusal: Refusal, messages: u64) {
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
    fn what_was_announced_is_not_lost_when_it_is_handed_over_behind_later_ones() {
        let mut tally = Tally::default();
        hear(&mut tally, 5);
        let header = Header {
            seq: 6,
            epoch: 1,
            ..Header::ZERO
        };
        tally.announce(INPUT_POSITION, &header);
        for (seq, lost, repeated) in [(7, 0, false), (8, 0, false), (6, 0, true), (11, 2, false)] {
            assert_eq!(hear(&mut tally, seq), Heard { lost, repeated }, "{seq}");
        }
        assert_eq!(tally.received[INPUT_POSITION], 5);
        assert_eq!(tally.counters.lost, 2);
    }

    #[test]
    fn a_late_fix_is_counted_and_is_not_the_newest() {
        let mut tally = Tally::default();
        tally.fused(INPUT_POSITION, 0, 500);
        tally.fused(INPUT_POSITION, 0, 300);
        assert_eq!(tally.last_fix_stamp_ns, 500);
        tally.forget_fused();
        assert_eq!(tally.last_fix_stamp_ns, 0);
    }

    #[test]
    fn a_refusal_is_counted_by_its_reason() {
        let mut tally = Tally::default();
        tally.refuse_all(Refusal(3), 2);
        // A reason that does not exist is a refusal all the same.
        tally.refuse(Refusal(u32::MAX));
        assert_eq!(
            (tally.counters.rejected, tally.rejected_by_reason[3]),
            (3, 2)
        );
    }
}
