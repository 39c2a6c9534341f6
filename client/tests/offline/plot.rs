//! Figures: well-formed SVG of bounded size that says what it should; the report stands alone.

use hdrhistogram::Histogram;
use inekf_client::plot::{
    LatencySeries, Panel, Report, Section, Table, TrajectoryPlot, error_bands, error_panels,
    format_ns, latency, trajectory,
};

/// Checks that every tag is closed in order, and that text holds no bare `<` or `&`.
fn assert_well_formed(xml: &str) {
    let mut open: Vec<&str> = Vec::new();
    let mut rest = xml;
    while let Some(start) = rest.find('<') {
        let tag = &rest[start + 1..];
        let end = tag.find('>').expect("a tag ends");
        let (inside, after) = (&tag[..end], &tag[end + 1..]);
        let name = inside
            .trim_start_matches('/')
            .split_whitespace()
            .next()
            .unwrap_or("");
        assert!(
            name.starts_with(|c: char| c.is_ascii_alphabetic()),
            "tag <{inside}>"
        );
        if inside.starts_with('/') {
            assert_eq!(open.pop(), Some(name));
        } else if !inside.ends_with('/') {
            open.push(name);
        }
        rest = after;
    }
    assert!(open.is_empty(), "not closed: {open:?}");
    for (at, _) in xml.match_indices('&') {
        let entity = xml[at..].split_once(';').map_or("", |(entity, _)| entity);
        assert!(
            ["&amp", "&lt", "&gt", "&quot", "&apos", "&#39"].contains(&entity),
            "{entity}"
        );
    }
}

fn circle(points: u32, radius: f64) -> Vec<[f64; 2]> {
    let angle = |i: u32| f64::from(i) / f64::from(points) * std::f64::consts::TAU;
    (0..points)
        .map(|i| [radius * angle(i).cos(), radius * angle(i).sin()])
        .collect()
}

/// Centres `(cx, cy)` of the circles of a given radius.
fn dots(svg: &str, radius: u32) -> Vec<(f64, f64)> {
    let number = |tag: &str, name: &str| -> f64 {
        let from = tag.find(name).unwrap() + name.len();
        tag[from..].split('"').next().unwrap().parse().unwrap()
    };
    svg.match_indices("<circle")
        .map(|(at, _)| svg[at..].split('>').next().unwrap())
        .filter(|tag| number(tag, " r=\"") == f64::from(radius))
        .map(|tag| (number(tag, "cx=\""), number(tag, "cy=\"")))
        .collect()
}

#[test]
fn trajectory_has_one_scale_on_both_axes() {
    for (dx, dy) in [(400.0, 100.0), (10.0, 300.0), (0.0, 0.0)] {
        let fixes = [[5.0, 5.0], [5.0 + dx, 5.0], [5.0, 5.0 + dy]];
        let plot = TrajectoryPlot {
            fixes: &fixes,
            ..TrajectoryPlot::default()
        };
        let svg = trajectory("<A & B>", &plot).unwrap();
        assert_well_formed(&svg);
        assert!(svg.contains("East (m)") && svg.contains("North (m)"));
        let at = dots(&svg, 2);
        assert_eq!(at.len(), 3);
        if dx > 0.0 {
            let (east, north) = ((at[1].0 - at[0].0) / dx, (at[0].1 - at[2].1) / dy);
            // Pixels are whole: the scale is known to 1 pixel over each distance.
            assert!(
                (east - north).abs() <= 1.0 / dx + 1.0 / dy,
                "{east} {north}"
            );
            assert!(east > 0.0);
        }
    }
}

#[test]
fn long_series_make_small_figures() {
    let path = circle(200_000, 300.0);
    let plot = TrajectoryPlot {
        truth: &path,
        estimate: &path,
        fixes: &path,
    };
    let svg = trajectory("long", &plot).unwrap();
    assert_well_formed(&svg);
    assert!(svg.len() < 600_000, "{}", svg.len());

    let error: Vec<f64> = path.iter().map(|point| point[0] / 300.0).collect();
    let panel = Panel {
        label: "East error".to_owned(),
        unit: "m".to_owned(),
        time_s: (0..error.len()).map(|i| i as f64 * 0.005).collect(),
        sigma: vec![0.4; error.len()],
        error,
    };
    let svg = error_bands("errors", &[panel.clone(), panel]).unwrap();
    assert_well_formed(&svg);
    assert!(svg.len() < 200_000, "{}", svg.len());
    assert!(
        svg.contains("rms 0.707 m, 100.0 % within the band"),
        "note missing"
    );
}

