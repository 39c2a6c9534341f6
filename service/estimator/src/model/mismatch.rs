//! The declared ways in which a model may be wrong: the three classes of \[LC\] III, as columns.
//!
//! Class 1 is here for odometry, in [`inertial_mismatch`](super::inertial_mismatch) for an IMU, and summed up in
//! [`process`](super::process).
//!
//! A mismatch is one to three unknown parameters m, small and zero in the assumed model. To first order
//!
//! ```text
//! xi(k|k-1) = F xi + T m + w        class 1, the mean of the process: T = d_kappa   (LC (13), (29))
//! y - h     = H xi + dh m + v       class 2, the action's model: the scale          (LC (14), (31))
//!                                   class 3, the action of a perturbation           (LC (15), (33))
//! ```
//!
//! xi is the left-invariant error (body axes), so are the columns of T; those of dh are in the axes of the
//! residual, world, metres per unit of m. A gain does not see the parameters if `L (H T + dh) = T`.

use nalgebra::{SMatrix, SVector, Vector3};

use super::observation::points::Points;
use super::odometry::OdometryStep;
use super::pose::{Pose, RigidPose};
use super::process::{MeanMismatch, Motion, Part, PathNoise};

/// Most parameters that one mismatch has.
pub const MAX_PARAMETERS: usize = 3;

/// Up to three columns of R rows: one for each parameter of a mismatch.
///
/// ```
/// use inekf::model::Columns;
/// use nalgebra::Vector2;
///
/// let columns = Columns::one(Vector2::new(1.0, 2.0));
/// assert_eq!(columns.map(|column| column * 3.0).as_slice(), [Vector2::new(3.0, 6.0)]);
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Columns<const R: usize> {
    columns: [SVector<f64, R>; MAX_PARAMETERS],
    count: usize,
}

impl<const R: usize> Columns<R> {
    /// One column.
    ///
    /// ```
    /// use inekf::model::Columns;
    /// use nalgebra::Vector2;
    ///
    /// assert_eq!(Columns::one(Vector2::new(1.0, 2.0)).as_slice().len(), 1);
    /// ```
    pub fn one(column: SVector<f64, R>) -> Self {
        Self {
            columns: [column, SVector::zeros(), SVector::zeros()],
            count: 1,
        }
    }

    /// Three columns.
    ///
    /// ```
    /// use inekf::model::Columns;
    /// use nalgebra::Vector3;
    ///
    /// // One for each axis that a frame may be turned about.
    /// let about = Columns::three([Vector3::x(), Vector3::y(), Vector3::z()]);
    /// assert_eq!(about.as_slice()[2], Vector3::z());
    /// ```
    pub fn three(columns: [SVector<f64, R>; MAX_PARAMETERS]) -> Self {
        Self { columns, count: 3 }
    }

    /// The columns.
    ///
    /// ```
    /// use inekf::model::Columns;
    /// use nalgebra::Vector2;
    ///
    /// // As many as there are parameters.
    /// assert_eq!(Columns::one(Vector2::x()).as_slice(), [Vector2::x()]);
    /// ```
    pub fn as_slice(&self) -> &[SVector<f64, R>] {
        &self.columns[..self.count]
    }

    /// `f` of every column.
    ///
    /// ```
    /// use inekf::model::Columns;
    /// use nalgebra::{Matrix1x2, Vector1, Vector2};
    ///
    /// // H T, as a constraint needs it.
    /// let (h, t) = (Matrix1x2::new(0.0, 1.0), Columns::one(Vector2::new(5.0, 2.0)));
    /// assert_eq!(t.map(|t| h * t).as_slice(), [Vector1::new(2.0)]);
    /// ```
    pub fn map<const Q: usize>(
        &self,
        f: impl Fn(&SVector<f64, R>) -> SVector<f64, Q>,
    ) -> Columns<Q> {
        Columns {
            columns: core::array::from_fn(|i| f(&self.columns[i])),
            count: self.count,
        }
    }
}

