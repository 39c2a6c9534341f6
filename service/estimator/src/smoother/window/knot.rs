//! One state of the window, with the motion that led to it, what saw it, and its gains.
//!
//! All in left-invariant coordinates at the estimate of the last solve.

use nalgebra::{ArrayStorage, Matrix3, SMatrix, SVector, Vector3};

use super::Fix;
use super::fix::HeadingRow;
use super::track::{InputJacobian, Track};
use crate::columns::combined;
use crate::filter::{Covariance, Factor, Seen, Side, is_mild};
use crate::model::InertialState;
use crate::smoother::linearise;
use crate::smoother::{Jacobians, Link, Preintegration};

/// What the passes need of a fix beyond the fix.
#[derive(Clone, Copy, Debug)]
pub(super) struct FixGain<const D: usize> {
    /// K, D x 3.
    pub gain: SMatrix<f64, D, 3>,
    /// Inverse of the innovation covariance.
    pub weight: Matrix3<f64>,
    /// What depends on the estimate in H.
    pub row: HeadingRow,
}

/// How a state was reached: what is read only where gains are computed.
#[derive(Clone, Copy, Debug)]
pub(super) struct Passage<G, const D: usize> {
    /// The motion from the state before; without meaning for the oldest state.
    pub motion: Preintegration<G, D>,
    /// F of the motion with its exact Jacobians; with frozen ones the track has it.
    pub transition: SMatrix<f64, D, D>,
    /// B of the motion, where the state has biases and the Jacobians are frozen.
    pub inputs: InputJacobian,
    /// Covariance given all that was before this state: kept up to date where gains are constants, and for the
    /// newest state.
    pub predicted: Covariance<D>,
}

impl<G: InertialState<D>, const D: usize> Passage<G, D> {
    /// The motion from `before`, linearised there with a frozen Jacobian of its residual. Keeps B; gives the rest.
    pub fn track(&mut self, before: &G) -> Track {
        if G::IS_GROUP_AFFINE {
            return Track::new(&self.motion.motion().step);
        }
        let motion = self.motion.motion_of(before);
        self.inputs = motion.input_jacobian;
        Track::new(&motion.step)
    }

    /// The motion from `before` to `chi` linearised with exact Jacobians: keeps F. Gives the offset and, from the
    /// `filtered` covariance before it, the one after.
    pub fn link<S: Side>(
        &mut self,
        before: &G,
        chi: &G,
        filtered: &Covariance<D>,
    ) -> (SVector<f64, D>, Covariance<D>) {
        let link = Link {
            motion: self.motion,
            noise: *self.motion.noise().matrix(),
        };
        let linear = linearise::motion::<G, S, _, D>(&link, before, chi, Jacobians::Exact);
        self.transition = linear.transition;
        let carried = filtered.transformed(&linear.transition);
        (linear.offset, carried.plus(&linear.noise))
    }
}

/// A state, with what every pass over the window reads.
#[derive(Clone, Copy, Debug)]
pub(super) struct Knot<G, const D: usize> {
    /// The estimate.
    pub chi: G,
    /// Whether the estimate is where the motion leads from the state before: so it is until an update moves both.
    pub is_predicted: bool,
    /// Both before the update that is under way.
    pub before: (G, bool),
    /// The motion from the state before, where its Jacobian is frozen.
    pub track: Track,
    pub fix: Option<Fix>,
    /// Present if there is a fix and its gain has been computed.
    gain: Option<FixGain<D>>,
    /// Covariance given all up to this state.
    pub filtered: Covariance<D>,

    /// On the way forward the filtered correction, on the way back the smoothed one.
    pub correction: SVector<f64, D>,
    /// Innovation, and the same times the inverse of its covariance.
    pub innovation: Vector3<f64>,
    pub weighted: Vector3<f64>,
}

impl<G: InertialState<D>, const D: usize> Knot<G, D> {
    /// A state that nothing has seen yet, at the end of `track`.
    pub fn new(chi: G, track: Track, predicted: &Covariance<D>) -> Self {
        Self {
            chi,
            is_predicted: true,
            before: (chi, true),
            track,
            fix: None,
            filtered: *predicted,
            gain: None,
            correction: SVector::zeros(),
            innovation: Vector3::zeros(),
            weighted: Vector3::zeros(),
        }
    }

    /// The same in place of an older one.
    pub fn begin(&mut self, chi: G, track: Track, predicted: &Covariance<D>) {
        (self.chi, self.is_predicted) = (chi, true);
        self.track = track;
        (self.fix, self.gain) = (None, None);
        self.filtered = *predicted;
    }

    /// Takes the fix back.
    pub fn unsee(&mut self, passage: &Passage<G, D>) {
        self.fix = None;
        self.gain = None;
        self.filtered = passage.predicted;
    }

