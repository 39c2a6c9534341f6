//! Zero-velocity detection: an IMU that says the vehicle stands, made into velocity fixes of zero.
//!
//! A vehicle stands if over a window the gyroscope and the accelerometer hardly change, and the gyroscope reads little:
//! by axis, `std(gyro) <= gyro_std_rps`, `std(accel) <= accel_std_mps2`, `|mean(gyro)| <= gyro_mean_rps`. An engine, a
//! road and rotors shake an IMU far more than its own noise does; a vehicle that glides at a constant speed without any
//! shaking (a boat on still water, a simulation without vibration) looks like one that stands, and must not use this.
//!
//! The fix is of the velocity of the IMU, zero in the world, so that the daemon has to know its source
//! (`[[velocity_source]]`). Body axes, SI units.
//!
//! ```
//! use inekf_client::dataset::ImuRow;
//! use inekf_client::standstill::{Standstill, StandstillOptions};
//!
//! let mut standstill = Standstill::new(StandstillOptions::default());
//! let row = |i: u64| ImuRow {
//!     stamp_ns: i * 10_000_000,
//!     gyro_rps: [0.0; 3],
//!     accel_mps2: [0.0, 0.0, 9.81],
//! };
//! let fixes: Vec<_> = (0..100).filter_map(|i| standstill.push(&row(i))).collect();
//! assert!(!fixes.is_empty());
//! assert_eq!(fixes[0].velocity_w_mps, [0.0; 3]);
//! ```

use std::collections::VecDeque;

use crate::dataset::{Dataset, ImuRow, VelocityRow};

/// When a vehicle stands, and what is made of it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StandstillOptions {
    /// Length of the window, s.
    pub window_s: f64,
    /// Largest standard deviation of the angular rate, by axis, rad/s.
    pub gyro_std_rps: f64,
    /// Largest mean of the angular rate, by axis, rad/s: above the gyroscope's bias.
    pub gyro_mean_rps: f64,
    /// Largest standard deviation of the specific force, by axis, m/s^2.
    pub accel_std_mps2: f64,
    /// Time between two fixes, s.
    pub period_s: f64,
    /// Standard deviation of a fix, by axis, m/s.
    pub sigma_mps: f64,
    /// Source that the fixes carry.
    pub source: u32,
}

impl Default for StandstillOptions {
    /// A MEMS IMU on a vehicle with wheels.
    fn default() -> Self {
        Self {
            window_s: 0.5,
            gyro_std_rps: 0.01,
            gyro_mean_rps: 0.03,
            accel_std_mps2: 0.1,
            period_s: 0.2,
            sigma_mps: 0.02,
            source: 0,
        }
    }
}

/// Watches one IMU.
#[derive(Clone, Debug)]
pub struct Standstill {
    options: StandstillOptions,
    window: VecDeque<ImuRow>,
    last_fix_ns: Option<u64>,
}

impl Standstill {
    /// A watch that has seen nothing yet.
    #[must_use]
    pub fn new(options: StandstillOptions) -> Self {
        Self {
            options,
            window: VecDeque::new(),
            last_fix_ns: None,
        }
    }

    /// Takes the next sample; a fix at its stamp if the vehicle stands and one is due.
    pub fn push(&mut self, row: &ImuRow) -> Option<VelocityRow> {
        // A clock that went back begins a new recording.
        if self
            .window
            .back()
            .is_some_and(|last| row.stamp_ns <= last.stamp_ns)
        {
            self.window.clear();
            self.last_fix_ns = None;
        }
        self.window.push_back(*row);
        let window_ns = nanoseconds(self.options.window_s);
        while self
            .window
            .get(1)
            .is_some_and(|second| row.stamp_ns - second.stamp_ns >= window_ns)
        {
            self.window.pop_front();
        }
        let full = row.stamp_ns - self.window.front()?.stamp_ns >= window_ns;
        let due = self.last_fix_ns.is_none_or(|last_ns| {
            row.stamp_ns.saturating_sub(last_ns) >= nanoseconds(self.options.period_s)
        });
        if !(full && due && self.stands()) {
            return None;
        }
        self.last_fix_ns = Some(row.stamp_ns);
        Some(VelocityRow {
            stamp_ns: row.stamp_ns,
            source: self.options.source,
            velocity_w_mps: [0.0; 3],
            sigma_mps: [self.options.sigma_mps; 3],
        })
    }

    /// Whether the window is that of a vehicle that stands.
    fn stands(&self) -> bool {
        let quiet = |values: fn(&ImuRow) -> [f64; 3], largest_std: f64, largest_mean: f64| {
            (0..3).all(|axis| {
                let (mean, std) = mean_and_std(self.window.iter().map(|row| values(row)[axis]));
                std <= largest_std && mean.abs() <= largest_mean
            })
        };
        let options = &self.options;
        // A few samples tell nothing about how much they vary.
        self.window.len() >= 5
            && quiet(
                |row| row.gyro_rps,
                options.gyro_std_rps,
                options.gyro_mean_rps,
            )
            && quiet(|row| row.accel_mps2, options.accel_std_mps2, f64::INFINITY)
    }
}

impl Dataset {
    /// Adds a velocity fix of zero wherever the IMU says that the vehicle stands; returns how many.
    pub fn add_standstill(&mut self, options: &StandstillOptions) -> usize {
        let mut standstill = Standstill::new(*options);
        let before = self.velocity.len();
        let fixes = self.imu.iter().filter_map(|row| standstill.push(row));
        self.velocity.extend(fixes);
        self.sort();
        self.velocity.len() - before
    }
}

fn nanoseconds(seconds: f64) -> u64 {
    (seconds.max(0.0) * 1e9) as u64
}

/// Two passes: the values are far from zero beside their spread.
fn mean_and_std(values: impl Iterator<Item = f64> + Clone) -> (f64, f64) {
    let count = values.clone().count().max(1) as f64;
    let mean = values.clone().sum::<f64>() / count;
    let square = values.map(|value| (value - mean).powi(2)).sum::<f64>() / count;
    (mean, square.sqrt())
}
