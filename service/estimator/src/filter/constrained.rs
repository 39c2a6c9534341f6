//! The linearly constrained rule, \[LC\] (22): LC-InEKF on the left or right, LC-EKF on the additive error.
//!
//! The columns are `(Delta, T) = (H d, d)` for each process mismatch, with d the direction accumulated since
//! the last update, and `(dh, 0)` for each output mismatch, at the iterate.

use nalgebra::{SMatrix, SVector};

use super::belief::Belief;
use super::constraint::Constraints;
use super::covariance::Covariance;
use super::gain::{GainRule, Judgement};
use super::linearised::Linearised;
use super::side::{Left, Side};
use super::update::UpdateError;
use crate::model::process::MAX_PROCESS_MISMATCHES;
use crate::model::{
    Columns, Declared, MeanMismatch, Observation, OutputMismatch, Points, Pose, ProcessColumns,
};

/// The gain that the declared mismatches do not reach.
///
/// ```
/// use inekf::filter::{Belief, Constrained, Covariance, Left, UpdateOptions, update_with};
/// use inekf::lie::{LieGroup, SE2};
/// use inekf::model::{
///     Declared, OdometryStep, OutputMismatch, PlanarPair, PointFix, ProcessColumns, ProcessMismatch,
/// };
/// use nalgebra::{Matrix2, Matrix3, Vector2, Vector3};
///
/// let fix = |position_w| PointFix {
///     position_w,
///     covariance_w: Matrix2::identity(),
///     lever_arm_b: Vector2::zeros(),
///     scale_error: 0.0,
/// };
/// let points = PlanarPair::new([fix(Vector2::new(9.5, 0.3)), fix(Vector2::new(20.0, 0.0))]);
/// let p = Covariance::from_variances(&Vector3::new(0.01, 1.0, 1.0));
/// let mut belief = Belief::<SE2, Left, 3>::new(SE2::identity(), p);
/// belief.mean.position.x = 10.0;
/// // The second source shows twice the distance: its scale is declared to be unknown.
/// let process = ProcessColumns::<3, ProcessMismatch>::new(&[]).expect("none");
/// let outputs = [Declared::hard(OutputMismatch::MeasurementScale { source: 1 })];
/// let rule = Constrained::new(&belief, &process, &outputs, &points);
/// update_with(&mut belief, &points, &rule, &UpdateOptions::ITERATED)?;
/// // So it says nothing along x, and the first one is followed half way.
/// assert!((belief.mean.position.x - 9.75).abs() < 0.05);
/// # Ok::<(), inekf::filter::UpdateError>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Constrained<'a, const D: usize, const K: usize, const N: usize, const M: usize> {
    process: [(SVector<f64, D>, f64); MAX_PROCESS_MISMATCHES],
    process_count: usize,
    outputs: &'a [Declared<OutputMismatch>],
    points: &'a Points<K, N, M>,
}

