//! What came of a fault, and all of them as a Markdown table.

use std::fmt::Write;
use std::time::Duration;

use super::Row;

/// Samples that were sent, and what became of them.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Balance {
    /// Sent by feeders.
    pub sent: u64,
    /// Received by daemons, or answered with an estimate where the daemon was killed.
    pub received: u64,
    /// Known to be lost, from gaps in `seq`.
    pub lost: u64,
}

impl Balance {
    /// Asserts that every sample is accounted for, and gives it back.
    pub fn checked(self) -> Self {
        assert_eq!(self.sent, self.received + self.lost, "{self:?}");
        self
    }
}

/// What came of a fault; anything worse is a panic.
#[derive(Clone, Debug, Default)]
pub struct Outcome {
    /// How often it was inflicted; 0 if it is not possible here, and the note says why.
    pub count: u32,
    /// Who went on.
    pub survivors: &'static str,
    /// From the start of what was killed to the first estimate that goes through it again, start of the process
    /// included; or what the note says.
    pub times: Vec<Duration>,
    /// The samples.
    pub balance: Option<Balance>,
    /// Files in shared memory and of its nodes and services: before, and after all have gone.
    pub files: Option<(usize, usize)>,
    /// Anything else.
    pub note: String,
}

impl Outcome {
    /// That of a fault that cannot be inflicted here.
    pub fn skipped(why: impl Into<String>) -> Self {
        Self {
            note: format!("skipped: {}", why.into()),
            ..Self::default()
        }
    }

    /// Median and maximum of the times, ms.
    pub fn median_and_max_ms(&self) -> Option<(f64, f64)> {
        let mut times = self.times.clone();
        times.sort_unstable();
        let ms = |time: &Duration| time.as_secs_f64() * 1e3;
        Some((ms(times.get(times.len() / 2)?), ms(times.last()?)))
    }

    fn line(&self, row: &Row) -> String {
        let times = self
            .median_and_max_ms()
            .map(|(p50, max)| format!("{p50:.0} / {max:.0}"))
            .unwrap_or_default();
        let balance = self
            .balance
            .map(|b| format!("{} = {} + {}", b.sent, b.received, b.lost))
            .unwrap_or_default();
        let files = self
            .files
            .map(|(before, after)| format!("{before} / {after}"))
            .unwrap_or_default();
        format!(
            "| {} | {} | {} | {times} | {balance} | {files} | {} |\n",
            row.fault, self.count, self.survivors, self.note
        )
    }
}

/// The table; a row that failed has the reason in place of its outcome.
pub fn markdown(rows: &[(&Row, Result<Outcome, String>)]) -> String {
    let mut table = String::from(
        "| fault | times | went on | back after p50 / max, ms | samples sent = received + lost | files before / after | |\n\
         |---|---|---|---|---|---|---|\n",
    );
    for (row, outcome) in rows {
        match outcome {
            Ok(outcome) => table.push_str(&outcome.line(row)),
            // Writing to a string does not fail.
            Err(reason) => {
                let reason = reason.replace('\n', " ").replace('|', "\\|");
                let _ = writeln!(table, "| {} | | | | | | **failed**: {reason} |", row.fault);
            }
        }
    }
    table
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_median_and_the_maximum_are_those_of_the_times() {
        let outcome = Outcome {
            times: [30, 10, 20].map(Duration::from_millis).to_vec(),
            ..Outcome::default()
        };
        assert_eq!(outcome.median_and_max_ms(), Some((20.0, 30.0)));
        assert_eq!(Outcome::default().median_and_max_ms(), None);
    }

    #[test]
    #[should_panic(expected = "lost")]
    fn a_balance_that_does_not_add_up_is_noticed() {
        let balance = Balance {
            sent: 3,
            received: 1,
            lost: 1,
        };
        balance.checked();
    }
}
