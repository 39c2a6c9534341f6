//! Keeping time: real time, faster or slower, or as fast as it goes.

use std::fmt;
use std::str::FromStr;
use std::time::{Duration, Instant};

/// How fast recorded time passes.
///
/// ```
/// use inekf_client::pace::Speed;
///
/// assert_eq!("max".parse(), Ok(Speed::Max));
/// assert_eq!("0.5".parse(), Ok(Speed::Times(0.5)));
/// assert!("0".parse::<Speed>().is_err());
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Speed {
    /// This many times real time.
    Times(f64),
    /// As fast as the daemon takes it, without losing a sample.
    Max,
}

impl FromStr for Speed {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        if text == "max" {
            return Ok(Self::Max);
        }
        match text.parse::<f64>() {
            Ok(times) if times.is_finite() && times > 0.0 && times <= 1e6 => Ok(Self::Times(times)),
            _ => Err("a number of times real time, such as 1 or 0.5, or max".to_owned()),
        }
    }
}

impl fmt::Display for Speed {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Times(times) => write!(formatter, "{times}"),
            Self::Max => formatter.write_str("max"),
        }
    }
}

/// The last stretch before a deadline is spun, for sleeping overshoots.
const SPUN: Duration = Duration::from_micros(150);

/// Maps stamps to deadlines on this machine's clock.
///
/// ```
/// use std::time::Instant;
///
/// use inekf_client::pace::Pace;
///
/// // A hundred times as fast: a sample a second later is due in 10 ms.
/// let pace = Pace::new(0, 100.0);
/// assert!(pace.deadline(1_000_000_000) > Instant::now());
/// ```
#[derive(Clone, Copy, Debug)]
pub struct Pace {
    start: Instant,
    first_ns: u64,
    times: f64,
}

impl Pace {
    /// A pace at which the stamp `first_ns` is now.
    ///
    /// ```
    /// use inekf_client::pace::Pace;
    /// use std::time::Instant;
    ///
    /// // What begins now is due now.
    /// let pace = Pace::new(5_000_000_000, 1.0);
    /// assert!(pace.deadline(5_000_000_000) <= Instant::now());
    /// ```
    pub fn new(first_ns: u64, times: f64) -> Self {
        Self {
            start: Instant::now(),
            first_ns,
            times,
        }
    }

    /// When `stamp_ns` is due.
    ///
    /// ```
    /// use std::time::Duration;
    ///
    /// use inekf_client::pace::Pace;
    ///
    /// // At half speed a second of data takes two, and what is in the past is due at once.
    /// let pace = Pace::new(5_000_000_000, 0.5);
    /// let start = pace.deadline(5_000_000_000);
    /// assert_eq!(pace.deadline(6_000_000_000) - start, Duration::from_secs(2));
    /// assert_eq!(pace.deadline(1), start);
    /// ```
    pub fn deadline(&self, stamp_ns: u64) -> Instant {
        let ahead_s = stamp_ns.saturating_sub(self.first_ns) as f64 * 1e-9 / self.times;
        self.start + Duration::from_secs_f64(ahead_s)
    }

    /// Waits until `stamp_ns` is due, asleep for most of it.
    ///
    /// ```
    /// use std::time::Instant;
    ///
    /// use inekf_client::pace::Pace;
    ///
    /// let pace = Pace::new(0, 1.0);
    /// pace.wait(1_000_000);
    /// // Never too early.
    /// assert!(Instant::now() >= pace.deadline(1_000_000));
    /// ```
    pub fn wait(&self, stamp_ns: u64) {
        let deadline = self.deadline(stamp_ns);
        let ahead = deadline.saturating_duration_since(Instant::now());
        if ahead > SPUN {
            std::thread::sleep(ahead - SPUN);
        }
        while Instant::now() < deadline {
            std::hint::spin_loop();
        }
    }
}
