//! The accuracy that is promised on real recordings, through the real `inekf-client replay` and daemon, with the
//! configurations of the project. Needs the folder that `INEKF_DATASETS` names, and says that it skips without.

#[path = "recordings/standstill.rs"]
mod standstill;

use std::path::Path;

use inekf_client::dataset::read_truth;
use inekf_client::evaluate::{DEFAULT_MAX_GAP_NS, Summary, Trajectory, wrap_angle};
use inekf_tests::folder::{Folder, fixes, heading_of, recording, with_heading};
use inekf_tests::process::project_config;
use inekf_tests::replay::{Replayed, replay, replay_smoothed};
use inekf_tests::score::{SECOND_NS, against_fixes, against_truth, gyro_bias};
use nalgebra::Vector3;

fn truth_errors(replayed: &Replayed, recording: &Path, start_s: u64) -> Summary {
    let truth = read_truth(recording.join("truth.csv")).unwrap_or_else(|error| panic!("{error}"));
    against_truth(&replayed.rows, &truth, start_s * SECOND_NS)
}

#[test]
fn a_car_with_noisy_fixes_and_a_heading_ten_degrees_wrong_is_within_two_thirds_of_a_metre() {
    let Some(recording) = recording("kitti00_car_a") else {
        return;
    };
    let folder = Folder::with_files(&recording, &["imu.csv", "meta.json"]);
    folder.take(&recording, "position_noisy.csv", "position.csv");
    let config = project_config("kitti00_car_a");
    for wrong_deg in [10.0, -10.0] {
        let config = with_heading(&config, heading_of(&config) + wrong_deg, 10.0);
        let rmse =
            truth_errors(&replay(folder.path(), &config, &[]), &recording, 30).position_rmse_m;
        println!(
            "heading {wrong_deg} deg wrong: RMSE {:.3} m east, {:.3} m north",
            rmse.x, rmse.y
        );
        assert!(rmse.x <= 0.57 && rmse.y <= 0.66);
    }
}

#[test]
fn smoothing_over_fifty_seconds_more_than_halves_the_error_and_costs_the_newest_state_nothing() {
    let Some(recording) = recording("kitti00_car_a") else {
        return;
    };
    let folder = Folder::with_files(&recording, &["imu.csv", "meta.json"]);
    folder.take(&recording, "position_noisy.csv", "position.csv");
    let filter = replay(folder.path(), &project_config("kitti00_car_a"), &[]);
    let config = project_config("kitti00_car_a_smoother");
    let (smoother, _, states) = replay_smoothed(folder.path(), &config, &[]);

    let [filtered, newest] =
        [&filter, &smoother].map(|replayed| truth_errors(replayed, &recording, 30));
    println!(
        "filter {:.4} m, newest smoothed state {:.4} m",
        filtered.distance_rmse_m, newest.distance_rmse_m
    );
    assert!(newest.distance_rmse_m <= filtered.distance_rmse_m);

    // The states that left the window: all but the last fifty.
    let left = &states[..states.len() - 50];
    assert_eq!(states.len(), fixes(folder.path(), "position.csv").len());
    let truth = read_truth(recording.join("truth.csv")).unwrap_or_else(|error| panic!("{error}"));
    let smoothed = against_truth(left, &truth, 0);
    println!(
        "left the window: RMSE {:.3} m east, {:.3} m north, heading {:.3} deg",
        smoothed.position_rmse_m.x,
        smoothed.position_rmse_m.y,
        smoothed.heading_rmse_rad.to_degrees()
    );
    assert!(smoothed.position_rmse_m.x <= 0.20 && smoothed.position_rmse_m.y <= 0.28);
    assert!(smoothed.heading_rmse_rad.to_degrees() <= 0.4);
}

