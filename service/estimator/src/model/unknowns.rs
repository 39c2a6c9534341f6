//! Mismatches carried as states: the models of odometry and of position fixes with their parameters m.
//!
//! ```text
//! chi+ = chi (Omega Exp(m_t log Omega + m_b dt), (1 + m_u) u)      m+ = m + random walk
//! y_i  = Exp(m_r)^T ((1 + eps_i + m_s) x + R b_i)
//! ```
//!
//! Linearised at the estimated parameters, not at zero: what the hard constraint of \[LC\] throws away, an
//! augmented filter learns. The parameters lie in the state in the order of the declarations, those of the
//! process first; places that are left over mean nothing, and with a variance of zero change nothing: one P
//! serves every set of at most P parameters.

use nalgebra::{SMatrix, SVector, Vector3};

use super::augmented::Augmented;
use super::mismatch::{Declared, OutputMismatch, ProcessMismatch, rotation_columns};
use super::observation::Observation;
use super::observation::points::Points;
use super::odometry::OdometryStep;
use super::pose::{Pose, RigidPose};
use super::process::MAX_PROCESS_MISMATCHES;
use crate::lie::{LieGroup, SO2, SO3};

/// Most output mismatches that a state carries.
pub const MAX_OUTPUT_MISMATCHES: usize = 8;

/// What the parameters of an [`Augmented`] state mean.
///
/// ```
/// use inekf::model::{OutputMismatch, ProcessMismatch, Unknowns};
///
/// let scale = OutputMismatch::MeasurementScale { source: 0 };
/// let unknowns = Unknowns::new::<2, 2>(&[ProcessMismatch::OdometryScale], &[scale]).expect("two of two");
/// // Those of the motion first.
/// assert!(unknowns.is_of_motion(0) && !unknowns.is_of_motion(1));
/// // Three do not fit into two.
/// assert!(Unknowns::new::<2, 2>(&[ProcessMismatch::OdometryScale], &[scale, scale.at(1)]).is_none());
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Unknowns {
    process: [Option<ProcessMismatch>; MAX_PROCESS_MISMATCHES],
    outputs: [Option<OutputMismatch>; MAX_OUTPUT_MISMATCHES],
}

/// The transition of an augmented state over one step.
///
/// ```
/// use inekf::lie::{LieGroup, SE2};
/// use inekf::model::{Augmented, OdometryStep, ProcessMismatch, Unknowns};
/// use nalgebra::{Vector1, Vector3};
///
/// let unknowns = Unknowns::new::<2, 1>(&[ProcessMismatch::OdometryScale], &[]).expect("one");
/// let state = Augmented::<SE2, 3, 1, 4>::new(SE2::identity(), Vector1::new(0.1));
/// let seen = OdometryStep::new(&Vector3::new(0.0, 10.0, 0.0), 1.0);
/// let actual = unknowns.step(&seen, &state);
/// // A tenth longer than it was seen; a scale that is off by more would lead farther by the way.
/// assert!((actual.step.kappa.position.x - 11.0).abs() < 1e-12);
/// assert!((actual.left_jacobian[(1, 3)] - 10.0).abs() < 1e-9);
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AugmentedStep<G, const D: usize> {
    /// The step, with the estimated parameters in it.
    pub step: OdometryStep<G>,
    /// F, D x D, of the left-invariant error.
    pub left_jacobian: SMatrix<f64, D, D>,
}

impl Unknowns {
    /// These mismatches, in N dimensions, as P parameters. `None` if they have more parameters than P, or are more
    /// than [`MAX_PROCESS_MISMATCHES`] and [`MAX_OUTPUT_MISMATCHES`].
    ///
    /// ```
    /// use inekf::model::{OutputMismatch, Unknowns};
    ///
    /// // A turn about any axis is one parameter in the plane, and three in space.
    /// let turn = OutputMismatch::MeasurementRotation { source: 0, axis_w: None };
    /// assert!(Unknowns::new::<2, 1>(&[], &[turn]).is_some());
    /// assert!(Unknowns::new::<3, 1>(&[], &[turn]).is_none());
    /// ```
    pub fn new<const N: usize, const P: usize>(
        process: &[ProcessMismatch],
        outputs: &[OutputMismatch],
    ) -> Option<Self> {
        Self::listed::<N, P>(process.iter().copied(), outputs.iter().copied())
    }

