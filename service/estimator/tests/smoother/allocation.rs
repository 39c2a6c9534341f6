//! With room given ahead, smoothing allocates nothing.

use inekf::filter::{Belief, Covariance, Gtsam, Left, Side};
use inekf::lie::{LieGroup, SE23};
use inekf::smoother::{Batch, BatchOptions};
use nalgebra::SVector;

use crate::common::seeded;
use crate::counting::allocations;
use crate::drive::{by_imu, full};

fn assert_no_allocation<S: Side>() {
    let mut rng = seeded(861);
    let prior: Belief<SE23, Left, 9> = Belief::new(
        SE23::identity(),
        Covariance::from_variances(&SVector::repeat(1.0)),
    );
    let q = full(0.1, &mut rng);
    let chain = by_imu(prior, &SVector::repeat(0.5), &q, 20, &mut rng);
    let mut batch = Batch::<SE23, S, 9, 3>::with_capacity(chain.states(), chain.sightings().len());
    let count = allocations(|| {
        batch.dead_reckon(&chain);
        let done = batch.smooth(&chain, &BatchOptions::default());
        assert!(done.is_ok_and(|done| done.converged));
    });
    assert_eq!(count, 0);
}

#[test]
fn smoothing_allocates_nothing() {
    assert!(
        allocations(|| drop(std::hint::black_box(Box::new(1)))) > 0,
        "the counter counts"
    );
    assert_no_allocation::<Left>();
    assert_no_allocation::<Gtsam>();
}
