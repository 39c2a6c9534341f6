//! What the window remembers of the states that have left it: a prior on its oldest state.
//!
//! Marginalisation gives, at the estimate `chi_lin` of that moment, a correction of mean m and covariance P (in the
//! coordinates of side S). The estimate moves on, and the prior must be said anew at each `chi_hat`:
//!
//! | form | residual p at `chi_hat` | covariance |
//! |---|---|---|
//! | [`GroupMean`](PriorForm::GroupMean) | `chi_hat - chi_bar`, with `chi_bar = chi_lin + m` | P, frozen |
//! | [`Linear`](PriorForm::Linear) | `(chi_hat - chi_lin) - m`, \[PAR\] (41) | P, frozen |
//! | [`Recentred`](PriorForm::Recentred) | as the first | carried to `chi_bar`, then to `chi_hat`: \[IS\] (14) |
//!
//! where + and - are the retraction of S and its inverse: for [`Left`](crate::filter::Left) the residual of the first
//! is `log(chi_bar^-1 chi_hat)`. With the covariance frozen the gains of the window do not depend on the estimate.

use nalgebra::SVector;

use crate::filter::{Covariance, Side};
use crate::lie::LieGroup;
use crate::smoother::Gaussian;

/// How a prior follows the estimate.
///
/// ```
/// # use inekf::model::{Discretisation, ImuInput, ImuNoise, PositionObservation};
/// # use inekf::smoother::{Preintegration, WindowError};
/// # use nalgebra::{Matrix3, Vector3};
/// use inekf::filter::{Belief, Covariance, Left};
/// use inekf::lie::{LieGroup, SE23};
/// use inekf::smoother::{PriorForm, Window, WindowOptions};
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
/// # let seen_at = |x_m: f64| PositionObservation {
/// #     position_w: Vector3::new(x_m, 0.0, 0.0),
/// #     covariance_w: Matrix3::identity() * 0.01,
/// #     lever_arm_b: Vector3::zeros(),
/// # };
/// let with = |prior| Window::<SE23, Left, 9>::new(&first, &WindowOptions { prior, ..WindowOptions::new(2) });
/// let (mut by_mean, mut linear) = (with(PriorForm::GroupMean), with(PriorForm::Linear));
/// for (k, x_m) in [0.3, -0.2, 0.4].into_iter().enumerate() {
///     by_mean.push(&second_of_rest);
///     by_mean.update(seen_at(x_m))?;
///     linear.push(&second_of_rest);
///     linear.update(seen_at(x_m))?;
///     // The same as long as no state has left.
///     assert!(k > 0 || by_mean.states().eq(linear.states()));
/// }
/// // And after that by as much as the estimates moved since, which is little here.
/// assert!(by_mean.newest().mean.between(&linear.newest().mean).log().norm() < 0.01);
/// # Ok::<(), WindowError>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PriorForm {
    /// A mean on the group, and a frozen covariance.
    GroupMean,
    /// A mean in the coordinates at the point of marginalisation, and a frozen covariance.
    Linear,
    /// A mean on the group, and a covariance that the exact Jacobians carry along. It leaks information: after
    /// marginalisation under a wrong heading, the heading counts as known better than it is.
    Recentred,
}

/// A prior on one state. Its covariance is in the coordinates of the side S that made it.
#[derive(Clone, Copy, Debug)]
pub(super) struct Prior<G, const D: usize> {
    form: PriorForm,
    /// `chi_bar`, or `chi_lin` for the linear form.
    anchor: G,
    /// m for the linear form, else zero.
    offset: SVector<f64, D>,
    covariance: Covariance<D>,
}

impl<G: LieGroup<D>, const D: usize> Prior<G, D> {
    /// The prior of this form that wants `first` as it is.
    pub(super) fn new<S: Side>(
        form: PriorForm,
        first: &G,
        left_covariance: &Covariance<D>,
    ) -> Self {
        let mut prior = Self {
            form,
            anchor: *first,
            offset: SVector::zeros(),
            covariance: *left_covariance,
        };
        prior.replace::<S>(form, first, &SVector::zeros(), left_covariance);
        prior
    }

    /// Becomes the prior of this form from a correction of `chi_lin`, of this mean and covariance in left-invariant
    /// coordinates.
    pub(super) fn replace<S: Side>(
        &mut self,
        form: PriorForm,
        chi_lin: &G,
        left_mean: &SVector<f64, D>,
        left_covariance: &Covariance<D>,
    ) {
        let mut mean = *left_mean;
        if S::IS_LEFT {
            self.covariance = *left_covariance;
        } else {
            let from_left = S::from_left(chi_lin);
            mean = from_left * left_mean;
            self.covariance = left_covariance.transformed(&from_left);
        }
        if form == PriorForm::Recentred {
            self.covariance = self.covariance.transformed(&S::jacobian::<G, D>(&mean));
        }
        self.form = form;
        (self.anchor, self.offset) = match form {
            PriorForm::Linear => (*chi_lin, mean),
            PriorForm::GroupMean | PriorForm::Recentred => {
                (S::retract(chi_lin, &mean), SVector::zeros())
            }
        };
    }

    /// Whether the covariance at an estimate does not depend on the estimate.
    pub(super) fn is_constant<S: Side>(&self) -> bool {
        S::IS_LEFT && self.form != PriorForm::Recentred
    }

    /// The mean, in left-invariant coordinates, of the correction that the prior wants at `chi`: minus its residual.
    /// For priors that [are constant](Self::is_constant).
    pub(super) fn mean_at<S: Side>(&self, chi: &G) -> SVector<f64, D> {
        self.offset - S::difference(&self.anchor, chi)
    }

    /// The correction that the prior wants at `chi`, in left-invariant coordinates.
    pub(super) fn at<S: Side>(&self, chi: &G) -> Gaussian<D> {
        let wanted = self.mean_at::<S>(chi);
        if self.is_constant::<S>() {
            return Gaussian {
                mean: wanted,
                covariance: self.covariance,
            };
        }
        let mut to_left = S::to_left(chi);
        if self.form == PriorForm::Recentred {
            to_left *= S::jacobian::<G, D>(&-wanted);
        }
        Gaussian {
            mean: to_left * wanted,
            covariance: self.covariance.transformed(&to_left),
        }
    }
}