    /// The declared mismatches as P parameters, and the standard deviation of each parameter: zero where a place is
    /// left over. `None` as in [`new`](Self::new), or if a sigma is not a finite number: of what is unknown
    /// altogether there is no state, only a constraint.
    ///
    /// ```
    /// use inekf::model::{Declared, ProcessMismatch, Unknowns};
    ///
    /// let soft = Declared::soft(ProcessMismatch::OdometryScale, 0.05);
    /// let (_, sigmas) = Unknowns::declared::<2, 3>(&[soft], &[]).expect("one of three");
    /// // Two places are left over, and mean nothing.
    /// assert_eq!(sigmas.as_slice(), [0.05, 0.0, 0.0]);
    /// // Of what is unknown altogether there is no state.
    /// assert!(Unknowns::declared::<2, 3>(&[Declared::hard(ProcessMismatch::OdometryScale)], &[]).is_none());
    /// ```
    pub fn declared<const N: usize, const P: usize>(
        process: &[Declared<ProcessMismatch>],
        outputs: &[Declared<OutputMismatch>],
    ) -> Option<(Self, SVector<f64, P>)> {
        let unknowns = Self::listed::<N, P>(
            process.iter().map(|declared| declared.mismatch),
            outputs.iter().map(|declared| declared.mismatch),
        )?;
        let of_process = process.iter().map(|declared| (1, declared.sigma));
        let of_outputs = outputs
            .iter()
            .map(|declared| (declared.mismatch.parameters::<N>(), declared.sigma));
        let mut sigmas = SVector::<f64, P>::zeros();
        let mut places = sigmas.iter_mut();
        for (count, sigma) in of_process.chain(of_outputs) {
            for place in places.by_ref().take(count) {
                *place = sigma;
            }
        }
        let all_finite = sigmas.iter().all(|sigma| sigma.is_finite());
        all_finite.then_some((unknowns, sigmas))
    }

    fn listed<const N: usize, const P: usize>(
        process: impl Iterator<Item = ProcessMismatch>,
        outputs: impl Iterator<Item = OutputMismatch>,
    ) -> Option<Self> {
        let mut unknowns = Self {
            process: [None; MAX_PROCESS_MISMATCHES],
            outputs: [None; MAX_OUTPUT_MISMATCHES],
        };
        let mut parameters = 0;
        let mut places = unknowns.process.iter_mut();
        for mismatch in process {
            *places.next()? = Some(mismatch);
            parameters += 1;
        }
        let mut places = unknowns.outputs.iter_mut();
        for mismatch in outputs {
            *places.next()? = Some(mismatch);
            parameters += mismatch.parameters::<N>();
        }
        (parameters <= P).then_some(unknowns)
    }

    /// Whether the parameter at `index` is one of the process: of the motion, not of a measurement.
    ///
    /// ```
    /// use inekf::model::{OutputMismatch, ProcessMismatch, Unknowns};
    ///
    /// let scale_of = |source| OutputMismatch::MeasurementScale { source };
    /// let unknowns = Unknowns::new::<2, 2>(&[ProcessMismatch::OdometryScale], &[scale_of(0)]).expect("two");
    /// assert!(unknowns.is_of_motion(0) && !unknowns.is_of_motion(1));
    /// ```
    pub fn is_of_motion(&self, index: usize) -> bool {
        index < self.process().count()
    }

    /// The mismatches of the process: their places are those of their parameters.
    fn process(&self) -> impl Iterator<Item = &ProcessMismatch> {
        self.process.iter().flatten()
    }

