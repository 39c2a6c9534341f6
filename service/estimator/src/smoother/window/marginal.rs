//! Covariances of the states given all fixes, before and after them: what the later ones tell, gathered on the way back.
//!
//! With the information L at the end of a state (Bryson and Frazier; the second derivative where the adjoint is the
//! first), of left-invariant errors:
//!
//! ```text
//! P given all = P - P L P            at each state, P given all up to it
//! L <- (I - K H)^T L (I - K H) + H^T S^-1 H     before its fix
//! L <- F^T L F                                  before its motion
//! ```
//!
//! as linearised at the last update. Nothing but innovation covariances is inverted, here as there.

use nalgebra::SMatrix;

use super::Window;
use crate::filter::{Belief, Covariance, Left, Side};
use crate::model::InertialState;

/// How far the covariance of the oldest state has come.
#[derive(Clone, Copy, Debug)]
pub(super) struct Cover<const D: usize> {
    /// The states from here on have been passed; none yet, if there is no such place.
    end: Option<usize>,
    /// At the end of the state before.
    information: SMatrix<f64, D, D>,
    /// Of the oldest state, once it has been reached.
    covariance: Option<Covariance<D>>,
}

impl<const D: usize> Default for Cover<D> {
    fn default() -> Self {
        Self {
            end: None,
            information: SMatrix::zeros(),
            covariance: None,
        }
    }
}

impl<const D: usize> Cover<D> {
    /// The window is another one.
    pub fn forget(&mut self) {
        (self.end, self.covariance) = (None, None);
    }
}

impl<G: InertialState<D>, S: Side, const D: usize> Window<G, S, D> {
    /// Goes on with the covariance of the oldest state, for it to be known when that leaves, while `budget` units of work
    /// are left, and takes what it did from them. Whether it is known.
    pub fn cover_oldest(&mut self, budget: &mut i64) -> bool {
        if self.cover.covariance.is_some() {
            return true;
        }
        let mut index = match self.cover.end {
            Some(end) => end - 1,
            None => {
                self.cover.information = SMatrix::zeros();
                self.knots.len() - 1
            }
        };
        let cost = self.work_of_cover();
        while index > 0 {
            if *budget <= 0 {
                return false;
            }
            *budget -= cost;
            self.cover.information = self.before(index, &self.cover.information);
            self.cover.end = Some(index);
            index -= 1;
        }
        self.cover.covariance = Some(self.given(0, &self.cover.information));
        true
    }

    /// The oldest state, with its covariance given all fixes.
    pub fn oldest(&mut self) -> Belief<G, Left, D> {
        let mut budget = i64::MAX;
        self.cover_oldest(&mut budget);
        let known = self.cover.covariance;
        Belief::new(self.knots[0].chi, known.unwrap_or(self.knots[0].filtered))
    }

    /// Hands over the covariances of the left-invariant errors of all states given all fixes, the newest first, each with its
    /// index, the oldest 0. Matrix products for each state: for reports, not for each sample.
    pub fn covariances(&self, give: &mut dyn FnMut(usize, &Covariance<D>)) {
        let mut information = SMatrix::zeros();
        for index in (0..self.knots.len()).rev() {
            give(index, &self.given(index, &information));
            if index > 0 {
                information = self.before(index, &information);
            }
        }
    }

    /// State `index`, oldest 0, with the covariance of its left-invariant error given all fixes, before and
    /// after; `None` beyond the newest. Matrix products for each later state.
    pub fn smoothed(&self, index: usize) -> Option<Belief<G, Left, D>> {
        let knot = self.knots.get(index)?;
        let mut information = SMatrix::zeros();
        for later in (index + 1..self.knots.len()).rev() {
            information = self.before(later, &information);
        }
        Some(Belief::new(knot.chi, self.given(index, &information)))
    }

    /// The covariance of a state, from the information at its end.
    fn given(&self, index: usize, information: &SMatrix<f64, D, D>) -> Covariance<D> {
        let p = self.knots[index].filtered.matrix();
        Covariance::from_upper(p - p * information * p)
    }

    /// The information at the end of the state before `index`, from that at its own end.
    fn before(&self, index: usize, end: &SMatrix<f64, D, D>) -> SMatrix<f64, D, D> {
        let (knot, passage) = (&self.knots[index], &self.passages[index]);
        let start = knot.information(end);
        if !self.is_tracked() {
            return passage.transition.tr_mul(&start) * passage.transition;
        }
        let mut half = SMatrix::<f64, D, D>::zeros();
        for column in 0..D {
            let carried = knot
                .track
                .carry_back(&start.column(column).into_owned(), &passage.inputs);
            half.set_row(column, &carried.transpose());
        }
        let mut whole = half;
        for column in 0..D {
            let carried = knot
                .track
                .carry_back(&half.column(column).into_owned(), &passage.inputs);
            whole.set_column(column, &carried);
        }
        whole
    }
}
