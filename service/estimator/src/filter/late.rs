//! A correction of the past, given to the belief of now without going back: the cost does not depend on how long ago
//! it was.
//!
//! Between two group-affine beliefs that no measurement separates, errors move by a linear map that no estimate enters
//! (\[IS\], Proposition 1). Whatever a measurement that came late does to the belief then, `(chi, P)` becoming
//! `(chi+, P+)`, therefore does the same to the belief now, carried along by that map. With `chi_now = W phi(chi) U`
//! ([`Drift`], M the differential of phi), exactly:
//!
//! ```text
//! chi_now+ = W phi(chi+) U
//! left     P_now+ = P_now - F (P - P+) F^T                          F = Ad_{U^-1} M
//! right    P_now+ = C_now (P_now - F (P - C^-1 P+ C^-T) F^T) C_now^T    F = Ad_W M
//! ```
//!
//! C = `Ad(chi+ chi^-1)` and `C_now = Ad(chi_now+ chi_now^-1)`: in world coordinates the noise of the steps is turned
//! with the body, and so with its correction; taking P+ back to where P was and the whole forth again turns it alike.
//! In the additive error of the EKF, which between measurements is a linear image of the left one, the left formula
//! holds there. For the Kalman update `chi_now+ = chi_now exp(F K z)` and `P - P+ = K H P`; nothing here asks what
//! kind of update it was, iterated or not.
//!
//! U and F come from the two means alone, so that nothing is accumulated that could drift, over milliseconds or hours.
//! Biases (then F depends on them), or an update in between, need a replay.

use core::marker::PhantomData;

use nalgebra::SMatrix;

use super::additive::Additive;
use super::belief::Belief;
use super::covariance::Covariance;
use super::side::{Left, Right, Side};
use crate::lie::LieGroup;
use crate::model::{Automorphism, Drift};

/// The least share of a variance that may remain for a subtraction to be as good as a replay: with less, more than a
/// digit and a half go with what is taken away.
pub const LEAST_SHARE: f64 = 0.03;

/// What a measurement changed at its own time, to be carried on to later beliefs.
///
/// ```
/// use inekf::filter::{
///     Belief, Covariance, LateCorrection, Left, UpdateOptions, propagate_odometry, update,
/// };
/// use inekf::lie::{LieGroup, SE2};
/// use inekf::model::{Drift, OdometryStep, PlanarFix, PointFix};
/// use nalgebra::{Matrix2, Matrix3, Vector2, Vector3};
///
/// let p = Covariance::from_variances(&Vector3::new(0.01, 1.0, 1.0));
/// let then = Belief::<SE2, Left, 3>::new(SE2::identity(), p);
/// let step = OdometryStep::new(&Vector3::new(0.1, 5.0, 0.0), 1.0);
/// let move_on = |belief: &Belief<SE2, Left, 3>| propagate_odometry(belief, &step, &(Matrix3::identity() * 0.01));
/// let fix = PlanarFix::new([PointFix {
///     position_w: Vector2::new(0.5, -0.2),
///     covariance_w: Matrix2::identity(),
///     lever_arm_b: Vector2::zeros(),
///     scale_error: 0.0,
/// }]);
/// let mut corrected = then;
/// update(&mut corrected, &fix, &UpdateOptions::ITERATED)?;
/// // The fix came when the vehicle had gone on: carried to now, it is what a replay would have given.
/// let late = LateCorrection::between(&then, &corrected);
/// let carried = late.carried(&Drift::none(), &move_on(&then)).expect("little was taken away");
/// let replayed = move_on(&corrected);
/// assert!(carried.mean.between(&replayed.mean).log().norm() < 1e-9);
/// assert!((carried.covariance.matrix() - replayed.covariance.matrix()).norm() < 1e-9);
/// # Ok::<(), inekf::filter::UpdateError>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LateCorrection<G, S, const D: usize> {
    /// chi.
    before: G,
    /// chi+.
    after: G,
    /// What P lost, D x D, in the coordinates of the error around chi; see [`LateSide::lost`].
    lost: SMatrix<f64, D, D>,
    side: PhantomData<S>,
}

