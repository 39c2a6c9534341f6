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
///
/// ```
/// use inekf::filter::Left;
/// use inekf::lie::{LieGroup, SE2};
/// use inekf::model::OdometryStep;
/// use inekf::smoother::Link;
/// use inekf::smoother::linearise::{Jacobians, motion};
/// use nalgebra::{Matrix3, Vector3};
///
/// let ahead = OdometryStep::<SE2>::new(&Vector3::new(0.1, 1.0, 0.0), 1.0);
/// let link = Link { motion: ahead, noise: Matrix3::identity() };
/// let (from, reached) = (SE2::identity(), ahead.apply(&SE2::identity()));
/// let apart = |to: &SE2| {
///     let of = |jacobians| motion::<SE2, Left, _, 3>(&link, &from, to, jacobians).transition;
///     (of(Jacobians::Exact) - of(Jacobians::Frozen)).norm()
/// };
/// // They agree where the motion leads, and differ by as much as the state is elsewhere.
/// assert!(apart(&reached) < 1e-12);
/// assert!(apart(&(reached * SE2::exp(&Vector3::new(0.5, 0.0, 0.0)))) > 0.1);
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Jacobians {
    /// The true ones: Gauss-Newton on the cost as it is.
    Exact,
    /// Those at a residual of zero, `J = K = I` in body coordinates, as \[IS\] prints them for the links. Covariances then do not
    /// depend on the trajectory; the step differs from the exact one to second order in the residual.
    Frozen,
}

/// The prior around `chi`.
///
/// ```
/// # use inekf::model::{PlanarFix, PointFix};
/// # use nalgebra::{Matrix2, Vector2};
/// use inekf::filter::{Belief, Covariance, Left};
/// use inekf::lie::{LieGroup, SE2};
/// use inekf::model::OdometryStep;
/// use inekf::smoother::Chain;
/// use inekf::smoother::linearise::{self, Jacobians};
/// use nalgebra::{Matrix3, Vector3};
///
/// # let seen = |x_m: f64| PlanarFix::new([PointFix {
/// #     position_w: Vector2::new(x_m, 0.0),
/// #     covariance_w: Matrix2::identity(),
/// #     lever_arm_b: Vector2::zeros(),
/// #     scale_error: 0.0,
/// # }]);
/// let ahead = OdometryStep::<SE2>::new(&Vector3::new(0.0, 1.0, 0.0), 1.0);
/// let p = Covariance::from_variances(&Vector3::new(0.01, 1.0, 1.0));
/// let prior = Belief::<SE2, Left, 3>::new(SE2::identity(), p);
/// let mut chain = Chain::with_capacity(prior, 2, 1);
/// chain.advance(ahead, Matrix3::identity() * 0.01);
/// chain.observe(seen(2.0));
///
/// // The error of a trajectory that begins half a metre too far: the prior wants it back.
/// let chi = SE2::exp(&Vector3::new(0.0, 0.5, 0.0));
/// let wanted = linearise::prior(&prior, &chi, Jacobians::Exact);
/// assert!((wanted.mean - Vector3::new(0.0, -0.5, 0.0)).norm() < 1e-12);
/// ```
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
///
/// ```
/// # use inekf::model::{PlanarFix, PointFix};
/// # use nalgebra::{Matrix2, Vector2};
/// use inekf::filter::{Belief, Covariance, Left};
/// use inekf::lie::{LieGroup, SE2};
/// use inekf::model::OdometryStep;
/// use inekf::smoother::Chain;
/// use inekf::smoother::linearise::{self, Jacobians};
/// use nalgebra::{Matrix3, Vector3};
///
/// # let seen = |x_m: f64| PlanarFix::new([PointFix {
/// #     position_w: Vector2::new(x_m, 0.0),
/// #     covariance_w: Matrix2::identity(),
/// #     lever_arm_b: Vector2::zeros(),
/// #     scale_error: 0.0,
/// # }]);
/// let ahead = OdometryStep::<SE2>::new(&Vector3::new(0.0, 1.0, 0.0), 1.0);
/// let p = Covariance::from_variances(&Vector3::new(0.01, 1.0, 1.0));
/// let prior = Belief::<SE2, Left, 3>::new(SE2::identity(), p);
/// let mut chain = Chain::with_capacity(prior, 2, 1);
/// chain.advance(ahead, Matrix3::identity() * 0.01);
/// chain.observe(seen(2.0));
///
/// let (from, link) = (SE2::identity(), &chain.links()[0]);
/// let linear = |to: &SE2| linearise::motion::<SE2, Left, _, 3>(link, &from, to, Jacobians::Exact);
/// // Where the motion leads, the errors are those that it makes.
/// let reached = ahead.apply(&from);
/// assert!(linear(&reached).offset.norm() < 1e-12);
/// // Half a metre beyond, they have to take it back.
/// let beyond = reached * SE2::exp(&Vector3::new(0.0, 0.5, 0.0));
/// assert!((linear(&beyond).offset - Vector3::new(0.0, -0.5, 0.0)).norm() < 1e-12);
/// ```
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
pub(crate) fn departure<G, S, T, const D: usize>(motion: &T, from: &G, to: &G) -> SVector<f64, D>
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
///
/// ```
/// # use inekf::model::{PlanarFix, PointFix};
/// # use nalgebra::Matrix2;
/// use inekf::filter::{Belief, Covariance, Left};
/// use inekf::lie::{LieGroup, SE2};
/// use inekf::model::OdometryStep;
/// use inekf::smoother::{Chain, linearise};
/// use nalgebra::{Matrix3, Vector2, Vector3};
///
/// # let seen = |x_m: f64| PlanarFix::new([PointFix {
/// #     position_w: Vector2::new(x_m, 0.0),
/// #     covariance_w: Matrix2::identity(),
/// #     lever_arm_b: Vector2::zeros(),
/// #     scale_error: 0.0,
/// # }]);
/// let ahead = OdometryStep::<SE2>::new(&Vector3::new(0.0, 1.0, 0.0), 1.0);
/// let p = Covariance::from_variances(&Vector3::new(0.01, 1.0, 1.0));
/// let prior = Belief::<SE2, Left, 3>::new(SE2::identity(), p);
/// let mut chain = Chain::with_capacity(prior, 2, 1);
/// chain.advance(ahead, Matrix3::identity() * 0.01);
/// chain.observe(seen(2.0));
///
/// let linear = linearise::measurement(&seen(2.0), &SE2::identity());
/// // Two metres off; a metre ahead would be a metre less.
/// assert_eq!(linear.value, Vector2::new(2.0, 0.0));
/// assert_eq!(linear.jacobian * Vector3::new(0.0, 1.0, 0.0), Vector2::new(1.0, 0.0));
/// ```
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
