//! Many vehicles in one daemon: at what rate and number does a sample first come late?
//!
//! Two processors: the daemon spins on one, with all vehicles on one thread; this process feeds every vehicle in turn at
//! even distances from the other, and reads every estimate. A sample is late if its estimate is published a period
//! after it was sent or later, when the next one is due.

use std::fmt::Write;

use anyhow::{Context, bail, ensure};
use clap::Args;
use hdrhistogram::Histogram;
use inekf_client::daemon::{Daemon, private_instance};
use inekf_client::dataset::ImuRow;
use inekf_client::feed::Numbering;
use inekf_client::plot::format_ns;
use inekf_shared::clock::monotonic_ns;
use inekf_shared::message::{EstimateSe23, ImuSample};
use inekf_shared::topic::Instance;
use inekf_shared::transport::{self, Node, Outlet, Subscriber};

use crate::latency::row::histogram;
use crate::pin;
use crate::progress::progress;

/// Samples of each vehicle before anything counts: the first state takes ten.
const WARM_UP: u64 = 100;
/// After the last sample estimates may take this long.
const DRAIN_NS: u64 = 1_000_000_000;
/// Vehicles read after each sample that is sent: more than one, or reading would never catch up.
const READ_PER_SEND: usize = 2;
/// Estimates taken of a vehicle at a time.
const READ_AT_ONCE: usize = 8;

/// What to measure.
#[derive(Args, Clone, Debug)]
pub struct FleetOptions {
    /// Vehicles.
    #[arg(long, default_value_t = 100)]
    pub instances: usize,
    /// Samples of each a second.
    #[arg(long, default_value_t = 1000)]
    pub rate: u64,
    /// For so long.
    #[arg(long, default_value_t = 5)]
    pub seconds: u64,
    /// Nine states instead of fifteen.
    #[arg(long)]
    pub without_biases: bool,
}

/// One vehicle as this process sees it.
struct Vehicle {
    samples: Outlet<ImuSample>,
    estimates: Subscriber<EstimateSe23>,
    numbering: Numbering,
}

/// What came of it. All lengths are nanoseconds.
#[derive(Debug)]
pub struct FleetReport {
    options: FleetOptions,
    sent: u64,
    answered: u64,
    late: u64,
    /// Samples that this process itself sent a period behind their time, or more.
    behind: u64,
    /// From the sample's sending to its estimate's publishing.
    answer: Histogram<u64>,
    /// From the sample in the daemon's hand to its estimate's publishing.
    inside: Histogram<u64>,
}

/// Measures.
///
/// # Errors
/// An option is out of range, the daemon cannot serve so many, or there is one processor only.
pub fn measure(options: &FleetOptions) -> anyhow::Result<FleetReport> {
    ensure!(
        (1..=4096).contains(&options.instances) && (1..=100_000).contains(&options.rate),
        "--instances has to be 1 to 4096, --rate 1 to 100000"
    );
    let processors = pin::processors()?;
    let [here, there, ..] = processors[..] else {
        bail!("two processors are needed: one for the daemon, one for those it serves");
    };
    let folder = tempfile::tempdir()?;
    let file = folder.path().join("fleet.toml");
    std::fs::write(&file, config(options, there))?;
    let name = private_instance("fleet")?;
    let last = options.instances - 1;
    let daemon = Daemon::start_fleet(&file, &format!("{name}-{{0..{last}}}"))?;
    pin::pin(None, here)?;
    let node = transport::open_node("inekf-bench")?;
    let bar = progress("vehicles opened", options.instances as u64);
    let mut vehicles = Vec::with_capacity(options.instances);
    for index in 0..options.instances {
        let instance = Instance::new(&format!("{name}-{index}"))?;
        vehicles.push(Vehicle::open(&node, &instance)?);
        bar.inc(1);
    }
    bar.finish_and_clear();
    let mut report = FleetReport {
        options: options.clone(),
        sent: 0,
        answered: 0,
        late: 0,
        behind: 0,
        answer: histogram()?,
        inside: histogram()?,
    };
    report.drive(&mut vehicles)?;
    daemon.stop()?;
    Ok(report)
}

/// No fixes, a given place, and a short past to go back to: what a vehicle in a simulator needs.
fn config(options: &FleetOptions, cpu: usize) -> String {
    format!(
        "model = \"imu\"\nbiases = {}\n\
         [noise]\ngyro_density = 1e-3\naccel_density = 1e-2\n\
         [initial]\nposition_m = [0.0, 0.0, 0.0]\nlevel_window_s = 0.01\n\
         [late]\nwindow_s = 0.1\ncapacity = 128\n\
         [runtime]\nwait = \"spin\"\ncpu = {cpu}\n",
        !options.without_biases
    )
}

