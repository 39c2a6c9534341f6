//! The entire functions `S_k` and the navigation integrals `Gamma_m` against their Taylor series in
//! double-double arithmetic (106 bits), and their derivatives against differences.

use inekf::lie::series::{
    RotationSeries, cos_sinc, entire, gamma, gamma_times_derivative, inverse_jacobian_coefficient,
};
use inekf::lie::{LieGroup, SO3};
use nalgebra::{Matrix3, Vector3};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::StandardNormal;

/// An unevaluated sum of two doubles (Dekker 1971).
#[derive(Clone, Copy)]
struct Wide(f64, f64);

impl Wide {
    fn sum(a: f64, b: f64) -> Self {
        let s = a + b;
        let b_kept = s - a;
        Self(s, (a - (s - b_kept)) + (b - b_kept))
    }

    fn plus(self, other: Self) -> Self {
        let Self(high, low) = Self::sum(self.0, other.0);
        Self::sum(high, low + self.1 + other.1)
    }

    fn times(self, b: f64) -> Self {
        let high = self.0 * b;
        let low = self.0.mul_add(b, -high) + self.1 * b;
        Self::sum(high, low)
    }

    fn over(self, b: f64) -> Self {
        let high = self.0 / b;
        let low = ((-high).mul_add(b, self.0) + self.1) / b;
        Self::sum(high, low)
    }
}

/// `S_k(t)` by its definition. The terms reach `e^theta`, of which double-double keeps 32 digits.
fn taylor(k: usize, t: f64) -> f64 {
    let mut term = Wide(1.0, 0.0);
    for i in 1..=k {
        term = term.over(i as f64);
    }
    let mut sum = Wide(0.0, 0.0);
    for n in 0..120 {
        sum = sum.plus(term);
        let next = 2 * n + k + 1;
        term = term.times(-t).over((next * (next + 1)) as f64);
    }
    sum.0 + sum.1
}

/// From 0 and underflow, through both switches (0.0625 and 10), to angles of 20 rad.
fn arguments() -> Vec<f64> {
    let mut arguments = vec![
        0.0,
        f64::MIN_POSITIVE,
        0.0625_f64.next_down(),
        0.0625,
        0.0625_f64.next_up(),
        10.0_f64.next_down(),
        10.0,
        10.0_f64.next_up(),
    ];
    arguments.extend((-60..=0).map(|i| 10f64.powf(0.25 * f64::from(i))));
    arguments.extend((1..=1600).map(|i| 0.25 * f64::from(i)));
    arguments
}

#[test]
fn the_functions_match_their_taylor_series_through_the_switches() {
    for t in arguments() {
        let s = entire(t);
        for (k, actual) in s.into_iter().enumerate() {
            let expected = taylor(k, t);
            // S_0 and S_1 oscillate with amplitudes 1 and 1/theta and S_2 touches zero, where only their
            // size counts, which for k >= 2 is about 1 / ((k - 2)! t), and 1/k! at 0. The rounding of theta
            // itself moves the argument of the sine by theta / 2 units in the last place.
            let theta = t.sqrt().max(1.0);
            let size = match k {
                0 => 1.0,
                1 => 1.0 / theta,
                _ => expected
                    .abs()
                    .max(taylor(k - 2, 0.0) / (t + (k * k) as f64)),
            };
            let tolerance = 4.0 * f64::EPSILON * size * theta;
            let error = (actual - expected).abs();
            assert!(
                error <= tolerance,
                "S_{k}({t:e}) = {actual:e}, not {expected:e}"
            );
        }
    }
}

#[test]
fn below_three_radians_every_function_but_the_oscillating_ones_is_relatively_exact() {
    for t in arguments().into_iter().filter(|t| *t < 9.0) {
        for (k, actual) in entire(t).into_iter().enumerate().skip(2) {
            let expected = taylor(k, t);
            let error = (actual / expected - 1.0).abs();
            assert!(error < 1.2e-15, "S_{k}({t:e}): relative error {error:e}");
        }
    }
}

#[test]
fn cos_and_sinc_agree_with_the_taylor_series() {
    for t in arguments() {
        let (cos, sinc) = cos_sinc(t);
        let tolerance = 2.0 * f64::EPSILON * t.sqrt().max(1.0);
        assert!((cos - taylor(0, t)).abs() <= tolerance, "cos at {t:e}");
        assert!((sinc - taylor(1, t)).abs() <= tolerance, "sinc at {t:e}");
    }
}

#[test]
fn the_inverse_jacobian_coefficient_has_its_known_values() {
    // c(0) = 1/12; the series is 1/12 + t/720 + t^2/30240 + ...
    assert!((inverse_jacobian_coefficient(0.0) - 1.0 / 12.0).abs() < 1e-16);
    let t = 1e-4;
    let expected = 1.0 / 12.0 + t / 720.0 + t * t / 30240.0;
    assert!((inverse_jacobian_coefficient(t) - expected).abs() < 1e-16);
    // cot(pi/2) = 0, so that c(pi^2) = 1/pi^2; cot(pi/4) = 1.
    let pi = std::f64::consts::PI;
    assert!((inverse_jacobian_coefficient(pi * pi) - 1.0 / (pi * pi)).abs() < 1e-16);
    let quarter = 0.25 * pi * pi;
    let expected = (1.0 - 0.25 * pi) / quarter;
    assert!((inverse_jacobian_coefficient(quarter) - expected).abs() < 1e-16);
}

#[test]
fn what_is_not_finite_stays_so() {
    for t in [f64::NAN, f64::INFINITY] {
        assert!(entire(t).iter().any(|s| !s.is_finite()), "{t}");
        assert!(!cos_sinc(t).0.is_finite(), "{t}");
    }
}

