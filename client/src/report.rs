//! A report of a run: one HTML file with everything in it, and its figures as SVG.
//!
//! Trajectory, error with three standard deviations, NEES and NIS with their bands, latency and what became of the
//! fixes: each part is there if there is something to show.

use inekf_shared::message::Counters;

use crate::consistency::{NeesSample, band_95, degrees, nees_series};
use crate::dataset::{PositionRow, Truth};
use crate::evaluate::{
    DEFAULT_MAX_GAP_NS, Deviations, ErrorSample, Summary, Trajectory, deviations, errors, summarise,
};
use crate::plot::{
    ConsistencyPlot, LatencySeries, PlotError, Report, Section, Table, TrajectoryPlot, consistency,
    error_bands, error_panels, format_ns, latency, trajectory,
};
use crate::table::EstimateRow;

/// The normalised innovation squared of one fix.
///
/// ```
/// use inekf_client::consistency::band_95;
/// use inekf_client::report::NisSample;
///
/// let nis = NisSample { stamp_ns: 0, nis: 12.0, degrees: 3 };
/// // Larger than what a fix that fits its covariance gives in 97.5 % of all cases.
/// assert!(nis.nis > band_95(nis.degrees).1);
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NisSample {
    /// Stamp of the fix's estimate, ns.
    pub stamp_ns: u64,
    /// The value.
    pub nis: f64,
    /// Its degrees of freedom: 3, in the plane 2.
    pub degrees: usize,
}

/// What a report is made of; every list may be empty.
///
/// ```
/// use inekf_client::dataset::Truth;
/// use inekf_client::report::{Material, build};
///
/// let nothing = Material {
///     title: "Nothing",
///     subtitle: "at all",
///     rows: &[],
///     truth: &Truth::None,
///     fixes: &[],
///     settled_s: 0.0,
///     nis: &[],
///     latencies: &[],
///     latency_note: "",
///     counters: None,
/// };
/// // Every list may be empty: there is a page, and no figure of errors in it.
/// let built = build(&nothing)?;
/// assert!(built.html.contains("<h1>Nothing</h1>") && built.summary.is_none());
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Copy, Debug)]
pub struct Material<'a> {
    /// The title.
    pub title: &'a str,
    /// A line below it: what was run, on which data.
    pub subtitle: &'a str,
    /// The estimates.
    pub rows: &'a [EstimateRow],
    /// The truth.
    pub truth: &'a Truth,
    /// Position fixes.
    pub fixes: &'a [PositionRow],
    /// Errors are summed up from so long after the first estimate on, s.
    pub settled_s: f64,
    /// NIS of the fixes of position.
    pub nis: &'a [NisSample],
    /// Latencies.
    pub latencies: &'a [LatencySeries<'a>],
    /// A line below them: where they were taken.
    pub latency_note: &'a str,
    /// What became of the inputs.
    pub counters: Option<Counters>,
}

