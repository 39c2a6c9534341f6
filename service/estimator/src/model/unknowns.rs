//! Mismatches carried as states: the models of odometry and of position fixes with their parameters m.
//!
//! ```text
//! chi+ = chi (Omega Exp(m_b dt), (1 + m_u) u)      m+ = m + random walk
//! y_i  = Exp(m_r)^T ((1 + eps_i + m_s) x + R b_i)
//! ```
//!
//! Linearised at the estimated parameters, not at zero: what the hard constraint of \[LC\] throws away, an
//! augmented filter learns. The parameters lie in the state in the order of the declarations, those of the
//! process first.

use nalgebra::{SMatrix, SVector, Vector3};

use super::augmented::Augmented;
use super::mismatch::{OutputMismatch, ProcessMismatch, rotation_columns};
use super::observation::Observation;
use super::observation::points::Points;
use super::odometry::OdometryStep;
use super::pose::{Pose, RigidPose};
use crate::lie::{LieGroup, SO2, SO3};

/// What the parameters of an [`Augmented`] state mean.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Unknowns<'a> {
    process: &'a [ProcessMismatch],
    outputs: &'a [OutputMismatch],
}

/// The transition of an augmented state over one step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AugmentedStep<G, const D: usize> {
    /// The step, with the estimated parameters in it.
    pub step: OdometryStep<G>,
    /// F, D x D, of the left-invariant error.
    pub left_jacobian: SMatrix<f64, D, D>,
}

impl<'a> Unknowns<'a> {
    /// These mismatches, in N dimensions, as P parameters. `None` if their parameters are not P in number.
    pub fn new<const N: usize, const P: usize>(
        process: &'a [ProcessMismatch],
        outputs: &'a [OutputMismatch],
    ) -> Option<Self> {
        let of_outputs: usize = outputs.iter().map(OutputMismatch::parameters::<N>).sum();
        (process.len() + of_outputs == P).then_some(Self { process, outputs })
    }

    /// The step that the measured `step` is, seen from `state`, and its transition matrix.
    pub fn step<G, const B: usize, const P: usize, const D: usize, const N: usize>(
        &self,
        step: &OdometryStep<G>,
        state: &Augmented<G, B, P, D>,
    ) -> AugmentedStep<G, D>
    where
        G: RigidPose<B, N>,
    {
        let (mut scale, mut turn) = (1.0, SVector::<f64, B>::zeros());
        for (mismatch, m) in self.process.iter().zip(&state.parameters) {
            match *mismatch {
                ProcessMismatch::OdometryScale => scale += m,
                ProcessMismatch::OdometryRotationBias { axis } if axis < G::ROTATION_DIM => {
                    turn[axis] += m * step.dt_s;
                }
                ProcessMismatch::OdometryRotationBias { .. } => {}
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
        for (index, mismatch) in self.process.iter().enumerate() {
            // The scale's direction belongs to the whole step, the bias's to its end.
            let direction = match mismatch {
                ProcessMismatch::OdometryScale => turned.scale_direction(),
                ProcessMismatch::OdometryRotationBias { .. } => {
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
    pub fn observe<const K: usize, const N: usize, const M: usize>(
        &self,
        points: Points<K, N, M>,
    ) -> AugmentedPoints<'a, K, N, M> {
        self.observe_from(0, points)
    }

    /// `points` of the sources from `first_source` on, as an augmented state sees them: for sources that come
    /// one at a time.
    pub fn observe_from<const K: usize, const N: usize, const M: usize>(
        &self,
        first_source: usize,
        points: Points<K, N, M>,
    ) -> AugmentedPoints<'a, K, N, M> {
        AugmentedPoints {
            points,
            first_source,
            outputs: self.outputs,
            first: self.process.len(),
        }
    }
}

/// Position fixes whose mismatches are in the state.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AugmentedPoints<'a, const K: usize, const N: usize, const M: usize> {
    points: Points<K, N, M>,
    /// Which source the first of the points is of.
    first_source: usize,
    outputs: &'a [OutputMismatch],
    /// Index of the first parameter of the outputs.
    first: usize,
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

impl<const K: usize, const N: usize, const M: usize> AugmentedPoints<'_, K, N, M> {
    /// The mismatches of the point at `place` in the stack, each with the index of its first parameter.
    fn mismatches_of(&self, place: usize) -> impl Iterator<Item = (&OutputMismatch, usize)> {
        let source = self.first_source + place;
        let indexed = self.outputs.iter().scan(self.first, |next, mismatch| {
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
> Observation<Augmented<G, B, P, D>, D, M> for AugmentedPoints<'_, K, N, M>
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