/// A mismatch with what is known of the size of its parameters.
///
/// ```
/// use inekf::model::{Declared, ProcessMismatch};
///
/// // Nothing is known of it, or that it is of some 5 %.
/// let hard = Declared::hard(ProcessMismatch::OdometryScale);
/// let soft = Declared::soft(ProcessMismatch::OdometryScale, 0.05);
/// assert!(hard.sigma.is_infinite() && soft.sigma == 0.05);
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Declared<T> {
    /// The mismatch.
    pub mismatch: T,
    /// Standard deviation of each of its parameters; infinity if nothing is known, which is the hard
    /// constraint of \[LC\].
    pub sigma: f64,
}

impl<T> Declared<T> {
    /// Nothing is known of the size: the constraint of \[LC\].
    ///
    /// ```
    /// use inekf::model::{Declared, ProcessMismatch};
    ///
    /// assert!(Declared::hard(ProcessMismatch::OdometryScale).sigma.is_infinite());
    /// ```
    pub fn hard(mismatch: T) -> Self {
        Self {
            mismatch,
            sigma: f64::INFINITY,
        }
    }

    /// The parameters have this standard deviation.
    ///
    /// ```
    /// use inekf::model::{Declared, ProcessMismatch};
    ///
    /// // Wheels that are off by 2 % or so.
    /// assert_eq!(Declared::soft(ProcessMismatch::OdometryScale, 0.02).sigma, 0.02);
    /// ```
    pub fn soft(mismatch: T, sigma: f64) -> Self {
        Self { mismatch, sigma }
    }
}

/// Class 1: the odometry's increment is `kappa delta_kappa`, \[LC\] (12).
///
/// ```
/// use inekf::lie::{LieGroup, SE2};
/// use inekf::model::{OdometryStep, ProcessMismatch};
/// use nalgebra::Vector3;
///
/// // A gyro's bias turns more the longer the step is, a wheel's scale leads farther the longer its way.
/// let step = OdometryStep::<SE2>::new(&Vector3::new(0.0, 10.0, 0.0), 2.0);
/// let bias = ProcessMismatch::OdometryRotationBias { axis: 0 }.direction(&step);
/// let scale = ProcessMismatch::OdometryScale.direction(&step);
/// assert_eq!((bias, scale), (Vector3::new(2.0, 0.0, 0.0), Vector3::new(0.0, 10.0, 0.0)));
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ProcessMismatch {
    /// The translation is `(1 + m) u`: slipping or deflated wheels. One parameter.
    OdometryScale,
    /// The rotation vector is `(1 + m) log Omega`: a wheel base or a gyro's scale that is off, about every axis
    /// alike. One parameter.
    OdometryTurnScale,
    /// The rotation gains `m dt` about one axis of the body, m in rad/s: a gyro's bias. One parameter.
    OdometryRotationBias {
        /// Index of the axis in the rotation's tangent: 0 in the plane, 0 to 2 in space.
        axis: usize,
    },
}

impl ProcessMismatch {
    /// `d_kappa / m` of one step, D, left-invariant: `(0, Omega^T u)` for the scale, `(log Omega, 0)` for that of
    /// the turn, `(dt e, 0)` for the bias.
    ///
    /// ```
    /// use inekf::lie::{LieGroup, SE2};
    /// use inekf::model::{OdometryStep, ProcessMismatch};
    /// use nalgebra::Vector3;
    ///
    /// // What a step a little longer than measured differs by, in body axes at its end.
    /// let (m, increment) = (1e-6, Vector3::new(0.5, 2.0, 1.0));
    /// let step = OdometryStep::<SE2>::new(&increment, 1.0);
    /// let longer = OdometryStep::<SE2>::new(&Vector3::new(0.5, 2.0 * (1.0 + m), 1.0 + m), 1.0);
    /// let change = step.kappa.between(&longer.kappa).log() / m;
    /// assert!((ProcessMismatch::OdometryScale.direction(&step) - change).norm() < 1e-6);
    /// ```
    pub fn direction<G: RigidPose<D, N>, const D: usize, const N: usize>(
        &self,
        step: &OdometryStep<G>,
    ) -> SVector<f64, D> {
        match *self {
            Self::OdometryScale => step.scale_direction(),
            Self::OdometryTurnScale => step.turn_direction(),
            Self::OdometryRotationBias { axis } => {
                let mut direction = SVector::<f64, D>::zeros();
                if axis < G::ROTATION_DIM {
                    direction[axis] = step.dt_s;
                }
                direction
            }
        }
    }
}

