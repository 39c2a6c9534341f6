//! A picture in words: one line for logs and pipes, and the lines of each panel of the screen.

use inekf_shared::message::{
    INPUT_HEADING, INPUT_POSITION, MAX_SOURCES, STATE_ALIGNING, STATE_WAITING, input_name,
    reason_name, source_index, state_name, waiting_for_name,
};

use super::Picture;
use crate::plot::format_ns;

/// One line: state, rates, age, position with one sigma, heading, NIS, counters, latency.
///
/// ```
/// use std::time::Duration;
///
/// use inekf_client::model::Model;
/// use inekf_client::monitor::{Picture, text};
/// use inekf_shared::message::{EstimateSe2, Zero};
///
/// let mut picture = Picture::new("cart", Model::Odometry2d)?;
/// picture.take_estimate(&EstimateSe2 { p_w_m: [1.0, 2.0], ..EstimateSe2::ZERO });
/// picture.finish(0, Duration::from_secs(1), 0);
/// let line = text::line(&picture);
/// assert!(line.starts_with("no word of the daemon yet, samples 0.0 Hz, estimates 1.0 Hz"));
/// assert!(line.contains("position 1.000 2.000 0.000 m") && line.contains("heading 0.00 deg"));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[must_use]
pub fn line(picture: &Picture) -> String {
    let mut parts = vec![state(picture), rates(picture)];
    if let Some(position) = picture.position() {
        let [x, y, z] = position.mean;
        parts.push(format!("position {x:.3} {y:.3} {z:.3} m"));
        if let Some([sx, sy, sz]) = position.sigma {
            parts.push(format!("sigma {sx:.3} {sy:.3} {sz:.3} m"));
        }
    }
    if let Some(pose) = picture.pose {
        parts.push(format!(
            "heading {:.2} deg",
            pose.heading_rad().to_degrees()
        ));
    }
    for (source, nis) in picture.nis() {
        parts.push(format!("nis[{source}] {nis:.2}"));
    }
    parts.push(fixes(picture));
    parts.extend(sources(picture));
    if !picture.latency.is_empty() {
        parts.push(latency(picture));
    }
    parts.retain(|part| !part.is_empty());
    parts.join(", ")
}

/// The daemon's state, and what it waits for.
///
/// ```
/// use inekf_client::model::Model;
/// use inekf_client::monitor::{Picture, text};
/// use inekf_shared::message::{Health, STATE_WAITING, WAITING_FOR_POSITION, Zero};
///
/// let mut picture = Picture::new("car", Model::Imu)?;
/// picture.take_health(&Health {
///     state: STATE_WAITING,
///     waiting_for: WAITING_FOR_POSITION,
///     ..Health::ZERO
/// });
/// assert_eq!(text::state(&picture), "waiting for position");
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[must_use]
pub fn state(picture: &Picture) -> String {
    let Some(health) = picture.health else {
        return "no word of the daemon yet".to_owned();
    };
    let mut text = state_name(health.state).to_owned();
    if matches!(health.state, STATE_WAITING | STATE_ALIGNING) {
        text += &format!(" for {}", waiting_for_name(health.waiting_for));
    }
    if let Some(age_ns) = picture.health_age_ns.filter(|age| *age > 5_000_000_000) {
        text += &format!(" {} ago, silent since", format_ns(age_ns as f64));
    }
    text
}

/// Rates of samples and estimates, and the age of the last estimate.
///
/// ```
/// use std::time::Duration;
///
/// use inekf_client::model::Model;
/// use inekf_client::monitor::{Picture, text};
/// use inekf_shared::message::{Health, Zero};
///
/// let mut picture = Picture::new("car", Model::Imu)?;
/// picture.take_health(&Health { imu_rate_hz: 200.0, ..Health::ZERO });
/// picture.finish(0, Duration::from_secs(1), 3);
/// // Estimates that this monitor was too slow for are said.
/// assert_eq!(text::rates(&picture), "samples 200.0 Hz, estimates 0.0 Hz, 3 missed here");
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[must_use]
pub fn rates(picture: &Picture) -> String {
    let samples = picture.health.map_or(0.0, |health| health.imu_rate_hz);
    let mut text = format!(
        "samples {samples:.1} Hz, estimates {:.1} Hz",
        picture.estimate_rate_hz
    );
    if let Some(age_ns) = picture.estimate_age_ns {
        text += &format!(", age {}", format_ns(age_ns as f64));
    }
    if picture.missed > 0 {
        text += &format!(", {} missed here", picture.missed);
    }
    text
}

