//! How much work there is: a count, so that where a slice of a solution ends does not depend on any clock.

use super::Window;
use crate::filter::Side;
use crate::model::InertialState;

/// Units of work, about a tenth of a microsecond each on a processor of 2020: one state, forward and with gains that are
/// stored, or back: vectors only.
const VECTORS: i64 = 1;

/// One state forward with its gain and covariance, about as the product of matrices of dimension D.
const fn matrices(dimension: usize, tracked: bool) -> i64 {
    let cube = (dimension * dimension * dimension) as i64;
    1 + cube / if tracked { 250 } else { 140 }
}

impl<G: InertialState<D>, S: Side, const D: usize> Window<G, S, D> {
    /// The units of work of the next push and update, and of the covariance of the state that leaves.
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
    /// // More states, more work: as long as there is room for them.
    /// let of_two = window.work();
    /// window.push(&second_of_rest);
    /// assert!(window.work() > of_two);
    /// ```
    pub fn work(&self) -> i64 {
        let states = (self.knots.len() + 1).min(self.options.capacity) as i64;
        let of_oldest = if self.is_full() {
            self.work_of_cover()
        } else {
            0
        };
        let each = states * (of_oldest + self.work_forward() + self.work_back());
        self.options.iterations as i64 * each + self.work_of_push()
    }

    /// The units of work of a push.
    ///
    /// ```
    /// use inekf::filter::{Belief, Covariance, Left};
    /// use inekf::lie::{LieGroup, SE23};
    /// use inekf::smoother::{Window, WindowOptions};
    /// use nalgebra::SVector;
    ///
    /// let first = Belief::new(SE23::identity(), Covariance::from_variances(&SVector::repeat(0.1)));
    /// let mut window = Window::<SE23, Left, 9>::new(&first, &WindowOptions::new(3));
    /// // A part of the work.
    /// assert!(window.work_of_push() < window.work());
    /// ```
    pub fn work_of_push(&self) -> i64 {
        3 * matrices(D, self.is_tracked())
    }

    pub(super) fn work_of_cover(&self) -> i64 {
        matrices(D, self.is_tracked())
    }

    pub(super) fn work_forward(&self) -> i64 {
        if self.must_linearise() {
            matrices(D, self.is_tracked())
        } else {
            VECTORS
        }
    }

    pub(super) fn work_back(&self) -> i64 {
        if self.is_affine() {
            VECTORS
        } else {
            VECTORS + (D * D / 100) as i64
        }
    }
}
