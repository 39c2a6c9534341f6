//! What it was measured on: read from `/proc`; what the system does not say is left out.

use std::fs;

use inekf_shared::clock::monotonic_ns;
use serde_json::{Value, json};

/// Readings of the clock to tell its cost from.
const READINGS: u64 = 10_000;

/// The machine and its load.
#[derive(Clone, Debug)]
pub struct Machine {
    /// Name of the processor.
    pub cpu_model: String,
    /// How many this process may use.
    pub processors: usize,
    /// The two that were measured on.
    pub pinned: [usize; 2],
    /// Release of the kernel.
    pub kernel: String,
    /// Whether the processor says that it is a virtual one.
    pub hypervisor: bool,
    /// Cost of reading the clock, ns; a round holds one.
    pub clock_ns: f64,
    /// The load average of one minute at the start and at the end.
    pub load: [Option<f64>; 2],
    /// Share of all processors' time that the hypervisor gave to others meanwhile.
    pub stolen: Option<f64>,
    steal_at_start: Option<Ticks>,
}

/// Ticks of all processors since boot: all of them, and those the hypervisor kept.
type Ticks = (u64, u64);

impl Machine {
    /// Describes this machine at the start of a measurement.
    pub fn describe(processors: usize, pinned: [usize; 2]) -> Self {
        let cpu = text("/proc/cpuinfo");
        let cpu_model = field(&cpu, "model name").unwrap_or("unknown").to_owned();
        let mut flags = field(&cpu, "flags").unwrap_or("").split_whitespace();
        Self {
            cpu_model,
            processors,
            pinned,
            kernel: text("/proc/sys/kernel/osrelease").trim().to_owned(),
            hypervisor: flags.any(|flag| flag == "hypervisor"),
            clock_ns: clock_cost_ns(),
            load: [load(), None],
            stolen: None,
            steal_at_start: steal(&text("/proc/stat")),
        }
    }

    /// Takes the load at the end.
    pub fn finish(&mut self) {
        self.load[1] = load();
        let now = steal(&text("/proc/stat"));
        self.stolen = self.steal_at_start.zip(now).map(|(start, now)| {
            let all = now.0.saturating_sub(start.0).max(1);
            now.1.saturating_sub(start.1) as f64 / all as f64
        });
    }

    /// For programs.
    pub fn json(&self) -> Value {
        json!({
            "cpu_model": self.cpu_model,
            "processors": self.processors,
            "pinned_to": self.pinned,
            "kernel": self.kernel,
            "hypervisor": self.hypervisor,
            "clock_ns": self.clock_ns,
            "load_average_start": self.load[0],
            "load_average_end": self.load[1],
            "stolen_share": self.stolen,
        })
    }

    /// For people: two lines.
    pub fn text(&self) -> String {
        let kind = if self.hypervisor { ", virtual" } else { "" };
        let number =
            |value: Option<f64>| value.map_or("?".to_owned(), |value| format!("{value:.2}"));
        format!(
            "machine  {}, {} processors{kind}, kernel {}\n\
             load     {} at the start, {} at the end; {} % stolen; processors {} and {}; reading the \
             clock {:.0} ns\n",
            self.cpu_model,
            self.processors,
            self.kernel,
            number(self.load[0]),
            number(self.load[1]),
            number(self.stolen.map(|share| 100.0 * share)),
            self.pinned[0],
            self.pinned[1],
            self.clock_ns,
        )
    }
}

fn text(file: &str) -> String {
    fs::read_to_string(file).unwrap_or_default()
}

/// The first line `name : value`.
fn field<'a>(text: &'a str, name: &str) -> Option<&'a str> {
    let mut pairs = text.lines().filter_map(|line| line.split_once(':'));
    let found = pairs.find(|(key, _)| key.trim() == name);
    found.map(|(_, value)| value.trim())
}

fn load() -> Option<f64> {
    text("/proc/loadavg").split(' ').next()?.parse().ok()
}

/// From the line `cpu user nice system idle iowait irq softirq steal ..`.
fn steal(stat: &str) -> Option<Ticks> {
    let line = stat.lines().next()?.strip_prefix("cpu ")?;
    let ticks: Option<Vec<u64>> = line
        .split_whitespace()
        .map(|tick| tick.parse().ok())
        .collect();
    let ticks = ticks?;
    Some((ticks.iter().take(8).sum(), *ticks.get(7)?))
}

fn clock_cost_ns() -> f64 {
    let started_ns = monotonic_ns();
    for _ in 0..READINGS {
        std::hint::black_box(monotonic_ns());
    }
    (monotonic_ns() - started_ns) as f64 / READINGS as f64
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn fields_and_stolen_ticks_are_found() {
        let cpu = "processor\t: 0\nmodel name\t: A CPU: fast\nflags\t\t: fpu hypervisor\n";
        assert_eq!(field(cpu, "model name"), Some("A CPU: fast"));
        assert_eq!(field(cpu, "bugs"), None);
        let stat = "cpu  10 0 20 30 0 0 0 40 5 5\ncpu0 1 2 3 4 5 6 7 8 9 10\n";
        assert_eq!(steal(stat), Some((100, 40)));
        assert_eq!(steal("intr 1"), None);
    }
}
