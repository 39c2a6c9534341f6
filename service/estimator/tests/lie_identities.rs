//! The contract of `LieGroup`, run for every group: each operation is an identity, and each identity is a
//! test, at the scales a filter meets. Oracles: the homogeneous matrices of `lie_support`, the matrix
//! exponential, exact series in `ad`, numerical differentiation.
//!
//! Tolerances are relative to the largest entry, with lengths measured in a unit that makes them about 1.
//! `ROUNDING` is 45 units in the last place; the largest errors, 20 to 30, are the oracles'.

mod lie_support;

use inekf::lie::{SE2, SE3, SE23, SO2, SO3, TwoFrames};
use inekf::model::NavState;
use lie_support::{Homogeneous, exponential_series, matrix_exponential};
use nalgebra::{DMatrix, SMatrix, SVector};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::StandardNormal;
use std::f64::consts::PI;

const ROUNDING: f64 = 1e-14;
const SAMPLES: usize = 300;

/// Where tangent vectors are drawn.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Regime {
    /// Rotations of a uniform angle up to pi, the rest uniform in [-10, 10].
    Everywhere,
    /// Standard normal: rotations beyond pi occur.
    Normal,
    /// 1e-7 times standard normal.
    Tiny,
    /// Angles that `t = theta^2` cannot represent.
    Vanishing,
    /// Angles of pi less 1e-3 to 1e-9.
    NearPi,
    /// As everywhere, with lengths up to 1e6.
    Far,
}

const REGIMES: [Regime; 6] = [
    Regime::Everywhere,
    Regime::Normal,
    Regime::Tiny,
    Regime::Vanishing,
    Regime::NearPi,
    Regime::Far,
];

fn normal<const N: usize>(rng: &mut ChaCha8Rng) -> SVector<f64, N> {
    SVector::from_fn(|_, _| rng.sample(StandardNormal))
}

impl Regime {
    fn draw<G: Homogeneous<D>, const D: usize>(self, rng: &mut ChaCha8Rng) -> SVector<f64, D> {
        match self {
            Self::Normal => normal(rng),
            Self::Tiny => 1e-7 * normal(rng),
            Self::Vanishing => 1e-300 * normal(rng),
            Self::Everywhere => {
                let angle = rng.random_range(0.0..PI);
                self.turned::<G, D>(angle, 10.0, rng)
            }
            Self::NearPi => {
                let angle = PI - 10f64.powf(-rng.random_range(3.0..9.0));
                self.turned::<G, D>(angle, 10.0, rng)
            }
            Self::Far => {
                let angle = rng.random_range(0.0..PI);
                self.turned::<G, D>(angle, 1e6, rng)
            }
        }
    }

    /// A rotation of exactly this angle in a random direction, the rest in a box of this half-width.
    fn turned<G: Homogeneous<D>, const D: usize>(
        self,
        angle: f64,
        half_width: f64,
        rng: &mut ChaCha8Rng,
    ) -> SVector<f64, D> {
        let mut xi = half_width * SVector::from_fn(|_, _| rng.random_range(-1.0..1.0));
        let direction: SVector<f64, 3> = normal(rng);
        let norm = direction.rows(0, G::ROTATION).norm();
        for i in 0..G::ROTATION {
            xi[i] = angle * direction[i] / norm;
        }
        xi
    }
}

/// The largest entry of the part of a tangent vector that is a length, at least 1.
fn length<G: Homogeneous<D>, const D: usize>(xi: &SVector<f64, D>) -> f64 {
    xi.iter()
        .skip(G::ROTATION)
        .fold(1.0, |largest, entry| entry.abs().max(largest))
}

/// A matrix that acts on tangent vectors, in lengths of this unit.
fn in_unit<G: Homogeneous<D>, const D: usize>(
    matrix: &SMatrix<f64, D, D>,
    unit: f64,
) -> DMatrix<f64> {
    let scale = |i| if i < G::ROTATION { 1.0 } else { unit };
    DMatrix::from_fn(D, D, |i, j| matrix[(i, j)] * scale(j) / scale(i))
}

