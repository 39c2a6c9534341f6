//! The routines timed, by criterion, in nanoseconds.

use core::time::Duration;

use criterion::{BatchSize, Criterion};

use crate::suite::Suite;

/// How many beliefs are prepared at a time: few enough for the first cache.
const BATCH: u64 = 12;

/// Times each routine.
pub struct Clock(Criterion);

impl Clock {
    /// Criterion as its command line says, with short runs.
    pub fn new() -> Self {
        let criterion = Criterion::default()
            .warm_up_time(Duration::from_millis(300))
            .measurement_time(Duration::from_millis(1000));
        Self(criterion.configure_from_args())
    }

    /// Prints what criterion keeps for the end.
    pub fn finish(&self) {
        self.0.final_summary();
    }
}

impl Suite for Clock {
    fn in_place<T: Copy>(&mut self, name: &str, start: T, mut change: impl FnMut(&mut T)) {
        self.0.bench_function(name, |bencher| {
            bencher.iter_batched_ref(|| start, &mut change, BatchSize::NumIterations(BATCH));
        });
    }

    fn call<R>(&mut self, name: &str, mut routine: impl FnMut() -> R) {
        self.0
            .bench_function(name, |bencher| bencher.iter(&mut routine));
    }
}
