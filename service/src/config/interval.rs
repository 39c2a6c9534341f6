//! The range of numbers a key accepts, worded for people: `0 to 30`, `above 0, at most 60`.

use std::fmt;

/// A range of finite numbers whose two ends each may or may not belong to it.
#[derive(Clone, Copy, Debug)]
pub(super) struct Interval {
    low: f64,
    high: f64,
    has_low: bool,
    has_high: bool,
}

impl Interval {
    /// `low ..= high`: both ends are allowed.
    pub(super) const fn closed(low: f64, high: f64) -> Self {
        Self {
            low,
            high,
            has_low: true,
            has_high: true,
        }
    }

    /// Above `low`, up to and including `high`: for sizes and times that must not vanish.
    pub(super) const fn above(low: f64, high: f64) -> Self {
        Self {
            low,
            high,
            has_low: false,
            has_high: true,
        }
    }

    /// Strictly between `low` and `high`: for probabilities.
    pub(super) const fn open(low: f64, high: f64) -> Self {
        Self {
            low,
            high,
            has_low: false,
            has_high: false,
        }
    }

    /// Whether `value` lies in the range. NaN and the infinities never do.
    pub(super) fn contains(&self, value: f64) -> bool {
        let above_low = value > self.low || (self.has_low && value == self.low);
        let below_high = value < self.high || (self.has_high && value == self.high);
        above_low && below_high
    }
}

impl fmt::Display for Interval {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { low, high, .. } = self;
        match (self.has_low, self.has_high) {
            (true, true) => write!(f, "{low} to {high}"),
            (false, true) => write!(f, "above {low}, at most {high}"),
            (true, false) => write!(f, "at least {low}, below {high}"),
            (false, false) => write!(f, "above {low}, below {high}"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::Interval;

    #[test]
    fn ends_belong_as_the_wording_says() {
        let cases = [
            (Interval::closed(0.0, 1.0), "0 to 1", true, true),
            (Interval::above(0.0, 1.0), "above 0, at most 1", false, true),
            (Interval::open(0.0, 1.0), "above 0, below 1", false, false),
        ];
        for (interval, wording, low, high) in cases {
            assert_eq!(interval.to_string(), wording);
            assert_eq!(interval.contains(0.0), low, "{wording}: 0");
            assert_eq!(interval.contains(1.0), high, "{wording}: 1");
            assert!(interval.contains(0.5), "{wording}: 0.5");
            for outside in [
                -1e-300,
                1.0 + f64::EPSILON,
                f64::NAN,
                f64::INFINITY,
                f64::NEG_INFINITY,
            ] {
                assert!(!interval.contains(outside), "{wording}: {outside}");
            }
        }
    }
}