/// A report with its figures.
///
/// ```
/// use inekf_client::dataset::{Truth, Truth2dRow};
/// use inekf_client::exchange::truth_table;
/// use inekf_client::report::{Material, build};
///
/// let row = |i: u64| Truth2dRow { stamp_ns: i * 100_000_000, theta_rad: 0.0, p_w_m: [i as f64, 0.0] };
/// let truth = Truth::Planar((0..20).map(row).collect());
/// let table = truth_table(&truth).expect("twenty rows");
/// // The truth as its own estimate: no error, and the figures as files beside the page.
/// let built = build(&Material {
///     title: "Perfect",
///     subtitle: "",
///     rows: &table.rows,
///     truth: &truth,
///     fixes: &[],
///     settled_s: 0.5,
///     nis: &[],
///     latencies: &[],
///     latency_note: "",
///     counters: None,
/// })?;
/// let summary = built.summary.expect("they have time in common");
/// assert_eq!((summary.count, summary.distance_max_m), (15, 0.0));
/// assert!(built.figures.iter().all(|(name, svg)| name.ends_with(".svg") && svg.starts_with("<svg")));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug)]
pub struct Built {
    /// The page.
    pub html: String,
    /// Names of files and SVG text.
    pub figures: Vec<(&'static str, String)>,
    /// Errors from the time on that the material names; `None` without truth there.
    pub summary: Option<Summary>,
}

/// Builds the report.
///
/// ```
/// use inekf_client::dataset::Truth;
/// use inekf_client::report::{Material, build};
/// use inekf_client::table::{EstimateRow, EstimateState};
///
/// let row = |i: u64| EstimateRow {
///     stamp_ns: i * 1_000_000,
///     state: EstimateState::Plane { theta_rad: 0.0, p_w_m: [i as f64, 0.0] },
///     covariance: vec![],
/// };
/// let rows: Vec<EstimateRow> = (0..10).map(row).collect();
/// let built = build(&Material {
///     title: "A run",
///     subtitle: "without truth",
///     rows: &rows,
///     truth: &Truth::None,
///     fixes: &[],
///     settled_s: 0.0,
///     nis: &[],
///     latencies: &[],
///     latency_note: "",
///     counters: None,
/// })?;
/// assert!(built.html.contains("<svg") && built.summary.is_none());
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// # Errors
/// [`PlotError`] if the drawing library fails.
pub fn build(material: &Material<'_>) -> Result<Built, PlotError> {
    let mut parts = Parts {
        start_ns: material.rows.first().map_or(0, |row| row.stamp_ns),
        sections: Vec::new(),
        figures: Vec::new(),
    };
    parts.trajectory(material)?;
    let summary = parts.error(material)?;
    parts.nees(material)?;
    parts.nis(material)?;
    parts.latency(material)?;
    parts.fixes(material);
    let report = Report {
        title: material.title.to_owned(),
        subtitle: material.subtitle.to_owned(),
        sections: parts.sections,
    };
    Ok(Built {
        html: report.to_html(),
        figures: parts.figures,
        summary,
    })
}

struct Parts {
    start_ns: u64,
    sections: Vec<Section>,
    figures: Vec<(&'static str, String)>,
}

impl Parts {
    fn push(
        &mut self,
        heading: &str,
        text: String,
        table: Option<Table>,
        figure: Option<(&'static str, String)>,
    ) {
        let svg = figure.as_ref().map_or("", |(_, svg)| svg).to_owned();
        self.figures.extend(figure);
        self.sections.push(Section {
            heading: heading.to_owned(),
            text,
            table,
            svg,
        });
    }

    fn seconds(&self, stamp_ns: u64) -> f64 {
        (stamp_ns as f64 - self.start_ns as f64) * 1e-9
    }

    fn trajectory(&mut self, material: &Material<'_>) -> Result<(), PlotError> {
        let truth = top_view(&Trajectory::from_truth(material.truth));
        let estimate = top_view(&Trajectory::from_estimates(material.rows));
        let fixes: Vec<[f64; 2]> = material
            .fixes
            .iter()
            .map(|fix| [fix.position_w_m[0], fix.position_w_m[1]])
            .collect();
        let plot = TrajectoryPlot {
            truth: &truth,
            estimate: &estimate,
            fixes: &fixes,
        };
        let svg = trajectory("Trajectory from above", &plot)?;
        self.push(
            "Trajectory",
            String::new(),
            None,
            Some(("trajectory.svg", svg)),
        );
        Ok(())
    }

    fn error(&mut self, material: &Material<'_>) -> Result<Option<Summary>, PlotError> {
        let errors = errors(
            &Trajectory::from_estimates(material.rows),
            &Trajectory::from_truth(material.truth),
            DEFAULT_MAX_GAP_NS,
        );
        if errors.is_empty() {
            return Ok(None);
        }
        let sigmas = deviations_at(material.rows, &errors);
        let panels = error_panels(&errors, &sigmas, self.start_ns);
        let svg = error_bands("Error against the truth", &panels)?;
        let from_ns = self.start_ns + (material.settled_s.max(0.0) * 1e9) as u64;
        let summary = summarise(&errors, from_ns);
        let text = format!("RMSE from {} s on.", material.settled_s);
        self.push(
            "Error",
            text,
            summary.as_ref().map(error_table),
            Some(("error.svg", svg)),
        );
        Ok(summary)
    }

    fn nees(&mut self, material: &Material<'_>) -> Result<(), PlotError> {
        let truth = Trajectory::from_truth(material.truth);
        let series = nees_series(material.rows, &truth, DEFAULT_MAX_GAP_NS);
        let (Some(first), false) = (material.rows.first(), series.is_empty()) else {
            return Ok(());
        };
        let degrees = degrees(first.state.layout());
        let values: Vec<f64> = series.iter().map(|sample| sample.nees).collect();
        let time_s: Vec<f64> = series
            .iter()
            .map(|sample: &NeesSample| self.seconds(sample.stamp_ns))
            .collect();
        self.band("NEES", "nees.svg", degrees, &time_s, &values)
    }

    fn nis(&mut self, material: &Material<'_>) -> Result<(), PlotError> {
        let Some(first) = material.nis.first() else {
            return Ok(());
        };
        let values: Vec<f64> = material.nis.iter().map(|sample| sample.nis).collect();
        let time_s: Vec<f64> = material
            .nis
            .iter()
            .map(|sample| self.seconds(sample.stamp_ns))
            .collect();
        self.band("NIS", "nis.svg", first.degrees, &time_s, &values)
    }

    fn band(
        &mut self,
        name: &str,
        file: &'static str,
        degrees: usize,
        time_s: &[f64],
        values: &[f64],
    ) -> Result<(), PlotError> {
        let band = band_95(degrees);
        let plot = ConsistencyPlot {
            name,
            time_s,
            values,
            band,
        };
        let svg = consistency(&format!("{name} with {degrees} degrees of freedom"), &plot)?;
        let count = values.len() as f64;
        let inside = values
            .iter()
            .filter(|value| (band.0..=band.1).contains(*value))
            .count() as f64;
        let text = format!(
            "{:.1} % lie between {:.2} and {:.2}, the band of 95 %; the mean is {:.2}, where {degrees} is expected. \
             Above the band the covariance is too small, below it too large.",
            100.0 * inside / count,
            band.0,
            band.1,
            values.iter().sum::<f64>() / count,
        );
        self.push(name, text, None, Some((file, svg)));
        Ok(())
    }

    fn latency(&mut self, material: &Material<'_>) -> Result<(), PlotError> {
        if material.latencies.is_empty() {
            return Ok(());
        }
        let svg = latency("Latency per sample", material.latencies)?;
        self.push(
            "Latency",
            material.latency_note.to_owned(),
            Some(latency_table(material.latencies)),
            Some(("latency.svg", svg)),
        );
        Ok(())
    }

    fn fixes(&mut self, material: &Material<'_>) {
        let Some(counters) = material.counters else {
            return;
        };
        let row = |name: &str, count: u64| vec![name.to_owned(), count.to_string()];
        let table = Table {
            header: ["inputs", "count"].map(str::to_owned).to_vec(),
            rows: vec![
                row("fixes accepted", counters.accepted),
                row("fixes gated", counters.gated),
                row("fixes too late", counters.late),
                row("fixes without their partner", counters.unpaired),
                row("inputs lost", counters.lost),
                row("inputs rejected", counters.rejected),
            ],
        };
        self.push("Fixes", String::new(), Some(table), None);
    }
}

fn top_view(trajectory: &Trajectory) -> Vec<[f64; 2]> {
    let poses = trajectory.poses().iter();
    poses.map(|pose| [pose.p_w_m.x, pose.p_w_m.y]).collect()
}

/// The deviations of the rows that have an error; none if one of them has none.
fn deviations_at(rows: &[EstimateRow], errors: &[ErrorSample]) -> Vec<Deviations> {
    let mut rows = rows.iter();
    let at = |error: &ErrorSample| deviations(rows.find(|row| row.stamp_ns == error.stamp_ns)?);
    let found: Option<Vec<Deviations>> = errors.iter().map(at).collect();
    found.unwrap_or_default()
}

fn error_table(summary: &Summary) -> Table {
    let position = summary.position_rmse_m;
    let cells = |name: &str, value: f64, unit: &str| {
        vec![name.to_owned(), format!("{value:.3}"), unit.to_owned()]
    };
    Table {
        header: ["quantity", "RMSE", "unit"].map(str::to_owned).to_vec(),
        rows: vec![
            cells("position east", position.x, "m"),
            cells("position north", position.y, "m"),
            cells("position up", position.z, "m"),
            cells("heading", summary.heading_rmse_rad.to_degrees(), "deg"),
            cells("attitude", summary.attitude_rmse_rad.to_degrees(), "deg"),
        ],
    }
}

fn latency_table(latencies: &[LatencySeries<'_>]) -> Table {
    let rows = latencies.iter().map(|series| {
        let histogram = series.histogram;
        let mut cells = vec![series.name.to_owned()];
        cells.extend([0.5, 0.99, 0.999].map(|q| format_ns(histogram.value_at_quantile(q) as f64)));
        cells.push(format_ns(histogram.max() as f64));
        cells
    });
    Table {
        header: ["", "p50", "p99", "p99.9", "max"]
            .map(str::to_owned)
            .to_vec(),
        rows: rows.collect(),
    }
}
