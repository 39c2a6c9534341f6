//! The terms of the cost around a trajectory, as the linear problem of the [solver](super::solver): \[IS\] (14).
//!
//! The unknowns are the left-invariant errors, `chi_i = chi_hat_i exp(xi_i)` to first order, whatever the
//! parametrisation: one parametrisation's unknowns are another's times a matrix, and so is the step
//! (\[PAR\], Proposition 3). What differs is the chart in which a residual is written, and the retraction.
//!
//! With B a parametrisation in body coordinates, J its Jacobian, and `r = difference(a, b)` the residual of a term:
//!
//! | term | residual | linear form |
//! |---|---|---|
//! | prior | `r = difference(chi_bar, chi_hat_0)` | `xi_0 ~ N(-J r, J P0 J^T)` |
//! | link | `r = difference(f(chi_hat_i), chi_hat_{i+1})` | `xi_{i+1} = Ad_{m^-1} F xi_i - J r + w`, w of `J Q J^T`, `m = f(chi_hat_i)^-1 chi_hat_{i+1}` |
//! | observation | `z = y - h(chi_hat)` | `z = H xi + v`, v of N |
//!
//! In the exponential chart `J = J_r(r)` and `J r = r`. \[IS\] leaves J out of the links, and the adjoint too:
//! [`Jacobians::Frozen`]. \[IS\] (24) is the link with the adjoint.

use nalgebra::SMatrix;

use super::chain::{Link, Motion};
use super::solver::{Gaussian, LinearMeasurement, LinearMotion};
use crate::filter::{Belief, Covariance, Side};
use crate::lie::LieGroup;
use crate::model::Observation;

/// Which derivatives of the residuals of the prior and of the links are used.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Jacobians {
    /// The true ones: Gauss-Newton on the cost as it is.
    Exact,
    /// Those at a residual of zero, as \[IS\] prints them for the links: `J = I`, `m = I`. Covariances then do not
    /// depend on the trajectory; the step differs from the exact one to second order in the residual.
    Frozen,
}

/// The prior around `chi`.
pub fn prior<G: LieGroup<D>, P: Side, const D: usize>(
    belief: &Belief<G, P, D>,
    chi: &G,
    jacobians: Jacobians,
) -> Gaussian<D> {
    let residual = P::difference(&belief.mean, chi);
    let (mean, covariance) = match jacobians {
        Jacobians::Exact => {
            let jacobian = P::jacobian::<G, D>(&residual);
            (
                -(jacobian * residual),
                belief.covariance.transformed(&jacobian),
            )
        }
        Jacobians::Frozen => (-residual, belief.covariance),
    };
    if P::IS_LEFT {
        return Gaussian { mean, covariance };
    }
    let to_left = P::to_left(chi);
    Gaussian {
        mean: to_left * mean,
        covariance: covariance.transformed(&to_left),
    }
}

/// The link from `from` to `to`, with its residual in the body chart of S.
pub fn motion<G, S, T, const D: usize>(
    link: &Link<T, D>,
    from: &G,
    to: &G,
    jacobians: Jacobians,
) -> LinearMotion<D>
where
    G: LieGroup<D>,
    S: Side,
    T: Motion<G, D>,
{
    let expected = link.motion.apply(from);
    let transition = link.motion.left_jacobian(from);
    let residual = S::Body::difference(&expected, to);
    match jacobians {
        Jacobians::Exact => {
            let jacobian = S::Body::jacobian::<G, D>(&residual);
            let back: SMatrix<f64, D, D> = to.inverse().compose(&expected).adjoint();
            LinearMotion {
                transition: back * transition,
                offset: -(jacobian * residual),
                noise: *Covariance::from_upper(link.noise)
                    .transformed(&jacobian)
                    .matrix(),
            }
        }
        Jacobians::Frozen => LinearMotion {
            transition,
            offset: -residual,
            noise: link.noise,
        },
    }
}

/// The observation around `chi`.
pub fn measurement<G, O, const D: usize, const M: usize>(
    observation: &O,
    chi: &G,
) -> LinearMeasurement<D, M>
where
    G: LieGroup<D>,
    O: Observation<G, D, M>,
{
    LinearMeasurement {
        value: observation.residual(chi),
        jacobian: observation.left_jacobian(chi),
        noise: observation.noise(),
    }
}
