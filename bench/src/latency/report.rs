//! The rows as text and as JSON. Ratios compare figures of one placement only.

use std::fmt::Write;

use inekf_client::plot::format_ns;
use serde_json::{Map, Value, json};

use super::LatencyOptions;
use super::machine::Machine;
use super::mechanism::{Case, Mechanism, PACES, Pace, Wait};
use super::placement::{PLACEMENTS, Placement};
use super::row::{Distribution, FIGURES, MEDIAN, P999, Row};

/// What was measured.
#[derive(Clone, Debug)]
pub struct Report {
    /// Every case at every pace.
    pub rows: Vec<Row>,
    /// On which machine.
    pub machine: Machine,
    /// With which options.
    pub options: LatencyOptions,
}

/// The 15-state filter by the plain echo, both spinning at saturation.
#[derive(Clone, Copy, Debug)]
struct Headline {
    placement: Placement,
    p50: f64,
    p999: f64,
    /// Whether noise dominates a figure behind each.
    is_noise: [bool; 2],
}

impl Report {
    fn row(&self, mechanism: Mechanism, wait: Wait, pace: Pace) -> Option<&Row> {
        let case = Case { mechanism, wait };
        let mut rows = self.rows.iter();
        rows.find(|row| row.case == case && row.pace == pace)
    }

    /// The plain echo that a row is compared with.
    fn echo(&self, row: &Row, placement: Placement) -> Option<&Distribution> {
        self.row(Mechanism::Echo, row.case.wait, row.pace)?
            .at(placement)
    }

    /// The headline of each placement in which both were measured.
    fn headlines(&self) -> Vec<(u64, Headline)> {
        let in_placement = |placement| {
            let filter = self.row(Mechanism::Filter15, Wait::Spin, Pace::Saturated)?;
            let (ours, echo) = (filter.at(placement)?, self.echo(filter, placement)?);
            let is_noise = |quantile| {
                [ours, echo]
                    .iter()
                    .any(|it| it.noise(quantile, false).is_some())
            };
            let headline = Headline {
                placement,
                p50: ours.ratio_to(echo, MEDIAN),
                p999: ours.ratio_to(echo, P999),
                is_noise: [is_noise(MEDIAN), is_noise(P999)],
            };
            Some((ours.rounds.len().min(echo.rounds.len()), headline))
        };
        PLACEMENTS.into_iter().filter_map(in_placement).collect()
    }

    /// That of the placement with the most rounds.
    fn headline(&self) -> Option<Headline> {
        let most = self
            .headlines()
            .into_iter()
            .max_by_key(|(rounds, _)| *rounds);
        most.map(|(_, headline)| headline)
    }

    /// The placement in which most rounds at saturation were made.
    pub fn main_placement(&self) -> Placement {
        let rounds = |placement: &Placement| {
            let saturated = self.rows.iter().filter(|row| row.pace == Pace::Saturated);
            let of_row = |row: &Row| row.at(*placement).map_or(0, |it| it.rounds.len());
            saturated.map(of_row).sum::<u64>()
        };
        let most = PLACEMENTS.into_iter().max_by_key(rounds);
        most.unwrap_or(Placement::SeparateCores)
    }

    /// Chunks left out because the placement changed during them.
    fn left_out(&self) -> usize {
        self.rows.iter().map(|row| row.mixed).sum()
    }

    /// All chunks.
    fn chunks(&self) -> usize {
        let of_row = |row: &Row| {
            let kept = PLACEMENTS
                .into_iter()
                .filter_map(|placement| row.at(placement));
            row.mixed + kept.map(Distribution::chunks).sum::<usize>()
        };
        self.rows.iter().map(of_row).sum()
    }

    /// Tables for people.
    pub fn text(&self) -> String {
        let mut text = self.machine.text();
        for wait in [Wait::Spin, Wait::Event] {
            for pace in PACES {
                for placement in PLACEMENTS {
                    text += &self.table(wait, pace, placement);
                }
            }
        }
        let _ = write!(
            text,
            "\n{} of {} chunks left out: the placement of the processors changed during them.\n\
             ~ noise dominates the figure (the JSON says why); the maximum is a single round.\n\
             inside: p50 of the daemon's own part, from the sample in hand to its estimate sent.\n\
             halts/s: rounds 10 µs longer than their median, for each second of rounds.\n",
            self.left_out(),
            self.chunks(),
        );
        match self.headline() {
            Some(headline) => {
                let [p50, p999] = headline.is_noise.map(tilde);
                let _ = writeln!(
                    text,
                    "estimate with 15 states by plain echo, {}: p50 {p50}{:.2}, p99.9 {p999}{:.2}",
                    headline.placement.name(),
                    headline.p50,
                    headline.p999,
                );
            }
            None => text += "no placement holds both the filter and the echo: take more turns\n",
        }
        text
    }