    /// The step that the measured `step` is, seen from `state`, and its transition matrix.
    ///
    /// ```
    /// use inekf::lie::{LieGroup, SE2};
    /// use inekf::model::{Augmented, OdometryStep, ProcessMismatch, Unknowns};
    /// use nalgebra::{Vector1, Vector3};
    ///
    /// // A gyro that shows 0.1 rad/s too little: what looked like straight on was a turn.
    /// let bias = ProcessMismatch::OdometryRotationBias { axis: 0 };
    /// let unknowns = Unknowns::new::<2, 1>(&[bias], &[]).expect("one");
    /// let state = Augmented::<SE2, 3, 1, 4>::new(SE2::identity(), Vector1::new(0.1));
    /// let actual = unknowns.step(&OdometryStep::new(&Vector3::new(0.0, 10.0, 0.0), 2.0), &state);
    /// assert!((actual.step.kappa.rotation.angle_rad() - 0.2).abs() < 1e-12);
    /// ```
    pub fn step<G, const B: usize, const P: usize, const D: usize, const N: usize>(
        &self,
        step: &OdometryStep<G>,
        state: &Augmented<G, B, P, D>,
    ) -> AugmentedStep<G, D>
    where
        G: RigidPose<B, N>,
    {
        let (mut scale, mut turn) = (1.0, SVector::<f64, B>::zeros());
        for (mismatch, m) in self.process().zip(&state.parameters) {
            match mismatch {
                ProcessMismatch::OdometryScale => scale += m,
                ProcessMismatch::OdometryTurnScale
                | ProcessMismatch::OdometryRotationBias { .. } => {
                    turn += mismatch.direction(step) * *m;
                }
            }
        }
        let by_turn = G::exp(&turn);
        let turned = OdometryStep {
            kappa: step.kappa.compose(&by_turn),
            dt_s: step.dt_s,
        };
        let actual = OdometryStep {
            kappa: turned
                .kappa
                .with_position_w(&(step.kappa.position_w() * scale)),
            dt_s: step.dt_s,
        };
        let on_pose = actual.left_jacobian();
        let turn_jacobian = G::right_jacobian(&turn);
        let mut left_jacobian = SMatrix::<f64, D, D>::identity();
        for column in 0..B {
            for row in 0..B {
                left_jacobian[(row, column)] = on_pose[(row, column)];
            }
        }
        for (index, mismatch) in self.process().enumerate() {
            // The direction of the translation belongs to the whole step, those of the turn to its end.
            let direction = match mismatch {
                ProcessMismatch::OdometryScale => turned.scale_direction(),
                ProcessMismatch::OdometryTurnScale
                | ProcessMismatch::OdometryRotationBias { .. } => {
                    turn_jacobian * mismatch.direction(step)
                }
            };
            for row in 0..B {
                left_jacobian[(row, B + index)] = direction[row];
            }
        }
        AugmentedStep {
            step: actual,
            left_jacobian,
        }
    }

    /// `points` as an augmented state sees them.
    ///
    /// ```
    /// # use inekf::model::PointFix;
    /// # use nalgebra::{Matrix2, Vector2};
    /// use inekf::lie::{LieGroup, SE2};
    /// use inekf::model::{Augmented, Observation, OutputMismatch, PlanarFix, Unknowns};
    /// use nalgebra::Vector1;
    ///
    /// let scale_of = |source| OutputMismatch::MeasurementScale { source };
    /// # let fix = |x_m: f64| PointFix {
    /// #     position_w: Vector2::new(x_m, 0.0),
    /// #     covariance_w: Matrix2::identity(),
    /// #     lever_arm_b: Vector2::zeros(),
    /// #     scale_error: 0.0,
    /// # };
    /// let unknowns = Unknowns::new::<2, 1>(&[], &[scale_of(0)]).expect("one");
    /// let mut state = Augmented::<SE2, 3, 1, 4>::new(SE2::identity(), Vector1::new(0.1));
    /// state.pose.position.x = 10.0;
    /// // A source that is thought to show a tenth too much, ten metres away: what shows eleven fits.
    /// let seen = unknowns.observe(PlanarFix::new([fix(11.0)]));
    /// assert!(seen.residual(&state).norm() < 1e-12);
    /// ```
    pub fn observe<const K: usize, const N: usize, const M: usize>(
        &self,
        points: Points<K, N, M>,
    ) -> AugmentedPoints<K, N, M> {
        self.observe_from(0, points)
    }

    /// `points` of the sources from `first_source` on, as an augmented state sees them: for sources that come
    /// one at a time.
    ///
    /// ```
    /// # use inekf::model::PointFix;
    /// # use nalgebra::{Matrix2, Vector2};
    /// use inekf::lie::{LieGroup, SE2};
    /// use inekf::model::{Augmented, Observation, OutputMismatch, PlanarFix, Unknowns};
    /// use nalgebra::Vector1;
    ///
    /// let scale_of = |source| OutputMismatch::MeasurementScale { source };
    /// # let fix = |x_m: f64| PointFix {
    /// #     position_w: Vector2::new(x_m, 0.0),
    /// #     covariance_w: Matrix2::identity(),
    /// #     lever_arm_b: Vector2::zeros(),
    /// #     scale_error: 0.0,
    /// # };
    /// let unknowns = Unknowns::new::<2, 1>(&[], &[scale_of(1)]).expect("one");
    /// let mut state = Augmented::<SE2, 3, 1, 4>::new(SE2::identity(), Vector1::new(0.1));
    /// state.pose.position.x = 10.0;
    /// // A fix of the second source, which is the one that is off.
    /// let seen = unknowns.observe_from(1, PlanarFix::new([fix(11.0)]));
    /// assert!(seen.residual(&state).norm() < 1e-12);
    /// ```
    pub fn observe_from<const K: usize, const N: usize, const M: usize>(
        &self,
        first_source: usize,
        points: Points<K, N, M>,
    ) -> AugmentedPoints<K, N, M> {
        self.observe_by(core::array::from_fn(|place| first_source + place), points)
    }