    /// The offset of the motion from `before`, `xi = F xi_before + offset + w`, with frozen Jacobians:
    /// minus `log(f(chi_before)^-1 chi)` of \[IS\] (14), or what the parametrisation has in its place.
    #[inline]
    pub fn offset<S: Side>(&self, before: &G) -> SVector<f64, D> {
        if self.is_predicted {
            return SVector::zeros();
        }
        let expected = self.track.apply(before);
        let residual = S::Residual::difference(&expected, &self.chi);
        if S::Residual::IS_LEFT {
            -residual
        } else {
            -(S::Residual::to_left(&expected) * residual)
        }
    }

    /// The gain, and the covariance after the fix, where `filtered` is the one before it. `false` if the innovation
    /// covariance is not positive definite.
    pub fn weigh(&mut self) -> bool {
        let Some(fix) = &self.fix else {
            self.gain = None;
            return true;
        };
        let noise = fix.covariance_b(&self.chi);
        let row = fix.heading_row(&self.chi);
        let p_ht = fix.covariance_with(&self.filtered, &row);
        let mut innovation = noise;
        for axis in 0..3 {
            let seen = fix.seen(&p_ht.column(axis).into_owned(), &row);
            innovation += seen * Vector3::ith(axis, 1.0).transpose();
        }
        let Some(factor) = Factor::new(&innovation) else {
            return false;
        };
        let weight = factor.inverse();
        let gain = times(&p_ht, &weight);
        // As the filter does it.
        if Factor::new(&noise).is_some_and(|noise| is_mild(&noise, &innovation)) {
            let decorrelated = factor.decorrelated_rows(&p_ht);
            self.filtered.reduce(&decorrelated, factor.reciprocals());
        } else {
            let h = fix.jacobian(&row);
            self.filtered = self
                .filtered
                .corrected_with(&p_ht, &gain, &Seen::by(&h), &h, &noise);
        }
        self.gain = Some(FixGain { gain, weight, row });
        true
    }

    /// The filtered correction from the `predicted` one.
    #[inline]
    pub fn correct(&mut self, predicted: &SVector<f64, D>) {
        let (Some(fix), Some(gain)) = (&self.fix, &self.gain) else {
            self.correction = *predicted;
            return;
        };
        self.innovation = fix.residual_b(&self.chi) - fix.seen(predicted, &gain.row);
        self.weighted = gain.weight * self.innovation;
        self.correction = plus_product(predicted, &gain.gain, &self.innovation);
    }

    /// The smoothed correction, from the adjoint at the end of this state, zero if it is the newest; gives the adjoint at
    /// its beginning.
    #[inline]
    pub fn smooth(&mut self, adjoint: SVector<f64, D>, is_newest: bool) -> SVector<f64, D> {
        if !is_newest {
            self.correction = plus_product(&self.correction, self.filtered.matrix(), &adjoint);
        }
        match (&self.fix, &self.gain) {
            (Some(fix), Some(gain)) => {
                let weight = self.weighted - gain.gain.tr_mul(&adjoint);
                fix.add_transposed(adjoint, &weight, &gain.row)
            }
            _ => adjoint,
        }
    }

    /// The information matrix at the beginning of this state, from that at its end.
    pub fn information(&self, end: &SMatrix<f64, D, D>) -> SMatrix<f64, D, D> {
        match (&self.fix, &self.gain) {
            (Some(fix), Some(gain)) => {
                let h = fix.jacobian::<D>(&gain.row);
                let by_gain = end * gain.gain;
                let inner = gain.gain.tr_mul(&by_gain) + gain.weight;
                end + h.tr_mul(&(inner * h - by_gain.transpose())) - by_gain * h
            }
            _ => *end,
        }
    }
}

/// `sum + M x`.
#[inline]
fn plus_product<const D: usize, const N: usize>(
    sum: &SVector<f64, D>,
    m: &SMatrix<f64, D, N>,
    x: &SVector<f64, N>,
) -> SVector<f64, D> {
    let ([sum], [x]) = (&sum.data.0, x.data.0);
    let column = combined::<D, D, D, D, N>(sum, x, m.data.0.each_ref());
    SVector::from_array_storage(ArrayStorage([column]))
}

/// `A S`.
#[inline]
fn times<const D: usize>(a: &SMatrix<f64, D, 3>, s: &Matrix3<f64>) -> SMatrix<f64, D, 3> {
    let columns = s
        .data
        .0
        .map(|factors| combined::<D, D, D, D, 3>(&[0.0; D], factors, a.data.0.each_ref()));
    SMatrix::from_array_storage(ArrayStorage(columns))
}