    /// One group of rows; empty if nothing was measured in it.
    fn table(&self, wait: Wait, pace: Pace, placement: Placement) -> String {
        let group = self
            .rows
            .iter()
            .filter(|row| row.case.wait == wait && row.pace == pace);
        let mut lines = String::new();
        for row in group {
            let Some(it) = row.at(placement) else {
                continue;
            };
            let _ = write!(lines, "{:<28}", row.case.mechanism.name());
            for (name, quantile) in FIGURES {
                let is_marked = name != "max" && it.noise(quantile, row.is_raw()).is_some();
                let figure = format_ns(it.figure(quantile) as f64);
                let _ = write!(lines, "{:>10}", format!("{}{figure}", tilde(is_marked)));
            }
            let echo = self.echo(row, placement);
            let by_echo = echo.map_or("-".to_owned(), |echo| {
                format!("{:.2}", it.ratio_to(echo, MEDIAN))
            });
            let inside = match it.inside.len() {
                0 => "-".to_owned(),
                _ => format_ns(it.inside.value_at_quantile(MEDIAN) as f64),
            };
            let _ = writeln!(
                lines,
                "{inside:>10}{:>9.0}{:>9.1}{by_echo:>9}{:>9}",
                it.halts_per_s(),
                it.ratio_to_raw(),
                it.rounds.len()
            );
        }
        if lines.is_empty() {
            return lines;
        }
        let title = format!("{}, {}, {}", wait.name(), pace.name(), placement.name());
        format!(
            "\n{title}\n{:<28}{:>10}{:>10}{:>10}{:>10}{:>10}{:>10}{:>9}{:>9}{:>9}{:>9}\n{lines}",
            "",
            "p50",
            "p99",
            "p99.9",
            "p99.99",
            "max",
            "inside",
            "halts/s",
            "/ line",
            "/ echo",
            "rounds"
        )
    }

    /// Everything, for programs.
    pub fn json(&self) -> Value {
        let mut rows = Vec::new();
        for row in &self.rows {
            let places = PLACEMENTS.into_iter();
            let found = places.filter_map(|place| Some((place, row.at(place)?)));
            let values: Vec<Value> = found
                .map(|(place, it)| self.row_json(row, place, it))
                .collect();
            if values.is_empty() {
                rows.push(empty_json(row));
            }
            rows.extend(values);
        }
        let headline = self.headline();
        let by_placement = self.headlines().into_iter().map(|(_, headline)| {
            let ratios = json!({"ratio_p50": headline.p50, "ratio_p999": headline.p999});
            (headline.placement.name().to_owned(), ratios)
        });
        json!({
            "ratio_p50": headline.map(|headline| headline.p50),
            "ratio_p999": headline.map(|headline| headline.p999),
            "ratio_placement": headline.map(|headline| headline.placement.name()),
            "ratio_p50_is_noise": headline.map(|headline| headline.is_noise[0]),
            "ratio_p999_is_noise": headline.map(|headline| headline.is_noise[1]),
            "ratio_by_placement": by_placement.collect::<Map<String, Value>>(),
            "chunks": self.chunks(),
            "chunks_left_out": self.left_out(),
            "machine": self.machine.json(),
            "options": {
                "only": self.options.only,
                "rounds": self.options.rounds,
                "turns": self.options.turns,
                "seconds": self.options.seconds,
                "sibling_below_ns": self.options.sibling_below_ns,
            },
            "rows": rows,
        })
    }

    fn row_json(&self, row: &Row, placement: Placement, it: &Distribution) -> Value {
        let mut value = identity(row);
        let echo = self.echo(row, placement);
        let mut noise = Map::new();
        for (name, quantile) in FIGURES {
            value.insert(format!("{name}_ns"), it.figure(quantile).into());
            if let Some(why) = it.noise(quantile, row.is_raw()) {
                noise.insert(name.to_owned(), why.name().into());
            }
        }
        if !it.inside.is_empty() {
            for (name, quantile) in FIGURES {
                let figure = it.inside.value_at_quantile(quantile);
                value.insert(format!("inside_{name}_ns"), figure.into());
            }
        }
        let ratio = |quantile| echo.map(|echo| it.ratio_to(echo, quantile));
        value.extend([
            ("placement".to_owned(), placement.name().into()),
            ("chunks".to_owned(), it.chunks().into()),
            ("count".to_owned(), it.rounds.len().into()),
            ("halts_per_s".to_owned(), it.halts_per_s().into()),
            ("missed".to_owned(), it.missed.into()),
            ("preempted".to_owned(), it.preempted.into()),
            ("noise".to_owned(), noise.into()),
            ("ratio_p50".to_owned(), ratio(MEDIAN).into()),
            ("ratio_p999".to_owned(), ratio(P999).into()),
            ("ratio_p50_cache_line".to_owned(), it.ratio_to_raw().into()),
            (
                "cache_line_p50_ns".to_owned(),
                it.pings.value_at_quantile(MEDIAN).into(),
            ),
        ]);
        value.into()
    }
}

/// What was measured, without what came of it.
fn identity(row: &Row) -> Map<String, Value> {
    let rate = match row.pace {
        Pace::Saturated => Value::Null,
        Pace::Hz(rate) => rate.into(),
    };
    Map::from_iter([
        ("name".to_owned(), row.case.mechanism.name().into()),
        ("wait".to_owned(), row.case.wait.name().into()),
        ("pace".to_owned(), row.pace.name().into()),
        ("rate_hz".to_owned(), rate),
        ("chunks_left_out".to_owned(), row.mixed.into()),
    ])
}

/// A row all of whose chunks were left out.
fn empty_json(row: &Row) -> Value {
    let mut value = identity(row);
    value.insert("placement".to_owned(), Value::Null);
    value.insert("count".to_owned(), 0.into());
    value.into()
}

fn tilde(is_noise: bool) -> &'static str {
    if is_noise { "~" } else { "" }
}
