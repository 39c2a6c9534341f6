//! A concentrated Gaussian on a Lie group: a mean, and the covariance of the invariant error.

use core::marker::PhantomData;

use super::covariance::Covariance;
use super::side::{Left, Right, Side};
use crate::lie::LieGroup;

/// `chi = retract(mean, xi)` with `xi ~ N(0, covariance)`, in the error of side S (\[IS\] (4)).
///
/// ```
/// use inekf::filter::{Belief, Covariance, Left};
/// use inekf::lie::{LieGroup, SE2};
/// use nalgebra::{SVector, Vector3};
///
/// let here = SE2::exp(&Vector3::new(0.5, 10.0, 0.0));
/// let variances = SVector::<f64, 3>::new(0.01, 1.0, 1.0);
/// let belief = Belief::<SE2, Left, 3>::new(here, Covariance::from_variances(&variances));
/// // The same belief, its error in world axes, and back.
/// let back = belief.to_right().to_left();
/// assert!((back.covariance.matrix() - belief.covariance.matrix()).norm() < 1e-9);
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Belief<G, S, const D: usize> {
    /// The estimate.
    pub mean: G,
    /// Covariance of the error, tangent order of the group.
    pub covariance: Covariance<D>,
    side: PhantomData<S>,
}

impl<G: LieGroup<D>, S: Side, const D: usize> Belief<G, S, D> {
    /// The belief with this mean and this covariance of the error of side S.
    ///
    /// ```
    /// use inekf::filter::{Belief, Covariance, Left, Right};
    /// use inekf::lie::{LieGroup, SE2};
    /// use nalgebra::Vector3;
    ///
    /// // Ten metres from the origin, with 0.1 rad of doubt about a rotation: of the body, or of everything about the origin.
    /// let chi = SE2::exp(&Vector3::new(0.0, 10.0, 0.0));
    /// let p = Covariance::from_variances(&Vector3::new(0.01, 0.0, 0.0));
    /// let across = |p: Covariance<3>| p.matrix()[(2, 2)];
    /// assert!(across(Belief::<SE2, Left, 3>::new(chi, p).left_covariance()).abs() < 1e-12);
    /// assert!((across(Belief::<SE2, Right, 3>::new(chi, p).left_covariance()) - 1.0).abs() < 1e-12);
    /// ```
    pub fn new(mean: G, covariance: Covariance<D>) -> Self {
        Self {
            mean,
            covariance,
            side: PhantomData,
        }
    }

    /// The belief whose left-invariant error has this covariance.
    ///
    /// ```
    /// use inekf::filter::{Belief, Covariance, Right};
    /// use inekf::lie::{LieGroup, SE2};
    /// use nalgebra::Vector3;
    ///
    /// let chi = SE2::exp(&Vector3::new(0.5, 3.0, 1.0));
    /// let left = Covariance::from_variances(&Vector3::new(0.01, 1.0, 4.0));
    /// // Whatever the side inside, the covariance that is published is of the left-invariant error.
    /// let belief = Belief::<SE2, Right, 3>::from_left_covariance(chi, left);
    /// assert!((belief.left_covariance().matrix() - left.matrix()).norm() < 1e-12);
    /// assert!((belief.covariance.matrix() - left.matrix()).norm() > 0.1);
    /// ```
    pub fn from_left_covariance(mean: G, mut covariance: Covariance<D>) -> Self {
        if !S::IS_LEFT {
            covariance.transform_by::<G>(&S::from_left(&mean));
        }
        Self::new(mean, covariance)
    }

    /// Covariance of the left-invariant error, which is what is published.
    ///
    /// ```
    /// use inekf::filter::{Belief, Covariance, Left};
    /// use inekf::lie::{LieGroup, SE2};
    /// use nalgebra::Vector3;
    ///
    /// let p = Covariance::from_variances(&Vector3::new(0.01, 1.0, 4.0));
    /// let belief = Belief::<SE2, Left, 3>::new(SE2::identity(), p);
    /// assert_eq!(belief.left_covariance(), p);
    /// ```
    pub fn left_covariance(&self) -> Covariance<D> {
        let mut covariance = self.covariance;
        if !S::IS_LEFT {
            covariance.transform_by::<G>(&S::to_left(&self.mean));
        }
        covariance
    }

