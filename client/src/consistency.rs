//! Whether errors are as large as their covariance says: the normalised estimation error squared (NEES) over a run.
//!
//! The error is left-invariant, `chi = chi_hat exp(xi)`, in body axes, as the covariance is. With
//! `R_hat^T R = Exp(phi)` and J the left Jacobian of SO(3):
//! `xi = (phi, J(phi)^-1 R_hat^T (v - v_hat), J(phi)^-1 R_hat^T (p - p_hat))`. `xi^T P^-1 xi` is chi-square with as many
//! degrees of freedom as `xi` has entries: 9 for navigation (the biases, which a recording's truth does not know, are
//! left out, and their rows of the covariance with them), 6 for a pose, 3 in the plane.

use nalgebra::{Matrix2, Vector2};

use crate::evaluate::{Pose, Trajectory, estimate_pose, nees, wrap_angle};
use crate::simulate::left_jacobian_inverse;
use crate::table::estimate::triangle_len;
use crate::table::{EstimateRow, EstimateState, Layout};

/// The NEES at one stamp.
///
/// ```
/// use inekf_client::consistency::{NeesSample, band_95, degrees};
/// use inekf_client::table::Layout;
///
/// // A run whose pose errors are as large as its covariance says has most of these in the band.
/// let sample = NeesSample { stamp_ns: 1_000_000, nees: 5.3 };
/// let (low, high) = band_95(degrees(Layout::Pose));
/// assert!(low < sample.nees && sample.nees < high);
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NeesSample {
    /// Stamp, ns.
    pub stamp_ns: u64,
    /// The value.
    pub nees: f64,
}

/// Degrees of freedom of the NEES of a model.
///
/// ```
/// use inekf_client::consistency::degrees;
/// use inekf_client::table::Layout;
///
/// // Biases are left out: a recording's truth does not know them.
/// assert_eq!(degrees(Layout::Navigation), 9);
/// assert_eq!(degrees(Layout::Plane), 3);
/// ```
#[must_use]
pub fn degrees(layout: Layout) -> usize {
    match layout {
        Layout::Navigation => 9,
        Layout::Pose => 6,
        Layout::Plane => 3,
    }
}

/// The error of an estimate against the truth of the same time, in the order of its covariance, without biases. A
/// velocity that the truth does not know is taken to be right.
///
/// ```
/// use inekf_client::consistency::invariant_error;
/// use inekf_client::evaluate::{Pose, estimate_pose};
/// use inekf_client::table::{EstimateRow, EstimateState};
///
/// // A vehicle that faces north (y) and is a metre further on than estimated: a metre along its own x.
/// let north = EstimateState::Plane { theta_rad: 90_f64.to_radians(), p_w_m: [0.0, 4.0] };
/// let row = EstimateRow { stamp_ns: 0, state: north, covariance: vec![] };
/// let mut truth: Pose = estimate_pose(0, &north);
/// truth.p_w_m.y += 1.0;
/// let xi = invariant_error(&row, &truth);
/// assert!((xi[1] - 1.0).abs() < 1e-12 && xi[0].abs() < 1e-12 && xi[2].abs() < 1e-12);
/// ```
#[must_use]
pub fn invariant_error(row: &EstimateRow, truth: &Pose) -> Vec<f64> {
    let estimate = estimate_pose(row.stamp_ns, &row.state);
    let to_body = estimate.q_wb.inverse();
    if let EstimateState::Plane { .. } = row.state {
        let turn = wrap_angle(truth.heading_rad() - estimate.heading_rad());
        let apart = to_body * (truth.p_w_m - estimate.p_w_m);
        let carried = planar_jacobian_inverse(turn) * Vector2::new(apart.x, apart.y);
        return vec![turn, carried.x, carried.y];
    }
    let turn = (to_body * truth.q_wb).scaled_axis();
    let carried = left_jacobian_inverse(&turn);
    let mut error: Vec<f64> = turn.iter().copied().collect();
    if let EstimateState::Navigation { v_w_mps, .. } = row.state {
        let v_w_mps = v_w_mps.into();
        let apart = truth.v_w_mps.unwrap_or(v_w_mps) - v_w_mps;
        error.extend((carried * (to_body * apart)).iter());
    }
    let apart = truth.p_w_m - estimate.p_w_m;
    error.extend((carried * (to_body * apart)).iter());
    error
}

/// The inverse of the left Jacobian of SE(2)'s translation: `[a b; -b a]`, `a = (t/2) cot(t/2)`, `b = t/2`.
fn planar_jacobian_inverse(turn_rad: f64) -> Matrix2<f64> {
    let half = 0.5 * turn_rad;
    let a = if half.abs() < 1e-4 {
        1.0 - half * half / 3.0
    } else {
        half / half.tan()
    };
    Matrix2::new(a, half, -half, a)
}