impl<G: LieGroup<D>, S: LateSide, const D: usize> LateCorrection<G, S, D> {
    /// What changed from `before` the measurement to `after` it.
    ///
    /// ```
    /// use inekf::filter::{Belief, Covariance, LateCorrection, Left, propagate_odometry};
    /// use inekf::lie::{LieGroup, SE2};
    /// use inekf::model::{Drift, OdometryStep};
    /// use nalgebra::{Matrix3, Vector3};
    ///
    /// let p = Covariance::from_variances(&Vector3::new(0.01, 1.0, 1.0));
    /// let then = Belief::<SE2, Left, 3>::new(SE2::identity(), p);
    /// let step = OdometryStep::new(&Vector3::new(0.1, 5.0, 0.0), 1.0);
    /// let now = propagate_odometry(&then, &step, &(Matrix3::identity() * 0.01));
    /// // Nothing was changed, so nothing is carried on.
    /// let late = LateCorrection::between(&then, &then);
    /// let carried = late.carried(&Drift::none(), &now).expect("nothing was taken away");
    /// assert!(carried.mean.between(&now.mean).log().norm() < 1e-12);
    /// assert!((carried.covariance.matrix() - now.covariance.matrix()).norm() < 1e-12);
    /// ```
    pub fn between(before: &Belief<G, S, D>, after: &Belief<G, S, D>) -> Self {
        Self {
            before: before.mean,
            after: after.mean,
            lost: S::lost(before, after),
            side: PhantomData,
        }
    }

    /// The belief `now`, which `drift` and what the body felt have led to from the belief before the measurement, as
    /// if they had led to it from the one after. Biases and measurements in between have no place in this.
    ///
    /// `None` where less than [`LEAST_SHARE`] of a variance remains, so that the subtraction would lose digits: replay.
    ///
    /// ```
    /// # use inekf::filter::{UpdateOptions, update};
    /// # use inekf::model::{PlanarFix, PointFix};
    /// # use nalgebra::{Matrix2, Vector2};
    /// use inekf::filter::{Belief, Covariance, LateCorrection, Left, propagate_odometry};
    /// use inekf::lie::{LieGroup, SE2};
    /// use inekf::model::{Drift, OdometryStep};
    /// use nalgebra::{Matrix3, Vector3};
    ///
    /// let p = Covariance::from_variances(&Vector3::new(0.01, 1.0, 1.0));
    /// let then = Belief::<SE2, Left, 3>::new(SE2::identity(), p);
    /// let step = OdometryStep::new(&Vector3::new(0.1, 5.0, 0.0), 1.0);
    /// let now = propagate_odometry(&then, &step, &(Matrix3::identity() * 0.01));
    /// # let corrected_by = |variance: f64| {
    /// #     let fix = PlanarFix::new([PointFix {
    /// #         position_w: Vector2::new(0.5, -0.2),
    /// #         covariance_w: Matrix2::identity() * variance,
    /// #         lever_arm_b: Vector2::zeros(),
    /// #         scale_error: 0.0,
    /// #     }]);
    /// #     let mut corrected = then;
    /// #     update(&mut corrected, &fix, &UpdateOptions::PLAIN).map(|_| corrected)
    /// # };
    /// // A thousand times as good as what was known: too little would be left of a difference.
    /// let late = LateCorrection::between(&then, &corrected_by(1e-6)?);
    /// assert!(late.carried(&Drift::none(), &now).is_none());
    /// # Ok::<(), inekf::filter::UpdateError>(())
    /// ```
    pub fn carried<A: Automorphism<G, D>>(
        &self,
        drift: &Drift<G, A, D>,
        now: &Belief<G, S, D>,
    ) -> Option<Belief<G, S, D>> {
        let (belief, share) = self.carried_with_share(drift, now);
        (share >= LEAST_SHARE).then_some(belief)
    }

    /// [`carried`](Self::carried) in any case, with the least share of a variance that remains.
    ///
    /// ```
    /// # use inekf::filter::{UpdateOptions, update};
    /// # use inekf::model::{PlanarFix, PointFix};
    /// # use nalgebra::{Matrix2, Vector2};
    /// use inekf::filter::{Belief, Covariance, LateCorrection, Left, propagate_odometry};
    /// use inekf::lie::{LieGroup, SE2};
    /// use inekf::model::{Drift, OdometryStep};
    /// use nalgebra::{Matrix3, Vector3};
    ///
    /// let p = Covariance::from_variances(&Vector3::new(0.01, 1.0, 1.0));
    /// let then = Belief::<SE2, Left, 3>::new(SE2::identity(), p);
    /// let step = OdometryStep::new(&Vector3::new(0.1, 5.0, 0.0), 1.0);
    /// let now = propagate_odometry(&then, &step, &(Matrix3::identity() * 0.01));
    /// # let corrected_by = |variance: f64| {
    /// #     let fix = PlanarFix::new([PointFix {
    /// #         position_w: Vector2::new(0.5, -0.2),
    /// #         covariance_w: Matrix2::identity() * variance,
    /// #         lever_arm_b: Vector2::zeros(),
    /// #         scale_error: 0.0,
    /// #     }]);
    /// #     let mut corrected = then;
    /// #     update(&mut corrected, &fix, &UpdateOptions::PLAIN).map(|_| corrected)
    /// # };
    /// // As good as what was known: half of the variance is left, and by now a little was added.
    /// let late = LateCorrection::between(&then, &corrected_by(1.0)?);
    /// let (_, share) = late.carried_with_share(&Drift::none(), &now);
    /// assert!(share > 0.5 && share < 0.52);
    /// # Ok::<(), inekf::filter::UpdateError>(())
    /// ```
    pub fn carried_with_share<A: Automorphism<G, D>>(
        &self,
        drift: &Drift<G, A, D>,
        now: &Belief<G, S, D>,
    ) -> (Belief<G, S, D>, f64) {
        let body = drift.body_between(&self.before, &now.mean);
        let mean = drift.apply(&self.after).compose(&body);
        let (remaining, share) = S::remaining(&self.lost, drift, &body, now);
        (S::recentred(&remaining, now, mean), share)
    }
}

