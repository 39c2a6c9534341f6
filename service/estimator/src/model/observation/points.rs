//! Positions of points of the body, seen by one or several sources at once: \[LC\] (25), stacked.
//!
//! `y_i = (1 + eps_i) x + R b_i + v_i`, world frame, metres. The residual stays in world axes, as everywhere
//! here; the body-frame innovation of \[LC\] (27) is `R^T` times it, and leads to the same correction.

use nalgebra::{SMatrix, SVector};

use super::Observation;
use crate::model::pose::Pose;

/// What one source says of one point of the body, N = 2 or 3 dimensions.
///
/// ```
/// use inekf::lie::{LieGroup, SE2};
/// use inekf::model::PointFix;
/// use nalgebra::{Matrix2, Vector2};
///
/// let fix = PointFix {
///     position_w: Vector2::new(21.0, 0.5),
///     covariance_w: Matrix2::identity(),
///     lever_arm_b: Vector2::new(0.0, 0.5), // half a metre to the left
///     scale_error: 0.1,
/// };
/// let mut chi = SE2::identity();
/// chi.position.x = 20.0;
/// // (1 + eps) x + R b.
/// assert!((fix.expected_w(&chi) - Vector2::new(22.0, 0.5)).norm() < 1e-12);
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PointFix<const N: usize> {
    /// Measured position, m, world frame.
    pub position_w: SVector<f64, N>,
    /// Covariance, m^2, world axes.
    pub covariance_w: SMatrix<f64, N, N>,
    /// From the body's origin to the point, m, body frame.
    pub lever_arm_b: SVector<f64, N>,
    /// The scale error `eps` that the source is assumed to have; 0 for a true scale.
    pub scale_error: f64,
}

impl<const N: usize> PointFix<N> {
    /// Where the fix is expected, m, world frame: `(1 + eps) x + R b`.
    ///
    /// ```
    /// # use nalgebra::Matrix2;
    /// use inekf::lie::{LieGroup, SE2};
    /// use inekf::model::PointFix;
    /// use nalgebra::Vector2;
    ///
    /// # let fix = |x_m: f64| PointFix {
    /// #     position_w: Vector2::new(x_m, 0.0),
    /// #     covariance_w: Matrix2::identity(),
    /// #     lever_arm_b: Vector2::zeros(),
    /// #     scale_error: 0.0,
    /// # };
    /// // A source whose metres are a tenth too short sees a tenth more of them.
    /// let mut chi = SE2::identity();
    /// chi.position.x = 20.0;
    /// let short = PointFix { scale_error: 0.1, ..fix(0.0) };
    /// assert!((short.expected_w(&chi) - Vector2::new(22.0, 0.0)).norm() < 1e-12);
    /// ```
    pub fn expected_w<G: Pose<D, N>, const D: usize>(&self, chi: &G) -> SVector<f64, N> {
        chi.point_w(&self.lever_arm_b, 1.0 + self.scale_error)
    }
}

/// K fixes of N dimensions, taken together as one observation of `M = K N`. Their noises are independent.
///
/// ```
/// use inekf::lie::{LieGroup, SE2};
/// use inekf::model::{Observation, PlanarPair, PointFix};
/// use nalgebra::{Matrix2, Vector2};
///
/// let fix = |x_m, variance| PointFix {
///     position_w: Vector2::new(x_m, 0.0),
///     covariance_w: Matrix2::identity() * variance,
///     lever_arm_b: Vector2::zeros(),
///     scale_error: 0.0,
/// };
/// // Two sources at one time, one observation of four dimensions.
/// let pair = PlanarPair::new([fix(1.0, 1.0), fix(2.0, 4.0)]);
/// assert_eq!(pair.residual(&SE2::identity()).as_slice(), [1.0, 0.0, 2.0, 0.0]);
/// assert_eq!(pair.noise_covariance().diagonal().as_slice(), [1.0, 1.0, 4.0, 4.0]);
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Points<const K: usize, const N: usize, const M: usize> {
    /// The fixes, in the order in which the observation stacks them.
    pub fixes: [PointFix<N>; K],
}

