//! A window that is worked on in slices, with the next update anticipated, against the same at once.

use inekf::filter::{Gtsam, Left, Side};
use inekf::lie::SE23;
use inekf::model::{HeadingObservation, InertialState, NavState, PositionObservation};
use inekf::smoother::{Fix, Jacobians, PriorForm, Window, WindowOptions};
use nalgebra::Matrix3;

use crate::drive::{ANISOTROPIC, Drive, ISOTROPIC};

/// The same updates at once, and in slices with the next one anticipated: by how much at a time, and how far.
fn assert_slices_change_no_bit<G: InertialState<D>, S: Side, const D: usize>(
    options: &WindowOptions,
    covariance_of: impl Fn(usize) -> Matrix3<f64>,
) {
    let drive = Drive::<G, D>::new(30, 0.2, ANISOTROPIC, 27);
    let windows = || Window::<G, S, D>::new(&drive.first, options);
    let (mut whole, mut sliced) = (windows(), windows());
    let mut ready = 0;
    for (k, (motion, fix)) in drive.seconds.iter().enumerate() {
        let mut fix: Fix = PositionObservation {
            covariance_w: covariance_of(k),
            ..*fix
        }
        .into();
        if k % 11 == 7 {
            fix = HeadingObservation {
                heading: k as f64 * 0.1,
                sigma: 0.5,
            }
            .into();
        }
        let was_ready = sliced.is_ready_for(&fix);
        assert_eq!(sliced.push(motion), whole.push(motion));
        let expected = whole.update(fix);
        sliced.begin(fix).expect("a state without a fix");
        let mut actual = None;
        if was_ready {
            ready += 1;
            actual = sliced.lead();
            if options.iterations == 1 {
                assert_eq!(sliced.newest(), whole.newest(), "fix {k}");
            }
        }
        while actual.is_none() {
            let most = 1 + (k as i64 % 3) * 10;
            let mut budget = most;
            actual = sliced.advance(&mut budget);
            // No slice does more than one state too many.
            assert!(budget < most && budget > -50, "{budget}");
        }
        assert_eq!(actual, Some(expected));
        assert!(whole.states().eq(sliced.states()), "fix {k}");
        let mut share = 40;
        while !sliced.cover_oldest(&mut share) {
            share = 40;
        }
        assert_eq!(Some(sliced.oldest()), whole.smoothed(0));
        // Sometimes all, sometimes nothing, sometimes a part.
        let mut rest = [i64::MAX, i64::MAX, 0, 25][k % 4];
        let done = sliced.anticipate(&mut rest);
        assert!(done || k % 4 > 1 || options.capacity == 1);
        assert!(whole.states().eq(sliced.states()), "the oldest state stays");
    }
    assert!(ready > 5, "{ready}");
}

#[test]
fn slices_and_anticipation_change_no_bit() {
    let mixed = |k: usize| if k % 7 < 5 { ISOTROPIC } else { ANISOTROPIC };
    for capacity in [1, 2, 9, 50] {
        for iterations in [1, 2] {
            for (jacobians, prior) in [
                (Jacobians::Frozen, PriorForm::GroupMean),
                (Jacobians::Exact, PriorForm::Recentred),
            ] {
                let options = WindowOptions {
                    iterations,
                    jacobians,
                    first_prior: prior,
                    prior,
                    ..WindowOptions::new(capacity)
                };
                assert_slices_change_no_bit::<SE23, Left, 9>(&options, |_| ISOTROPIC);
                assert_slices_change_no_bit::<SE23, Left, 9>(&options, mixed);
                assert_slices_change_no_bit::<SE23, Gtsam, 9>(&options, mixed);
                assert_slices_change_no_bit::<NavState, Left, 15>(&options, mixed);
            }
        }
    }
}
