//! Zero-velocity detection on recordings, against their true speed: where it fires the vehicle stands, what it is worth
//! there, and that it costs nothing elsewhere. The engine runs in this process.

use std::path::Path;

use inekf_client::dataset::{Dataset, Truth, TruthRow, read_truth};
use inekf_shared::message::{ESTIMATE_PROPAGATED, EstimateSe23, ZERO_VELOCITY_SOURCE};
use inekf_tests::folder::{Folder, recording};
use inekf_tests::in_process;
use inekf_tests::process::project_config;
use inekf_tests::score::{SECOND_NS, assert_same};
use nalgebra::Vector3;

/// A recording with noisy fixes, its truth, and the estimates without and with detection.
struct Compared {
    truth: Vec<TruthRow>,
    without: Vec<EstimateSe23>,
    with: Vec<EstimateSe23>,
}

fn compared(name: &str, truth: &str, more: &str) -> Option<Compared> {
    let recording = recording(name)?;
    let folder = Folder::with_files(&recording, &["imu.csv", "meta.json"]);
    folder.take(&recording, "position_noisy.csv", "position.csv");
    let dataset = Dataset::load(folder.path()).unwrap_or_else(|error| panic!("{error}"));
    let config = project_config(name);
    let run = |config: &str| {
        let mut estimates = Vec::new();
        in_process::run(&dataset, config, &mut estimates);
        estimates
    };
    Some(Compared {
        truth: spatial(&recording.join(truth)),
        without: run(&config),
        with: run(&format!("{config}\n[zero_velocity]\n{more}")),
    })
}

fn spatial(file: &Path) -> Vec<TruthRow> {
    match read_truth(file).unwrap_or_else(|error| panic!("{error}")) {
        Truth::Spatial(rows) => rows,
        other => panic!("{other:?}"),
    }
}

impl Compared {
    /// The truth next to a stamp.
    fn at(&self, stamp_ns: u64) -> &TruthRow {
        let later = self.truth.partition_point(|row| row.stamp_ns < stamp_ns);
        &self.truth[later.min(self.truth.len() - 1)]
    }

    fn true_speed(&self, stamp_ns: u64) -> f64 {
        Vector3::from(self.at(stamp_ns).v_w_mps).norm()
    }

    /// True speeds where detection fired, m/s, the least first.
    fn fired_at(&self) -> Vec<f64> {
        let fired = self
            .with
            .iter()
            .filter(|estimate| estimate.head.source == ZERO_VELOCITY_SOURCE);
        let mut speeds: Vec<f64> = fired
            .map(|estimate| self.true_speed(estimate.head.stamp_ns))
            .collect();
        speeds.sort_by(f64::total_cmp);
        speeds
    }

    /// RMS of what `error` says of the propagated estimates that `counts`.
    fn rms(
        &self,
        estimates: &[EstimateSe23],
        counts: impl Fn(u64) -> bool,
        error: impl Fn(&EstimateSe23, &TruthRow) -> f64,
    ) -> f64 {
        let squares: Vec<f64> = estimates
            .iter()
            .filter(|estimate| estimate.head.flags & ESTIMATE_PROPAGATED != 0)
            .filter(|estimate| counts(estimate.head.stamp_ns))
            .map(|estimate| error(estimate, self.at(estimate.head.stamp_ns)).powi(2))
            .collect();
        (squares.iter().sum::<f64>() / squares.len() as f64).sqrt()
    }
}

fn speed(estimate: &EstimateSe23, _truth: &TruthRow) -> f64 {
    Vector3::from(estimate.v_w_mps).norm()
}

/// Horizontal distance, m.
fn distance(estimate: &EstimateSe23, truth: &TruthRow) -> f64 {
    (Vector3::from(estimate.p_w_m) - Vector3::from(truth.p_w_m))
        .xy()
        .norm()
}

#[test]
fn a_car_that_stands_with_its_engine_running_is_held_and_a_drive_is_none_the_worse() {
    let Some(boulder) = compared("rtk_car_boulder", "reference.csv", "") else {
        return;
    };
    let fired = boulder.fired_at();
    let fastest = *fired.last().expect("it stands for 40 s");
    let stands = |stamp_ns| boulder.true_speed(stamp_ns) < 0.03;
    let at_rest = [&boulder.without, &boulder.with].map(|estimates| {
        (
            boulder.rms(estimates, stands, speed),
            boulder.rms(estimates, stands, distance),
        )
    });
    let drives = |stamp_ns| stamp_ns > 120 * SECOND_NS;
    let driving =
        [&boulder.without, &boulder.with].map(|estimates| boulder.rms(estimates, drives, distance));
    println!(
        "{} fixes of zero, at {fastest:.3} m/s at most; at rest (speed m/s, position m) {at_rest:.2?}; driving (m) {driving:.2?}",
        fired.len()
    );
    assert!(fired.len() >= 100);
    assert!(fastest < 0.05, "it fired at {fastest} m/s");
    assert!(at_rest[1].0 < 0.2 * at_rest[0].0 && at_rest[1].1 < 0.6 * at_rest[0].1);
    assert!(driving[1] <= driving[0]);
}

#[test]
fn limits_twice_as_wide_do_not_take_a_moving_car_for_one_that_stands() {
    let wide = "accel_std_mps2 = 0.6\ngyro_std_rps = 0.12\naccel_change_mps2 = 0.2\ngyro_change_rps = 0.04\nspeed_mps = 4.0\n";
    let Some(boulder) = compared("rtk_car_boulder", "reference.csv", wide) else {
        return;
    };
    let fastest = boulder.fired_at().last().copied();
    println!("wide limits: at {fastest:?} m/s at most");
    assert!(fastest.is_some_and(|fastest| fastest < 0.15));
}

#[test]
fn smooth_driving_is_not_taken_for_rest_and_nothing_changes() {
    let Some(kitti) = compared("kitti00_car_a", "truth.csv", "") else {
        return;
    };
    assert!(kitti.fired_at().is_empty());
    assert_same(&kitti.with, &kitti.without);
    // An IMU that is quiet, and no more, is no proof: at any speed limit it fires at more than 5 m/s.
    let imu_alone =
        "after_s = 1.0\naccel_change_mps2 = 100.0\ngyro_change_rps = 10.0\nspeed_mps = 10.0\n";
    let Some(kitti) = compared("kitti00_car_a", "truth.csv", imu_alone) else {
        return;
    };
    let fastest = kitti.fired_at().last().copied();
    assert!(fastest.is_some_and(|fastest| fastest > 5.0), "{fastest:?}");
}
