//! What a window does with fixes that it cannot or must not use, and that it takes no memory after construction.

use inekf::filter::{Belief, Left, UpdateOptions, Verdict, update};
use inekf::lie::SE23;
use inekf::model::{InertialState, NavState, PositionObservation};
use inekf::smoother::{Jacobians, Preintegration, Window, WindowError, WindowOptions};
use nalgebra::{Matrix3, Vector3};

use crate::counting::allocations;
use crate::drive::{ANISOTROPIC, Drive, ISOTROPIC};

type Window9 = Window<SE23, Left, 9>;

fn states<G: InertialState<D>, const D: usize>(window: &Window<G, Left, D>) -> Vec<G> {
    window.states().copied().collect()
}

/// Both ways to linearise: constant gains, and all anew with two iterations.
fn both() -> [(WindowOptions, Matrix3<f64>); 2] {
    let anew = WindowOptions {
        jacobians: Jacobians::Exact,
        iterations: 2,
        ..WindowOptions::new(6)
    };
    [(WindowOptions::new(6), ISOTROPIC), (anew, ANISOTROPIC)]
}

/// A window that refuses `bad` at every state goes on as one that never saw it.
fn assert_unharmed(bad: impl Fn(&PositionObservation) -> PositionObservation, error: WindowError) {
    for (options, covariance_w) in both() {
        let drive = Drive::<SE23, 9>::new(15, 0.2, covariance_w, 21);
        let mut window = Window9::new(&drive.first, &options);
        let mut beside = Window9::new(&drive.first, &options);
        for (motion, fix) in &drive.seconds {
            window.push(motion);
            beside.push(motion);
            let before = (states(&window), window.newest());
            assert_eq!(window.update(bad(fix)), Err(error));
            assert_eq!((states(&window), window.newest()), before);
            window.update(*fix).expect("an update");
            beside.update(*fix).expect("an update");
            assert_eq!(states(&window), states(&beside));
            assert_eq!(window.newest(), beside.newest());
        }
    }
}

#[test]
fn a_fix_that_is_not_finite_is_refused_and_leaves_no_trace() {
    for value in [f64::NAN, f64::INFINITY] {
        assert_unharmed(
            |fix| PositionObservation {
                position_w: Vector3::new(0.0, value, 0.0),
                ..*fix
            },
            WindowError::NotFinite,
        );
    }
}

#[test]
fn a_noise_that_is_not_positive_is_refused_and_leaves_no_trace() {
    assert_unharmed(
        |fix| PositionObservation {
            covariance_w: -1e6 * fix.covariance_w,
            ..*fix
        },
        WindowError::InnovationNotPositiveDefinite,
    );
}

#[test]
fn a_fix_beyond_the_gate_leaves_no_trace() {
    for (options, covariance_w) in both() {
        let gated = WindowOptions {
            gate: 100.0,
            ..options
        };
        let drive = Drive::<SE23, 9>::new(15, 0.2, covariance_w, 22);
        let mut window = Window9::new(&drive.first, &gated);
        let mut beside = Window9::new(&drive.first, &options);
        for (motion, fix) in &drive.seconds {
            window.push(motion);
            beside.push(motion);
            let before = (states(&window), window.newest());
            let outlier = PositionObservation {
                position_w: fix.position_w + Vector3::new(1e3, 0.0, 0.0),
                ..*fix
            };
            let correction = window.update(outlier).expect("a verdict");
            assert_eq!(correction.verdict, Verdict::Gated);
            assert!(correction.nis > 100.0);
            assert_eq!((states(&window), window.newest()), before);
            let correction = window.update(*fix).expect("an update");
            assert_eq!(correction.verdict, Verdict::Accepted);
            beside.update(*fix).expect("an update");
            assert_eq!(states(&window), states(&beside));
        }
    }
}

/// At a new window's only state the innovation is the filter's.
#[test]
fn the_normalised_innovation_is_the_filters() {
    let drive = Drive::<NavState, 15>::new(1, 0.2, ANISOTROPIC, 23);
    let (motion, fix) = &drive.seconds[0];
    let mut window = Window::<NavState, Left, 15>::new(&drive.first, &WindowOptions::new(5));
    let mut filter: Belief<NavState, Left, 15> = motion.carry(&drive.first);
    window.push(motion);
    let expected = update(&mut filter, fix, &UpdateOptions::PLAIN)
        .expect("an update")
        .nis;
    let actual = window.update(*fix).expect("an update").nis;
    assert!(
        (actual - expected).abs() < 1e-8 * expected,
        "{actual}, {expected}"
    );
}

#[test]
fn a_state_takes_one_fix_and_a_motion_of_no_length_makes_room_for_another() {
    let drive = Drive::<SE23, 9>::new(1, 0.2, ANISOTROPIC, 24);
    let (motion, fix) = &drive.seconds[0];
    let mut twice = Window9::new(&drive.first, &WindowOptions::new(5));
    twice.push(motion);
    twice.update(*fix).expect("the first");
    assert_eq!(twice.update(*fix), Err(WindowError::AlreadySeen));
    twice.push(&Preintegration::new(&twice.newest().mean));
    twice.update(*fix).expect("the second");
    // The states of one moment stay one.
    let ends = states(&twice);
    let apart = (ends[1].position - ends[2].position).norm();
    assert!(apart < 1e-9, "apart by {apart:e} m");

    // Two fixes alike tell as much as one of half the covariance.
    let half = PositionObservation {
        covariance_w: 0.5 * fix.covariance_w,
        ..*fix
    };
    let mut once = Window9::new(&drive.first, &WindowOptions::new(5));
    once.push(motion);
    once.update(half).expect("an update");
    let (two, one) = (twice.newest().covariance, once.newest().covariance);
    let share = two.matrix().trace() / one.matrix().trace();
    assert!((share - 1.0).abs() < 0.05, "{share}");
}

#[test]
fn a_window_that_begins_again_is_new() {
    let drive = Drive::<SE23, 9>::new(15, 0.2, ISOTROPIC, 25);
    let mut used = Window9::new(&drive.first, &WindowOptions::new(6));
    for (motion, fix) in &drive.seconds {
        used.push(motion);
        used.update(*fix).expect("an update");
    }
    used.restart(&drive.first);
    let mut new = Window9::new(&drive.first, &WindowOptions::new(6));
    for (motion, fix) in &drive.seconds {
        assert_eq!(used.push(motion), new.push(motion));
        assert_eq!(used.update(*fix), new.update(*fix));
        assert_eq!(states(&used), states(&new));
    }
}

fn assert_allocates_nothing<G: InertialState<D>, const D: usize>(options: &WindowOptions) {
    let drive = Drive::<G, D>::new(30, 0.2, ANISOTROPIC, 26);
    let mut window = Window::<G, Left, D>::new(&drive.first, options);
    let allocated = allocations(|| {
        for (k, (motion, fix)) in drive.seconds.iter().enumerate() {
            window.push(motion);
            let covariance_w = if k % 2 == 0 { ISOTROPIC } else { ANISOTROPIC };
            let fix = PositionObservation {
                covariance_w,
                ..*fix
            };
            assert!(window.update(fix).is_ok());
        }
        assert!(window.smoothed(0).is_some());
        window.restart(&drive.first);
    });
    assert_eq!(allocated, 0);
}

#[test]
fn a_window_allocates_at_construction_only() {
    let counted = allocations(|| drop(std::hint::black_box(Box::new(1))));
    assert!(counted > 0, "the counter counts");
    for (options, _) in both() {
        assert_allocates_nothing::<SE23, 9>(&options);
        assert_allocates_nothing::<NavState, 15>(&options);
    }
}