impl<'a, const D: usize, const K: usize, const N: usize, const M: usize>
    Constrained<'a, D, K, N, M>
{
    /// The rule for an update of `belief` with `points`, after the motion of `process`.
    ///
    /// ```
    /// # use inekf::model::PointFix;
    /// # use nalgebra::{Matrix2, Vector2};
    /// use inekf::filter::{Belief, Constrained, Covariance, GainRule, Left, Linearised};
    /// use inekf::lie::{LieGroup, SE2};
    /// use inekf::model::{Declared, OutputMismatch, PlanarPair, ProcessColumns, ProcessMismatch};
    /// use nalgebra::{SVector, Vector3, Vector4};
    ///
    /// # let fix = |x_m: f64| PointFix {
    /// #     position_w: Vector2::new(x_m, 0.0),
    /// #     covariance_w: Matrix2::identity(),
    /// #     lever_arm_b: Vector2::zeros(),
    /// #     scale_error: 0.0,
    /// # };
    /// let points = PlanarPair::new([fix(9.5), fix(20.0)]);
    /// let p = Covariance::from_variances(&Vector3::new(0.01, 1.0, 1.0));
    /// let mut belief = Belief::<SE2, Left, 3>::new(SE2::identity(), p);
    /// belief.mean.position.x = 10.0;
    /// let process = ProcessColumns::<3, ProcessMismatch>::new(&[]).expect("none");
    /// let noise = points.noise_covariance();
    /// let linearised = Linearised::at(&belief, &points, &belief.mean, &SVector::zeros(), &noise).expect("definite");
    /// let outputs = [Declared::hard(OutputMismatch::MeasurementScale { source: 1 })];
    /// let rule = Constrained::new(&belief, &process, &outputs, &points);
    /// // What a wrong scale of the second source adds at ten metres is not followed.
    /// let gain = rule.gain(&belief.covariance, &linearised)?;
    /// assert!((gain * Vector4::new(0.0, 0.0, 10.0, 0.0)).norm() < 1e-9);
    /// # Ok::<(), inekf::filter::UpdateError>(())
    /// ```
    pub fn new<G: Pose<D, N>, S: Side>(
        belief: &Belief<G, S, D>,
        process: &ProcessColumns<D, impl MeanMismatch>,
        outputs: &'a [Declared<OutputMismatch>],
        points: &'a Points<K, N, M>,
    ) -> Self {
        let mut rule = Self {
            process: [(SVector::zeros(), 0.0); MAX_PROCESS_MISMATCHES],
            process_count: 0,
            outputs,
            points,
        };
        for (declared, direction) in process.active() {
            let direction = if S::IS_LEFT {
                direction
            } else {
                S::from_left(&belief.mean) * direction
            };
            rule.process[rule.process_count] = (direction, declared.sigma);
            rule.process_count += 1;
        }
        rule
    }

    /// Whether the declared mismatches can be constrained with the sources of `points` at all, and how many
    /// dimensions of the measurement that takes: tried at a pose in general position. For use at start-up, with
    /// [`ProcessColumns::in_general_motion`]; accidents on the way are refused by the update itself.
    ///
    /// # Errors
    /// [`UpdateError::NoSuchSource`], [`UpdateError::UnsolvableConstraints`] or
    /// [`UpdateError::TooManyConstraints`].
    ///
    /// ```
    /// use inekf::filter::Constrained;
    /// use inekf::lie::SE2;
    /// use inekf::model::{
    ///     Declared, OutputMismatch, PlanarFix, PointFix, ProcessColumns, ProcessMismatch,
    /// };
    /// use nalgebra::{Matrix2, Vector2};
    ///
    /// let points = PlanarFix::new([PointFix {
    ///     position_w: Vector2::zeros(),
    ///     covariance_w: Matrix2::identity(),
    ///     lever_arm_b: Vector2::zeros(),
    ///     scale_error: 0.0,
    /// }]);
    /// let process = ProcessColumns::<3, ProcessMismatch>::new(&[]).expect("none");
    /// // There is one source, and the mismatch is of a second.
    /// let outputs = [Declared::hard(OutputMismatch::MeasurementScale { source: 1 })];
    /// assert!(Constrained::check::<SE2>(&process, &outputs, &points).is_err());
    /// assert_eq!(Constrained::check::<SE2>(&process, &[], &points), Ok(0));
    /// ```
    pub fn check<G: Pose<D, N>>(
        process: &ProcessColumns<D, impl MeanMismatch>,
        outputs: &'a [Declared<OutputMismatch>],
        points: &'a Points<K, N, M>,
    ) -> Result<usize, UpdateError> {
        for output in outputs {
            let source = output.mismatch.source();
            if source >= K {
                return Err(UpdateError::NoSuchSource { source, sources: K });
            }
        }
        // No coordinate vanishes, no two directions agree.
        let chi = G::exp(&SVector::from_fn(|i, _| 0.3 + 0.7 * (i as f64 * i as f64)));
        let belief = Belief::<G, Left, D>::new(chi, Covariance::from_variances(&SVector::zeros()));
        let rule = Self::new(&belief, process, outputs, points);
        rule.assembled(&chi, &points.left_jacobian(&chi))?.rank()
    }

    /// The columns of `L Delta = T` at the iterate.
    ///
    /// # Errors
    /// [`UpdateError::TooManyConstraints`].
    ///
    /// ```
    /// # use inekf::model::PointFix;
    /// # use nalgebra::{Matrix2, Vector2};
    /// use inekf::filter::{Belief, Constrained, Covariance, Left, Linearised};
    /// use inekf::lie::{LieGroup, SE2};
    /// use inekf::model::{Declared, OutputMismatch, PlanarPair, ProcessColumns, ProcessMismatch};
    /// use nalgebra::{SVector, Vector3};
    ///
    /// # let fix = |x_m: f64| PointFix {
    /// #     position_w: Vector2::new(x_m, 0.0),
    /// #     covariance_w: Matrix2::identity(),
    /// #     lever_arm_b: Vector2::zeros(),
    /// #     scale_error: 0.0,
    /// # };
    /// let points = PlanarPair::new([fix(9.5), fix(20.0)]);
    /// let p = Covariance::from_variances(&Vector3::new(0.01, 1.0, 1.0));
    /// let mut belief = Belief::<SE2, Left, 3>::new(SE2::identity(), p);
    /// belief.mean.position.x = 10.0;
    /// let process = ProcessColumns::<3, ProcessMismatch>::new(&[]).expect("none");
    /// let noise = points.noise_covariance();
    /// let linearised = Linearised::at(&belief, &points, &belief.mean, &SVector::zeros(), &noise).expect("definite");
    /// let outputs = [Declared::hard(OutputMismatch::MeasurementScale { source: 1 })];
    /// let rule = Constrained::new(&belief, &process, &outputs, &points);
    /// // L Delta = T.
    /// let constraints = rule.constraints(&linearised)?;
    /// let gain = constraints.gain(&linearised)?;
    /// for (delta, t) in constraints.columns() {
    ///     assert!((gain * delta - t).norm() < 1e-9);
    /// }
    /// # Ok::<(), inekf::filter::UpdateError>(())
    /// ```
    pub fn constraints<G: Pose<D, N>>(
        &self,
        linearised: &Linearised<G, D, M>,
    ) -> Result<Constraints<D, M>, UpdateError> {
        self.assembled(&linearised.chi, &linearised.h)
    }

    fn assembled<G: Pose<D, N>>(
        &self,
        chi: &G,
        h: &SMatrix<f64, M, D>,
    ) -> Result<Constraints<D, M>, UpdateError> {
        let mut constraints = Constraints::default();
        for (direction, sigma) in &self.process[..self.process_count] {
            let t = Columns::one(*direction);
            constraints.push(&t.map(|t| h * t), &t, *sigma)?;
        }
        for output in self.outputs {
            let delta = output.mismatch.columns(self.points, chi);
            constraints.push(&delta, &delta.map(|_| SVector::zeros()), output.sigma)?;
        }
        Ok(constraints)
    }
}

impl<G: Pose<D, N>, const D: usize, const K: usize, const N: usize, const M: usize>
    GainRule<G, D, M> for Constrained<'_, D, K, N, M>
{
    fn judge(&self, linearised: &Linearised<G, D, M>) -> Result<Judgement, UpdateError> {
        self.constraints(linearised)?.judge(linearised)
    }

    fn gain(
        &self,
        _prior: &Covariance<D>,
        linearised: &Linearised<G, D, M>,
    ) -> Result<SMatrix<f64, D, M>, UpdateError> {
        self.constraints(linearised)?.gain(linearised)
    }

    fn covariance(
        &self,
        prior: &Covariance<D>,
        linearised: &Linearised<G, D, M>,
    ) -> Result<Covariance<D>, UpdateError> {
        let constraints = self.constraints(linearised)?;
        let gain = constraints.gain(linearised)?;
        Ok(constraints.covariance(prior, linearised, &gain))
    }
}
