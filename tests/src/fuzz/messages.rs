//! Input messages as raw bytes, into an engine of any model.
//!
//! The first byte of the input chooses the configuration; then, again and again, one byte chooses the kind of message
//! and the message's bytes follow. What must hold after each: every published number of the state is finite; if the
//! message was refused the state is what it was, bit for bit; and every message is counted.

use std::sync::OnceLock;

use inekf_service::config::Config;
use inekf_service::engine::{Engine, History, Model, Outbox, Use, build};
use inekf_shared::message::{
    EstimateMessage, Header, HeadingFix, INPUT_HEADING, INPUT_POSITION, INPUT_VELOCITY, ImuSample,
    Odometry2d, Odometry3d, PositionFix, REASON_INTERNAL, StateVector, VelocityFix, Zero,
};
use inekf_shared::transport::InputMessage;

use super::raw::{bytes_of, take};

/// The configurations: every model, filter and smoother, with a gate and a small memory.
pub(super) fn configs() -> &'static [Config] {
    const ENDS: &str =
        "[late]\ncapacity = 8\n[update]\ngate_probability = 0.9999\nrecover_after = 2\n";
    const INERTIAL: &str = "[noise]\ngyro_density = 3e-4\naccel_density = 2e-2\ngyro_bias_walk = 1e-5\n\
                            [initial]\nlevel = 'given'\nposition_m = [0.0, 0.0, 0.0]\n\
                            [[velocity_source]]\nid = 0\n";
    const ODOMETRY: &str = "[noise]\nrotation_density = 3e-3\ntranslation_density = 1e-2\n\
                            [initial]\nposition_m = [0.0, 0.0]\n";
    static CONFIGS: OnceLock<Vec<Config>> = OnceLock::new();
    CONFIGS.get_or_init(|| {
        let space = ODOMETRY.replace("[0.0, 0.0]", "[0.0, 0.0, 0.0]");
        [
            format!("model = 'imu'\n{INERTIAL}[[heading_source]]\nid = 0\n{ENDS}"),
            format!("model = 'imu'\nbiases = false\ninvariance = 'right'\n{INERTIAL}{ENDS}"),
            format!(
                "model = 'imu'\nestimator = 'smoother'\n{INERTIAL}[smoother]\nwindow = 4\n{ENDS}"
            ),
            format!("model = 'odometry2d'\n{ODOMETRY}{ENDS}"),
            format!("model = 'odometry3d'\n{space}{ENDS}"),
        ]
        .iter()
        .map(|text| Config::from_toml_str(text, "fuzz").unwrap_or_else(|faults| panic!("{faults}")))
        .collect()
    })
}

/// The target.
pub fn run(bytes: &[u8]) {
    let Some((choice, rest)) = bytes.split_first() else {
        return;
    };
    let configs = configs();
    let config = &configs[usize::from(*choice) % configs.len()];
    if build(config, Feed(rest)).is_err() {
        panic!("the configuration is good");
    }
}

/// Feeds an engine.
struct Feed<'a>(&'a [u8]);

/// Where estimates go that nobody reads.
pub(super) struct Nowhere;

impl<E: EstimateMessage> Outbox<E> for Nowhere {
    fn publish(&mut self, _estimate: &mut E) {}
}

