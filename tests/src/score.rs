//! Estimates against truth and fixes. Metres, world ENU; stamps in nanoseconds.

use std::fs::File;
use std::io::BufReader;
use std::path::Path;

use inekf_client::dataset::{PositionRow, Truth};
use inekf_client::evaluate::{DEFAULT_MAX_GAP_NS, Summary, Trajectory, errors, summarise};
use inekf_client::table::{EstimateRow, EstimateState, read_estimates};
use inekf_shared::message::EstimateSe23;
use nalgebra::Vector3;

/// Nanoseconds of a second.
pub const SECOND_NS: u64 = 1_000_000_000;

/// The rows of an estimate CSV.
pub fn estimates(file: &Path) -> Vec<EstimateRow> {
    let input = File::open(file).unwrap_or_else(|error| panic!("{}: {error}", file.display()));
    let name = file.display().to_string();
    let table = read_estimates(&name, BufReader::new(input));
    table.unwrap_or_else(|faults| panic!("{faults}")).rows
}

/// RMSE and maxima against the truth from `start_ns` on.
pub fn against_truth(rows: &[EstimateRow], truth: &Truth, start_ns: u64) -> Summary {
    let errors = errors(
        &Trajectory::from_estimates(rows),
        &Trajectory::from_truth(truth),
        DEFAULT_MAX_GAP_NS,
    );
    summarise(&errors, start_ns).expect("the truth is known somewhere")
}

/// RMSE by axis (east, north, up) of the estimated antenna against fixes from `start_ns` on; the estimate is
/// interpolated at the fixes' stamps.
pub fn against_fixes(
    rows: &[EstimateRow],
    fixes: &[PositionRow],
    lever_arm_b_m: [f64; 3],
    start_ns: u64,
) -> Vector3<f64> {
    let trajectory = Trajectory::from_estimates(rows);
    let squares: Vec<Vector3<f64>> = fixes
        .iter()
        .filter(|fix| fix.stamp_ns >= start_ns)
        .filter_map(|fix| {
            let pose = trajectory.at(fix.stamp_ns, DEFAULT_MAX_GAP_NS)?;
            let antenna_w = pose.p_w_m + pose.q_wb * Vector3::from(lever_arm_b_m);
            let error = antenna_w - Vector3::from(fix.position_w_m);
            Some(error.component_mul(&error))
        })
        .collect();
    assert!(!squares.is_empty(), "no fix to compare with");
    let count = squares.len() as f64;
    (squares.into_iter().sum::<Vector3<f64>>() / count).map(f64::sqrt)
}

/// The gyro bias of a row, rad/s.
pub fn gyro_bias(row: &EstimateRow) -> Vector3<f64> {
    match row.state {
        EstimateState::Navigation { gyro_bias_rps, .. } => gyro_bias_rps.into(),
        _ => panic!("the estimate has no biases"),
    }
}

/// Everything that makes an estimate what it is, as bits: stamp, mean and covariance, without the latency stamps.
pub fn bits(estimate: &EstimateSe23) -> Vec<u64> {
    let parts = [
        &estimate.q_wb[..],
        &estimate.v_w_mps,
        &estimate.p_w_m,
        &estimate.gyro_bias_rps,
        &estimate.accel_bias_mps2,
        &estimate.covariance,
    ];
    let numbers = parts.into_iter().flatten().map(|number| number.to_bits());
    [estimate.head.stamp_ns]
        .into_iter()
        .chain(numbers)
        .collect()
}

/// Asserts that two series of estimates are the same, bit for bit; so are their flags.
pub fn assert_same(ours: &[EstimateSe23], theirs: &[EstimateSe23]) {
    assert_same_states(ours, theirs);
    for (index, (our, their)) in ours.iter().zip(theirs).enumerate() {
        assert_eq!(
            our.head.flags, their.head.flags,
            "flags of estimate {index}"
        );
    }
}

/// Asserts that two series of estimates have the same stamps, means and covariances, bit for bit.
pub fn assert_same_states(ours: &[EstimateSe23], theirs: &[EstimateSe23]) {
    assert_eq!(ours.len(), theirs.len(), "estimates");
    let different = |(our, their): &(&EstimateSe23, &EstimateSe23)| bits(our) != bits(their);
    if let Some((index, (our, their))) = ours
        .iter()
        .zip(theirs)
        .enumerate()
        .find(|(_, pair)| different(pair))
    {
        panic!(
            "estimate {index} of {}: at {} ns {:?}, at {} ns {:?} m, or another bit",
            ours.len(),
            our.head.stamp_ns,
            our.p_w_m,
            their.head.stamp_ns,
            their.p_w_m
        );
    }
}
