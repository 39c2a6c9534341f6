//! The same steps by general matrix products, as one would write them first.
//!
//! `P+ = F P F^T + Q` with F and Q as the model gives them, and Joseph's update with dense H.

use inekf::filter::{Belief, Covariance, Side};
use inekf::lie::LieGroup;
use inekf::model::{Discretisation, InertialState, Observation};
use nalgebra::SMatrix;

use crate::setup::{DT_S, GRAVITY_W, NOISE, sample};

/// Propagation over one sample in the left-invariant error.
pub fn propagate<G: InertialState<D>, S: Side, const D: usize>(belief: &mut Belief<G, S, D>) {
    let zoh = Discretisation::ZeroOrderHold;
    let step = belief.mean.imu_step(&sample(), &GRAVITY_W, DT_S, zoh);
    let (mean, f, q) = belief.mean.advance(&step, &NOISE);
    let (f, q) = if S::IS_LEFT {
        (f, q)
    } else {
        let after = S::from_left(&mean);
        let before = S::to_left(&belief.mean);
        (after * f * before, after * q * after.transpose())
    };
    let p = f * belief.covariance.matrix() * f.transpose() + q;
    *belief = Belief::new(mean, Covariance::from_upper(p));
}

/// One Kalman update in the left-invariant error, without iteration and transport.
pub fn update<G, S, O, const D: usize, const M: usize>(
    belief: &mut Belief<G, S, D>,
    observation: &O,
) where
    G: LieGroup<D>,
    S: Side,
    O: Observation<G, D, M>,
{
    let p = belief.covariance.matrix();
    let h = observation.left_jacobian(&belief.mean);
    let noise = observation.noise();
    let s = h * p * h.transpose() + noise;
    let Some(inverse) = s.try_inverse() else {
        return;
    };
    let gain = p * h.transpose() * inverse;
    let xi = gain * observation.residual(&belief.mean);
    let rest = SMatrix::<f64, D, D>::identity() - gain * h;
    let corrected = rest * p * rest.transpose() + gain * noise * gain.transpose();
    *belief = Belief::new(
        S::retract(&belief.mean, &xi),
        Covariance::from_upper(corrected),
    );
}

/// `A P A^T`.
pub fn transformed<const D: usize>(
    a: &SMatrix<f64, D, D>,
    p: &SMatrix<f64, D, D>,
) -> SMatrix<f64, D, D> {
    a * p * a.transpose()
}
