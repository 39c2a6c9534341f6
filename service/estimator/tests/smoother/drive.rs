//! Chains for the tests: the drive of [IS] section II, and random motions on SE(2), SE(3) and SE_2(3).

use inekf::filter::{Belief, Left, Side};
use inekf::lie::{LieGroup, SE2, SE23};
use inekf::model::{
    Discretisation, ImuInput, ImuStep, Observation, OdometryStep, PointFix, Points, RigidPose,
};
use inekf::smoother::Chain;
use nalgebra::{SMatrix, SVector, Vector3};
use rand_chacha::ChaCha8Rng;

use crate::common::{GRAVITY_W, covariance_of_scale, normal};

/// A fix of the body's origin in N dimensions.
pub type Fix<const N: usize> = Points<1, N, N>;

/// A chain on G with a left-invariant prior and fixes in N dimensions.
pub type Drive<G, T, const D: usize, const N: usize> = Chain<G, Left, T, Fix<N>, D>;

/// A fix at `position_w` with the given standard deviation, m.
pub fn fix<const N: usize>(position_w: SVector<f64, N>, sigma_m: f64) -> Fix<N> {
    Fix::new([PointFix {
        position_w,
        covariance_w: SMatrix::identity() * (sigma_m * sigma_m),
        lever_arm_b: SVector::zeros(),
        scale_error: 0.0,
    }])
}

/// A drive by odometry over `steps` turns and metres, with a fix of 0.5 m at every second state but the first. The
/// truth starts `error` away from the prior's mean, and the odometry has noise of the covariance `q`.
pub fn by_odometry<G, const D: usize, const N: usize>(
    prior: Belief<G, Left, D>,
    error: &SVector<f64, D>,
    q: &SMatrix<f64, D, D>,
    steps: usize,
    rng: &mut ChaCha8Rng,
) -> Drive<G, OdometryStep<G>, D, N>
where
    G: RigidPose<D, N>,
    Fix<N>: Observation<G, D, N>,
{
    let mut truth = Left::retract(&prior.mean, error);
    let mut chain = Chain::with_capacity(prior, steps + 1, steps);
    for k in 1..=steps {
        let mut increment: SVector<f64, D> = 0.3 * normal::<D, 1>(rng);
        increment[G::POSITION] += 5.0;
        let step = OdometryStep::new(&increment, 1.0);
        let disturbance = root(q) * normal::<D, 1>(rng);
        truth = Left::retract(&step.apply(&truth), &disturbance);
        chain.advance(step, *q);
        if k % 2 == 0 {
            chain.observe(fix(truth.position_w() + 0.5 * normal::<N, 1>(rng), 0.5));
        }
    }
    chain
}

/// A flight of `steps` IMU intervals of 0.5 s, with a fix of 1 m at every second state but the first, and process
/// noise of the covariance `q`.
pub fn by_imu(
    prior: Belief<SE23, Left, 9>,
    error: &SVector<f64, 9>,
    q: &SMatrix<f64, 9, 9>,
    steps: usize,
    rng: &mut ChaCha8Rng,
) -> Drive<SE23, ImuStep, 9, 3> {
    let mut truth = Left::retract(&prior.mean, error);
    let mut chain = Chain::with_capacity(prior, steps + 1, steps);
    for k in 1..=steps {
        let input = ImuInput {
            omega_b: 0.5 * normal::<3, 1>(rng),
            force_b: 2.0 * normal::<3, 1>(rng) + Vector3::new(0.0, 0.0, 9.8),
        };
        let step = ImuStep::new(&input, &GRAVITY_W, 0.5, Discretisation::ZeroOrderHold);
        let disturbance = root(q) * normal::<9, 1>(rng);
        truth = Left::retract(&step.step.apply(&truth), &disturbance);
        chain.advance(step, *q);
        if k % 2 == 0 {
            chain.observe(fix(truth.position + normal::<3, 1>(rng), 1.0));
        }
    }
    chain
}

/// The symmetric square root.
pub fn root<const D: usize>(covariance: &SMatrix<f64, D, D>) -> SMatrix<f64, D, D> {
    if covariance.amax() == 0.0 {
        return SMatrix::zeros();
    }
    let dynamic = nalgebra::DMatrix::from_column_slice(D, D, covariance.as_slice());
    let eigen = dynamic.symmetric_eigen();
    let values = eigen.eigenvalues.map(|value| value.max(0.0).sqrt());
    let root = &eigen.eigenvectors
        * nalgebra::DMatrix::from_diagonal(&values)
        * eigen.eigenvectors.transpose();
    SMatrix::from_column_slice(root.as_slice())
}

/// A full covariance with every standard deviation about `sigma`.
pub fn full<const D: usize>(sigma: f64, rng: &mut ChaCha8Rng) -> SMatrix<f64, D, D> {
    *covariance_of_scale(&SVector::repeat(sigma), rng).matrix()
}

/// The largest difference of two trajectories, as left-invariant errors.
pub fn gap<G: LieGroup<D>, const D: usize>(a: &[G], b: &[G]) -> f64 {
    assert_eq!(a.len(), b.len());
    a.iter().zip(b).fold(0.0, |gap: f64, (a, b)| {
        let error = Left::difference(a, b).amax();
        if error.is_nan() {
            f64::INFINITY
        } else {
            gap.max(error)
        }
    })
}

/// The length of a trajectory in the plane, m.
pub fn length_m(states: &[SE2]) -> f64 {
    states
        .windows(2)
        .map(|pair| (pair[1].position - pair[0].position).norm())
        .sum()
}
