//! The terms of the cost around a trajectory, as the linear problem of the [solver](super::solver): \[IS\] (14).
//!
//! The unknowns are the left-invariant errors, `chi_i = chi_hat_i exp(xi_i)` to first order, whatever the
//! parametrisation: one parametrisation's unknowns are another's times a matrix, and so is the step
//! (\[PAR\], Proposition 3). What differs is the chart in which a residual is written, and the retraction.
//!
//! | term | residual | linear form |
//! |---|---|---|
//! | prior | `r = difference(chi_bar, chi_hat_0)` | `xi_0 ~ N(-J r, J P0 J^T)` |
//! | link | `r = difference(f(chi_hat_i), chi_hat_{i+1})` | `xi_{i+1} = K F xi_i - J r + w`, w of `J Q J^T` |
//! | observation | `z = y - h(chi_hat)` | `z = H xi + v`, v of N |
//!
//! J says how the residual follows its end, K how it follows its start ([`Side::jacobian`],
//! [`Side::origin_jacobian`]); for a chart that is not in body axes, both change coordinates too. In the
//! exponential chart `J = J_r(r)`, `J r = r` and `K = Ad_exp(-r)`, which is \[IS\] (24). \[IS\] (14) leaves J and K
//! out of the links: [`Jacobians::Frozen`].

use nalgebra::{SMatrix, SVector};

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
    /// Those at a residual of zero, `J = K = I` in body coordinates, as \[IS\] prints them for the links. Covariances then do not
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

/// The link from `from` to `to`, with its residual in the chart of S.
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
    let transition = link.motion.left_jacobian(from);
    if jacobians == Jacobians::Frozen {
        return LinearMotion {
            transition,
            offset: -departure::<G, S, T, D>(&link.motion, from, to),
            noise: link.noise,
        };
    }
    let expected = link.motion.apply(from);
    let residual = S::Residual::difference(&expected, to);
    let mut to_end = S::Residual::jacobian::<G, D>(&residual);
    let mut from_start = S::Residual::origin_jacobian::<G, D>(&residual);
    let mut of_noise = to_end;
    if !S::Residual::IS_LEFT {
        let to_left = S::Residual::to_left(to);
        let from_left: SMatrix<f64, D, D> = S::Residual::from_left(&expected);
        to_end = to_left * to_end;
        from_start = to_left * from_start * from_left;
        of_noise = to_end * from_left;
    }
    LinearMotion {
        transition: from_start * transition,
        offset: -(to_end * residual),
        noise: *Covariance::from_upper(link.noise)
            .transformed(&of_noise)
            .matrix(),
    }
}

/// How far `to` is from where `motion` leads from `from`: the residual in the chart of S, in body coordinates, which
/// are those of the noise.
pub fn departure<G, S, T, const D: usize>(motion: &T, from: &G, to: &G) -> SVector<f64, D>
where
    G: LieGroup<D>,
    S: Side,
    T: Motion<G, D>,
{
    let expected = motion.apply(from);
    let residual = S::Residual::difference(&expected, to);
    if S::Residual::IS_LEFT {
        residual
    } else {
        S::Residual::to_left(&expected) * residual
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