    /// `points` of these sources, as an augmented state sees them.
    ///
    /// ```
    /// # use inekf::model::PointFix;
    /// # use nalgebra::{Matrix2, Vector2};
    /// use inekf::lie::{LieGroup, SE2};
    /// use inekf::model::{Augmented, Observation, OutputMismatch, PlanarPair, Unknowns};
    /// use nalgebra::Vector1;
    ///
    /// let scale_of = |source| OutputMismatch::MeasurementScale { source };
    /// # let fix = |x_m: f64| PointFix {
    /// #     position_w: Vector2::new(x_m, 0.0),
    /// #     covariance_w: Matrix2::identity(),
    /// #     lever_arm_b: Vector2::zeros(),
    /// #     scale_error: 0.0,
    /// # };
    /// let unknowns = Unknowns::new::<2, 1>(&[], &[scale_of(2)]).expect("one");
    /// let mut state = Augmented::<SE2, 3, 1, 4>::new(SE2::identity(), Vector1::new(0.1));
    /// state.pose.position.x = 10.0;
    /// // The third source and the first, at one time: the third is off.
    /// let seen = unknowns.observe_by([2, 0], PlanarPair::new([fix(11.0), fix(10.0)]));
    /// assert!(seen.residual(&state).norm() < 1e-12);
    /// ```
    pub fn observe_by<const K: usize, const N: usize, const M: usize>(
        &self,
        sources: [usize; K],
        points: Points<K, N, M>,
    ) -> AugmentedPoints<K, N, M> {
        AugmentedPoints {
            points,
            sources,
            unknowns: *self,
        }
    }
}

/// Position fixes whose mismatches are in the state.
///
/// ```
/// # use inekf::model::PointFix;
/// # use nalgebra::Matrix2;
/// use inekf::lie::{LieGroup, SE2};
/// use inekf::model::{Augmented, Observation, OutputMismatch, PlanarFix, Unknowns};
/// use nalgebra::{Vector1, Vector2};
///
/// let scale_of = |source| OutputMismatch::MeasurementScale { source };
/// # let fix = |x_m: f64| PointFix {
/// #     position_w: Vector2::new(x_m, 0.0),
/// #     covariance_w: Matrix2::identity(),
/// #     lever_arm_b: Vector2::zeros(),
/// #     scale_error: 0.0,
/// # };
/// let unknowns = Unknowns::new::<2, 1>(&[], &[scale_of(0)]).expect("one");
/// let mut state = Augmented::<SE2, 3, 1, 4>::new(SE2::identity(), Vector1::new(0.0));
/// state.pose.position.x = 10.0;
/// let seen = unknowns.observe(PlanarFix::new([fix(10.0)]));
/// // At ten metres a unit of the scale is ten metres, in the column behind the pose.
/// assert_eq!(seen.left_jacobian(&state).column(3), Vector2::new(10.0, 0.0));
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AugmentedPoints<const K: usize, const N: usize, const M: usize> {
    points: Points<K, N, M>,
    /// Which source each of the points is of.
    sources: [usize; K],
    unknowns: Unknowns,
}

/// The frame of a source turned by the parameters m: `Exp(m)^T`, and its right Jacobian.
struct Frame<const N: usize> {
    inverse: SMatrix<f64, N, N>,
    m: Vector3<f64>,
    axis_w: Option<Vector3<f64>>,
}

impl<const N: usize> Frame<N> {
    fn turned(axis_w: Option<Vector3<f64>>, m: Vector3<f64>) -> Self {
        let inverse = if N == 2 {
            let rotation = SO2::from_angle(-m.x).matrix();
            SMatrix::from_fn(|row, column| rotation[(row, column)])
        } else {
            let rotation = SO3::exp(&-axis_w.map_or(m, |axis| axis * m.x)).matrix();
            SMatrix::from_fn(|row, column| rotation[(row, column)])
        };
        Self { inverse, m, axis_w }
    }

