//! Mixtures of Gaussians on a Lie group, and the one Gaussian with their moments.
//!
//! All components are written in the coordinates of one `Chart` at a reference c: with
//! `xi_i = log(c^-1 chi_i)`, a component is `chi = c exp(xi_i + Jr(xi_i)^-1 e_i)` to first order, so that its
//! mean is `xi_i` and its covariance `C_i = Jr(xi_i)^-1 P_i Jr(xi_i)^-T`. There a mixture is a sum:
//!
//! ```text
//! m = sum w_i xi_i,    C = sum w_i (C_i + (xi_i - m)(xi_i - m)^T)
//! ```
//!
//! and the merged belief is `c exp(m)` with `Jr(m) C Jr(m)^T`: the covariance carried as after an update
//! (\[PAR\], Proposition 2). The heaviest component is the reference, which keeps every `xi_i` that matters
//! short. Entering and leaving the chart is what costs; any number of mixtures in it is cheap.

use nalgebra::{SMatrix, SVector};

use crate::filter::{Belief, Covariance, Left};
use crate::lie::LieGroup;

/// A Gaussian in the coordinates of a chart.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Local<const D: usize> {
    /// Mean.
    pub xi: SVector<f64, D>,
    /// Covariance, symmetric.
    pub covariance: SMatrix<f64, D, D>,
}

/// Coordinates `xi` around c: `chi = c exp(xi)`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Chart<G> {
    /// c.
    pub reference: G,
}

impl<G> Chart<G> {
    /// The chart at the heaviest of `beliefs`.
    pub fn at_heaviest<const D: usize, const S: usize>(
        weights: &[f64; S],
        beliefs: &[Belief<G, Left, D>; S],
    ) -> Self
    where
        G: LieGroup<D>,
    {
        const { assert!(S > 0, "a mixture has components") };
        let mut heaviest = 0;
        for i in 1..S {
            if weights[i] > weights[heaviest] {
                heaviest = i;
            }
        }
        Self {
            reference: beliefs[heaviest].mean,
        }
    }

    /// `belief` in these coordinates.
    pub fn enter<const D: usize>(&self, belief: &Belief<G, Left, D>) -> Local<D>
    where
        G: LieGroup<D>,
    {
        let xi = self.reference.inverse().compose(&belief.mean).log();
        let carried = belief
            .covariance
            .transformed(&G::right_jacobian_inverse(&xi));
        Local {
            xi,
            covariance: *carried.matrix(),
        }
    }

    /// The belief with these coordinates.
    pub fn leave<const D: usize>(&self, local: &Local<D>) -> Belief<G, Left, D>
    where
        G: LieGroup<D>,
    {
        let covariance = Covariance::from_upper(local.covariance);
        Belief::new(
            self.reference.compose(&G::exp(&local.xi)).normalized(),
            covariance.transformed(&G::right_jacobian(&local.xi)),
        )
    }
}

/// Mean and covariance of a mixture in one chart; `None` if no weight is positive. The weights need not add up
/// to one.
pub(crate) fn moments<'a, const D: usize>(
    components: impl Iterator<Item = (f64, &'a Local<D>)>,
) -> Option<Local<D>> {
    let mut total = 0.0;
    let mut sum = Local {
        xi: SVector::zeros(),
        covariance: SMatrix::zeros(),
    };
    for (weight, component) in components.filter(|(weight, _)| *weight > 0.0) {
        // Running moments: the spread about the mean so far, with no cancellation.
        total += weight;
        let share = weight / total;
        let apart = component.xi - sum.xi;
        sum.xi += apart * share;
        for column in 0..D {
            let across = apart[column] * share * (1.0 - share);
            for row in 0..D {
                let entry = &mut sum.covariance[(row, column)];
                *entry +=
                    (component.covariance[(row, column)] - *entry) * share + apart[row] * across;
            }
        }
    }
    (total > 0.0).then_some(sum)
}

/// The belief with the mean and the covariance of the mixture of `beliefs`; `None` if no weight is positive.
///
/// ```
/// use inekf::filter::{Belief, Covariance, Left};
/// use inekf::filter::adaptive::mixture::merged;
/// use inekf::lie::SO2;
/// use nalgebra::Vector1;
///
/// let variance = Covariance::from_variances(&Vector1::new(0.01));
/// let at = |angle_rad| Belief::<SO2, Left, 1>::new(SO2::from_angle(angle_rad), variance);
/// // Two headings on either side of the half turn: between them is the half turn, not zero.
/// let whole = merged(&[0.5, 0.5], &[at(3.1), at(-3.1)]).expect("positive weights");
/// let apart = core::f64::consts::PI - 3.1;
/// assert!((whole.mean.angle_rad().abs() - core::f64::consts::PI).abs() < 1e-12);
/// // The variance is that of each and that of their means.
/// assert!((whole.covariance.matrix()[(0, 0)] - (0.01 + apart * apart)).abs() < 1e-12);
/// ```
pub fn merged<G, const D: usize, const S: usize>(
    weights: &[f64; S],
    beliefs: &[Belief<G, Left, D>; S],
) -> Option<Belief<G, Left, D>>
where
    G: LieGroup<D>,
{
    let chart = Chart::at_heaviest(weights, beliefs);
    let locals = beliefs.each_ref().map(|belief| chart.enter(belief));
    moments(weights.iter().copied().zip(&locals)).map(|local| chart.leave(&local))
}