/// One fix in the plane.
pub type PlanarFix = Points<1, 2, 2>;
/// Two fixes in the plane.
pub type PlanarPair = Points<2, 2, 4>;
/// One fix in space.
pub type SpatialFix = Points<1, 3, 3>;
/// Two fixes in space.
pub type SpatialPair = Points<2, 3, 6>;

impl<const K: usize, const N: usize, const M: usize> Points<K, N, M> {
    /// These fixes as one observation.
    ///
    /// ```
    /// # use inekf::lie::LieGroup;
    /// # use inekf::model::PointFix;
    /// # use nalgebra::Matrix2;
    /// use inekf::model::PlanarPair;
    /// use nalgebra::Vector2;
    ///
    /// # let fix = |x_m: f64| PointFix {
    /// #     position_w: Vector2::new(x_m, 0.0),
    /// #     covariance_w: Matrix2::identity(),
    /// #     lever_arm_b: Vector2::zeros(),
    /// #     scale_error: 0.0,
    /// # };
    /// let pair = PlanarPair::new([fix(1.0), fix(2.0)]);
    /// assert_eq!(pair.fixes[1].position_w, Vector2::new(2.0, 0.0));
    /// ```
    pub fn new(fixes: [PointFix<N>; K]) -> Self {
        const { assert!(M == K * N, "M is the number of fixes times their dimension") };
        Self { fixes }
    }

    /// A column of the observation that is `part` in the rows of `source` and zero in the others.
    pub(crate) fn place(source: usize, part: &SVector<f64, N>) -> SVector<f64, M> {
        let mut whole = SVector::<f64, M>::zeros();
        for row in 0..N {
            whole[source * N + row] = part[row];
        }
        whole
    }
}

impl<G: Pose<D, N>, const D: usize, const K: usize, const N: usize, const M: usize>
    Observation<G, D, M> for Points<K, N, M>
{
    fn residual(&self, chi: &G) -> SVector<f64, M> {
        let mut residual = SVector::<f64, M>::zeros();
        for (source, fix) in self.fixes.iter().enumerate() {
            residual += Self::place(source, &(fix.position_w - fix.expected_w(chi)));
        }
        residual
    }

    fn left_jacobian(&self, chi: &G) -> SMatrix<f64, M, D> {
        let mut h = SMatrix::<f64, M, D>::zeros();
        for (source, fix) in self.fixes.iter().enumerate() {
            let block = chi.point_jacobian(&fix.lever_arm_b, 1.0 + fix.scale_error);
            for column in 0..D {
                for row in 0..N {
                    h[(source * N + row, column)] = block[(row, column)];
                }
            }
        }
        h
    }

    fn noise(&self) -> SMatrix<f64, M, M> {
        self.noise_covariance()
    }
}

impl<const K: usize, const N: usize, const M: usize> Points<K, N, M> {
    /// Covariance of the stacked noise, M x M: one block for each fix.
    ///
    /// ```
    /// # use inekf::lie::LieGroup;
    /// # use nalgebra::Vector2;
    /// use inekf::model::{PlanarPair, PointFix};
    /// use nalgebra::Matrix2;
    ///
    /// # let fix = |x_m: f64| PointFix {
    /// #     position_w: Vector2::new(x_m, 0.0),
    /// #     covariance_w: Matrix2::identity(),
    /// #     lever_arm_b: Vector2::zeros(),
    /// #     scale_error: 0.0,
    /// # };
    /// let uncertain = PointFix { covariance_w: Matrix2::new(4.0, 1.0, 1.0, 4.0), ..fix(1.0) };
    /// let noise = PlanarPair::new([fix(1.0), uncertain]).noise_covariance();
    /// // The axes of one source may be correlated, the sources are not.
    /// assert_eq!((noise[(2, 3)], noise[(1, 2)]), (1.0, 0.0));
    /// ```
    pub fn noise_covariance(&self) -> SMatrix<f64, M, M> {
        let mut noise = SMatrix::<f64, M, M>::zeros();
        for (source, fix) in self.fixes.iter().enumerate() {
            for column in 0..N {
                for row in 0..N {
                    noise[(source * N + row, source * N + column)] =
                        fix.covariance_w[(row, column)];
                }
            }
        }
        noise
    }
}
