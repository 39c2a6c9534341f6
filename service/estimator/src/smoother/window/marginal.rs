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
    ///
    /// ```
    /// # use inekf::model::{Discretisation, ImuInput, ImuNoise, PositionObservation};
    /// # use inekf::smoother::{Preintegration, WindowError};
    /// # use nalgebra::{Matrix3, Vector3};
    /// use inekf::filter::{Belief, Covariance, Left};
    /// use inekf::lie::{LieGroup, SE23};
    /// use inekf::smoother::{Window, WindowOptions};
    /// use nalgebra::SVector;
    ///
    /// let first = Belief::new(SE23::identity(), Covariance::from_variances(&SVector::repeat(0.1)));
    /// # let second_of_rest = {
    /// #     let at_rest = ImuInput { omega_b: Vector3::zeros(), force_b: Vector3::new(0.0, 0.0, 9.80665) };
    /// #     let noise = ImuNoise { gyro_psd: 1e-6, accel_psd: 1e-4, gyro_bias_psd: 0.0, accel_bias_psd: 0.0 };
    /// #     let g_w = Vector3::new(0.0, 0.0, -9.80665);
    /// #     let mut motion = Preintegration::new(&SE23::identity());
    /// #     motion.push(&at_rest, &g_w, 1.0, Discretisation::ZeroOrderHold, &noise);
    /// #     motion
    /// # };
    /// # let seen_at = |x_m: f64| PositionObservation {
    /// #     position_w: Vector3::new(x_m, 0.0, 0.0),
    /// #     covariance_w: Matrix3::identity() * 0.01,
    /// #     lever_arm_b: Vector3::zeros(),
    /// # };
    /// let mut window = Window::<SE23, Left, 9>::new(&first, &WindowOptions::new(3));
    /// window.push(&second_of_rest);
    /// window.push(&second_of_rest);
    /// window.update(seen_at(0.3))?;
    /// // One state in each piece: the same as at once.
    /// let mut pieces = 1;
    /// while !window.cover_oldest(&mut 1) {
    ///     pieces += 1;
    /// }
    /// assert!(pieces > 1);
    /// assert_eq!(Some(window.oldest()), window.smoothed(0));
    /// # Ok::<(), WindowError>(())
    /// ```
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
    ///
    /// ```
    /// # use inekf::model::{Discretisation, ImuInput, ImuNoise, PositionObservation};
    /// # use inekf::smoother::{Preintegration, WindowError};
    /// # use nalgebra::{Matrix3, Vector3};
    /// use inekf::filter::{Belief, Covariance, Left};
    /// use inekf::lie::{LieGroup, SE23};
    /// use inekf::smoother::{Window, WindowOptions};
    /// use nalgebra::SVector;
    ///
    /// let first = Belief::new(SE23::identity(), Covariance::from_variances(&SVector::repeat(0.1)));
    /// # let second_of_rest = {
    /// #     let at_rest = ImuInput { omega_b: Vector3::zeros(), force_b: Vector3::new(0.0, 0.0, 9.80665) };
    /// #     let noise = ImuNoise { gyro_psd: 1e-6, accel_psd: 1e-4, gyro_bias_psd: 0.0, accel_bias_psd: 0.0 };
    /// #     let g_w = Vector3::new(0.0, 0.0, -9.80665);
    /// #     let mut motion = Preintegration::new(&SE23::identity());
    /// #     motion.push(&at_rest, &g_w, 1.0, Discretisation::ZeroOrderHold, &noise);
    /// #     motion
    /// # };
    /// # let seen_at = |x_m: f64| PositionObservation {
    /// #     position_w: Vector3::new(x_m, 0.0, 0.0),
    /// #     covariance_w: Matrix3::identity() * 0.01,
    /// #     lever_arm_b: Vector3::zeros(),
    /// # };
    /// let mut window = Window::<SE23, Left, 9>::new(&first, &WindowOptions::new(3));
    /// window.push(&second_of_rest);
    /// window.update(seen_at(0.3))?;
    /// // The later fix tells of it, less than of its own state: the velocity between them is not known.
    /// let variance = |belief: Belief<SE23, Left, 9>| belief.covariance.matrix()[(6, 6)];
    /// let (oldest, newest) = (variance(window.oldest()), variance(window.newest()));
    /// assert!(newest < oldest && oldest < variance(first));
    /// # Ok::<(), WindowError>(())
    /// ```
    pub fn oldest(&mut self) -> Belief<G, Left, D> {
        let mut budget = i64::MAX;
        self.cover_oldest(&mut budget);
        let known = self.cover.covariance;
        Belief::new(self.knots[0].chi, known.unwrap_or(self.knots[0].filtered))
    }

    /// Hands over the covariances of the left-invariant errors of all states given all fixes, the newest first, each with its
    /// index, the oldest 0. Matrix products for each state: for reports, not for each sample.
    ///
    /// ```
    /// # use inekf::model::{Discretisation, ImuInput, ImuNoise};
    /// # use inekf::smoother::Preintegration;
    /// # use nalgebra::Vector3;
    /// use inekf::filter::{Belief, Covariance, Left};
    /// use inekf::lie::{LieGroup, SE23};
    /// use inekf::smoother::{Window, WindowOptions};
    /// use nalgebra::SVector;
    ///
    /// let first = Belief::new(SE23::identity(), Covariance::from_variances(&SVector::repeat(0.1)));
    /// # let second_of_rest = {
    /// #     let at_rest = ImuInput { omega_b: Vector3::zeros(), force_b: Vector3::new(0.0, 0.0, 9.80665) };
    /// #     let noise = ImuNoise { gyro_psd: 1e-6, accel_psd: 1e-4, gyro_bias_psd: 0.0, accel_bias_psd: 0.0 };
    /// #     let g_w = Vector3::new(0.0, 0.0, -9.80665);
    /// #     let mut motion = Preintegration::new(&SE23::identity());
    /// #     motion.push(&at_rest, &g_w, 1.0, Discretisation::ZeroOrderHold, &noise);
    /// #     motion
    /// # };
    /// let mut window = Window::<SE23, Left, 9>::new(&first, &WindowOptions::new(3));
    /// window.push(&second_of_rest);
    /// window.push(&second_of_rest);
    /// let mut order = Vec::new();
    /// window.covariances(&mut |index, _| order.push(index));
    /// // The newest first.
    /// assert_eq!(order, [2, 1, 0]);
    /// ```
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
    ///
    /// ```
    /// # use inekf::model::{Discretisation, ImuInput, ImuNoise, PositionObservation};
    /// # use inekf::smoother::{Preintegration, WindowError};
    /// # use nalgebra::{Matrix3, Vector3};
    /// use inekf::filter::{Belief, Covariance, Left};
    /// use inekf::lie::{LieGroup, SE23};
    /// use inekf::smoother::{Window, WindowOptions};
    /// use nalgebra::SVector;
    ///
    /// let first = Belief::new(SE23::identity(), Covariance::from_variances(&SVector::repeat(0.1)));
    /// # let second_of_rest = {
    /// #     let at_rest = ImuInput { omega_b: Vector3::zeros(), force_b: Vector3::new(0.0, 0.0, 9.80665) };
    /// #     let noise = ImuNoise { gyro_psd: 1e-6, accel_psd: 1e-4, gyro_bias_psd: 0.0, accel_bias_psd: 0.0 };
    /// #     let g_w = Vector3::new(0.0, 0.0, -9.80665);
    /// #     let mut motion = Preintegration::new(&SE23::identity());
    /// #     motion.push(&at_rest, &g_w, 1.0, Discretisation::ZeroOrderHold, &noise);
    /// #     motion
    /// # };
    /// # let seen_at = |x_m: f64| PositionObservation {
    /// #     position_w: Vector3::new(x_m, 0.0, 0.0),
    /// #     covariance_w: Matrix3::identity() * 0.01,
    /// #     lever_arm_b: Vector3::zeros(),
    /// # };
    /// let mut window = Window::<SE23, Left, 9>::new(&first, &WindowOptions::new(3));
    /// window.push(&second_of_rest);
    /// window.update(seen_at(0.3))?;
    /// // Nothing came after the newest.
    /// assert_eq!(window.smoothed(1), Some(window.newest()));
    /// assert!(window.smoothed(2).is_none());
    /// # Ok::<(), WindowError>(())
    /// ```
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
