//! Estimates as people read them: seconds, metres, degrees, and standard deviations in world axes.
//!
//! Columns `t_s,x,y,z,roll_deg,pitch_deg,yaw_deg`, with a velocity `vx,vy,vz`, with a covariance
//! `sx,sy,sz,syaw_deg`. World ENU; yaw is counter-clockwise from east, pitch positive with the nose down, roll positive
//! to the right: turns about the body's own axes in the order yaw, pitch, roll. What a column holds is rounded to a
//! micrometre or microdegree: to compute with, take the estimate CSV itself.

use std::io::Write;

use super::tum::Seconds;
use super::{ExportError, require_sorted};
use crate::evaluate::{deviations, estimate_pose};
use crate::table::EstimateTable;

/// Writes the table.
///
/// # Errors
/// [`ExportError`]; nothing is written if the stamps do not increase.
///
/// ```
/// use inekf_client::exchange::flat;
/// use inekf_client::table::read_estimates;
///
/// let table = read_estimates("estimate.csv", &b"t_ns,theta,x,y\n1500000000,0.0,1.0,2.0\n"[..])?;
/// let mut text = Vec::new();
/// flat::write(&table, &mut text)?;
/// let text = String::from_utf8(text)?;
/// assert_eq!(text.lines().next(), Some("t_s,x,y,z,roll_deg,pitch_deg,yaw_deg"));
/// assert!(text.contains("\n1.500000000,1.000000,2.000000,"));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn write(table: &EstimateTable, out: &mut impl Write) -> Result<(), ExportError> {
    require_sorted(&table.rows)?;
    let with_velocity = table
        .rows
        .iter()
        .all(|row| estimate_pose(row.stamp_ns, &row.state).v_w_mps.is_some());
    let with_deviations = table.rows.iter().all(|row| deviations(row).is_some());
    write!(out, "t_s,x,y,z,roll_deg,pitch_deg,yaw_deg")?;
    if with_velocity {
        write!(out, ",vx,vy,vz")?;
    }
    if with_deviations {
        write!(out, ",sx,sy,sz,syaw_deg")?;
    }
    writeln!(out)?;
    for row in &table.rows {
        let pose = estimate_pose(row.stamp_ns, &row.state);
        let (roll, pitch, yaw) = pose.q_wb.euler_angles();
        let mut numbers = pose.p_w_m.iter().copied().collect::<Vec<f64>>();
        numbers.extend([roll, pitch, yaw].map(f64::to_degrees));
        if let Some(velocity) = pose.v_w_mps.filter(|_| with_velocity) {
            numbers.extend(velocity.iter());
        }
        if let Some(deviations) = deviations(row).filter(|_| with_deviations) {
            numbers.extend(deviations.position_m.iter());
            numbers.push(deviations.heading_rad.to_degrees());
        }
        write!(out, "{}", Seconds(row.stamp_ns))?;
        for number in numbers {
            write!(out, ",{number:.6}")?;
        }
        writeln!(out)?;
    }
    Ok(())
}