#[test]
fn a_transient_is_cut_off_and_noted() {
    let mut error = vec![0.1; 1000];
    error[3] = -40.0;
    let panel = Panel {
        label: "Heading error".to_owned(),
        unit: "deg".to_owned(),
        time_s: (0..1000).map(f64::from).collect(),
        error,
        sigma: Vec::new(),
    };
    let svg = error_bands("errors", &[panel]).unwrap();
    assert!(svg.contains("cut off: largest 40.00 deg"));
}

#[test]
fn empty_figures_are_drawn_without_data() {
    assert_well_formed(&trajectory("nothing", &TrajectoryPlot::default()).unwrap());
    assert_well_formed(&error_bands("nothing", &error_panels(&[], &[], 0)).unwrap());
    assert_well_formed(&error_bands("nothing", &[]).unwrap());
    assert_well_formed(&latency("nothing", &[]).unwrap());
    let empty = Histogram::<u64>::new(3).unwrap();
    let series = LatencySeries {
        name: "empty",
        histogram: &empty,
    };
    assert_well_formed(&latency("nothing", &[series]).unwrap());
}

#[test]
fn latency_states_its_percentiles() {
    let mut histogram = Histogram::<u64>::new(3).unwrap();
    for i in 1..=10_000 {
        histogram.record(i * 10).unwrap();
    }
    let series = [LatencySeries {
        name: "sent to read",
        histogram: &histogram,
    }];
    let svg = latency("Latency", &series).unwrap();
    assert_well_formed(&svg);
    for label in ["0 %", "90 %", "99 %", "99.9 %", "99.99 %", "1 µs", "100 µs"] {
        assert!(svg.contains(label), "{label}");
    }
    // The histogram keeps three digits: 50 us is recorded within 0.1 %.
    assert!(svg.contains("sent to read: p50 50 µs, p99 99"), "legend");
    for count in [1, 2] {
        let mut few = Histogram::<u64>::new(3).unwrap();
        few.record_n(700, count).unwrap();
        let series = [LatencySeries {
            name: "few",
            histogram: &few,
        }];
        assert_well_formed(&latency("Latency", &series).unwrap());
    }
}

#[test]
fn nanoseconds_are_written_in_a_fitting_unit() {
    for (ns, expected) in [
        (0.0, "0 ns"),
        (850.0, "850 ns"),
        (1000.0, "1 µs"),
        (1250.0, "1.25 µs"),
        (34_560.0, "34.6 µs"),
        (345_600.0, "346 µs"),
        (100_000.0, "100 µs"),
        (3.4e6, "3.4 ms"),
        (2e9, "2 s"),
    ] {
        assert_eq!(format_ns(ns), expected);
    }
}

#[test]
fn report_is_one_file_that_refers_to_nothing() {
    let svg = trajectory("Path", &TrajectoryPlot::default()).unwrap();
    let report = Report {
        title: "Run <1>".to_owned(),
        subtitle: "a & b".to_owned(),
        sections: vec![Section {
            heading: "Errors".to_owned(),
            text: "Root mean square.".to_owned(),
            table: Some(Table {
                header: vec!["axis".to_owned(), "rmse (m)".to_owned()],
                rows: vec![vec!["east".to_owned(), "0.12".to_owned()]],
            }),
            svg,
        }],
    };
    let html = report.to_html();
    assert!(html.contains("<h1>Run &lt;1&gt;</h1>") && html.contains("a &amp; b"));
    assert!(html.contains("<td>0.12</td>") && html.contains("<svg"));
    for outside in ["src=", "href=", "url(", "@import", "<script"] {
        assert!(!html.contains(outside), "{outside}");
    }
    let body = html
        .split_once("<body>")
        .unwrap()
        .1
        .split_once("</body>")
        .unwrap()
        .0;
    assert_well_formed(body);
}
