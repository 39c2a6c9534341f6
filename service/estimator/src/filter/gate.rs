//! The chi-square gate: how large a normalised innovation squared may be.
//!
//! The survival function of chi-square with k degrees of freedom has a closed form for every
//! integer k: `Q_1(x) = erfc(sqrt(x/2))`, `Q_2(x) = exp(-x/2)`, and
//! `Q_{k+2}(x) = Q_k(x) + (x/2)^{k/2} exp(-x/2) / Gamma(k/2 + 1)`.

/// Most degrees of freedom that an innovation has.
pub const MAX_DEGREES: usize = 16;

/// Largest normalised innovation squared that is let in, for each number of degrees of freedom.
///
/// The degrees are those that the filter finds: hard constraints take theirs from the innovation, and what is
/// left must be judged by its own number. An innovation of which nothing is left is let in.
///
/// ```
/// use inekf::filter::Gate;
///
/// // One good fix of three dimensions in a thousand is refused.
/// let gate = Gate::of_probability(0.999);
/// assert!(gate.admits(16.0, 3) && !gate.admits(16.5, 3));
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Gate {
    /// By degrees of freedom.
    limits: [f64; MAX_DEGREES + 1],
}

impl Gate {
    /// Lets everything in.
    pub const OPEN: Self = Self::at(f64::INFINITY);

    /// Lets in what is at most `limit`, whatever the degrees.
    ///
    /// ```
    /// use inekf::filter::Gate;
    ///
    /// let gate = Gate::at(9.0);
    /// assert!(gate.admits(8.9, 1) && !gate.admits(9.1, 3));
    /// assert!(Gate::OPEN.admits(1e300, 3));
    /// ```
    pub const fn at(limit: f64) -> Self {
        let mut limits = [limit; MAX_DEGREES + 1];
        limits[0] = f64::INFINITY;
        Self { limits }
    }

    /// Lets in what a consistent filter sees with `probability`; 1 or more lets everything in.
    ///
    /// ```
    /// use inekf::filter::Gate;
    ///
    /// // More degrees of freedom may be further off together.
    /// let gate = Gate::of_probability(0.95);
    /// assert!(!gate.admits(5.0, 1) && gate.admits(5.0, 3));
    /// ```
    pub fn of_probability(probability: f64) -> Self {
        let mut gate = Self::OPEN;
        for (degrees, limit) in gate.limits.iter_mut().enumerate().skip(1) {
            *limit = chi_square_quantile(degrees, probability);
        }
        gate
    }

    /// Whether an innovation with this normalised square is let in.
    ///
    /// ```
    /// use inekf::filter::Gate;
    ///
    /// // An innovation of which hard constraints leave nothing is let in; one that is not a number never is.
    /// let gate = Gate::of_probability(0.95);
    /// assert!(gate.admits(0.0, 0) && !gate.admits(f64::NAN, 3));
    /// ```
    pub fn admits(&self, nis: f64, degrees: usize) -> bool {
        self.limits.get(degrees).is_none_or(|limit| nis <= *limit)
    }
}

/// Probability that a chi-square variable with `degrees >= 1` degrees of freedom exceeds `x`.
///
/// ```
/// use inekf::filter::gate::chi_square_survival;
///
/// // With two degrees of freedom it is exp(-x / 2).
/// assert!((chi_square_survival(2, 3.0) - (-1.5_f64).exp()).abs() < 1e-12);
/// ```
pub fn chi_square_survival(degrees: usize, x: f64) -> f64 {
    if x <= 0.0 {
        return 1.0;
    }
    if !x.is_finite() {
        return if x.is_nan() { x } else { 0.0 };
    }
    let half = 0.5 * x;
    // The term (x/2)^{k/2} exp(-x/2) / Gamma(k/2 + 1) for the current k, as a logarithm: with many
    // degrees the first terms are below the smallest number and the sum is not.
    let (mut k, mut survival, mut log_term) = if degrees % 2 == 1 {
        let log_term = 0.5 * half.ln() - half + core::f64::consts::FRAC_2_SQRT_PI.ln();
        (1_usize, libm::erfc(half.sqrt()), log_term)
    } else {
        (2, (-half).exp(), half.ln() - half)
    };
    while k < degrees {
        survival += log_term.exp();
        k += 2;
        log_term += (half / (0.5 * k as f64)).ln();
    }
    survival.min(1.0)
}

/// The value that a chi-square variable with `degrees >= 1` degrees of freedom stays below with
/// `probability`; infinity for a probability of 1 or more, 0 for 0 or less.
///
/// ```
/// use inekf::filter::gate::{chi_square_quantile, chi_square_survival};
///
/// let limit = chi_square_quantile(3, 0.999);
/// assert!((limit - 16.266).abs() < 1e-3);
/// assert!((chi_square_survival(3, limit) - 0.001).abs() < 1e-9);
/// ```
pub fn chi_square_quantile(degrees: usize, probability: f64) -> f64 {
    if probability.is_nan() || probability >= 1.0 {
        return f64::INFINITY;
    }
    if probability <= 0.0 {
        return 0.0;
    }
    let tail = 1.0 - probability;
    let mut low = 0.0;
    let mut high = degrees as f64 + 10.0;
    while chi_square_survival(degrees, high) > tail {
        high *= 2.0;
    }
    // Bisection to the last bit: this runs when a configuration is read, never on the hot path.
    for _ in 0..200 {
        let middle = 0.5 * (low + high);
        if middle <= low || middle >= high {
            break;
        }
        if chi_square_survival(degrees, middle) > tail {
            low = middle;
        } else {
            high = middle;
        }
    }
    0.5 * (low + high)
}
