//! Propagation of a belief through one IMU interval, or one step of odometry.

use nalgebra::{SMatrix, Vector3};

use super::belief::Belief;
use super::side::{InertialSide, Side};
use crate::lie::LieGroup;
use crate::model::{
    Augmented, Discretisation, ImuInput, ImuNoise, InertialState, OdometryStep, RigidPose, Unknowns,
};

/// Moves `belief` over `dt_s` seconds with the raw sample `measured` (its biases are removed here).
///
/// `P+ = F P F^T + Q` in the error of side S, by blocks ([`Transition`](crate::model::Transition)).
///
/// ```
/// use inekf::filter::{Belief, Covariance, Left, propagate};
/// use inekf::lie::{LieGroup, SE23};
/// use inekf::model::{Discretisation, ImuInput, ImuNoise};
/// use nalgebra::{SVector, Vector3};
///
/// // A second of rest: nothing moves, and what is known of the position grows by what is not known of the velocity.
/// let variances = SVector::from_fn(|i, _| if (3..6).contains(&i) { 0.04 } else { 0.0 });
/// let start = Belief::<SE23, Left, 9>::new(SE23::identity(), Covariance::from_variances(&variances));
/// let at_rest = ImuInput { omega_b: Vector3::zeros(), force_b: Vector3::new(0.0, 0.0, 9.80665) };
/// let quiet = ImuNoise { gyro_psd: 0.0, accel_psd: 0.0, gyro_bias_psd: 0.0, accel_bias_psd: 0.0 };
/// let g_w = Vector3::new(0.0, 0.0, -9.80665);
/// let after = propagate(&start, &at_rest, &g_w, 1.0, Discretisation::ZeroOrderHold, &quiet);
/// assert!(after.mean.position.norm() < 1e-12);
/// assert!((after.covariance.matrix()[(6, 6)] - 0.04).abs() < 1e-12);
/// ```
pub fn propagate<G: InertialState<D>, S: InertialSide, const D: usize>(
    belief: &Belief<G, S, D>,
    measured: &ImuInput,
    g_w: &Vector3<f64>,
    dt_s: f64,
    discretisation: Discretisation,
    noise: &ImuNoise,
) -> Belief<G, S, D> {
    let mut moved = *belief;
    propagate_in_place(&mut moved, measured, g_w, dt_s, discretisation, noise);
    moved
}

/// [`propagate`] without a second belief. Part of whatever calls it, so that it is compiled for the instructions that
/// are used there.
///
/// ```
/// use inekf::filter::{Belief, Covariance, Left, propagate, propagate_in_place};
/// use inekf::lie::{LieGroup, SE23};
/// use inekf::model::{Discretisation, ImuInput, ImuNoise};
/// use nalgebra::{SVector, Vector3};
///
/// let start = Belief::<SE23, Left, 9>::new(SE23::identity(), Covariance::from_variances(&SVector::repeat(0.1)));
/// let turn = ImuInput { omega_b: Vector3::new(0.0, 0.0, 0.5), force_b: Vector3::new(1.0, 0.0, 9.8) };
/// let noise = ImuNoise { gyro_psd: 1e-6, accel_psd: 1e-4, gyro_bias_psd: 0.0, accel_bias_psd: 0.0 };
/// let g_w = Vector3::new(0.0, 0.0, -9.80665);
/// let mut belief = start;
/// propagate_in_place(&mut belief, &turn, &g_w, 0.01, Discretisation::ZeroOrderHold, &noise);
/// assert_eq!(belief, propagate(&start, &turn, &g_w, 0.01, Discretisation::ZeroOrderHold, &noise));
/// ```
#[inline(always)]
pub fn propagate_in_place<G: InertialState<D>, S: InertialSide, const D: usize>(
    belief: &mut Belief<G, S, D>,
    measured: &ImuInput,
    g_w: &Vector3<f64>,
    dt_s: f64,
    discretisation: Discretisation,
    noise: &ImuNoise,
) {
    let before = &belief.mean;
    let increment = before.increment(measured, g_w, dt_s, discretisation);
    let mean = before.moved(&increment);
    let transition = S::transition(&increment, before.pose(), mean.pose());
    belief.mean = mean;
    belief
        .covariance
        .change_symmetrically(|p| G::carry(&transition, p, noise));
}