/// `P - lost`, and the least share of a variance that remains; 0 if that is not a number.
fn less<const D: usize>(p: &Covariance<D>, lost: &SMatrix<f64, D, D>) -> (Covariance<D>, f64) {
    let mut remaining = *p;
    let mut share = f64::INFINITY;
    remaining.change_symmetrically(|remaining| {
        *remaining -= lost;
        for i in 0..D {
            let (left, whole) = (remaining[(i, i)], p.matrix()[(i, i)]);
            // What was known exactly stays so.
            if left != whole {
                share = if left >= 0.0 {
                    share.min(left / whole)
                } else {
                    0.0
                };
            }
        }
    });
    (remaining, share)
}

/// A side on which a correction is carried on in time: in coordinates of the left-invariant error, unless it has better
/// ones.
///
/// ```
/// use inekf::filter::{Additive, Belief, Covariance, LateSide, Left, Right};
/// use inekf::lie::{LieGroup, SE2};
/// use nalgebra::Vector3;
///
/// fn lost<S: LateSide>() -> f64 {
///     let known = |variance| {
///         let p = Covariance::from_variances(&Vector3::repeat(variance));
///         Belief::<SE2, S, 3>::new(SE2::identity(), p)
///     };
///     S::lost(&known(1.0), &known(0.25))[(1, 1)]
/// }
/// // At the origin all errors are one.
/// assert_eq!((lost::<Left>(), lost::<Right>(), lost::<Additive>()), (0.75, 0.75, 0.75));
/// ```
pub trait LateSide: Side {
    /// What the covariance lost from `before` to `after` a measurement, in coordinates around the mean before.
    ///
    /// ```
    /// # use inekf::filter::{UpdateOptions, update};
    /// # use inekf::model::{PlanarFix, PointFix};
    /// # use nalgebra::{Matrix2, Vector2};
    /// use inekf::filter::{Belief, Covariance, LateSide, Left};
    /// use inekf::lie::{LieGroup, SE2};
    /// use nalgebra::Vector3;
    ///
    /// let p = Covariance::from_variances(&Vector3::new(0.01, 1.0, 1.0));
    /// let then = Belief::<SE2, Left, 3>::new(SE2::identity(), p);
    /// # let corrected_by = |variance: f64| {
    /// #     let fix = PlanarFix::new([PointFix {
    /// #         position_w: Vector2::new(0.5, -0.2),
    /// #         covariance_w: Matrix2::identity() * variance,
    /// #         lever_arm_b: Vector2::zeros(),
    /// #         scale_error: 0.0,
    /// #     }]);
    /// #     let mut corrected = then;
    /// #     update(&mut corrected, &fix, &UpdateOptions::PLAIN).map(|_| corrected)
    /// # };
    /// // P - P+, of a fix as good as what was known.
    /// let lost = Left::lost(&then, &corrected_by(1.0)?);
    /// assert!((lost.diagonal() - Vector3::new(0.0, 0.5, 0.5)).norm() < 1e-12);
    /// # Ok::<(), inekf::filter::UpdateError>(())
    /// ```
    #[inline]
    fn lost<G: LieGroup<D>, const D: usize>(
        before: &Belief<G, Self, D>,
        after: &Belief<G, Self, D>,
    ) -> SMatrix<f64, D, D> {
        before.left_covariance().matrix() - after.left_covariance().matrix()
    }

