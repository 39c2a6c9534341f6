//! The first state of an engine, from what is configured, was requested or is left of an earlier life; and its end.

use inekf_shared::message::{INPUT_POSITION, REASON_NOT_READY};
use nalgebra::{Matrix3, Vector3};

use super::super::fix::Antenna;
use super::super::history::History;
use super::super::model::Model;
use super::super::resume::Resumption;
use super::super::settings::PositionSource;
use super::super::tally::Refusal;
use super::Engine;

impl<M: Model, H: History<M>> Engine<M, H> {
    /// Starts if everything that the first state needs has come. True if there is one.
    pub(super) fn try_start(&mut self, stamp_ns: u64, input: &M::Input) -> bool {
        let without_ns = self.model.start_ns(None, stamp_ns, input);
        let of_stamp = |start_ns| (start_ns == stamp_ns).then_some(*input);
        if let Some(state) = self.requested.take() {
            self.start(without_ns, of_stamp(without_ns), state);
            return true;
        }
        if self.try_resume(without_ns, stamp_ns, input) {
            return true;
        }
        if self.model.initial().wait_for_request {
            return false;
        }
        let Some(r_wb) = self.model.attitude(stamp_ns, input) else {
            return false;
        };
        let mut started_by = None;
        let (start_ns, antenna) = match self.model.initial().position {
            PositionSource::Given { position_w, sigma } => (
                without_ns,
                Antenna {
                    position_w,
                    covariance_w: Matrix3::identity() * (sigma * sigma),
                    lever_arm_b: Vector3::zeros(),
                },
            ),
            PositionSource::FirstFix => match self.first_position {
                // A fix ahead of the samples waits for them; an old one is no place to start from.
                Some((fix_ns, source, antenna)) if fix_ns <= stamp_ns => {
                    self.first_position = None;
                    if stamp_ns - fix_ns > self.oldest_start_ns() {
                        self.output.tally.refuse(Refusal(REASON_NOT_READY));
                        return false;
                    }
                    self.output.tally.counters.accepted += 1;
                    started_by = Some((source, fix_ns));
                    (self.model.start_ns(Some(fix_ns), stamp_ns, input), antenna)
                }
                _ => return false,
            },
        };
        let alignment = self.model.initial().alignment(r_wb, &antenna);
        let state = self.model.aligned(&alignment);
        self.start(start_ns, of_stamp(start_ns), state);
        if let Some((source, fix_ns)) = started_by {
            self.output.tally.fused(INPUT_POSITION, source, fix_ns);
        }
        true
    }

    /// Continues from the state of an earlier life, if there is one that can be. Of odometry the first row, which
    /// begins at `begins_ns`, speaks for a part of the time since.
    fn try_resume(&mut self, begins_ns: u64, stamp_ns: u64, input: &M::Input) -> bool {
        let Some(earlier) = self.earlier.take() else {
            return false;
        };
        self.resumption = earlier.judge(stamp_ns);
        if let Resumption::Resumed { .. } = self.resumption {
            let start_ns = begins_ns.max(earlier.stamp_ns).min(stamp_ns);
            let silence_ns = start_ns - earlier.stamp_ns;
            let mut state = earlier.state;
            self.model
                .endure(&mut state, silence_ns, &earlier.settings.doubt);
            if self.model.is_sound(&state) {
                self.start(start_ns, (start_ns == stamp_ns).then_some(*input), state);
                self.output.resumed();
                return true;
            }
            self.resumption = Resumption::Unsound;
        }
        // What came for it is now as if there had been none.
        let mut early = core::mem::take(&mut self.early);
        for fix in early.drain(..) {
            self.keep_first(fix);
        }
        self.early = early;
        false
    }

    /// Something else sets the state.
    pub(super) fn give_up_earlier(&mut self) {
        if self.earlier.take().is_some() {
            self.resumption = Resumption::None;
        }
    }

    /// How old the fix may be that the state starts from: as late as any fix may be, or as long as
    /// the samples need not be doubted.
    fn oldest_start_ns(&self) -> u64 {
        self.model.max_gap_ns().max(self.fusion.late_window_ns)
    }

    pub(super) fn start(&mut self, stamp_ns: u64, input: Option<M::Input>, state: M::State) {
        let early = core::mem::take(&mut self.early);
        self.forget();
        self.early = early;
        self.requested = None;
        self.give_up_earlier();
        self.output.started(stamp_ns, &self.model.place_w(&state));
        self.history.start(&self.model, stamp_ns, input, state);
        self.time_base.advance_to(stamp_ns);
    }

    /// Forgets the state. The fixes that still waited for a sample are counted, as every input is.
    pub(super) fn forget(&mut self) {
        let waiting = self.history.waiting()
            + self.stack.clear() as u64
            + self.early.len() as u64
            + u64::from(self.first_position.is_some());
        let tally = &mut self.output.tally;
        tally.refuse_all(Refusal(REASON_NOT_READY), waiting);
        self.history.clear(&self.model);
        self.early.clear();
        self.model.forget_attitude();
        self.first_position = None;
    }
}
