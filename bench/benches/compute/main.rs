//! What the mathematics of one sample and of one fix costs, in nanoseconds, beside plain dense algebra.
//!
//! `cargo bench -p inekf-bench --bench compute [-- FILTER]`. Every figure is one call on data in the first
//! cache, as the daemon makes it: in place, on a belief that the call before it did not touch. A name that
//! ends in `/dense` is the same result by general matrix products, written in [`dense`]; the two are compared
//! before anything is timed.

use criterion::{Criterion, criterion_group, criterion_main};

mod dense;
mod groups;
mod predict;
mod setup;
mod update;

fn all(criterion: &mut Criterion) {
    predict::bench(criterion);
    update::bench(criterion);
    groups::bench(criterion);
}

criterion_group! {
    name = compute;
    config = Criterion::default()
        .warm_up_time(core::time::Duration::from_millis(300))
        .measurement_time(core::time::Duration::from_millis(1000));
    targets = all
}
criterion_main!(compute);
