//! Position fixes as a pose sees them: one, or two of different sources taken together.

use inekf::model::{PointFix, Points};
use inekf_shared::message::{PositionFix, REASON_BAD_DIMENSION};
use nalgebra::{Matrix3, SMatrix, SVector, Vector3};

use super::super::fix::{Antenna, Fix, FixKind, Measurement};
use super::super::intake::{MAX_POSITION_M, bounded, covariance, source};
use super::super::settings::Sources;
use super::super::tally::Refusal;

/// One or two position fixes of N dimensions.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Sighting<const N: usize> {
    /// One.
    One(u32, PointFix<N>),
    /// Two, in the order of the stack.
    Two([u32; 2], [PointFix<N>; 2]),
}

impl<const N: usize> Sighting<N> {
    /// Every fix.
    fn fixes(&self) -> &[PointFix<N>] {
        match self {
            Self::One(_, fix) => core::slice::from_ref(fix),
            Self::Two(_, fixes) => fixes,
        }
    }

    /// The sum of the squares of what `expected` does not explain, and the trace of the noise, both m^2.
    pub fn surprise(&self, expected: impl Fn(&PointFix<N>) -> SVector<f64, N>) -> (f64, f64) {
        let squares = |fix: &PointFix<N>| (fix.position_w - expected(fix)).norm_squared();
        let fixes = self.fixes();
        (
            fixes.iter().map(squares).sum(),
            fixes.iter().map(|fix| fix.covariance_w.trace()).sum(),
        )
    }
}

/// The fixes as one observation.
pub fn points<const K: usize, const N: usize, const M: usize>(
    fixes: [PointFix<N>; K],
) -> Points<K, N, M> {
    Points::new(fixes)
}

impl<const N: usize> Measurement for Sighting<N> {
    fn kind(&self) -> FixKind {
        FixKind::Position
    }

    fn dimension(&self) -> usize {
        N * self.fixes().len()
    }

    fn antenna(&self) -> Option<Antenna> {
        let fix = self.fixes().first()?;
        let in_space =
            |v: &SVector<f64, N>| Vector3::from_fn(|i, _| if i < N { v[i] } else { 0.0 });
        Some(Antenna {
            position_w: in_space(&fix.position_w),
            covariance_w: Matrix3::from_fn(|row, column| {
                if row < N && column < N {
                    fix.covariance_w[(row, column)]
                } else {
                    0.0
                }
            }),
            lever_arm_b: in_space(&fix.lever_arm_b),
        })
    }

    fn paired_with(&self, later: &Self) -> Option<Self> {
        match (self, later) {
            (Self::One(first, one), Self::One(second, other)) => {
                Some(Self::Two([*first, *second], [*one, *other]))
            }
            _ => None,
        }
    }
}

/// A checked position fix. In the plane z and its covariance are ignored, in space they must be there.
///
/// # Errors
/// By reason; see the constants of `inekf_shared::message`.
pub fn checked<const N: usize>(
    message: &PositionFix,
    sources: &Sources,
) -> Result<Fix<Sighting<N>>, Refusal> {
    if message.dimension != 3 && (message.dimension != 2 || N != 2) {
        return Err(Refusal(REASON_BAD_DIMENSION));
    }
    let settings = source(sources, FixKind::Position, message.source)?;
    let (mut position_w_m, mut covariance_w_m2) = (message.position_w_m, message.covariance_w_m2);
    if N == 2 {
        position_w_m[2] = 0.0;
        for k in 0..3 {
            covariance_w_m2[6 + k] = 0.0;
            covariance_w_m2[3 * k + 2] = 0.0;
        }
        covariance_w_m2[8] = covariance_w_m2[0];
    }
    let position_w = bounded(position_w_m, MAX_POSITION_M)?;
    let covariance_w = covariance(&covariance_w_m2, settings)?;
    let fix = PointFix {
        position_w: SVector::from_fn(|i, _| position_w[i]),
        covariance_w: SMatrix::from_fn(|row, column| covariance_w[(row, column)]),
        lever_arm_b: SVector::from_fn(|i, _| settings.lever_arm_b[i]),
        scale_error: settings.scale_error,
    };
    Ok(Fix {
        stamp_ns: message.header.stamp_ns,
        source: message.source,
        partner: None,
        seq: message.header.seq,
        measurement: Sighting::One(message.source, fix),
    })
}