    /// Hands the covariance of the left-invariant error to `read`, as it lies here if it is that one already.
    ///
    /// ```
    /// use inekf::filter::{Belief, Covariance, Left};
    /// use inekf::lie::{LieGroup, SE2};
    /// use nalgebra::Vector3;
    ///
    /// let p = Covariance::from_variances(&Vector3::new(0.01, 1.0, 4.0));
    /// let belief = Belief::<SE2, Left, 3>::new(SE2::identity(), p);
    /// // Without a copy: for what is written into a message with every sample.
    /// let mut message = [0.0; 6];
    /// belief.with_left_covariance(|p| p.write_upper_triangle(&mut message));
    /// assert_eq!(message, [0.01, 0.0, 0.0, 1.0, 0.0, 4.0]);
    /// ```
    #[inline]
    pub fn with_left_covariance<T>(&self, read: impl FnOnce(&Covariance<D>) -> T) -> T {
        if S::IS_LEFT {
            read(&self.covariance)
        } else {
            read(&self.left_covariance())
        }
    }

    /// Whether mean and covariance are finite and no variance is negative.
    ///
    /// ```
    /// use inekf::filter::{Belief, Covariance, Left};
    /// use inekf::lie::{LieGroup, SE2};
    /// use nalgebra::Vector3;
    ///
    /// let p = Covariance::from_variances(&Vector3::new(0.01, 1.0, 4.0));
    /// let nowhere = SE2::exp(&Vector3::new(0.0, f64::INFINITY, 0.0));
    /// assert!(Belief::<SE2, Left, 3>::new(SE2::identity(), p).is_plausible());
    /// assert!(!Belief::<SE2, Left, 3>::new(nowhere, p).is_plausible());
    /// ```
    pub fn is_plausible(&self) -> bool {
        self.mean.is_finite() && self.covariance.is_plausible()
    }
}

impl<G: LieGroup<D>, const D: usize> Belief<G, Left, D> {
    /// The same belief in the right-invariant error (\[PAR\] (14) with `A = Ad_chi`).
    ///
    /// ```
    /// use inekf::filter::{Belief, Covariance, Left};
    /// use inekf::lie::{LieGroup, SE2};
    /// use nalgebra::{Vector2, Vector3};
    ///
    /// // A metre along the body's x axis of a vehicle that faces north is a metre along y.
    /// let mut north = SE2::exp(&Vector3::new(90_f64.to_radians(), 0.0, 0.0));
    /// north.position = Vector2::zeros();
    /// let p = Covariance::from_variances(&Vector3::new(0.0, 1.0, 0.0));
    /// let right = Belief::<SE2, Left, 3>::new(north, p).to_right();
    /// assert!((right.covariance.matrix()[(2, 2)] - 1.0).abs() < 1e-12);
    /// ```
    pub fn to_right(&self) -> Belief<G, Right, D> {
        Belief::from_left_covariance(self.mean, self.covariance)
    }
}

impl<G: LieGroup<D>, const D: usize> Belief<G, Right, D> {
    /// The same belief in the left-invariant error.
    ///
    /// ```
    /// use inekf::filter::{Belief, Covariance, Right};
    /// use inekf::lie::{LieGroup, SE2};
    /// use nalgebra::Vector3;
    ///
    /// let p = Covariance::from_variances(&Vector3::new(0.01, 1.0, 4.0));
    /// let right = Belief::<SE2, Right, 3>::new(SE2::exp(&Vector3::new(0.5, 3.0, 1.0)), p);
    /// assert!((right.to_left().to_right().covariance.matrix() - p.matrix()).norm() < 1e-12);
    /// ```
    pub fn to_left(&self) -> Belief<G, Left, D> {
        Belief::new(self.mean, self.left_covariance())
    }
}
