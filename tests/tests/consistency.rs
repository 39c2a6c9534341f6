//! The 15-state filter's errors are as large as its covariance says: 200 simulated runs of each scenario, whose prior
//! and noise are exactly those the filter is told.
//!
//! The mean NEES over independent runs is held against its 99 % band at each of several times, and the mean NIS of all
//! position fixes against its own.

use std::collections::HashMap;

use inekf_client::dataset::{Dataset, Truth, TruthRow};
use inekf_client::simulate::{
    InitialOptions, PositionOptions, Scenario, SimulationOptions, simulate,
};
use inekf_service::engine::Outbox;
use inekf_shared::message::{ESTIMATE_UPDATED, EstimateSe23};
use inekf_tests::consistency::{band_99, normalised};
use inekf_tests::in_process;
use inekf_tests::score::SECOND_NS;
use rayon::prelude::*;

const RUNS: usize = 200;
const DURATION_S: u64 = 60;
/// By then the heading, 6 degrees off at the start, has been found.
const CONVERGED_S: u64 = 20;
/// Times at which NEES is looked at: every ten seconds.
const LOOK_EVERY_S: u64 = 10;

fn options(seed: u64) -> SimulationOptions {
    SimulationOptions {
        seed,
        imu_rate_hz: 100.0,
        duration_s: DURATION_S as f64,
        position: Some(PositionOptions {
            rate_hz: 2.0,
            ..PositionOptions::default()
        }),
        initial: Some(InitialOptions::default()),
        ..SimulationOptions::default()
    }
}

/// The configuration that knows exactly what the simulation does.
fn config() -> String {
    let exact = options(0);
    let position = exact.position.expect("position fixes");
    format!(
        "model = 'imu'\n\
         gravity_mps2 = {:?}\n\
         [noise]\n\
         gyro_density = {:?}\n\
         accel_density = {:?}\n\
         gyro_bias_walk = {:?}\n\
         accel_bias_walk = {:?}\n\
         [initial]\n\
         wait_for_request = true\n\
         [[position_source]]\n\
         id = 0\n\
         lever_arm_m = {:?}\n",
        exact.gravity_mps2,
        exact.gyro_density,
        exact.accel_density,
        exact.gyro_bias_walk,
        exact.accel_bias_walk,
        position.lever_arm_b_m,
    )
}

/// Keeps of each look the last estimate of that stamp, and the NIS of every fix after convergence.
#[derive(Default)]
struct Record {
    looks: HashMap<u64, EstimateSe23>,
    nis: Vec<f64>,
}

impl Outbox<EstimateSe23> for Record {
    fn publish(&mut self, estimate: &mut EstimateSe23) {
        let head = &estimate.head;
        if head.stamp_ns < CONVERGED_S * SECOND_NS {
            return;
        }
        if head.stamp_ns.is_multiple_of(LOOK_EVERY_S * SECOND_NS) {
            self.looks.insert(head.stamp_ns, *estimate);
        }
        if head.flags & ESTIMATE_UPDATED != 0 {
            self.nis.push(head.nis[0]);
        }
    }
}

/// What one run tells: NEES by time, and the NIS of its fixes.
struct Run {
    nees: Vec<(u64, f64)>,
    nis: Vec<f64>,
}

fn run(scenario: Scenario, seed: u64, config: &str) -> Run {
    let dataset = simulate(scenario, &options(seed)).expect("it can be simulated");
    let mut record = Record::default();
    let tally = in_process::run(&dataset, config, &mut record);
    assert_eq!(tally.counters.rejected, 0);
    assert_eq!(tally.counters.accepted, DURATION_S * 2);
    let nees = truth(&dataset)
        .iter()
        .filter_map(|row| {
            let estimate = record.looks.get(&row.stamp_ns)?;
            Some((row.stamp_ns, normalised(estimate, row)))
        })
        .collect();
    Run {
        nees,
        nis: record.nis,
    }
}

fn truth(dataset: &Dataset) -> &[TruthRow] {
    match &dataset.truth {
        Truth::Spatial(rows) => rows,
        _ => panic!("the truth is spatial"),
    }
}

fn check(scenario: Scenario) {
    let config = config();
    let runs: Vec<Run> = (1..=RUNS as u64)
        .into_par_iter()
        .map(|seed| run(scenario, seed, &config))
        .collect();

    let (low, high) = band_99(RUNS, 15);
    for look_s in (CONVERGED_S..=DURATION_S).step_by(LOOK_EVERY_S as usize) {
        let at_look = |run: &Run| {
            let found = run.nees.iter().find(|(ns, _)| *ns == look_s * SECOND_NS);
            found.expect("an estimate at each look").1
        };
        let mean = runs.iter().map(at_look).sum::<f64>() / RUNS as f64;
        println!("{scenario} at {look_s} s: mean NEES {mean:.3}, band {low:.3} to {high:.3}");
        assert!((low..=high).contains(&mean));
    }

    let nis: Vec<f64> = runs
        .iter()
        .flat_map(|run| run.nis.iter().copied())
        .collect();
    let (low, high) = band_99(nis.len(), 3);
    let mean = nis.iter().sum::<f64>() / nis.len() as f64;
    println!(
        "{scenario}: mean NIS of {} fixes {mean:.4}, band {low:.4} to {high:.4}",
        nis.len()
    );
    assert!((low..=high).contains(&mean));
}

#[test]
fn errors_on_a_road_are_as_large_as_the_covariance_says() {
    check(Scenario::RoadCircuit);
}

#[test]
fn errors_in_the_air_are_as_large_as_the_covariance_says() {
    check(Scenario::DroneLoops);
}