    /// What is left of the covariance of `now` of such a loss, in coordinates around its mean, after `drift` and the
    /// motion `body`, and the least share of a variance that this is.
    ///
    /// ```
    /// # use inekf::filter::{UpdateOptions, update};
    /// # use inekf::model::{PlanarFix, PointFix};
    /// # use nalgebra::{Matrix2, Vector2};
    /// use inekf::filter::{Belief, Covariance, LateSide, Left};
    /// use inekf::lie::{LieGroup, SE2};
    /// use inekf::model::Drift;
    /// use nalgebra::Vector3;
    ///
    /// let p = Covariance::from_variances(&Vector3::new(0.01, 1.0, 1.0));
    /// let then = Belief::<SE2, Left, 3>::new(SE2::identity(), p);
    /// # let corrected_by = |variance: f64| {
    /// #     let fix = PlanarFix::new([PointFix {
    /// #         position_w: Vector2::new(0.5, -0.2),
    /// #         covariance_w: Matrix2::identity() * variance,
    /// #         lever_arm_b: Vector2::zeros(),
    /// #         scale_error: 0.0,
    /// #     }]);
    /// #     let mut corrected = then;
    /// #     update(&mut corrected, &fix, &UpdateOptions::PLAIN).map(|_| corrected)
    /// # };
    /// // Of the belief before, which has not moved since, the one after remains.
    /// let corrected = corrected_by(1.0)?;
    /// let lost = Left::lost(&then, &corrected);
    /// let (remaining, share) = Left::remaining(&lost, &Drift::none(), &SE2::identity(), &then);
    /// assert!((remaining.matrix() - corrected.covariance.matrix()).norm() < 1e-12);
    /// assert!((share - 0.5).abs() < 1e-12);
    /// # Ok::<(), inekf::filter::UpdateError>(())
    /// ```
    #[inline]
    fn remaining<G: LieGroup<D>, A: Automorphism<G, D>, const D: usize>(
        lost: &SMatrix<f64, D, D>,
        drift: &Drift<G, A, D>,
        body: &G,
        now: &Belief<G, Self, D>,
    ) -> (Covariance<D>, f64) {
        let mut lost = *lost;
        drift.automorphism.congruence(&mut lost);
        G::congruence(&mut lost, &body.inverse().adjoint());
        now.with_left_covariance(|whole| less(whole, &lost))
    }

    /// The belief at `mean` whose covariance is `remaining` in coordinates around the mean of `now`.
    ///
    /// ```
    /// use inekf::filter::{Belief, Covariance, LateSide, Left, propagate_odometry};
    /// use inekf::lie::{LieGroup, SE2};
    /// use inekf::model::OdometryStep;
    /// use nalgebra::{Matrix3, Vector3};
    ///
    /// let p = Covariance::from_variances(&Vector3::new(0.01, 1.0, 1.0));
    /// let then = Belief::<SE2, Left, 3>::new(SE2::identity(), p);
    /// let step = OdometryStep::new(&Vector3::new(0.1, 5.0, 0.0), 1.0);
    /// let now = propagate_odometry(&then, &step, &(Matrix3::identity() * 0.01));
    /// // A left-invariant error is the same wherever the mean is.
    /// let moved = Left::recentred(&p, &then, now.mean);
    /// assert_eq!((moved.mean, moved.covariance), (now.mean, p));
    /// ```
    #[inline]
    fn recentred<G: LieGroup<D>, const D: usize>(
        remaining: &Covariance<D>,
        _now: &Belief<G, Self, D>,
        mean: G,
    ) -> Belief<G, Self, D> {
        Belief::from_left_covariance(mean, *remaining)
    }
}

impl LateSide for Left {}

impl LateSide for Additive {}

impl LateSide for Right {
    fn lost<G: LieGroup<D>, const D: usize>(
        before: &Belief<G, Self, D>,
        after: &Belief<G, Self, D>,
    ) -> SMatrix<f64, D, D> {
        let mut kept = after.covariance;
        kept.transform_by::<G>(&before.mean.compose(&after.mean.inverse()).adjoint());
        before.covariance.matrix() - kept.matrix()
    }

    fn remaining<G: LieGroup<D>, A: Automorphism<G, D>, const D: usize>(
        lost: &SMatrix<f64, D, D>,
        drift: &Drift<G, A, D>,
        _body: &G,
        now: &Belief<G, Self, D>,
    ) -> (Covariance<D>, f64) {
        let mut lost = *lost;
        drift.automorphism.congruence(&mut lost);
        G::congruence(&mut lost, &drift.world.adjoint());
        less(&now.covariance, &lost)
    }

    fn recentred<G: LieGroup<D>, const D: usize>(
        remaining: &Covariance<D>,
        now: &Belief<G, Self, D>,
        mean: G,
    ) -> Belief<G, Self, D> {
        let mut covariance = *remaining;
        covariance.transform_by::<G>(&mean.compose(&now.mean.inverse()).adjoint());
        Belief::new(mean, covariance)
    }
}
