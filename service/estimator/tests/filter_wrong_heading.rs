//! What iterations and transport are for: precise fixes on a heading that is wrong by 80 or 170 degrees.

mod common;

use common::drive::Drive;
use inekf::filter::{Belief, Left, Side, Transport, UpdateOptions, update};
use inekf::lie::{LieGroup, SE23};
use nalgebra::Cholesky;

const RUNS: u64 = 25;
const FIXES: usize = 30;

/// 9 x 25 degrees of freedom: the mean of the runs leaves this band with a probability of 1e-4.
const BAND: (f64, f64) = (
    151.708_741_422_999_7 / RUNS as f64,
    317.106_038_225_149 / RUNS as f64,
);

fn nees(belief: &Belief<SE23, Left, 9>, truth: &SE23) -> f64 {
    let xi = Left::difference(&belief.mean, truth);
    let factor = Cholesky::new(*belief.covariance.matrix()).expect("positive definite");
    xi.dot(&factor.solve(&xi))
}

/// The mean NEES after each fix, and how far off the heading is at worst in the end, in degrees.
fn run(
    wrong_deg: f64,
    sigma_deg: f64,
    fix_sigma_m: f64,
    options: &UpdateOptions,
) -> ([f64; FIXES], f64) {
    let mut means = [0.0; FIXES];
    let mut worst_deg = 0.0_f64;
    for run in 0..RUNS {
        let mut drive = Drive::start(1000 + run);
        let mut belief = [drive.belief::<Left>(wrong_deg, sigma_deg, fix_sigma_m)];
        for mean in &mut means {
            let fix = drive.second(&mut belief, fix_sigma_m);
            update(&mut belief[0], &fix, options).expect("an update");
            *mean += nees(&belief[0], &drive.truth) / RUNS as f64;
        }
        let turn = drive.truth.rotation.inverse() * belief[0].mean.rotation;
        worst_deg = worst_deg.max(turn.heading_rad().to_degrees().abs());
    }
    (means, worst_deg)
}

/// How wrong the heading is, its standard deviation, that of the fixes: degrees, degrees, metres.
const CASES: [(f64, f64, f64); 8] = [
    (80.0, 50.0, 0.01),
    (80.0, 50.0, 0.1),
    (80.0, 90.0, 0.01),
    (80.0, 90.0, 0.1),
    (170.0, 90.0, 0.01),
    (170.0, 90.0, 0.1),
    (-170.0, 180.0, 0.01),
    (-170.0, 180.0, 0.1),
];

/// From the fifth fix on the error is what the covariance says it is, and in the end the heading is found.
#[test]
fn the_iterated_filter_stays_consistent() {
    for (wrong_deg, sigma_deg, fix_sigma_m) in CASES {
        let (means, worst_deg) = run(wrong_deg, sigma_deg, fix_sigma_m, &UpdateOptions::ITERATED);
        for (k, mean) in means.iter().enumerate().skip(4) {
            assert!(
                BAND.0 < *mean && *mean < BAND.1,
                "{wrong_deg} deg wrong, fixes of {fix_sigma_m} m: mean NEES {mean} after fix {}",
                k + 1
            );
        }
        assert!(
            worst_deg < 10.0 * fix_sigma_m,
            "{worst_deg} deg off in the end"
        );
    }
}

/// The same runs through the plain filter, to know that they are hard: it believes what is not so.
#[test]
fn the_plain_filter_does_not() {
    for (wrong_deg, sigma_deg, fix_sigma_m) in CASES {
        let (means, _) = run(wrong_deg, sigma_deg, fix_sigma_m, &UpdateOptions::PLAIN);
        assert!(
            means[4] > BAND.1,
            "{wrong_deg} deg wrong, fixes of {fix_sigma_m} m: mean NEES {}",
            means[4]
        );
    }
}

/// Iterations without transport, and transport without iterations, where the fixes are precise.
#[test]
fn neither_part_alone_is_enough() {
    let one_pass = UpdateOptions {
        iterations: 1,
        ..UpdateOptions::ITERATED
    };
    let not_carried = UpdateOptions {
        transport: Transport::None,
        ..UpdateOptions::ITERATED
    };
    for (wrong_deg, sigma_deg, fix_sigma_m) in CASES.into_iter().filter(|case| case.2 < 0.05) {
        for options in [one_pass, not_carried] {
            let (means, _) = run(wrong_deg, sigma_deg, fix_sigma_m, &options);
            assert!(means[4] > BAND.1, "{options:?}: mean NEES {}", means[4]);
        }
    }
}
