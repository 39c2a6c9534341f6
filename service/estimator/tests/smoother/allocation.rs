//! With room given ahead, smoothing allocates nothing.

use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;

use inekf::filter::{Belief, Covariance, Gtsam, Left, Side};
use inekf::lie::{LieGroup, SE23};
use inekf::smoother::{Batch, BatchOptions};
use nalgebra::SVector;

use crate::common::seeded;
use crate::drive::{by_imu, full};

thread_local! {
    /// Allocations of this thread. The harness has threads of its own.
    static ALLOCATIONS: Cell<u64> = const { Cell::new(0) };
}

/// The system's allocator, counted.
struct Counting;

fn count() {
    // While the thread ends the counter may be gone; nobody looks at it any more then.
    let _ = ALLOCATIONS.try_with(|count| count.set(count.get() + 1));
}

// SAFETY: every call goes to the system's allocator with the arguments unchanged; the counter is a
// plain cell of the thread without a destructor, which never allocates.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        count();
        // SAFETY: the caller keeps the contract of `alloc`.
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        count();
        // SAFETY: the caller keeps the contract of `dealloc`; `pointer` came from the system.
        unsafe { System.dealloc(pointer, layout) }
    }

    unsafe fn realloc(&self, pointer: *mut u8, layout: Layout, size: usize) -> *mut u8 {
        count();
        // SAFETY: the caller keeps the contract of `realloc`; `pointer` came from the system.
        unsafe { System.realloc(pointer, layout, size) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

/// Allocations and frees of this thread while `work` runs.
pub fn allocations(work: impl FnOnce()) -> u64 {
    let before = ALLOCATIONS.with(Cell::get);
    work();
    ALLOCATIONS.with(Cell::get) - before
}

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
