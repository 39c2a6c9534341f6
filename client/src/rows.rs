//! From the stream of estimates to the rows of the estimate CSV.
//!
//! One row per propagated sample, as it is after the updates due at that stamp: an update of the
//! same stamp replaces the row, one between two samples has no row of its own.

use inekf_shared::message::{ESTIMATE_PROPAGATED, EstimateSe23};

use crate::table::estimate::triangle_len;
use crate::table::{EstimateRow, EstimateState};

/// Turns estimates into rows, one estimate late.
#[derive(Debug, Default)]
pub struct RowBuilder {
    current: Option<EstimateSe23>,
}

impl RowBuilder {
    /// Takes the next estimate; returns the row that it completes.
    pub fn push(&mut self, estimate: EstimateSe23) -> Option<EstimateSe23> {
        if estimate.head.flags & ESTIMATE_PROPAGATED != 0 {
            return self.current.replace(estimate);
        }
        if let Some(current) = &mut self.current
            && current.head.stamp_ns == estimate.head.stamp_ns
        {
            *current = estimate;
        }
        None
    }

    /// The last row.
    pub fn finish(self) -> Option<EstimateSe23> {
        self.current
    }
}

/// The estimate as a row of the CSV, with the upper triangle of its covariance.
pub fn row(estimate: &EstimateSe23) -> EstimateRow {
    EstimateRow {
        stamp_ns: estimate.head.stamp_ns,
        state: state(estimate),
        covariance: triangle(estimate).to_vec(),
    }
}

/// The mean.
pub fn state(estimate: &EstimateSe23) -> EstimateState {
    EstimateState::Navigation {
        q_wb: estimate.q_wb,
        v_w_mps: estimate.v_w_mps,
        p_w_m: estimate.p_w_m,
        gyro_bias_rps: estimate.gyro_bias_rps,
        accel_bias_mps2: estimate.accel_bias_mps2,
    }
}

/// The part of the covariance that is in use.
pub fn triangle(estimate: &EstimateSe23) -> &[f64] {
    let entries = triangle_len(estimate.head.dimension as usize);
    &estimate.covariance[..entries.min(estimate.covariance.len())]
}