/// The same as [`propagate`] by general matrix products, which know nothing of the blocks: its reference.
///
/// The left-invariant F and Q are carried to the side S by the adjoints before and after the step (\[PAR\],
/// Proposition 1).
///
/// ```
/// use inekf::filter::{Belief, Covariance, Right, propagate, propagate_dense};
/// use inekf::lie::{LieGroup, SE23};
/// use inekf::model::{Discretisation, ImuInput, ImuNoise};
/// use nalgebra::{SVector, Vector3};
///
/// let start = Belief::<SE23, Right, 9>::new(SE23::identity(), Covariance::from_variances(&SVector::repeat(0.1)));
/// let turn = ImuInput { omega_b: Vector3::new(0.0, 0.0, 0.5), force_b: Vector3::new(1.0, 0.0, 9.8) };
/// let noise = ImuNoise { gyro_psd: 1e-6, accel_psd: 1e-4, gyro_bias_psd: 0.0, accel_bias_psd: 0.0 };
/// let g_w = Vector3::new(0.0, 0.0, -9.80665);
/// // Another way to the same numbers.
/// let by_blocks = propagate(&start, &turn, &g_w, 0.01, Discretisation::ZeroOrderHold, &noise);
/// let dense = propagate_dense(&start, &turn, &g_w, 0.01, Discretisation::ZeroOrderHold, &noise);
/// assert!((by_blocks.covariance.matrix() - dense.covariance.matrix()).norm() < 1e-12);
/// ```
pub fn propagate_dense<G: InertialState<D>, S: Side, const D: usize>(
    belief: &Belief<G, S, D>,
    measured: &ImuInput,
    g_w: &Vector3<f64>,
    dt_s: f64,
    discretisation: Discretisation,
    noise: &ImuNoise,
) -> Belief<G, S, D> {
    let step = belief.mean.imu_step(measured, g_w, dt_s, discretisation);
    let (mean, f, q) = belief.mean.advance(&step, noise);
    moved(belief, mean, &f, &q)
}

/// Moves `belief` by one step of odometry, whose noise has the covariance `q` (D x D, of the left-invariant
/// error): \[LC\] (11) with `F = Ad_{kappa^-1}`. `P+ = F P F^T + Q` in the error of side S, as above.
///
/// ```
/// use inekf::filter::{Belief, Covariance, Left, propagate_odometry};
/// use inekf::lie::{LieGroup, SE2};
/// use inekf::model::OdometryStep;
/// use nalgebra::{Matrix3, Vector3};
///
/// // Ten metres ahead with 0.1 rad of doubt about the heading: a metre of doubt to the side.
/// let p = Covariance::from_variances(&Vector3::new(0.01, 0.0, 0.0));
/// let start = Belief::<SE2, Left, 3>::new(SE2::identity(), p);
/// let ahead = OdometryStep::new(&Vector3::new(0.0, 10.0, 0.0), 1.0);
/// let after = propagate_odometry(&start, &ahead, &Matrix3::zeros());
/// assert!((after.covariance.matrix()[(2, 2)] - 1.0).abs() < 1e-12);
/// assert!(after.covariance.matrix()[(1, 1)].abs() < 1e-12);
/// ```
pub fn propagate_odometry<G, S, const D: usize, const N: usize>(
    belief: &Belief<G, S, D>,
    step: &OdometryStep<G>,
    q: &SMatrix<f64, D, D>,
) -> Belief<G, S, D>
where
    G: RigidPose<D, N>,
    S: Side,
{
    moved(belief, step.apply(&belief.mean), &step.left_jacobian(), q)
}

/// Moves an augmented `belief` by one step of odometry, seen with the estimated parameters of `unknowns`; `q` is the
/// noise of the step on the pose and the random walk of the parameters, D x D.
///
/// ```
/// use inekf::filter::{Belief, Covariance, Left, propagate_augmented};
/// use inekf::lie::{LieGroup, SE2};
/// use inekf::model::{Augmented, OdometryStep, ProcessMismatch, Unknowns};
/// use nalgebra::{Matrix4, Vector1, Vector3, Vector4};
///
/// // A vehicle whose odometry is thought to show a tenth too little.
/// let unknowns = Unknowns::new::<2, 1>(&[ProcessMismatch::OdometryScale], &[]).expect("one parameter");
/// let start = Augmented::<SE2, 3, 1, 4>::new(SE2::identity(), Vector1::new(0.1));
/// let belief = Belief::<_, Left, 4>::new(start, Covariance::from_variances(&Vector4::repeat(0.0)));
/// let ahead = OdometryStep::new(&Vector3::new(0.0, 10.0, 0.0), 1.0);
/// let after = propagate_augmented(&belief, &unknowns, &ahead, &Matrix4::zeros());
/// assert!((after.mean.pose.position.x - 11.0).abs() < 1e-12);
/// ```
pub fn propagate_augmented<G, S, const B: usize, const P: usize, const D: usize, const N: usize>(
    belief: &Belief<Augmented<G, B, P, D>, S, D>,
    unknowns: &Unknowns,
    step: &OdometryStep<G>,
    q: &SMatrix<f64, D, D>,
) -> Belief<Augmented<G, B, P, D>, S, D>
where
    G: RigidPose<B, N>,
    S: Side,
{
    let actual = unknowns.step(step, &belief.mean);
    let mean = Augmented::new(actual.step.apply(&belief.mean.pose), belief.mean.parameters);
    moved(belief, mean, &actual.left_jacobian, q)
}

/// `belief` at `mean`, with the transition `f` and the noise `q` of the left-invariant error.
pub(super) fn moved<G: LieGroup<D>, S: Side, const D: usize>(
    belief: &Belief<G, S, D>,
    mean: G,
    f: &SMatrix<f64, D, D>,
    q: &SMatrix<f64, D, D>,
) -> Belief<G, S, D> {
    let covariance = if S::IS_LEFT {
        belief.covariance.transformed(f).plus(q)
    } else {
        let after = S::from_left(&mean);
        let f = after * f * S::to_left(&belief.mean);
        belief
            .covariance
            .transformed(&f)
            .plus(&(after * q * after.transpose()))
    };
    Belief::new(mean, covariance)
}
