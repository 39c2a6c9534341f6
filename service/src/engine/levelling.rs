//! The window of accelerometer readings from which the first attitude is found.

use std::collections::VecDeque;

use inekf::model::ImuInput;
use nalgebra::Vector3;

/// Readings kept at most; at higher rates the window is shorter than asked for.
const CAPACITY: usize = 4096;

/// The most recent readings, over a bounded time.
#[derive(Debug)]
pub struct Levelling {
    window_ns: u64,
    readings: VecDeque<(u64, Vector3<f64>)>,
    /// Stamp of the first reading since the start, in or out of the window.
    first_ns: Option<u64>,
}

impl Levelling {
    /// An empty window of this length, with all the memory it will use.
    pub fn new(window_ns: u64) -> Self {
        Self {
            window_ns,
            readings: VecDeque::with_capacity(CAPACITY),
            first_ns: None,
        }
    }

    /// Forgets all readings.
    pub fn clear(&mut self) {
        self.readings.clear();
        self.first_ns = None;
    }

    /// Adds a reading, forgetting those that have left the window.
    pub fn push(&mut self, stamp_ns: u64, input: &ImuInput) {
        self.first_ns.get_or_insert(stamp_ns);
        if self.readings.len() == CAPACITY {
            self.readings.pop_front();
        }
        self.readings.push_back((stamp_ns, input.force_b));
        while self
            .readings
            .front()
            .is_some_and(|(oldest, _)| stamp_ns.saturating_sub(*oldest) > self.window_ns)
        {
            self.readings.pop_front();
        }
    }

    /// Whether readings have come for as long as the window is.
    pub fn is_full(&self) -> bool {
        match (self.first_ns, self.readings.back()) {
            (Some(first), Some((last, _))) => last - first >= self.window_ns,
            _ => false,
        }
    }

    /// The mean specific force, m/s^2, body frame; `None` without readings.
    pub fn mean_force(&self) -> Option<Vector3<f64>> {
        if self.readings.is_empty() {
            return None;
        }
        let sum: Vector3<f64> = self.readings.iter().map(|(_, force)| *force).sum();
        Some(sum / self.readings.len() as f64)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_has_left_the_window_counts_no_more() {
        let mut window = Levelling::new(1_000);
        let reading = |force_z| ImuInput {
            omega_b: Vector3::zeros(),
            force_b: Vector3::new(0.0, 0.0, force_z),
        };
        window.push(0, &reading(50.0));
        assert!(!window.is_full());
        window.push(1_000, &reading(9.7));
        window.push(1_500, &reading(9.9));
        assert!(window.is_full());
        assert!((window.mean_force().unwrap().z - 9.8).abs() < 1e-12);
    }
}
