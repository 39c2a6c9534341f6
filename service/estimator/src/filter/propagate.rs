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