impl Vehicle {
    fn open(node: &Node, instance: &Instance) -> anyhow::Result<Self> {
        let samples = transport::input::<ImuSample>(node, instance)?.publisher()?;
        let estimates = transport::estimate::<EstimateSe23>(node, instance)?.subscriber()?;
        Ok(Self {
            samples: Outlet::new(samples, 1),
            estimates,
            numbering: Numbering::new(monotonic_ns()),
        })
    }

    fn send(&mut self, stamp_ns: u64) -> anyhow::Result<()> {
        let row = ImuRow {
            stamp_ns,
            gyro_rps: [0.0, 0.0, 0.1],
            accel_mps2: [0.1, 0.0, 9.80665],
        };
        let message = self.numbering.imu(&row, monotonic_ns());
        self.samples.send(&message).context("sending a sample")?;
        self.samples.restock();
        Ok(())
    }
}

impl FleetReport {
    /// Feeds all vehicles and reads their estimates.
    fn drive(&mut self, vehicles: &mut [Vehicle]) -> anyhow::Result<()> {
        let period_ns = 1_000_000_000 / self.options.rate;
        let count = vehicles.len() as u64;
        let last = WARM_UP + self.options.rate * self.options.seconds;
        let bar = progress("periods", last);
        let first_counted_ns = WARM_UP * period_ns;
        let mut next_read = 0;
        let start_ns = monotonic_ns() + period_ns;
        for step in 1..=last {
            for index in 0..vehicles.len() {
                let due_ns = start_ns + step * period_ns + index as u64 * period_ns / count;
                loop {
                    for _ in 0..READ_PER_SEND {
                        next_read = (next_read + 1) % vehicles.len();
                        self.read(&vehicles[next_read], first_counted_ns, period_ns)?;
                    }
                    if monotonic_ns() >= due_ns {
                        break;
                    }
                }
                vehicles[index].send(step * period_ns)?;
                if step > WARM_UP {
                    self.sent += 1;
                    self.behind += u64::from(monotonic_ns() > due_ns + period_ns);
                }
            }
            bar.inc(1);
        }
        bar.finish_and_clear();
        let end_ns = monotonic_ns() + DRAIN_NS;
        while self.answered < self.sent && monotonic_ns() < end_ns {
            for vehicle in &*vehicles {
                self.read(vehicle, first_counted_ns, period_ns)?;
            }
        }
        Ok(())
    }

    fn read(
        &mut self,
        vehicle: &Vehicle,
        first_counted_ns: u64,
        period_ns: u64,
    ) -> anyhow::Result<()> {
        for _ in 0..READ_AT_ONCE {
            let Some(estimate) = vehicle.estimates.receive()? else {
                break;
            };
            let head = &estimate.head;
            if head.stamp_ns <= first_counted_ns {
                continue;
            }
            let answer_ns = head.published_ns.saturating_sub(head.sent_ns);
            let inside_ns = head.published_ns.saturating_sub(head.received_ns);
            self.answer.saturating_record(answer_ns);
            self.inside.saturating_record(inside_ns);
            self.answered += 1;
            self.late += u64::from(answer_ns >= period_ns);
        }
        Ok(())
    }

    /// For people.
    pub fn text(&self) -> String {
        let figures = |histogram: &Histogram<u64>| {
            let mut text = String::new();
            for (name, quantile) in [("p50", 0.5), ("p99", 0.99), ("p99.9", 0.999), ("max", 1.0)] {
                let figure = format_ns(histogram.value_at_quantile(quantile) as f64);
                let _ = write!(text, "  {name} {figure}");
            }
            text
        };
        format!(
            "{} vehicles at {} Hz for {} s, {} states, one thread of the daemon\n\
             samples sent     {}\n\
             answered         {}\n\
             late             {}   (published a period after the sample was sent, or later)\n\
             sent behind time {}   (by a period or more: this side was the bottleneck)\n\
             sent to published{}\n\
             inside the daemon{}\n",
            self.options.instances,
            self.options.rate,
            self.options.seconds,
            if self.options.without_biases { 9 } else { 15 },
            self.sent,
            self.answered,
            self.late,
            self.behind,
            figures(&self.answer),
            figures(&self.inside),
        )
    }
}