/// Fails unless the difference is at most `tolerance` times the largest entry of `expected`.
fn assert_close(what: &str, actual: &DMatrix<f64>, expected: &DMatrix<f64>, tolerance: f64) {
    let difference = actual - expected;
    // A comparison that NaN fails.
    let close = difference
        .iter()
        .all(|d| d.abs() <= tolerance * expected.amax());
    assert!(
        close,
        "{what}: off by {:e} of {:e}\n{actual:.17}expected\n{expected:.17}",
        difference.amax(),
        expected.amax(),
    );
}

/// Fails unless rotation and lengths each agree to `tolerance` times their own largest entry.
fn assert_tangents_close<G: Homogeneous<D>, const D: usize>(
    what: &str,
    actual: &SVector<f64, D>,
    expected: &SVector<f64, D>,
    tolerance: f64,
) {
    for (start, count) in [(0, G::ROTATION), (G::ROTATION, D - G::ROTATION)] {
        let part = |xi: &SVector<f64, D>| {
            DMatrix::from_column_slice(count, 1, &xi.as_slice()[start..start + count])
        };
        assert_close(what, &part(actual), &part(expected), tolerance);
    }
}

/// The samples of every regime, with the place of each for messages.
fn for_every_sample<G: Homogeneous<D>, const D: usize>(
    mut check: impl FnMut(&str, Regime, &mut ChaCha8Rng),
) {
    for (seed, regime) in REGIMES.into_iter().enumerate() {
        let mut rng = ChaCha8Rng::seed_from_u64(seed as u64);
        for sample in 0..SAMPLES {
            let place = format!("{} {regime:?} sample {sample}", G::NAME);
            check(&place, regime, &mut rng);
        }
    }
}

/// exp and log are inverse to each other, both ways, and exp is the matrix exponential.
fn exponential_and_logarithm<G: Homogeneous<D>, const D: usize>() {
    for_every_sample::<G, D>(|place, regime, rng| {
        let xi = regime.draw::<G, D>(rng);
        let x = G::exp(&xi);
        let unit = length::<G, D>(&xi);

        let expected = matrix_exponential(&G::algebra(&xi, unit));
        assert_close(
            &format!("{place}: expm"),
            &x.matrix(unit),
            &expected,
            ROUNDING,
        );

        let log = x.log();
        let angle = log.rows(0, G::ROTATION).norm();
        assert!(angle <= PI + 1e-15, "{place}: angle {angle}");
        let again = G::exp(&log).matrix(unit);
        assert_close(
            &format!("{place}: exp log"),
            &again,
            &x.matrix(unit),
            ROUNDING,
        );

        if xi.rows(0, G::ROTATION).norm() < PI {
            assert_tangents_close::<G, D>(&format!("{place}: log exp"), &log, &xi, ROUNDING);
        }
    });
}

/// Products are products of matrices; identity, inverse, associativity.
fn group_axioms<G: Homogeneous<D>, const D: usize>() {
    for_every_sample::<G, D>(|place, regime, rng| {
        let [xi, eta, zeta] = [(); 3].map(|()| regime.draw::<G, D>(rng));
        let [x, y, z] = [xi, eta, zeta].map(|tangent| G::exp(&tangent));
        let unit = length::<G, D>(&xi)
            .max(length::<G, D>(&eta))
            .max(length::<G, D>(&zeta));
        let close = |what: &str, actual: G, expected: &DMatrix<f64>| {
            assert_close(
                &format!("{place}: {what}"),
                &actual.matrix(unit),
                expected,
                ROUNDING,
            );
        };

        let one = G::identity();
        let identity = one.matrix(unit);
        assert_eq!(
            identity,
            DMatrix::identity(identity.nrows(), identity.ncols())
        );
        close("X Y", x.compose(&y), &(x.matrix(unit) * y.matrix(unit)));
        close("X 1", x.compose(&one), &x.matrix(unit));
        close("1 X", one.compose(&x), &x.matrix(unit));
        close("X X^-1", x.compose(&x.inverse()), &identity);
        close("X^-1 X", x.inverse().compose(&x), &identity);
        close(
            "(X Y) Z",
            x.compose(&y).compose(&z),
            &x.compose(&y.compose(&z)).matrix(unit),
        );
        close("normalized", x.normalized(), &x.matrix(unit));
        assert!(x.is_finite(), "{place}");
    });
}

