//! A pose with the parameters of its mismatches: the direct product `G x R^P`.
//!
//! The parameters add, and the pose keeps its own error. Tangent order: that of the pose (B), then the parameters
//! (P), `D = B + P`. What they mean is said by [`Unknowns`](super::Unknowns).

use nalgebra::{SMatrix, SVector};

use crate::lie::LieGroup;

/// Pose and parameters.
///
/// ```
/// use inekf::lie::{LieGroup, SE2};
/// use inekf::model::Augmented;
/// use nalgebra::Vector1;
///
/// // A pose with a scale error beside it: a direct product.
/// let state = Augmented::<SE2, 3, 1, 4>::new(SE2::identity(), Vector1::new(0.1));
/// assert_eq!(state.compose(&state).parameters[0], 0.2);
/// assert_eq!(state.log()[3], 0.1);
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Augmented<G, const B: usize, const P: usize, const D: usize> {
    /// The pose, of dimension B.
    pub pose: G,
    /// The parameters of the mismatches; zero in the assumed model.
    pub parameters: SVector<f64, P>,
}

/// `block` on the pose, the identity on the parameters.
fn with_identity<const B: usize, const D: usize>(block: &SMatrix<f64, B, B>) -> SMatrix<f64, D, D> {
    let mut full = SMatrix::<f64, D, D>::identity();
    for column in 0..B {
        for row in 0..B {
            full[(row, column)] = block[(row, column)];
        }
    }
    full
}

impl<G: LieGroup<B>, const B: usize, const P: usize, const D: usize> Augmented<G, B, P, D> {
    /// The pose with these parameters.
    ///
    /// ```
    /// use inekf::lie::{LieGroup, SE2};
    /// use inekf::model::Augmented;
    /// use nalgebra::{Vector1, Vector3, Vector4};
    ///
    /// // The pose's coordinates, then the parameters.
    /// let pose = SE2::exp(&Vector3::new(0.5, 3.0, 1.0));
    /// let state = Augmented::<SE2, 3, 1, 4>::new(pose, Vector1::new(0.1));
    /// assert!((state.log() - Vector4::new(0.5, 3.0, 1.0, 0.1)).norm() < 1e-12);
    /// ```
    pub fn new(pose: G, parameters: SVector<f64, P>) -> Self {
        const {
            assert!(
                D == B + P,
                "D is the dimension of the pose and the number of parameters"
            )
        };
        Self { pose, parameters }
    }

    fn split(xi: &SVector<f64, D>) -> (SVector<f64, B>, SVector<f64, P>) {
        (
            SVector::from_fn(|row, _| xi[row]),
            SVector::from_fn(|row, _| xi[B + row]),
        )
    }
}

impl<G: LieGroup<B>, const B: usize, const P: usize, const D: usize> LieGroup<D>
    for Augmented<G, B, P, D>
{
    const ROTATION_DIM: usize = G::ROTATION_DIM;
    const VELOCITY_DIM: usize = G::VELOCITY_DIM;

    fn identity() -> Self {
        Self::new(G::identity(), SVector::zeros())
    }

    fn exp(xi: &SVector<f64, D>) -> Self {
        let (pose, parameters) = Self::split(xi);
        Self::new(G::exp(&pose), parameters)
    }

    fn log(&self) -> SVector<f64, D> {
        let pose = self.pose.log();
        SVector::from_fn(|row, _| {
            if row < B {
                pose[row]
            } else {
                self.parameters[row - B]
            }
        })
    }

    fn compose(&self, other: &Self) -> Self {
        Self::new(
            self.pose.compose(&other.pose),
            self.parameters + other.parameters,
        )
    }

    fn inverse(&self) -> Self {
        Self::new(self.pose.inverse(), -self.parameters)
    }

    fn adjoint(&self) -> SMatrix<f64, D, D> {
        with_identity(&self.pose.adjoint())
    }

    fn ad(xi: &SVector<f64, D>) -> SMatrix<f64, D, D> {
        let mut full = with_identity(&G::ad(&Self::split(xi).0));
        for row in B..D {
            full[(row, row)] = 0.0;
        }
        full
    }

    fn left_jacobian(xi: &SVector<f64, D>) -> SMatrix<f64, D, D> {
        with_identity(&G::left_jacobian(&Self::split(xi).0))
    }

    fn left_jacobian_inverse(xi: &SVector<f64, D>) -> SMatrix<f64, D, D> {
        with_identity(&G::left_jacobian_inverse(&Self::split(xi).0))
    }

    fn is_finite(&self) -> bool {
        self.pose.is_finite() && self.parameters.iter().all(|entry| entry.is_finite())
    }

    fn normalized(&self) -> Self {
        Self {
            pose: self.pose.normalized(),
            ..*self
        }
    }
}