impl MeanMismatch for ProcessMismatch {
    fn part(&self) -> Part {
        match self {
            Self::OdometryScale => Part::Way,
            Self::OdometryTurnScale | Self::OdometryRotationBias { .. } => Part::Turn,
        }
    }

    fn is_scale(&self) -> bool {
        !self.can_wait()
    }

    fn can_wait(&self) -> bool {
        matches!(self, Self::OdometryRotationBias { .. })
    }
}

/// Odometry, with the covariance of its noise (D x D, of the left-invariant error).
impl<G: RigidPose<D, N>, const D: usize, const N: usize> Motion<D, N> for OdometryStep<G> {
    type State = G;
    type Mismatch = ProcessMismatch;
    type Noise = SMatrix<f64, D, D>;

    fn carry(&self) -> impl Fn(&SVector<f64, D>, &ProcessMismatch) -> SVector<f64, D> {
        let f = self.left_jacobian();
        move |column, mismatch| f * column + mismatch.direction(self)
    }

    fn lengthen(&self, path: &mut PathNoise, q: &SMatrix<f64, D, D>) {
        let along_one = |first: usize, count: usize| {
            let variances = (first..first + count).map(|axis| q[(axis, axis)]);
            variances.sum::<f64>() / count as f64
        };
        path.way += along_one(G::POSITION, N);
        path.turn += along_one(0, G::ROTATION_DIM);
    }

    fn in_general_position() -> [Self; 2] {
        [Self::new(&SVector::from_fn(|i, _| 0.2 + 0.3 * i as f64), 1.0); 2]
    }
}

/// Classes 2 and 3: what is wrong with one of the position sources of a [`Points`].
///
/// ```
/// use inekf::lie::{LieGroup, SE2};
/// use inekf::model::{OutputMismatch, PlanarFix, PointFix};
/// use nalgebra::{Matrix2, Vector2};
///
/// let points = PlanarFix::new([PointFix {
///     position_w: Vector2::zeros(),
///     covariance_w: Matrix2::identity(),
///     lever_arm_b: Vector2::zeros(),
///     scale_error: 0.0,
/// }]);
/// let mut chi = SE2::identity();
/// chi.position = Vector2::new(30.0, 0.0);
/// // A scale leads along the position, a turn across it, both by as much as it is far.
/// let scale = OutputMismatch::MeasurementScale { source: 0 }.columns(&points, &chi);
/// let turn = OutputMismatch::MeasurementRotation { source: 0, axis_w: None }.columns(&points, &chi);
/// assert_eq!(scale.as_slice()[0], Vector2::new(30.0, 0.0));
/// assert!((turn.as_slice()[0] - Vector2::new(0.0, -30.0)).norm() < 1e-12);
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum OutputMismatch {
    /// Class 2: the source sees `(1 + eps + m) x + R b`. One parameter.
    MeasurementScale {
        /// Index of the source in the stacked observation.
        source: usize,
    },
    /// Class 3: the source's frame is turned, `y = Exp(m)^T ((1 + eps) x + R b)`.
    MeasurementRotation {
        /// Index of the source in the stacked observation.
        source: usize,
        /// The axis in world axes, if it is known: one parameter then. In the plane it is z, and this is
        /// ignored; in space `None` means any axis: three parameters, of which two can be seen.
        axis_w: Option<Vector3<f64>>,
    },
}

impl OutputMismatch {
    /// Index of the source that is wrong.
    ///
    /// ```
    /// use inekf::model::OutputMismatch;
    ///
    /// let turned = OutputMismatch::MeasurementRotation { source: 1, axis_w: None };
    /// assert_eq!(turned.source(), 1);
    /// ```
    pub fn source(&self) -> usize {
        match *self {
            Self::MeasurementScale { source } | Self::MeasurementRotation { source, .. } => source,
        }
    }