    /// The derivative of `Exp(m)^T y` in m, given `Exp(m)^T y`: `(Exp(m)^T y) x (Jr(m) d)`.
    fn derivative(&self, turned_y: &SVector<f64, N>, parameter: usize) -> SVector<f64, N> {
        let columns = rotation_columns(turned_y, self.axis_w);
        let columns = columns.as_slice();
        if columns.len() == 1 {
            return columns[0];
        }
        let jacobian = SO3::right_jacobian(&self.m);
        let terms = columns.iter().enumerate();
        terms
            .map(|(axis, column)| column * jacobian[(axis, parameter)])
            .sum()
    }
}

impl<const K: usize, const N: usize, const M: usize> AugmentedPoints<K, N, M> {
    /// The mismatches of the point at `place` in the stack, each with the index of its first parameter.
    fn mismatches_of(&self, place: usize) -> impl Iterator<Item = (&OutputMismatch, usize)> {
        let source = self.sources[place];
        let outputs = self.unknowns.outputs.iter().flatten();
        let indexed = outputs.scan(self.unknowns.process().count(), |next, mismatch| {
            let index = *next;
            *next += mismatch.parameters::<N>();
            Some((mismatch, index))
        });
        indexed.filter(move |(mismatch, _)| mismatch.source() == source)
    }

    /// The scale and the frame in which `source` sees.
    fn seen_by<const P: usize>(
        &self,
        source: usize,
        parameters: &SVector<f64, P>,
    ) -> (f64, Frame<N>) {
        let mut scale = 1.0 + self.points.fixes[source].scale_error;
        let (mut axis, mut turn) = (None, Vector3::zeros());
        for (mismatch, index) in self.mismatches_of(source) {
            match *mismatch {
                OutputMismatch::MeasurementScale { .. } => scale += parameters[index],
                OutputMismatch::MeasurementRotation { axis_w, .. } => {
                    axis = axis_w;
                    for row in 0..mismatch.parameters::<N>() {
                        turn[row] = parameters[index + row];
                    }
                }
            }
        }
        (scale, Frame::turned(axis, turn))
    }
}

impl<
    G,
    const B: usize,
    const P: usize,
    const D: usize,
    const K: usize,
    const N: usize,
    const M: usize,
> Observation<Augmented<G, B, P, D>, D, M> for AugmentedPoints<K, N, M>
where
    G: Pose<B, N>,
{
    fn residual(&self, chi: &Augmented<G, B, P, D>) -> SVector<f64, M> {
        let mut residual = SVector::<f64, M>::zeros();
        for (source, fix) in self.points.fixes.iter().enumerate() {
            let (scale, frame) = self.seen_by(source, &chi.parameters);
            let expected = frame.inverse * chi.pose.point_w(&fix.lever_arm_b, scale);
            residual += Points::<K, N, M>::place(source, &(fix.position_w - expected));
        }
        residual
    }

    fn left_jacobian(&self, chi: &Augmented<G, B, P, D>) -> SMatrix<f64, M, D> {
        let mut h = SMatrix::<f64, M, D>::zeros();
        for (source, fix) in self.points.fixes.iter().enumerate() {
            let (scale, frame) = self.seen_by(source, &chi.parameters);
            let on_pose = frame.inverse * chi.pose.point_jacobian(&fix.lever_arm_b, scale);
            for column in 0..B {
                for row in 0..N {
                    h[(source * N + row, column)] = on_pose[(row, column)];
                }
            }
            let seen = frame.inverse * chi.pose.point_w(&fix.lever_arm_b, scale);
            for (mismatch, index) in self.mismatches_of(source) {
                for parameter in 0..mismatch.parameters::<N>() {
                    let column = match mismatch {
                        OutputMismatch::MeasurementScale { .. } => {
                            frame.inverse * chi.pose.position_w()
                        }
                        OutputMismatch::MeasurementRotation { .. } => {
                            frame.derivative(&seen, parameter)
                        }
                    };
                    for row in 0..N {
                        h[(source * N + row, B + index + parameter)] = column[row];
                    }
                }
            }
        }
        h
    }

    fn noise(&self) -> SMatrix<f64, M, M> {
        self.points.noise_covariance()
    }
}
