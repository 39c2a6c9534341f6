//! A robot's own process: feeds its sensors and reads the estimate, here at rest on the spot.
//!
//! ```sh
//! inekf-service --config my.toml --instance car &
//! cargo run --release --example in_process car
//! ```
//!
//! SI units, radians; body forward-left-up, so that the accelerometer at rest reads +9.81 on z.

use std::error::Error;
use std::time::{Duration, Instant};

use inekf_client::dataset::{ImuRow, PositionRow};
use inekf_client::feed::Feeder;
use inekf_client::read::{EstimateReader, LatestEstimate};
use inekf_shared::clock::monotonic_ns;
use inekf_shared::topic::Instance;

const PERIOD: Duration = Duration::from_millis(5);

fn main() -> Result<(), Box<dyn Error>> {
    let name = std::env::args().nth(1).unwrap_or("default".to_owned());
    let instance = Instance::new(&name)?;
    let mut feeder = Feeder::open(&instance)?;
    // Every estimate in order, as a logger wants it; a controller reads `latest` when it needs one.
    let mut reader: EstimateReader = EstimateReader::open(&instance)?;
    let latest: LatestEstimate = LatestEstimate::open(&instance)?;

    let (mut estimates, mut heard) = (0, 0);
    let started = Instant::now();
    for step in 1..=400_u32 {
        std::thread::sleep((PERIOD * step).saturating_sub(started.elapsed()));
        let stamp_ns = monotonic_ns();
        if step % 40 == 0 {
            feeder.position(&PositionRow {
                stamp_ns,
                source: 0,
                dimension: 3,
                position_w_m: [1.0, 2.0, 3.0],
                sigma_m: [0.5; 3],
            })?;
        }
        heard += feeder.imu(&ImuRow {
            stamp_ns,
            gyro_rps: [0.0; 3],
            accel_mps2: [0.0, 0.0, 9.80665],
        })?;
        while let Some(estimate) = reader.next_estimate()? {
            estimates += 1;
            assert_eq!(estimate.head.dimension, 15, "biases are estimated, too");
        }
    }
    let [x, y, z] = latest.read().p_w_m;
    println!("{heard} samples heard, {estimates} estimates; now at {x:.2} {y:.2} {z:.2} m");
    Ok(())
}
