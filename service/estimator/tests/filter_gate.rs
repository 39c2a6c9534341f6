//! Chi-square against values computed to 60 digits by summation.

use inekf::filter::Gate;
use inekf::filter::gate::{MAX_DEGREES, chi_square_quantile, chi_square_survival};

/// Degrees of freedom, probability, quantile.
const QUANTILES: [(usize, f64, f64); 19] = [
    (1, 0.001, 1.570_797_149_262_48e-6),
    (1, 0.95, 3.841_458_820_694_126),
    (1, 0.99, 6.634_896_601_021_215),
    (2, 0.95, 5.991_464_547_107_982),
    (2, 0.99, 9.210_340_371_976_183),
    (3, 0.5, 2.365_973_884_375_338),
    (3, 0.95, 7.814_727_903_251_18),
    (3, 0.99, 11.344_866_730_144_37),
    (3, 0.999, 16.266_236_196_238_13),
    (6, 0.997, 19.804_652_358_849_61),
    (9, 0.95, 16.918_977_604_620_45),
    (15, 0.99, 30.577_914_166_892_49),
    (30, 0.05, 18.492_660_981_953_47),
    (1800, 0.99, 1_942.514_997_946_358),
    (3000, 0.001, 2_766.319_481_998_526),
    (3000, 0.005, 2_804.234_795_488_686),
    (3000, 0.5, 2_999.333_359_677_192_5),
    (3000, 0.995, 3_203.277_864_864_399),
    (3000, 0.999, 3_245.078_830_702_524),
];

#[test]
fn quantiles_are_those_of_the_tables() {
    for (degrees, probability, expected) in QUANTILES {
        let actual = chi_square_quantile(degrees, probability);
        // A probability near 0 is known to an absolute rounding only, as 1 less the tail.
        let tolerance = if probability < 0.01 && degrees == 1 {
            1e-12
        } else {
            1e-11
        };
        assert!(
            (actual - expected).abs() <= tolerance * expected.max(1e-2),
            "{degrees} degrees, {probability}: {actual:?}, expected {expected:?}"
        );
    }
}

#[test]
fn small_tails_are_relatively_exact() {
    for (degrees, x, expected) in [
        (1, 100.0, 1.523_970_604_832_105e-23),
        (2, 100.0, (-50.0_f64).exp()),
        (3, 60.0, 5.878_230_727_906_912e-13),
        (3000, 3000.0, 0.496_566_438_839_651_3),
        (2001, 1900.0, 0.946_698_227_661_073),
    ] {
        let actual = chi_square_survival(degrees, x);
        assert!(
            (actual / expected - 1.0).abs() < 1e-11,
            "{degrees} degrees beyond {x}: {actual:e}, expected {expected:e}"
        );
    }
}

#[test]
fn survival_falls_from_one_to_zero() {
    for degrees in [1, 2, 3, 4, 6, 9, 15, 16, 200, 3001] {
        let mut before = 1.0;
        for i in 0..=400 {
            let x = degrees as f64 * i as f64 / 100.0;
            let survival = chi_square_survival(degrees, x);
            // Where it is flat its rounding may jitter: thousands of terms, summed by their logarithms.
            assert!(
                survival <= before * (1.0 + 1e-12),
                "{degrees} degrees at {x}: {before} then {survival}"
            );
            assert!((0.0..=1.0).contains(&survival));
            before = survival;
        }
        assert_eq!(chi_square_survival(degrees, 0.0), 1.0);
        assert_eq!(chi_square_survival(degrees, -1.0), 1.0);
        assert_eq!(chi_square_survival(degrees, 1e6), 0.0);
        assert_eq!(chi_square_survival(degrees, f64::INFINITY), 0.0);
        assert!(chi_square_survival(degrees, f64::NAN).is_nan());
    }
}

#[test]
fn survival_and_quantile_are_inverse() {
    for degrees in [1, 2, 3, 6, 9, 15, 600] {
        for probability in [0.01, 0.3, 0.5, 0.9, 0.99, 0.9999, 1.0 - 1e-9] {
            let x = chi_square_quantile(degrees, probability);
            let tail = 1.0 - probability;
            let ratio = chi_square_survival(degrees, x) / tail;
            assert!(
                (ratio - 1.0).abs() < 1e-12,
                "{degrees} degrees, {probability}: {ratio}"
            );
        }
    }
}

#[test]
fn more_degrees_reach_further() {
    for probability in [0.05, 0.5, 0.99] {
        let quantiles: Vec<f64> = (1..40)
            .map(|k| chi_square_quantile(k, probability))
            .collect();
        assert!(quantiles.is_sorted_by(|a, b| a < b), "{quantiles:?}");
    }
}

#[test]
fn certainty_gates_nothing() {
    assert_eq!(chi_square_quantile(3, 1.0), f64::INFINITY);
    assert_eq!(chi_square_quantile(3, 1.5), f64::INFINITY);
    assert_eq!(chi_square_quantile(3, f64::NAN), f64::INFINITY);
    assert_eq!(chi_square_quantile(3, 0.0), 0.0);
    assert_eq!(chi_square_quantile(3, -1.0), 0.0);
}

#[test]
fn a_gate_judges_by_the_degrees_of_freedom() {
    let gate = Gate::of_probability(0.99);
    for (degrees, probability, quantile) in QUANTILES {
        if probability == 0.99 && degrees <= MAX_DEGREES {
            assert!(gate.admits(quantile * (1.0 - 1e-9), degrees));
            assert!(!gate.admits(quantile * (1.0 + 1e-9), degrees));
        }
    }
    for degrees in 1..=MAX_DEGREES {
        assert!(Gate::at(5.0).admits(5.0, degrees) && !Gate::at(5.0).admits(5.1, degrees));
        assert!(Gate::OPEN.admits(f64::MAX, degrees));
        assert!(Gate::of_probability(1.0).admits(f64::MAX, degrees));
    }
    // Where constraints leave nothing of the innovation, its square is rounding.
    assert!(Gate::at(0.0).admits(1e-20, 0) && gate.admits(1e-20, 0));
}
