//! How far apart two estimates of one state are.
//!
//! Of the means, the largest component of the left-invariant difference; of the covariances, both in left-invariant
//! coordinates, the largest entry of the difference. Both in standard deviations of the first estimate.

use inekf::filter::{Belief, Left, Side};
use inekf::lie::LieGroup;

/// How far apart two estimates are, in standard deviations of the first.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Apart {
    /// The means.
    pub mean: f64,
    /// The covariances, relative to the product of two standard deviations.
    pub covariance: f64,
}

impl Apart {
    /// What cannot be compared, since one of the two is no more.
    pub const LOST: Self = Self {
        mean: f64::INFINITY,
        covariance: f64::INFINITY,
    };

    /// From `one` to `other`.
    pub fn between<G: LieGroup<D>, const D: usize>(
        one: &Belief<G, Left, D>,
        other: &Belief<G, Left, D>,
    ) -> Self {
        let scale = one
            .covariance
            .matrix()
            .diagonal()
            .map(|variance| 1.0 / variance.sqrt());
        let mean = Left::difference(&one.mean, &other.mean).component_mul(&scale);
        let covariance = one.covariance.matrix() - other.covariance.matrix();
        let covariance = covariance.component_mul(&(scale * scale.transpose()));
        Self {
            mean: largest(mean.iter()),
            covariance: largest(covariance.iter()),
        }
    }

    /// The larger of each.
    #[must_use]
    pub fn or_larger(self, other: Self) -> Self {
        Self {
            mean: largest([self.mean, other.mean].iter()),
            covariance: largest([self.covariance, other.covariance].iter()),
        }
    }
}

/// The largest magnitude; what is not a number counts as larger than any.
fn largest<'a>(values: impl Iterator<Item = &'a f64>) -> f64 {
    values.fold(0.0, |most, value| {
        if value.abs() <= most || most.is_nan() {
            most
        } else {
            value.abs()
        }
    })
}