#[test]
fn a_car_with_sparse_precise_fixes_and_a_heading_eighty_degrees_wrong_does_as_well_as_if_it_knew() {
    let Some(recording) = recording("kitti00_car_a") else {
        return;
    };
    let every = 5;
    let folder = Folder::with_files(&recording, &["imu.csv", "meta.json", "position.csv"]);
    folder.thin("position.csv", every);
    let left_out: Vec<_> = fixes(&recording, "position.csv")
        .into_iter()
        .enumerate()
        .filter(|(index, _)| !index.is_multiple_of(every))
        .map(|(_, fix)| fix)
        .collect();
    let config = project_config("kitti00_car_a");
    let rmse = |config: &str| {
        let replayed = replay(folder.path(), config, &[]);
        let by_axis = against_fixes(&replayed.rows, &left_out, [0.0; 3], 60 * SECOND_NS);
        (by_axis.norm(), by_axis)
    };
    let known = rmse(&config);
    println!("heading known: RMSE {:.3} m", known.0);
    for wrong_deg in [80.0, -80.0] {
        let wrong = rmse(&with_heading(
            &config,
            heading_of(&config) + wrong_deg,
            100.0,
        ));
        println!("heading {wrong_deg} deg wrong: RMSE {:.3} m", wrong.0);
        assert!(wrong.0 <= 1.05 * known.0, "{wrong:?} against {known:?}");
    }
}

#[test]
fn a_drone_with_a_laser_tracker_is_within_eight_centimetres_and_finds_a_large_gyro_bias() {
    let Some(recording) = recording("euroc_mh01_mav") else {
        return;
    };
    let folder = Folder::with_files(&recording, &["imu.csv", "meta.json", "position.csv"]);
    let replayed = replay(folder.path(), &project_config("euroc_mh01_mav"), &[]);
    let rmse = truth_errors(&replayed, &recording, 20).distance_rmse_m;
    let last = replayed.rows.last().expect("a last row");
    let bias = gyro_bias(last);
    println!("RMSE {rmse:.4} m, final gyro bias {bias:?} rad/s");
    assert!(rmse < 0.08);
    // From the recording's notes: the gyro against the truth's attitude.
    assert!((bias - Vector3::new(0.078, -0.021, -0.003)).amax() <= 0.005);
}

/// The car near Boulder: fixes of a stand-alone receiver, 40 s at rest first, and a gyro-bias prior of 0.1 rad/s.
fn boulder(with_velocity: bool) {
    let Some(recording) = recording("rtk_car_boulder") else {
        return;
    };
    let folder = Folder::with_files(&recording, &["imu.csv", "meta.json"]);
    folder.take(&recording, "position_noisy.csv", "position.csv");
    if with_velocity {
        folder.take(&recording, "velocity.csv", "velocity.csv");
    }
    let config = project_config("rtk_car_boulder");
    assert!(config.contains("\ngyro_bias_sigma_rps = 0.1 "));
    let replayed = replay(folder.path(), &config, &[]);

    let start_ns = 120 * SECOND_NS;
    let rtk = fixes(&recording, "position.csv");
    let rmse = against_fixes(&replayed.rows, &rtk, [0.0, 0.05, 0.0], start_ns);
    let reference =
        read_truth(recording.join("reference.csv")).unwrap_or_else(|error| panic!("{error}"));
    let reference = Trajectory::from_truth(&reference);
    let estimate = Trajectory::from_estimates(&replayed.rows);
    let worst_deg = reference
        .poses()
        .iter()
        .filter(|pose| pose.stamp_ns >= start_ns)
        .filter_map(|pose| {
            let ours = estimate.at(pose.stamp_ns, DEFAULT_MAX_GAP_NS)?;
            Some(
                wrap_angle(ours.heading_rad() - pose.heading_rad())
                    .abs()
                    .to_degrees(),
            )
        })
        .fold(0.0, f64::max);
    println!(
        "RMSE {:.3} m east, {:.3} m north; heading at worst {worst_deg:.2} deg off",
        rmse.x, rmse.y
    );
    assert!(rmse.x <= 1.3 && rmse.y <= 1.3);
    assert!(worst_deg > 0.0 && worst_deg <= 10.0);
}

#[test]
fn a_car_that_stands_first_with_a_wide_bias_prior_is_within_a_metre_and_a_third() {
    boulder(false);
}

#[test]
fn a_car_that_stands_first_with_a_wide_bias_prior_does_so_with_velocities_too() {
    boulder(true);
}