/// The adjoint by its definition, as a homomorphism, and as the exponential of `ad`.
fn adjoint<G: Homogeneous<D>, const D: usize>() {
    for_every_sample::<G, D>(|place, regime, rng| {
        let [xi, eta] = [(); 2].map(|()| regime.draw::<G, D>(rng));
        let [x, y] = [xi, eta].map(|tangent| G::exp(&tangent));
        // The adjoint multiplies a length by an angle: at most 2 sqrt(3) pi times the largest one.
        let unit = 12.0 * length::<G, D>(&xi).max(length::<G, D>(&eta));
        let ad_x = x.adjoint();

        let conjugated = x.compose(&y).compose(&x.inverse());
        let moved = G::exp(&(ad_x * eta));
        let what = format!("{place}: X exp(eta) X^-1 = exp(Ad eta)");
        assert_close(
            &what,
            &conjugated.matrix(unit),
            &moved.matrix(unit),
            ROUNDING,
        );

        let conjugated = x.matrix(unit) * G::algebra(&eta, unit) * x.inverse().matrix(unit);
        let moved = G::algebra(&(ad_x * eta), unit);
        let what = format!("{place}: X eta^ X^-1 = (Ad eta)^");
        assert_close(&what, &conjugated, &moved, ROUNDING);

        let product = in_unit::<G, D>(&x.compose(&y).adjoint(), unit);
        let expected = in_unit::<G, D>(&ad_x, unit) * in_unit::<G, D>(&y.adjoint(), unit);
        assert_close(
            &format!("{place}: Ad_XY = Ad_X Ad_Y"),
            &product,
            &expected,
            ROUNDING,
        );

        let expected = matrix_exponential(&in_unit::<G, D>(&G::ad(&xi), unit));
        let what = format!("{place}: Ad_exp(xi) = expm(ad_xi)");
        assert_close(&what, &in_unit::<G, D>(&ad_x, unit), &expected, ROUNDING);
    });
}

/// The Jacobians against their series and each other.
fn jacobians<G: Homogeneous<D>, const D: usize>() {
    let identity = DMatrix::identity(D, D);
    for_every_sample::<G, D>(|place, regime, rng| {
        let xi = regime.draw::<G, D>(rng);
        let unit = length::<G, D>(&xi);
        let view = |matrix: &SMatrix<f64, D, D>| in_unit::<G, D>(matrix, unit);
        let (left, right) = (view(&G::left_jacobian(&xi)), view(&G::right_jacobian(&xi)));
        let angle = xi.rows(0, G::ROTATION).norm();

        // The terms of the series grow to e^angle and cancel, which costs digits beyond pi.
        if angle < PI {
            let ad = view(&G::ad(&xi));
            let what = format!("{place}: Jl = sum ad^n / (n + 1)!");
            assert_close(&what, &left, &exponential_series(&ad, 1), ROUNDING);
            let what = format!("{place}: Jr = sum (-ad)^n / (n + 1)!");
            assert_close(&what, &right, &exponential_series(&-ad, 1), ROUNDING);
        }

        let what = format!("{place}: Jl = Ad_exp Jr");
        let carried = view(&G::exp(&xi).adjoint()) * &right;
        assert_close(&what, &carried, &left, ROUNDING);

        // The inverse grows without bound towards 2 pi, and rounding errors in proportion.
        let left_inverse = view(&G::left_jacobian_inverse(&xi));
        let right_inverse = view(&G::right_jacobian_inverse(&xi));
        for (name, jacobian, inverse) in
            [("Jl", &left, &left_inverse), ("Jr", &right, &right_inverse)]
        {
            let tolerance = ROUNDING * inverse.amax().max(1.0);
            for product in [jacobian * inverse, inverse * jacobian] {
                assert_close(
                    &format!("{place}: {name} {name}^-1"),
                    &product,
                    &identity,
                    tolerance,
                );
            }
        }
    });
}

