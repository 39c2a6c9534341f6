//! Control requests as raw bytes: granted or refused with a reason, and a refusal changes nothing.
//!
//! The first byte chooses the configuration; requests follow one after the other.

use inekf_service::config::Config;
use inekf_service::daemon::{SmoothedPort, Terms, answer};
use inekf_service::engine::{Engine, History, Model, Use, build};
use inekf_shared::message::{
    CONTROL_BARRIER, CONTROL_CONFIG, CONTROL_OK, CONTROL_PAUSE, CONTROL_REFUSED,
    CONTROL_RELOAD_NOISE, CONTROL_RESET, CONTROL_RESUME, CONTROL_SET_STATE, CONTROL_SMOOTHED,
    CONTROL_SNAPSHOT, CONTROL_TAKE, ControlRequest, MODEL_IMU, MODEL_ODOMETRY_2D,
    MODEL_ODOMETRY_3D, StateVector, Zero, triangle_index,
};

use super::messages::{Nowhere, assert_finite, bits, configs};
use super::raw::{bytes_of, take};

/// The target.
pub fn run(bytes: &[u8]) {
    let Some((choice, rest)) = bytes.split_first() else {
        return;
    };
    let configs = configs();
    let config = &configs[usize::from(*choice) % configs.len()];
    let ask = Ask {
        config,
        bytes: rest,
    };
    if build(config, ask).is_err() {
        panic!("the configuration is good");
    }
}

/// Sends requests to an engine, inputs among them.
struct Ask<'a> {
    config: &'a Config,
    bytes: &'a [u8],
}

impl Use for Ask<'_> {
    type Output = ();

    fn with<M: Model, H: History<M>>(self, mut engine: Engine<M, H>) {
        let terms = Terms {
            config: self.config,
            config_text: "model = 'imu'",
            stepped: true,
            unused_checkpoint: false,
        };
        let mut bytes = self.bytes;
        let mut smoothed = SmoothedPort::closed();
        while let Some((request, rest)) = take::<ControlRequest>(bytes) {
            let before = engine.snapshot();
            let response = answer(&mut engine, &request, &terms, &mut Nowhere, &mut smoothed);
            assert_eq!(response.request_id, request.request_id);
            match response.status {
                // The one answer that has a text without being a refusal.
                CONTROL_OK if request.kind == CONTROL_CONFIG => {}
                CONTROL_OK => assert_eq!(response.reason(), ""),
                CONTROL_REFUSED => {
                    assert!(!response.reason().is_empty());
                    assert_eq!(bits(before.as_ref()), bits(engine.snapshot().as_ref()));
                }
                other => panic!("status {other}"),
            }
            assert_finite(engine.snapshot().as_ref());
            bytes = rest;
        }
    }
}

/// Every kind of request, for each configuration.
pub fn seeds() -> Vec<Vec<u8>> {
    let models = [
        (0, MODEL_IMU, 15),
        (1, MODEL_IMU, 9),
        (2, MODEL_IMU, 15),
        (3, MODEL_ODOMETRY_2D, 3),
        (4, MODEL_ODOMETRY_3D, 6),
    ];
    models
        .iter()
        .map(|(choice, model, dimension)| {
            let mut state = StateVector {
                model: *model,
                dimension: *dimension as u32,
                stamp_ns: 1_000_000_000,
                q_wb: [0.0, 0.0, 0.0, 1.0],
                ..StateVector::ZERO
            };
            for i in 0..*dimension {
                if let Some(index) = triangle_index(i, i, *dimension) {
                    state.covariance[index] = 0.01;
                }
            }
            let kinds = [
                CONTROL_SNAPSHOT,
                CONTROL_SET_STATE,
                CONTROL_SNAPSHOT,
                CONTROL_BARRIER,
                CONTROL_SMOOTHED,
                CONTROL_RESET,
                CONTROL_PAUSE,
                CONTROL_RESUME,
                CONTROL_RELOAD_NOISE,
                CONTROL_CONFIG,
                CONTROL_TAKE,
                CONTROL_SET_STATE,
            ];
            let mut bytes = vec![*choice];
            for (index, kind) in kinds.into_iter().enumerate() {
                bytes.extend(bytes_of(&ControlRequest {
                    kind,
                    request_id: index as u64 + 1,
                    state,
                    ..ControlRequest::ZERO
                }));
            }
            bytes
        })
        .collect()
}
