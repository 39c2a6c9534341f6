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
///
/// ```
/// use inekf_client::rows::RowBuilder;
/// use inekf_shared::message::{ESTIMATE_PROPAGATED, EstimateMessage, EstimateSe2, Zero};
///
/// let mut estimate = EstimateSe2::ZERO;
/// estimate.head.flags = ESTIMATE_PROPAGATED;
/// let mut rows = RowBuilder::default();
/// assert!(rows.push(estimate).is_none());
/// // A row late: the last one comes at the end.
/// assert_eq!(rows.finish(), Some(estimate));
/// ```
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
    ///
    /// ```
    /// use inekf_client::rows::RowBuilder;
    /// use inekf_shared::message::{ESTIMATE_PROPAGATED, EstimateSe2, Zero};
    ///
    /// let estimate = |stamp_ns| {
    ///     let mut estimate = EstimateSe2::ZERO;
    ///     (estimate.head.stamp_ns, estimate.head.flags) = (stamp_ns, ESTIMATE_PROPAGATED);
    ///     estimate
    /// };
    /// let mut rows = RowBuilder::default();
    /// assert!(rows.push(estimate(10)).is_none());
    /// // The next stamp completes the row of the one before.
    /// assert_eq!(rows.push(estimate(20)), Some(estimate(10)));
    /// ```
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
    ///
    /// ```
    /// use inekf_client::rows::RowBuilder;
    /// use inekf_shared::message::EstimateSe2;
    ///
    /// // Nothing came: there is no row.
    /// assert!(RowBuilder::<EstimateSe2>::default().finish().is_none());
    /// ```
    pub fn finish(self) -> Option<E> {
        self.current
    }
}

/// The estimate as a row of the CSV, with the upper triangle of its covariance.
///
/// ```
/// use inekf_client::rows::row;
/// use inekf_shared::message::{EstimateSe23, Zero};
///
/// let mut estimate = EstimateSe23::ZERO;
/// (estimate.head.stamp_ns, estimate.head.dimension) = (5, 9);
/// let row = row(&estimate);
/// assert_eq!((row.stamp_ns, row.covariance.len()), (5, 45));
/// ```
pub fn row<E: Estimate>(estimate: &E) -> EstimateRow {
    EstimateRow {
        stamp_ns: estimate.head().stamp_ns,
        state: state(estimate),
        covariance: triangle(estimate).to_vec(),
    }
}

/// The mean.
///
/// ```
/// use inekf_client::rows::state;
/// use inekf_client::table::Layout;
/// use inekf_shared::message::{EstimateSe3, Zero};
///
/// assert_eq!(state(&EstimateSe3::ZERO).layout(), Layout::Pose);
/// ```
pub fn state<E: Estimate>(estimate: &E) -> EstimateState {
    estimate.mean()
}

/// The part of the covariance that is in use.
///
/// ```
/// use inekf_client::rows::triangle;
/// use inekf_shared::message::{EstimateSe23, Zero};
///
/// // 9 states without biases, 15 with them: n (n + 1) / 2 entries.
/// let mut estimate = EstimateSe23::ZERO;
/// for (dimension, entries) in [(9, 45), (15, 120)] {
///     estimate.head.dimension = dimension;
///     assert_eq!(triangle(&estimate).len(), entries);
/// }
/// ```
pub fn triangle<E: Estimate>(estimate: &E) -> &[f64] {
    let entries = triangle_len(estimate.head().dimension as usize);
    let covariance = estimate.covariance();
    &covariance[..entries.min(covariance.len())]
}