/// The Jacobians against differences of the exponential's homogeneous matrices.
///
/// Fourth-order central differences of step 2e-3: the remainder is `h^4 / 30` times a fifth derivative of
/// order 1, 5e-13, and rounding contributes `1e-16 / h`, 1e-13.
fn jacobians_numerically<G: Homogeneous<D>, const D: usize>() {
    const STEP: f64 = 2e-3;
    const TOLERANCE: f64 = 3e-12;
    for_every_sample::<G, D>(|place, regime, rng| {
        let xi = regime.draw::<G, D>(rng);
        let unit = length::<G, D>(&xi);
        let (left, right) = (G::left_jacobian(&xi), G::right_jacobian(&xi));
        let inverse = G::exp(&xi).inverse().matrix(unit);
        for j in 0..D {
            let step = if j < G::ROTATION { STEP } else { STEP * unit };
            let at = |steps: f64| {
                let mut moved = xi;
                moved[j] += steps * step;
                G::exp(&moved).matrix(unit)
            };
            let derivative = ((at(1.0) - at(-1.0)) * 8.0 - (at(2.0) - at(-2.0))) / (12.0 * STEP);
            let column = |jacobian: &SMatrix<f64, D, D>| {
                G::algebra(&(jacobian.column(j) * (step / STEP)), unit)
            };
            let what = format!("{place}: column {j} of Jl");
            assert_close(&what, &(&derivative * &inverse), &column(&left), TOLERANCE);
            let what = format!("{place}: column {j} of Jr");
            assert_close(&what, &(&inverse * &derivative), &column(&right), TOLERANCE);
        }
    });
}

/// What is not finite stays visible, in whichever entry it came.
fn not_finite<G: Homogeneous<D>, const D: usize>() {
    for j in 0..D {
        for poison in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
            let mut xi = SVector::<f64, D>::repeat(0.1);
            xi[j] = poison;
            let x = G::exp(&xi);
            assert!(!x.is_finite(), "{}: exp of {poison} in entry {j}", G::NAME);
            assert!(
                !x.compose(&G::identity()).is_finite(),
                "{}: entry {j}",
                G::NAME
            );
        }
    }
    assert!(G::identity().is_finite());
    assert!(G::exp(&SVector::zeros()) == G::identity());
}

/// A million products later the rotation is still a rotation, without `normalized`.
fn long_chain<G: Homogeneous<D>, const D: usize>() {
    let mut rng = ChaCha8Rng::seed_from_u64(7);
    let mut xi = Regime::Everywhere.draw::<G, D>(&mut rng);
    xi *= 1e-3;
    let step = G::exp(&xi);
    let mut x = G::identity();
    for _ in 0..1_000_000 {
        x = x.compose(&step);
    }
    let ad = x.adjoint();
    let r = DMatrix::from_fn(D - G::ROTATION, D - G::ROTATION, |i, j| {
        ad[(G::ROTATION + i, G::ROTATION + j)]
    });
    let matrix = if D == G::ROTATION { x.matrix(1.0) } else { r };
    let gram = matrix.transpose() * &matrix;
    let identity = DMatrix::identity(gram.nrows(), gram.ncols());
    assert_close(&format!("{}: chain", G::NAME), &gram, &identity, 2e-15);
}

macro_rules! suite {
    ($($module:ident: $group:ty;)*) => {$(
        mod $module {
            use super::*;

            #[test]
            fn exp_and_log_are_inverse_and_exp_is_the_matrix_exponential() {
                exponential_and_logarithm::<$group, _>();
            }

            #[test]
            fn the_group_axioms_hold() {
                group_axioms::<$group, _>();
            }

            #[test]
            fn the_adjoint_moves_tangent_vectors() {
                adjoint::<$group, _>();
            }

            #[test]
            fn jacobians_match_their_series_and_invert() {
                jacobians::<$group, _>();
            }

            #[test]
            fn jacobians_match_numerical_differentiation() {
                jacobians_numerically::<$group, _>();
            }

            #[test]
            fn what_is_not_finite_is_reported() {
                not_finite::<$group, _>();
            }

            #[test]
            fn a_million_products_stay_on_the_group() {
                long_chain::<$group, _>();
            }
        }
    )*};
}

suite! {
    so2: SO2;
    so3: SO3;
    se2: SE2;
    se3: SE3;
    se23: SE23;
    two_frames: TwoFrames;
    nav_state: NavState;
}
