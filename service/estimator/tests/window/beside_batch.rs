//! A window from which nothing leaves, beside the batch smoother: at every fix it does what one iteration does.

use core::fmt::Debug;

use inekf::filter::{Belief, Left, Side};
use inekf::model::{InertialState, Observation};
use inekf::smoother::{
    Batch, BatchOptions, Chain, Fix, Jacobians, Preintegration, PriorForm, Window, WindowOptions,
};

use crate::common::assert_same_covariance;

/// States and fixes that there is room for.
const ROOM: usize = 20;

/// Both, fed alike with fixes of kind O, of dimension M.
pub struct BesideBatch<G, S, O, const D: usize, const M: usize>
where
    G: InertialState<D>,
    S: Side,
{
    window: Window<G, S, D>,
    chain: Chain<G, S, Preintegration<G, D>, O, D>,
    batch: Batch<G, S, D, M>,
    once: BatchOptions,
}

impl<G, S, O, const D: usize, const M: usize> BesideBatch<G, S, O, D, M>
where
    G: InertialState<D>,
    S: Side,
    O: Observation<G, D, M> + Into<Fix> + Copy + Debug,
{
    pub fn new(first: &Belief<G, Left, D>, jacobians: Jacobians) -> Self {
        let options = WindowOptions {
            first_prior: match jacobians {
                Jacobians::Exact => PriorForm::Recentred,
                Jacobians::Frozen => PriorForm::GroupMean,
            },
            jacobians,
            ..WindowOptions::new(ROOM)
        };
        let prior = Belief::from_left_covariance(first.mean, first.covariance);
        Self {
            window: Window::new(first, &options),
            chain: Chain::with_capacity(prior, ROOM, ROOM),
            batch: Batch::with_capacity(ROOM, ROOM),
            once: BatchOptions {
                iterations: 1,
                jacobians,
                step_control: false,
                ..BatchOptions::default()
            },
        }
    }

    /// One motion and the fix after it, which `fix` makes of the state that is expected there.
    pub fn assert_same_step(&mut self, motion: &Preintegration<G, D>, fix: impl FnOnce(&G) -> O) {
        let mut states: Vec<G> = self.window.states().copied().collect();
        let expected = motion.transition(&states[states.len() - 1]).0;
        states.push(expected);
        let fix = fix(&expected);
        self.batch.set_states(&states);
        self.chain.advance(*motion, *motion.noise().matrix());
        self.chain.observe(fix);
        let step = self.batch.iterate(&self.chain, &self.once);
        step.expect("a step of the batch");

        assert!(self.window.push(motion).is_none());
        self.window.update(fix).expect("an update");
        assert_eq!(self.window.states().len(), self.batch.states().len());
        for (actual, expected) in self.window.states().zip(self.batch.states()) {
            let off = Left::difference(actual, expected).norm();
            assert!(off < 1e-8, "{fix:?}: off by {off:e}");
        }
        let actual = self.window.newest().covariance;
        let expected = self.batch.newest_covariance();
        assert_same_covariance("P", actual.matrix(), expected.matrix(), 1e-8);
    }
}