/// What became of the fixes, as the last health message has it.
///
/// ```
/// use inekf_client::model::Model;
/// use inekf_client::monitor::{Picture, text};
/// use inekf_shared::message::{Health, Zero};
///
/// let mut picture = Picture::new("car", Model::Imu)?;
/// assert_eq!(text::fixes(&picture), "");
/// let mut health = Health::ZERO;
/// (health.counters.accepted, health.counters.gated) = (12, 1);
/// picture.take_health(&health);
/// assert_eq!(text::fixes(&picture), "accepted 12 gated 1 late 0 lost 0 rejected 0");
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[must_use]
pub fn fixes(picture: &Picture) -> String {
    let Some(health) = picture.health else {
        return String::new();
    };
    let counters = health.counters;
    format!(
        "accepted {} gated {} late {} lost {} rejected {}",
        counters.accepted, counters.gated, counters.late, counters.lost, counters.rejected
    )
}

/// From the sending of a sample to its estimate's publication.
///
/// ```
/// use inekf_client::model::Model;
/// use inekf_client::monitor::{Picture, text};
///
/// let mut picture = Picture::new("car", Model::Imu)?;
/// for ns in [900, 900, 900, 8_000] {
///     picture.latency.record(ns)?;
/// }
/// assert_eq!(text::latency(&picture), "latency p50 900 ns p99 8 µs max 8 µs");
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[must_use]
pub fn latency(picture: &Picture) -> String {
    let at = |quantile| format_ns(picture.latency.value_at_quantile(quantile) as f64);
    format!(
        "latency p50 {} p99 {} max {}",
        at(0.5),
        at(0.99),
        format_ns(picture.latency.max() as f64)
    )
}

/// The state: a line a quantity, with one sigma where it is known.
///
/// ```
/// use inekf_client::model::Model;
/// use inekf_client::monitor::{Picture, text};
/// use inekf_shared::message::{EstimateSe2, Zero};
///
/// let mut picture = Picture::new("cart", Model::Odometry2d)?;
/// assert_eq!(text::estimate(&picture), ["no estimate yet"]);
/// picture.take_estimate(&EstimateSe2 { theta_rad: 0.1, ..EstimateSe2::ZERO });
/// let lines = text::estimate(&picture);
/// // No velocity and no biases: this model has none.
/// assert!(lines[0].starts_with("position ") && lines[1].starts_with("attitude "));
/// assert_eq!(lines.len(), 2);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[must_use]
pub fn estimate(picture: &Picture) -> Vec<String> {
    let Some(pose) = picture.pose else {
        return vec!["no estimate yet".to_owned()];
    };
    let mut lines = Vec::new();
    let vector = |name: &str, [x, y, z]: [f64; 3], unit: &str| {
        format!("{name:<10} {x:>11.4} {y:>11.4} {z:>11.4} {unit}")
    };
    lines.push(vector("position", pose.p_w_m.into(), "m"));
    if let Some(sigma) = picture.deviations {
        lines.push(vector("  sigma", sigma.position_m.into(), "m"));
    }
    if let Some(v_w_mps) = pose.v_w_mps {
        lines.push(vector("velocity", v_w_mps.into(), "m/s"));
    }
    let (roll, pitch, yaw) = pose.q_wb.euler_angles();
    let degrees = [roll, pitch, yaw].map(f64::to_degrees);
    lines.push(vector("roll pitch yaw", degrees, "deg").replacen(
        "roll pitch yaw",
        "attitude  ",
        1,
    ));
    if let Some(sigma) = picture.deviations {
        let sigma_deg = sigma.heading_rad.to_degrees();
        lines.push(format!(
            "{:<10} {:>11} {:>11} {sigma_deg:>11.4} deg",
            "  sigma", "", ""
        ));
    }
    if let Some([gyro, accel]) = picture.biases {
        lines.push(vector("gyro bias", gyro, "rad/s"));
        lines.push(vector("accel bias", accel, "m/s^2"));
    }
    lines
}

