//! The window with biases against the batch smoother over all states.

use inekf::filter::{Belief, Left, Side};
use inekf::model::NavState;
use inekf::smoother::{Batch, BatchOptions, Chain, Jacobians, PriorForm, Window, WindowOptions};
use nalgebra::{Cholesky, SVector};

use crate::drive::{ANISOTROPIC, Drive};

const SECONDS: usize = 40;

fn batch(drive: &Drive<NavState, 15>) -> Batch<NavState, Left, 15, 3> {
    let mut chain = Chain::with_capacity(drive.first, SECONDS + 1, SECONDS);
    for (motion, fix) in &drive.seconds {
        chain.advance(*motion, *motion.noise().matrix());
        chain.observe(*fix);
    }
    let mut batch = Batch::with_capacity(SECONDS + 1, SECONDS);
    batch.dead_reckon(&chain);
    let done = batch
        .smooth(&chain, &BatchOptions::default())
        .expect("a solution");
    assert!(done.converged);
    batch
}

/// The window after all fixes, and the states that have left it, with their covariances then.
fn windowed(
    drive: &Drive<NavState, 15>,
    capacity: usize,
    iterations: usize,
) -> (Window<NavState, Left, 15>, Vec<Belief<NavState, Left, 15>>) {
    let options = WindowOptions {
        first_prior: PriorForm::Recentred,
        jacobians: Jacobians::Exact,
        iterations,
        ..WindowOptions::new(capacity)
    };
    let mut window = Window::new(&drive.first, &options);
    let mut left = Vec::new();
    for (motion, fix) in &drive.seconds {
        let oldest = window.smoothed(0).expect("a state");
        left.extend(window.push(motion).map(|_| oldest));
        window.update(*fix).expect("an update");
    }
    (window, left)
}

#[test]
fn a_long_window_finds_the_most_likely_trajectory() {
    let drive = Drive::new(SECONDS, 0.1, ANISOTROPIC, 31);
    let batch = batch(&drive);
    let (window, left) = windowed(&drive, SECONDS + 1, 4);
    assert!(left.is_empty());
    for (actual, expected) in window.states().zip(batch.states()) {
        let off = Left::difference(expected, actual).norm();
        assert!(off < 1e-6, "off by {off:e}");
    }
}

/// Half the states have left: their marginals stand for them, and the newest state hardly notices.
#[test]
fn a_short_window_is_near_it() {
    let drive = Drive::new(SECONDS, 0.1, ANISOTROPIC, 32);
    let batch = batch(&drive);
    let (window, left) = windowed(&drive, SECONDS / 2, 1);
    assert_eq!(left.len(), SECONDS + 1 - SECONDS / 2);
    let newest = window.newest();
    let off = Left::difference(&batch.states()[SECONDS], &newest.mean);
    let sigmas = newest.covariance.matrix().diagonal().map(f64::sqrt);
    let relative: SVector<f64, 15> = off.component_div(&sigmas);
    assert!(
        relative.iter().all(|share| share.abs() < 0.05),
        "{relative}"
    );
    // What left twenty seconds after its fix was sure to what it said: the difference that later fixes make has no
    // larger covariance, and its normalised square is 15 on average at most.
    let normalised = left.iter().zip(batch.states()).map(|(belief, expected)| {
        let off = Left::difference(&belief.mean, expected);
        let root = Cholesky::new(*belief.covariance.matrix()).expect("full rank");
        off.dot(&root.solve(&off))
    });
    let mean = normalised.sum::<f64>() / left.len() as f64;
    println!("normalised square of what later fixes change: {mean:.2}");
    assert!(mean < 15.0, "{mean}");
}