/// Rotation vectors of every size up to 6 rad, and zero.
fn rotation_vectors() -> Vec<Vector3<f64>> {
    let mut rng = ChaCha8Rng::seed_from_u64(11);
    let mut vectors = vec![Vector3::zeros()];
    for i in 0..400 {
        let direction = Vector3::from_fn(|_, _| rng.sample(StandardNormal)).normalize();
        let angle = if i % 2 == 0 {
            rng.random_range(0.0..6.0)
        } else {
            10f64.powf(rng.random_range(-9.0..0.0))
        };
        vectors.push(angle * direction);
    }
    vectors
}

/// A fixed vector of specific force, about as long as gravity.
const FORCE: Vector3<f64> = Vector3::new(0.7, -3.1, 9.2);

fn gammas(series: &RotationSeries) -> [Matrix3<f64>; 3] {
    [
        series.gamma::<0>(),
        series.gamma::<1>(),
        series.gamma::<2>(),
    ]
}

/// `sum_n hat(phi)^n / (n + m)!`, 50 terms.
fn integral_by_series(m: usize, phi: &Vector3<f64>) -> Matrix3<f64> {
    let hat = Matrix3::new(0.0, -phi.z, phi.y, phi.z, 0.0, -phi.x, -phi.y, phi.x, 0.0);
    let mut term = Matrix3::identity() * taylor(m, 0.0);
    let mut sum = term;
    for n in 1..50 {
        term = term * hat / (n + m) as f64;
        sum += term;
    }
    sum
}

#[test]
fn the_integrals_match_their_exact_series() {
    for phi in rotation_vectors() {
        let series = RotationSeries::at(&phi);
        let times = [
            series.gamma_times::<0>(&FORCE),
            series.gamma_times::<1>(&FORCE),
            series.gamma_times::<2>(&FORCE),
        ];
        // The terms of the oracle grow to e^theta and cancel.
        let tolerance = 1e-15 * phi.norm().exp().max(2.0);
        for (m, gamma) in gammas(&series).into_iter().enumerate() {
            let error = (gamma - integral_by_series(m, &phi)).amax();
            assert!(error <= tolerance, "Gamma_{m} at {phi}: {error:e}");
            let error = (times[m] - gamma * FORCE).amax();
            assert!(error <= 1e-14, "Gamma_{m} a at {phi}: {error:e}");
        }
        assert!(
            (SO3::exp(&phi).matrix() - gamma::<0>(&phi)).amax() <= 2e-15,
            "{phi}"
        );
        assert_eq!(SO3::left_jacobian(&phi), gamma::<1>(&phi));
    }
}

/// Fourth-order central difference of a function of one number, at 0.
fn difference<T>(f: impl Fn(f64) -> T) -> T
where
    T: std::ops::Sub<Output = T> + std::ops::Mul<f64, Output = T>,
{
    const STEP: f64 = 2e-3;
    ((f(STEP) - f(-STEP)) * 8.0 - (f(2.0 * STEP) - f(-2.0 * STEP))) * (1.0 / (12.0 * STEP))
}

/// The remainder is `h^4 / 30` times a fifth derivative of order `|a| = 10`, 5e-12.
const DIFFERENCE_TOLERANCE: f64 = 1e-11;

#[test]
fn the_derivative_of_an_integral_times_a_vector_matches_differences() {
    for phi in rotation_vectors() {
        let series = RotationSeries::at(&phi);
        let derivatives = [
            series.gamma_times_derivative::<0>(&FORCE),
            gamma_times_derivative::<1>(&phi, &FORCE),
            gamma_times_derivative::<2>(&phi, &FORCE),
        ];
        for (m, derivative) in derivatives.into_iter().enumerate() {
            for j in 0..3 {
                let expected = difference(|h| {
                    let mut moved = phi;
                    moved[j] += h;
                    gammas(&RotationSeries::at(&moved))[m] * FORCE
                });
                let error = (derivative.column(j) - expected).amax();
                assert!(
                    error <= DIFFERENCE_TOLERANCE,
                    "m = {m}, j = {j}, {phi}: {error:e}"
                );
            }
        }
    }
}

#[test]
fn the_derivative_of_an_integral_along_a_vector_matches_differences_and_barfoot() {
    let hat = inekf::lie::hat;
    for phi in rotation_vectors() {
        let series = RotationSeries::at(&phi);
        let along = [
            series.gamma_along::<0>(&FORCE),
            series.gamma_along::<1>(&FORCE),
            series.gamma_along::<2>(&FORCE),
        ];
        for (m, along) in along.into_iter().enumerate() {
            // Along the unit vector, so that the step is one of 2e-3 rad.
            let size = FORCE.norm();
            let direction = FORCE / size;
            let expected =
                difference(|h| gammas(&RotationSeries::at(&(phi + h * direction)))[m]) * size;
            let error = (along - expected).amax();
            assert!(error <= DIFFERENCE_TOLERANCE, "m = {m}, {phi}: {error:e}");
        }

        // Q(phi, rho) as published, quartic products and all.
        let (p, r) = (hat(&phi), hat(&FORCE));
        let s = |k| taylor(k, phi.norm_squared());
        let q = r * 0.5
            + (p * r + r * p + p * r * p) * s(3)
            + (p * p * r + r * p * p - p * r * p * 3.0) * s(4)
            + (p * r * p * p + p * p * r * p) * (0.5 * (s(4) - 3.0 * s(5)));
        assert!((along[1] - q).amax() <= 5e-14, "Q at {phi}");
    }
}
