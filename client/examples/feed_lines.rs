//! Feeds an IMU that writes lines `t_ns gx gy gz ax ay az` (rad/s, m/s^2, body forward-left-up) to standard input.

use std::error::Error;
use std::io::BufRead;

use inekf_client::dataset::ImuRow;
use inekf_client::feed::Feeder;
use inekf_shared::topic::Instance;

fn main() -> Result<(), Box<dyn Error>> {
    let name = std::env::args().nth(1).unwrap_or("default".to_owned());
    let mut feeder = Feeder::open(&Instance::new(&name)?)?;
    let (mut sent, mut heard) = (0, 0);
    for line in std::io::stdin().lock().lines() {
        let line = line?;
        let mut words = line.split([',', ' ']);
        // A header, or a line that was cut off: not a sample.
        let Some(Ok(stamp_ns)) = words.next().map(str::parse) else {
            continue;
        };
        let Ok(values) = words.map(str::parse).collect::<Result<Vec<f64>, _>>() else {
            continue;
        };
        let [gx, gy, gz, ax, ay, az] = values[..] else {
            continue;
        };
        let row = ImuRow {
            stamp_ns,
            gyro_rps: [gx, gy, gz],
            accel_mps2: [ax, ay, az],
        };
        heard += feeder.imu(&row)?;
        sent += 1;
    }
    println!("sent {sent} samples, {heard} of them heard by a daemon");
    Ok(())
}
