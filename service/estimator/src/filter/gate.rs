//! The chi-square gate: how large a normalised innovation squared may be.
//!
//! The survival function of chi-square with k degrees of freedom has a closed form for every
//! integer k: `Q_1(x) = erfc(sqrt(x/2))`, `Q_2(x) = exp(-x/2)`, and
//! `Q_{k+2}(x) = Q_k(x) + (x/2)^{k/2} exp(-x/2) / Gamma(k/2 + 1)`.

/// Probability that a chi-square variable with `degrees >= 1` degrees of freedom exceeds `x`.
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