impl Use for Feed<'_> {
    type Output = ();

    fn with<M: Model, H: History<M>>(self, mut engine: Engine<M, H>) {
        let mut bytes = self.0;
        let mut fed = 0;
        while let Some((kind, rest)) = bytes.split_first() {
            let before = engine.snapshot();
            let refused = |engine: &Engine<M, H>| {
                let tally = engine.tally();
                let broken = tally.rejected_by_reason[REASON_INTERNAL as usize];
                (tally.counters.rejected, broken)
            };
            let (rejected, broken) = refused(&engine);
            let left = match kind % 4 {
                0 => take::<M::Sample>(rest).map(|(sample, left)| {
                    engine.sample(&sample, 0, &mut Nowhere);
                    left
                }),
                1 => take::<PositionFix>(rest).map(|(fix, left)| {
                    engine.position(&fix, &mut Nowhere);
                    left
                }),
                2 => take::<VelocityFix>(rest).map(|(fix, left)| {
                    engine.velocity(&fix, &mut Nowhere);
                    left
                }),
                _ => take::<HeadingFix>(rest).map(|(fix, left)| {
                    engine.heading(&fix, &mut Nowhere);
                    left
                }),
            };
            let Some(left) = left else { break };
            fed += 1;
            let after = engine.snapshot();
            let (rejected_now, broken_now) = refused(&engine);
            // A message that is refused changes nothing. A sample that is let in may take waiting fixes with it into a
            // restart, and those are counted as refused: then the sample itself was not.
            let only_it = rejected_now == rejected + 1 && broken_now == broken;
            if only_it && kind % 4 != 0 {
                assert_eq!(bits(before.as_ref()), bits(after.as_ref()));
            }
            assert_finite(after.as_ref());
            bytes = left;
        }
        let tally = engine.tally();
        assert_eq!(tally.received.iter().sum::<u64>(), fed);
        engine.finish(&mut Nowhere);
        let tally = engine.tally();
        let counters = tally.counters;
        assert_eq!(
            counters.rejected,
            tally.rejected_by_reason.iter().sum::<u64>()
        );
        let fixes: u64 = [INPUT_POSITION, INPUT_VELOCITY, INPUT_HEADING]
            .map(|input| tally.received[input])
            .iter()
            .sum();
        let judged = counters.accepted + counters.gated + counters.late + counters.unpaired;
        assert!(judged + counters.rejected >= fixes, "{tally:?}");
    }
}

pub(super) fn bits(state: Option<&StateVector>) -> Option<Vec<u8>> {
    state.map(bytes_of)
}

pub(super) fn assert_finite(state: Option<&StateVector>) {
    let Some(state) = state else { return };
    let numbers = state
        .q_wb
        .iter()
        .chain(&state.v_w_mps)
        .chain(&state.p_w_m)
        .chain(&state.gyro_bias_rps)
        .chain(&state.accel_bias_mps2)
        .chain(&state.covariance);
    assert!(numbers.copied().all(f64::is_finite), "{state:?}");
}

/// For each configuration a stream of samples with fixes.
pub fn seeds() -> Vec<Vec<u8>> {
    (0..configs().len()).map(stream).collect()
}

fn header(index: u64) -> Header {
    Header {
        stamp_ns: 1_000_000_000 + index * 100_000_000,
        seq: index,
        sent_ns: 1,
        epoch: 1,
    }
}

/// A stream for the configuration at `choice`.
fn stream(choice: usize) -> Vec<u8> {
    let mut bytes = vec![choice as u8];
    for index in 0..6 {
        bytes.push(0);
        match choice {
            0..=2 => bytes.extend(sample(ImuSample {
                header: header(index),
                gyro_rps: [0.0, 0.0, 0.1],
                accel_mps2: [0.0, 0.1, 9.8],
            })),
            3 => bytes.extend(sample(Odometry2d {
                header: header(index),
                translation_m: [0.5, 0.0],
                ..Odometry2d::ZERO
            })),
            _ => bytes.extend(sample(Odometry3d {
                header: header(index),
                translation_m: [0.5, 0.0, 0.0],
                ..Odometry3d::ZERO
            })),
        }
        let unit = [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0];
        bytes.push(1);
        bytes.extend(sample(PositionFix {
            header: header(index),
            source: 0,
            dimension: 3,
            position_w_m: [0.1 * index as f64, 0.0, 0.0],
            covariance_w_m2: unit,
        }));
        if index == 3 {
            bytes.push(2);
            bytes.extend(sample(VelocityFix {
                header: header(index),
                covariance_w: unit,
                ..VelocityFix::ZERO
            }));
            bytes.push(3);
            bytes.extend(sample(HeadingFix {
                header: header(index),
                sigma_rad: 0.1,
                ..HeadingFix::ZERO
            }));
        }
    }
    bytes
}

fn sample<M: InputMessage>(message: M) -> Vec<u8> {
    bytes_of(&message)
}
