//! From the stream of estimates to the rows of the estimate CSV, whatever the model.
//!
//! One row per propagated sample, as it is after the updates due at that stamp: the last estimate of a
//! stamp is the row, even if its fix was held back until the next sample came; an update between two
//! samples has no row of its own.
//!
//! ```
//! use inekf_client::rows::RowBuilder;
//! use inekf_shared::message::{ESTIMATE_PROPAGATED, ESTIMATE_UPDATED, EstimateSe23, Zero};
//!
//! let estimate = |stamp_ns, flags| {
//!     let mut estimate = EstimateSe23::ZERO;
//!     (estimate.head.stamp_ns, estimate.head.flags) = (stamp_ns, flags);
//!     estimate
//! };
//! let mut rows = RowBuilder::default();
//! assert!(rows.push(estimate(10, ESTIMATE_PROPAGATED)).is_none());
//! // The fix of the same stamp takes the row over.
//! assert!(rows.push(estimate(10, ESTIMATE_UPDATED)).is_none());
//! let row = rows.push(estimate(20, ESTIMATE_PROPAGATED)).expect("the row of 10 ns");
//! assert_eq!((row.head.stamp_ns, row.head.flags), (10, ESTIMATE_UPDATED));
//! ```

use inekf_shared::message::{ESTIMATE_PROPAGATED, EstimateSe23};

use crate::model::Estimate;
use crate::table::estimate::triangle_len;
use crate::table::{EstimateRow, EstimateState};

/// Turns estimates into rows, one row late.
#[derive(Clone, Debug)]
pub struct RowBuilder<E = EstimateSe23> {
    current: Option<E>,
}

impl<E> Default for RowBuilder<E> {
    fn default() -> Self {
        Self { current: None }
    }
}

impl<E: Estimate> RowBuilder<E> {
    /// Takes the next estimate; returns the row that it completes.
    pub fn push(&mut self, estimate: E) -> Option<E> {
        let head = *estimate.head();
        if let Some(current) = &mut self.current
            && current.head().stamp_ns == head.stamp_ns
        {
            *current = estimate;
            return None;
        }
        if head.flags & ESTIMATE_PROPAGATED != 0 {
            return self.current.replace(estimate);
        }
        None
    }

    /// The last row.
    pub fn finish(self) -> Option<E> {
        self.current
    }
}

/// The estimate as a row of the CSV, with the upper triangle of its covariance.
pub fn row<E: Estimate>(estimate: &E) -> EstimateRow {
    EstimateRow {
        stamp_ns: estimate.head().stamp_ns,
        state: state(estimate),
        covariance: triangle(estimate).to_vec(),
    }
}

/// The mean.
pub fn state<E: Estimate>(estimate: &E) -> EstimateState {
    estimate.mean()
}

/// The part of the covariance that is in use.
pub fn triangle<E: Estimate>(estimate: &E) -> &[f64] {
    let entries = triangle_len(estimate.head().dimension as usize);
    let covariance = estimate.covariance();
    &covariance[..entries.min(covariance.len())]
}
