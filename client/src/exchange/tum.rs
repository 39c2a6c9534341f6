//! Trajectories as the TUM benchmark has them: a line `seconds x y z qx qy qz qw` a pose, nothing else.
//!
//! Seconds have nine decimals, so that no nanosecond is lost; position in metres, world ENU; the quaternion is Hamilton,
//! body to world. Poses of the plane lie at z = 0.

use std::io::Write;

use super::{ExportError, require_sorted};
use crate::evaluate::estimate_pose;
use crate::table::EstimateRow;

/// Writes the poses.
///
/// # Errors
/// [`ExportError`]; nothing is written if the stamps do not increase.
///
/// ```
/// use inekf_client::exchange::tum;
/// use inekf_client::table::read_estimates;
///
/// // A north-going pose: the quaternion of a quarter turn about z, x y z w.
/// let csv = b"t_ns,theta,x,y\n2000000001,1.5707963267948966,1.0,2.0\n";
/// let mut text = Vec::new();
/// tum::write(&read_estimates("estimate.csv", &csv[..])?.rows, &mut text)?;
/// assert!(text.starts_with(b"2.000000001 1.0 2.0 0.0 0.0 0.0 0.7071067811865"));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn write(rows: &[EstimateRow], out: &mut impl Write) -> Result<(), ExportError> {
    require_sorted(rows)?;
    for row in rows {
        let pose = estimate_pose(row.stamp_ns, &row.state);
        let (p, q) = (pose.p_w_m, pose.q_wb);
        writeln!(
            out,
            "{} {:?} {:?} {:?} {:?} {:?} {:?} {:?}",
            Seconds(row.stamp_ns),
            p.x,
            p.y,
            p.z,
            q.i,
            q.j,
            q.k,
            q.w
        )?;
    }
    Ok(())
}

/// Nanoseconds, shown as seconds with nine decimals.
///
/// ```
/// use inekf_client::exchange::tum::Seconds;
///
/// // A double has no room for the nanoseconds of this century; text has.
/// assert_eq!(Seconds(1_700_000_000_000_000_007).to_string(), "1700000000.000000007");
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Seconds(pub u64);

impl std::fmt::Display for Seconds {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(
            f,
            "{}.{:09}",
            self.0 / 1_000_000_000,
            self.0 % 1_000_000_000
        )
    }
}
