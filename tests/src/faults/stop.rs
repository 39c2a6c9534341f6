//! SIGTERM in every state: exit 0, soon, and nothing left.

use std::time::Instant;

use inekf_shared::message::{
    STATE_ALIGNING, STATE_DEGRADED, STATE_PAUSED, STATE_RUNNING, STATE_STALE, STATE_WAITING,
};
use rustix::process::Signal;

use super::kills::{kill, killed};
use super::scene::{CONFIG, INSTANCE, Scene};
use super::{Outcome, Plan};
use crate::link::{HealthReader, Link};
use crate::process::PATIENCE;

/// A state, the configuration that leads to it, and whether somebody feeds.
const STATES: &[(u32, &str, &str, bool)] = &[
    (STATE_WAITING, "", "", false),
    (
        STATE_WAITING,
        "level_sigma_deg",
        "wait_for_request = true\nlevel_sigma_deg",
        true,
    ),
    (
        STATE_ALIGNING,
        "level = 'given'",
        "level = 'accelerometer'\nlevel_window_s = 60.0",
        true,
    ),
    (STATE_RUNNING, "", "", true),
    (
        STATE_DEGRADED,
        "[health]",
        "[health]\ndegraded_after_s = 0.001",
        true,
    ),
    (
        STATE_STALE,
        "[health]",
        "[health]\nstale_after_s = 0.0001",
        true,
    ),
    // By request.
    (STATE_PAUSED, "", "", true),
];

fn pause(scene: &Scene) {
    let mut link: Link = Link::open(&scene.memory, INSTANCE);
    link.controller.pause().expect("it can be paused");
}

/// Each state, in either way of waiting.
pub fn in_every_state(plan: &Plan) -> Outcome {
    let rounds = plan.at_most(20);
    let mut times = Vec::new();
    let mut after = 0;
    for _ in 0..rounds.div_ceil(10) {
        for (state, key, with, fed) in STATES {
            for wait in ["event", "spin"] {
                let config = CONFIG.replace(
                    "heading_sigma_deg",
                    "level_sigma_deg = 5.0\nheading_sigma_deg",
                );
                let config = match *key {
                    "" => config,
                    key => config.replace(key, with),
                };
                let scene = Scene::with_config(&format!("{config}[runtime]\nwait = '{wait}'\n"));
                let daemon = scene.daemon();
                let health = HealthReader::open(&scene.memory, INSTANCE);
                let feeder = fed.then(|| scene.feeder(plan, 200));
                if *state == STATE_PAUSED {
                    pause(&scene);
                }
                health.wait_until("the state", |health| health.state == *state);
                let asked = Instant::now();
                daemon.stop_with(Signal::TERM).succeeded();
                times.push(asked.elapsed());
                assert!(asked.elapsed() < PATIENCE / 10);
                drop(health);
                if let Some(feeder) = feeder {
                    killed(kill(feeder));
                }
                after = after.max(scene.cleared());
            }
        }
    }
    Outcome {
        count: u32::try_from(times.len()).unwrap_or(u32::MAX),
        survivors: "feeder, reader",
        times,
        files: Some((0, after)),
        note: "waiting (for samples, for a request), aligning, running, degraded, stale, paused, asleep and spinning; exit 0; \
               time: until the exit"
            .to_owned(),
        ..Outcome::default()
    }
}