    /// The same of another source.
    ///
    /// ```
    /// use inekf::model::OutputMismatch;
    ///
    /// let scale = OutputMismatch::MeasurementScale { source: 0 };
    /// assert_eq!(scale.at(3).source(), 3);
    /// ```
    #[must_use]
    pub fn at(&self, source: usize) -> Self {
        match *self {
            Self::MeasurementScale { .. } => Self::MeasurementScale { source },
            Self::MeasurementRotation { axis_w, .. } => {
                Self::MeasurementRotation { source, axis_w }
            }
        }
    }

    /// How many parameters it has in N dimensions.
    ///
    /// ```
    /// use inekf::model::OutputMismatch;
    ///
    /// // A turn about any axis has three in space and one in the plane.
    /// let turn = OutputMismatch::MeasurementRotation { source: 0, axis_w: None };
    /// assert_eq!((turn.parameters::<2>(), turn.parameters::<3>()), (1, 3));
    /// ```
    pub fn parameters<const N: usize>(&self) -> usize {
        match self {
            Self::MeasurementRotation { axis_w: None, .. } if N == 3 => 3,
            _ => 1,
        }
    }

    /// dh: what the parameters add to `points` seen from `chi`, M rows. World axes, metres per unit or rad.
    /// Zero if the source does not exist.
    ///
    /// In body axes (times `R^T`) these are `R^T x` and `-R^T J ((1 + eps) x + R b)`, \[LC\] (31) and (33).
    ///
    /// ```
    /// # use inekf::model::PointFix;
    /// # use nalgebra::Matrix2;
    /// use inekf::lie::{LieGroup, SE2};
    /// use inekf::model::{OutputMismatch, PlanarPair};
    /// use nalgebra::Vector2;
    ///
    /// # let fix = |x_m: f64| PointFix {
    /// #     position_w: Vector2::new(x_m, 0.0),
    /// #     covariance_w: Matrix2::identity(),
    /// #     lever_arm_b: Vector2::zeros(),
    /// #     scale_error: 0.0,
    /// # };
    /// let mut chi = SE2::identity();
    /// chi.position = Vector2::new(30.0, 40.0);
    /// let points = PlanarPair::new([fix(30.0), fix(30.0)]);
    /// // The second source sees the scale, the first does not; a third is not there.
    /// let of = |source| OutputMismatch::MeasurementScale { source }.columns(&points, &chi);
    /// assert_eq!(of(1).as_slice()[0].as_slice(), [0.0, 0.0, 30.0, 40.0]);
    /// assert_eq!(of(2).as_slice()[0].norm(), 0.0);
    /// ```
    pub fn columns<G, const D: usize, const K: usize, const N: usize, const M: usize>(
        &self,
        points: &Points<K, N, M>,
        chi: &G,
    ) -> Columns<M>
    where
        G: Pose<D, N>,
    {
        let Some(fix) = points.fixes.get(self.source()) else {
            return Columns::one(SVector::zeros());
        };
        let columns = match *self {
            Self::MeasurementScale { .. } => Columns::one(chi.position_w()),
            Self::MeasurementRotation { axis_w, .. } => {
                rotation_columns(&fix.expected_w(chi), axis_w)
            }
        };
        columns.map(|column| Points::<K, N, M>::place(self.source(), column))
    }
}

/// The derivative of `Exp(m)^T y` at `m = 0`: `-J y` in the plane, `y x e_i` (or `y x axis`) in space.
pub(super) fn rotation_columns<const N: usize>(
    y: &SVector<f64, N>,
    axis_w: Option<Vector3<f64>>,
) -> Columns<N> {
    if N == 2 {
        return Columns::one(SVector::from_fn(
            |row, _| if row == 0 { y[1] } else { -y[0] },
        ));
    }
    let y = Vector3::from_fn(|row, _| y[row]);
    let about = |axis: Vector3<f64>| {
        let turned = y.cross(&axis);
        SVector::<f64, N>::from_fn(|row, _| turned[row])
    };
    match axis_w {
        Some(axis) => Columns::one(about(axis)),
        None => Columns::three([
            about(Vector3::x()),
            about(Vector3::y()),
            about(Vector3::z()),
        ]),
    }
}
