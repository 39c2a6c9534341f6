//! The monitor's screen and the report, without a daemon.

use std::time::Duration;

use inekf_client::dataset::{Truth, TruthRow};
use inekf_client::model::Model;
use inekf_client::monitor::{Picture, screen, text};
use inekf_client::report::{Material, NisSample, build};
use inekf_client::rows::row;
use inekf_shared::message::{
    ESTIMATE_PROPAGATED, EstimateHead, EstimateSe23, Health, INPUT_HEADING, INPUT_POSITION,
    STATE_RUNNING, STATE_WAITING, WAITING_FOR_POSITION, Zero, source_index, triangle_index,
};
use ratatui::Terminal;
use ratatui::backend::TestBackend;

/// An estimate at rest, two metres north and sure of it to half a metre.
fn estimate(stamp_ns: u64) -> EstimateSe23 {
    let mut estimate = EstimateSe23 {
        head: EstimateHead {
            stamp_ns,
            sent_ns: 1_000_000_000,
            published_ns: 1_000_007_000,
            flags: ESTIMATE_PROPAGATED,
            state: STATE_RUNNING,
            dimension: 15,
            ..EstimateHead::UNSTARTED
        },
        q_wb: [0.0, 0.0, 0.0, 1.0],
        p_w_m: [0.0, 2.0, 0.0],
        ..EstimateSe23::ZERO
    };
    estimate.head.nis[2] = 3.25;
    for i in 0..15 {
        estimate.covariance[triangle_index(i, i, 15).unwrap()] = 0.25;
    }
    estimate
}

fn drawn(picture: &Picture) -> String {
    let mut terminal = Terminal::new(TestBackend::new(100, 30)).unwrap();
    terminal.draw(|frame| screen::draw(frame, picture)).unwrap();
    terminal.backend().to_string()
}

#[test]
fn the_screen_shows_state_uncertainty_nis_and_latency() {
    let mut picture = Picture::new("car-7", Model::Imu).unwrap();
    assert!(drawn(&picture).contains("no word of the daemon yet"));
    picture.take_health(&Health {
        stamp_ns: 1_000_000_000,
        state: STATE_WAITING,
        waiting_for: WAITING_FOR_POSITION,
        ..Health::ZERO
    });
    picture.finish(1_000_000_000, Duration::from_secs(1), 0);
    assert!(drawn(&picture).contains("waiting for position"));

    let mut health = Health {
        stamp_ns: 2_000_000_000,
        state: STATE_RUNNING,
        imu_rate_hz: 200.5,
        ..Health::ZERO
    };
    health.counters.gated = 17;
    // Source 2 of the positions: heard of 30 ms before the message, which is 100 ms old; its newest fused fix is half a
    // second old by the sensors' clock. Source 1 of the headings was heard of, and never believed.
    health.last_imu_stamp_ns = 9_000_000_000;
    let of = |input, source| source_index(input, source).unwrap();
    health.delivered_ns[of(INPUT_POSITION, 2)] = 1_970_000_000;
    health.fused_stamp_ns[of(INPUT_POSITION, 2)] = 8_500_000_000;
    health.delivered_ns[of(INPUT_HEADING, 1)] = 1_000_000_000;
    picture.begin();
    picture.take_health(&health);
    for stamp_ns in 1..=100 {
        picture.take_estimate(&estimate(stamp_ns));
    }
    picture.finish(2_100_000_000, Duration::from_millis(500), 3);
    let screen = drawn(&picture);
    for word in [
        "car-7",
        "model imu",
        "running",
        "samples 200.5 Hz",
        "estimates 200.0 Hz",
        "3 missed here",
        "2.0000",
        "0.5000",
        "NIS of 2",
        "3.25",
        "gated              17",
        "p50 7 µs",
        "position 2: fused 500 ms old, heard 130 ms ago",
        "heading 1: none fused, heard 1.1 s ago",
    ] {
        assert!(screen.contains(word), "{word}:\n{screen}");
    }
    let line = text::line(&picture);
    assert!(
        line.starts_with("running, samples 200.5 Hz, estimates 200.0 Hz"),
        "{line}"
    );
    assert!(
        line.contains("sigma 0.500 0.500 0.500 m") && line.contains("nis[2] 3.25"),
        "{line}"
    );
    // A daemon that has been killed.
    picture.finish(62_000_000_000, Duration::from_secs(1), 3);
    assert!(
        text::state(&picture).contains("silent since"),
        "{}",
        text::state(&picture)
    );
}

#[test]
fn a_report_needs_nothing_but_itself_and_says_how_consistent_the_run_was() {
    let rows: Vec<_> = (0..200).map(|i| row(&estimate(i * 10_000_000))).collect();
    let truth: Vec<TruthRow> = rows
        .iter()
        .map(|row| TruthRow {
            stamp_ns: row.stamp_ns,
            q_wb: [0.0, 0.0, 0.0, 1.0],
            v_w_mps: [0.0; 3],
            // Three sigma to the east: (1.5 / 0.5)^2 = 9.
            p_w_m: [1.5, 2.0, 0.0],
            bias: None,
        })
        .collect();
    let nis = [NisSample {
        stamp_ns: 5,
        nis: 2.0,
        degrees: 3,
    }];
    let built = build(&Material {
        title: "a <run>",
        subtitle: "",
        rows: &rows,
        truth: &Truth::Spatial(truth),
        fixes: &[],
        settled_s: 1.0,
        nis: &nis,
        latencies: &[],
        latency_note: "",
        counters: None,
    })
    .unwrap();
    let summary = built.summary.unwrap();
    assert_eq!(summary.count, 100);
    assert!((summary.position_rmse_m.x - 1.5).abs() < 1e-12);
    let names: Vec<&str> = built.figures.iter().map(|(name, _)| *name).collect();
    assert_eq!(
        names,
        ["trajectory.svg", "error.svg", "nees.svg", "nis.svg"]
    );
    let html = &built.html;
    assert!(
        html.contains("the mean is 9.00, where 9 is expected"),
        "{html}"
    );
    assert!(html.contains("100.0 % lie between"));
    assert!(html.contains("a &lt;run&gt;"));
    for outside in ["src=", "href=", "url(", "@import", "<script"] {
        assert!(!html.contains(outside), "{outside}");
    }
}
