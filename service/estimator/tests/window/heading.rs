//! Fixes of the heading in the window: against the batch smoother, and among fixes of position.

use inekf::filter::{Forster, Left, Side, UpdateOptions, update};
use inekf::lie::SE23;
use inekf::model::{HeadingObservation, InertialState, NavState};
use inekf::smoother::{Jacobians, Window, WindowOptions};

use crate::beside_batch::BesideBatch;
use crate::common::assert_same_covariance;
use crate::drive::{Drive, ISOTROPIC};

/// Headings alone, one for each motion: what one iteration of the batch smoother does.
fn assert_is_batch<G: InertialState<D>, S: Side, const D: usize>(jacobians: Jacobians) {
    let drive = Drive::<G, D>::new(10, 0.2, ISOTROPIC, 41);
    let mut beside = BesideBatch::<G, S, _, D, 1>::new(&drive.first, jacobians);
    for (k, (motion, _)) in drive.seconds.iter().enumerate() {
        beside.assert_same_step(motion, |expected| HeadingObservation {
            heading: expected.pose().rotation.heading_rad() + 0.2 * (k as f64 * 1.3).sin(),
            sigma: 0.05,
        });
    }
}

#[test]
fn headings_alone_are_smoothed_as_the_batch_does() {
    for jacobians in [Jacobians::Frozen, Jacobians::Exact] {
        assert_is_batch::<SE23, Left, 9>(jacobians);
        assert_is_batch::<SE23, Forster, 9>(jacobians);
        assert_is_batch::<NavState, Left, 15>(jacobians);
    }
}

/// At a new window's only state innovation and covariance are the filter's, of one degree of freedom.
#[test]
fn a_first_heading_is_taken_as_the_filter_takes_it() {
    let drive = Drive::<NavState, 15>::new(1, 0.2, ISOTROPIC, 42);
    let motion = &drive.seconds[0].0;
    let mut filter = motion.carry(&drive.first);
    let heading = HeadingObservation {
        heading: filter.mean.pose().rotation.heading_rad() + 0.1,
        sigma: 0.05,
    };
    let mut window = Window::<NavState, Left, 15>::new(&drive.first, &WindowOptions::new(5));
    window.push(motion);
    let expected = update(&mut filter, &heading, &UpdateOptions::PLAIN).expect("an update");
    let actual = window.update(heading).expect("an update");
    assert!((actual.nis - expected.nis).abs() < 1e-8 * expected.nis);
    let newest = window.newest();
    assert!(Left::difference(&newest.mean, &filter.mean).norm() < 1e-9);
    let p = filter.covariance;
    assert_same_covariance("P", newest.covariance.matrix(), p.matrix(), 1e-9);
}