/// Each source of fixes that was ever heard of: how old its newest fused fix is, by the sensors' clock, and how long ago
/// anything came of it, by this machine's.
///
/// ```
/// use inekf_client::model::Model;
/// use inekf_client::monitor::{Picture, text};
/// use inekf_shared::message::{Health, INPUT_HEADING, Zero, source_index};
///
/// let mut health = Health { stamp_ns: 5_000_000, ..Health::ZERO };
/// let compass = source_index(INPUT_HEADING, 1).expect("there is such a source");
/// health.delivered_ns[compass] = 3_000_000;
/// let mut picture = Picture::new("car", Model::Imu)?;
/// picture.take_health(&health);
/// // It speaks, and nothing of it was fused.
/// assert_eq!(text::sources(&picture), ["heading 1: none fused, heard 2 ms ago"]);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[must_use]
pub fn sources(picture: &Picture) -> Vec<String> {
    let Some(health) = picture.health else {
        return Vec::new();
    };
    let since_ns = picture.health_age_ns.unwrap_or(0);
    let mut lines = Vec::new();
    for input in INPUT_POSITION..=INPUT_HEADING {
        for source in 0..MAX_SOURCES as u32 {
            let Some(at) = source_index(input, source) else {
                continue;
            };
            let Some(heard_ns) = health.delivery_age_ns(health.delivered_ns[at]) else {
                continue;
            };
            let fused = match health.fix_age_ns(health.fused_stamp_ns[at]) {
                Some(age_ns) => format!("fused {} old", format_ns(age_ns as f64)),
                None => "none fused".to_owned(),
            };
            let heard = format_ns((heard_ns + since_ns) as f64);
            let name = input_name(input);
            lines.push(format!("{name} {source}: {fused}, heard {heard} ago"));
        }
    }
    lines
}

/// Fixes: counters, the last NIS of each position source, and the ages of each source.
///
/// ```
/// use inekf_client::model::Model;
/// use inekf_client::monitor::{Picture, text};
/// use inekf_shared::message::{Health, REASON_NOT_FINITE, Zero};
///
/// let mut health = Health::ZERO;
/// health.rejected_by_reason[REASON_NOT_FINITE as usize] = 2;
/// let mut picture = Picture::new("car", Model::Imu)?;
/// picture.take_health(&health);
/// assert!(text::updates(&picture).contains(&"  2 not finite".to_owned()));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[must_use]
pub fn updates(picture: &Picture) -> Vec<String> {
    let mut lines = Vec::new();
    if let Some(health) = picture.health {
        let counters = health.counters;
        for (name, count) in [
            ("accepted", counters.accepted),
            ("gated", counters.gated),
            ("late", counters.late),
            ("lost", counters.lost),
            ("rejected", counters.rejected),
        ] {
            lines.push(format!("{name:<10} {count:>10}"));
        }
        for (code, count) in (0_u32..).zip(health.rejected_by_reason) {
            if count > 0 {
                lines.push(format!("  {count} {}", reason_name(code)));
            }
        }
    }
    for (source, nis) in picture.nis() {
        lines.push(format!("NIS of {source}   {nis:>10.2}"));
    }
    lines.extend(sources(picture));
    lines
}

/// Messages by input since the daemon's start, and the rates.
///
/// ```
/// use inekf_client::model::Model;
/// use inekf_client::monitor::{Picture, text};
/// use inekf_shared::message::{Health, INPUT_IMU, Zero};
///
/// let mut health = Health { uptime_ns: 7_900_000_000, instance_pid: 42, ..Health::ZERO };
/// health.received[INPUT_IMU] = 1500;
/// let mut picture = Picture::new("car", Model::Imu)?;
/// picture.take_health(&health);
/// let lines = text::inputs(&picture);
/// assert!(lines.iter().any(|line| line.starts_with("imu ") && line.ends_with(" 1500")));
/// assert_eq!(lines.last().map(String::as_str), Some("up 7 s, process 42"));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[must_use]
pub fn inputs(picture: &Picture) -> Vec<String> {
    let mut lines: Vec<String> = rates(picture).split(", ").map(str::to_owned).collect();
    if let Some(health) = picture.health {
        for (input, count) in health.received.iter().enumerate() {
            if *count > 0 {
                lines.push(format!("{:<10} {count:>10}", input_name(input)));
            }
        }
        lines.push(format!(
            "up {} s, process {}",
            health.uptime_ns / 1_000_000_000,
            health.instance_pid
        ));
    }
    lines
}
