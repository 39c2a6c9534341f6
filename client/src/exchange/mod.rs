//! Estimates for other people's tools: `inekf-client export`.
//!
//! | format | what reads it | module |
//! |---|---|---|
//! | `tum` | evo and other trajectory tools | [`tum`] |
//! | `csv` | spreadsheets: seconds, angles in degrees, standard deviations in world axes | [`flat`] |
//! | `mcap` | Foxglove, rosbag2: ROS 2 messages | [`mcap`](mod@mcap) |
//!
//! All are written from an [`EstimateTable`], whose stamps increase; a table whose stamps do not is refused, because some
//! of those tools take it without a word and compare the wrong poses.
//!
//! ```
//! use inekf_client::exchange::tum;
//! use inekf_client::table::{EstimateRow, EstimateState};
//!
//! let pose = EstimateRow {
//!     stamp_ns: 1_500_000_000,
//!     state: EstimateState::Plane { theta_rad: 0.0, p_w_m: [1.0, 2.0] },
//!     covariance: vec![],
//! };
//! let mut text = Vec::new();
//! tum::write(std::slice::from_ref(&pose), &mut text)?;
//! assert!(text.starts_with(b"1.500000000 1.0 2.0 0.0 "));
//! // What does not increase is refused.
//! assert!(tum::write(&[pose.clone(), pose], &mut text).is_err());
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

#[cfg(feature = "mcap")]
mod cdr;
pub mod flat;
#[cfg(feature = "mcap")]
pub mod mcap;
pub mod ros;
pub mod tum;

use std::io;

use crate::dataset::{Truth, TruthRow};
use crate::table::{EstimateRow, EstimateState, EstimateTable, Layout};

/// Estimates could not be exported.
///
/// ```
/// use inekf_client::exchange::{ExportError, require_sorted};
///
/// let error = require_sorted(&[]).expect_err("nothing to export");
/// assert!(matches!(error, ExportError::Empty));
/// assert_eq!(error.to_string(), "there are no estimates to export");
/// ```
#[derive(Debug, thiserror::Error)]
pub enum ExportError {
    /// Stamps do not increase.
    #[error(
        "the stamp {stamp_ns} ns does not come after {before_ns} ns: sort the rows by t_ns and keep one for each"
    )]
    Unsorted {
        /// The stamp.
        stamp_ns: u64,
        /// The one before it.
        before_ns: u64,
    },
    /// There are no rows.
    #[error("there are no estimates to export")]
    Empty,
    /// The stamp does not fit the format's time.
    #[error("the stamp {stamp_ns} ns is beyond what ROS time holds (the year 2038)")]
    TooLate {
        /// The stamp.
        stamp_ns: u64,
    },
    /// The file could not be written.
    #[error("{0}")]
    Write(#[from] io::Error),
    /// The MCAP library failed.
    #[cfg(feature = "mcap")]
    #[error("{0}")]
    Mcap(#[from] ::mcap::McapError),
}

/// Refuses what is empty or not in the order of its stamps.
///
/// # Errors
/// [`ExportError::Unsorted`], [`ExportError::Empty`].
///
/// ```
/// use inekf_client::exchange::{ExportError, require_sorted};
/// use inekf_client::table::{EstimateRow, EstimateState};
///
/// let row = |stamp_ns| EstimateRow {
///     stamp_ns,
///     state: EstimateState::Plane { theta_rad: 0.0, p_w_m: [0.0; 2] },
///     covariance: vec![],
/// };
/// assert!(require_sorted(&[row(1), row(2)]).is_ok());
/// // Twice the same stamp is refused as well.
/// let refused = require_sorted(&[row(1), row(2), row(2)]);
/// assert!(matches!(refused, Err(ExportError::Unsorted { stamp_ns: 2, before_ns: 2 })));
/// ```
pub fn require_sorted(rows: &[EstimateRow]) -> Result<(), ExportError> {
    if rows.is_empty() {
        return Err(ExportError::Empty);
    }
    match rows
        .windows(2)
        .find(|pair| pair[1].stamp_ns <= pair[0].stamp_ns)
    {
        None => Ok(()),
        Some(pair) => Err(ExportError::Unsorted {
            stamp_ns: pair[1].stamp_ns,
            before_ns: pair[0].stamp_ns,
        }),
    }
}

/// A truth as a table of estimates without covariance, so that it can be exported beside them. `None` if it has no rows.
///
/// ```
/// use inekf_client::dataset::{Truth, Truth2dRow};
/// use inekf_client::exchange::{truth_table, tum};
///
/// let truth = Truth::Planar(vec![Truth2dRow { stamp_ns: 0, theta_rad: 0.0, p_w_m: [4.0, 5.0] }]);
/// let table = truth_table(&truth).expect("it has rows");
/// let mut text = Vec::new();
/// tum::write(&table.rows, &mut text)?;
/// assert_eq!(text, b"0.000000000 4.0 5.0 0.0 0.0 0.0 0.0 1.0\n");
/// assert!(truth_table(&Truth::None).is_none());
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[must_use]
pub fn truth_table(truth: &Truth) -> Option<EstimateTable> {
    let (layout, rows): (Layout, Vec<EstimateRow>) = match truth {
        Truth::None => return None,
        Truth::Planar(rows) => {
            let rows = rows.iter().map(|row| EstimateRow {
                stamp_ns: row.stamp_ns,
                state: EstimateState::Plane {
                    theta_rad: row.theta_rad,
                    p_w_m: row.p_w_m,
                },
                covariance: Vec::new(),
            });
            (Layout::Plane, rows.collect())
        }
        Truth::Spatial(rows) => (Layout::Navigation, rows.iter().map(truth_row).collect()),
    };
    Some(EstimateTable {
        layout,
        covariance_dimension: None,
        rows,
    })
}

fn truth_row(row: &TruthRow) -> EstimateRow {
    let bias = row.bias.unwrap_or_default();
    EstimateRow {
        stamp_ns: row.stamp_ns,
        state: EstimateState::Navigation {
            q_wb: row.q_wb,
            v_w_mps: row.v_w_mps,
            p_w_m: row.p_w_m,
            gyro_bias_rps: bias.gyro_rps,
            accel_bias_mps2: bias.accel_mps2,
        },
        covariance: Vec::new(),
    }
}