/// The NEES of every row with a covariance at whose stamp the truth is known; `max_gap_ns` as in
/// [`errors`](crate::evaluate::errors).
///
/// ```
/// use inekf_client::consistency::nees_series;
/// use inekf_client::evaluate::{DEFAULT_MAX_GAP_NS, Trajectory, estimate_pose};
/// use inekf_client::table::{EstimateRow, EstimateState};
///
/// // Two standard deviations (of 0.5 m) too far west: 2^2.
/// let state = |x_m: f64| EstimateState::Plane { theta_rad: 0.0, p_w_m: [x_m, 0.0] };
/// let row = EstimateRow {
///     stamp_ns: 7,
///     state: state(-1.0),
///     covariance: vec![1.0, 0.0, 0.0, 0.25, 0.0, 1.0],
/// };
/// let truth = Trajectory::new_planar(vec![estimate_pose(7, &state(0.0))]);
/// let series = nees_series(&[row], &truth, DEFAULT_MAX_GAP_NS);
/// assert!((series[0].nees - 4.0).abs() < 1e-12);
/// ```
#[must_use]
pub fn nees_series(rows: &[EstimateRow], truth: &Trajectory, max_gap_ns: u64) -> Vec<NeesSample> {
    let sample = |row: &EstimateRow| {
        let error = invariant_error(row, &truth.at(row.stamp_ns, max_gap_ns)?);
        let covariance = leading(&row.covariance, error.len())?;
        Some(NeesSample {
            stamp_ns: row.stamp_ns,
            nees: nees(&error, &covariance)?,
        })
    };
    rows.iter().filter_map(sample).collect()
}

/// The upper triangle of the leading `dimension` rows and columns.
fn leading(triangle: &[f64], dimension: usize) -> Option<Vec<f64>> {
    let whole = (1..=15).find(|whole| triangle_len(*whole) == triangle.len())?;
    if whole < dimension {
        return None;
    }
    let mut kept = Vec::with_capacity(triangle_len(dimension));
    let mut start = 0;
    for row in 0..dimension {
        kept.extend_from_slice(triangle.get(start..start + dimension - row)?);
        start += whole - row;
    }
    Some(kept)
}

/// The band that holds 95 % of chi-square values: 2.5 % lie below it, 2.5 % above.
///
/// ```
/// use inekf_client::consistency::band_95;
///
/// let (low, high) = band_95(3);
/// assert!((low - 0.216).abs() < 1e-3 && (high - 9.348).abs() < 1e-3);
/// ```
#[must_use]
pub fn band_95(degrees: usize) -> (f64, f64) {
    (
        chi_square_quantile(degrees, 0.025),
        chi_square_quantile(degrees, 0.975),
    )
}

/// The value below which a chi-square number with `degrees` of freedom, 1 or more, lies with `probability`: by
/// bisection, to 1e-9 of its value.
///
/// ```
/// use inekf_client::consistency::chi_square_quantile;
///
/// // With two degrees of freedom it is -2 ln(1 - p).
/// assert!((chi_square_quantile(2, 0.95) + 2.0 * 0.05_f64.ln()).abs() < 1e-9);
/// ```
#[must_use]
pub fn chi_square_quantile(degrees: usize, probability: f64) -> f64 {
    let (mut low, mut high) = (0.0, degrees.max(1) as f64);
    while chi_square_below(degrees, high) < probability && high < 1e9 {
        high *= 2.0;
    }
    for _ in 0..100 {
        let middle = 0.5 * (low + high);
        if chi_square_below(degrees, middle) < probability {
            low = middle;
        } else {
            high = middle;
        }
    }
    0.5 * (low + high)
}

/// The probability that a chi-square number lies below `value`: the incomplete gamma function `P(degrees / 2, value / 2)`
/// as the series `x^a e^-x / Gamma(a + 1) (1 + x / (a + 1) + x^2 / ((a + 1)(a + 2)) + ..)`.
fn chi_square_below(degrees: usize, value: f64) -> f64 {
    let (a, x) = (0.5 * degrees.max(1) as f64, 0.5 * value);
    if x <= 0.0 {
        return 0.0;
    }
    let (mut term, mut sum, mut n) = (1.0, 1.0, a);
    while term > 1e-17 * sum {
        n += 1.0;
        term *= x / n;
        sum += term;
    }
    (a * x.ln() - x - ln_gamma_of_half(degrees.max(1) + 2) + sum.ln()).exp()
}

/// `ln Gamma(twice / 2)`, from `Gamma(1/2) = sqrt(pi)` or `Gamma(1) = 1` by `Gamma(a + 1) = a Gamma(a)`.
fn ln_gamma_of_half(twice: usize) -> f64 {
    let odd = twice % 2 == 1;
    let start = if odd {
        0.5 * std::f64::consts::PI.ln()
    } else {
        0.0
    };
    let first = if odd { 1 } else { 2 };
    (first..twice)
        .step_by(2)
        .map(|twice| (0.5 * twice as f64).ln())
        .fold(start, |sum, factor| sum + factor)
}
