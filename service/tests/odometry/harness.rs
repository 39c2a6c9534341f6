//! What the tests of odometry share: configurations, messages, feeding, and an estimate of any model.

use std::any::Any;

use inekf_service::config::{Checkpoint, Config};
use inekf_service::engine::resume::ResumeSettings;
use inekf_service::engine::{Engine, History, Model, Outbox, Use, build};
use inekf_shared::message::{
    Counters, EstimateHead, EstimateMessage, EstimateSe2, EstimateSe3, Header, INPUTS,
    MAX_MISMATCHES, MODEL_ODOMETRY_2D, MODEL_ODOMETRY_3D, Odometry2d, Odometry3d, PositionFix,
    REASONS, StateVector, Zero, triangle_index,
};

/// One row, ns.
pub const PERIOD: u64 = 100_000_000;
/// Where the drives begin, ns.
pub const START: u64 = 50_000_000_000;

/// Anything that an engine is fed with.
#[derive(Clone, Copy, Debug)]
pub enum Input {
    Plane(Odometry2d),
    Space(Odometry3d),
    Fix(PositionFix),
    Set(StateVector),
    /// A state of an earlier life.
    Resume(StateVector),
    Reset,
}

/// An estimate of any model.
#[derive(Clone, Debug)]
pub struct Estimate {
    pub head: EstimateHead,
    /// `theta, x, y` or `qx, qy, qz, qw, x, y, z`.
    pub mean: Vec<f64>,
    /// Upper triangle.
    pub covariance: Vec<f64>,
    pub mismatch: [f64; MAX_MISMATCHES],
    pub sigma: [f64; MAX_MISMATCHES],
}

impl Estimate {
    /// Every bit that says what is estimated.
    pub fn bits(&self) -> Vec<u64> {
        let numbers = self.mean.iter().chain(&self.covariance);
        let all = numbers.chain(&self.mismatch).chain(&self.sigma);
        let said = [
            self.head.stamp_ns,
            self.head.active_mismatches.into(),
            self.head.mode.into(),
        ];
        said.into_iter().chain(all.map(|x| x.to_bits())).collect()
    }

    /// Position, m.
    pub fn position(&self) -> &[f64] {
        if self.mean.len() == 3 {
            &self.mean[1..]
        } else {
            &self.mean[4..]
        }
    }
}

/// Every estimate, of any model.
#[derive(Default)]
pub struct All(pub Vec<Estimate>);

impl<E: EstimateMessage> Outbox<E> for All {
    fn publish(&mut self, estimate: &mut E) {
        let any = estimate as &dyn Any;
        let estimate = if let Some(e) = any.downcast_ref::<EstimateSe2>() {
            Estimate {
                head: e.head,
                mean: vec![e.theta_rad, e.p_w_m[0], e.p_w_m[1]],
                covariance: e.covariance.to_vec(),
                mismatch: e.mismatch,
                sigma: e.mismatch_sigma,
            }
        } else {
            let e = any.downcast_ref::<EstimateSe3>().unwrap();
            Estimate {
                head: e.head,
                mean: e.q_wb.iter().chain(&e.p_w_m).copied().collect(),
                covariance: e.covariance.to_vec(),
                mismatch: e.mismatch,
                sigma: e.mismatch_sigma,
            }
        };
        self.0.push(estimate);
    }
}

/// What came of a run.
pub struct Outcome {
    pub estimates: Vec<Estimate>,
    pub counters: Counters,
    pub reasons: [u64; REASONS],
    pub received: [u64; INPUTS],
    pub snapshot: Option<StateVector>,
    /// What requests were refused with.
    pub refusals: Vec<&'static str>,
}

impl Outcome {
    pub fn last(&self) -> &Estimate {
        self.estimates.last().unwrap()
    }

    /// Every bit of the snapshot.
    pub fn state_bits(&self) -> Vec<u64> {
        let state = self.snapshot.unwrap();
        let numbers = state.q_wb.iter().chain(&state.p_w_m);
        let bits = numbers.chain(&state.covariance).map(|x| x.to_bits());
        bits.chain([state.stamp_ns, state.model.into()]).collect()
    }
}

/// Feeds one input to an engine of whatever model; rows of another model are a mistake of the test.
pub fn feed<M: Model, H: History<M>>(
    engine: &mut Engine<M, H>,
    input: &Input,
    outbox: &mut impl Outbox<M::Estimate>,
) -> Result<(), &'static str> {
    match input {
        Input::Plane(row) => {
            let row = (row as &dyn Any).downcast_ref::<M::Sample>().unwrap();
            engine.sample(row, 0, outbox);
        }
        Input::Space(row) => {
            let row = (row as &dyn Any).downcast_ref::<M::Sample>().unwrap();
            engine.sample(row, 0, outbox);
        }
        Input::Fix(fix) => engine.position(fix, outbox),
        Input::Resume(state) => {
            return engine.resume_from(state, ResumeSettings::new(&Checkpoint::default()));
        }
        Input::Set(state) => return engine.set_state(state),
        Input::Reset => engine.reset(),
    }
    Ok(())
}

struct Feed<'a>(&'a [Input]);

impl Use for Feed<'_> {
    type Output = Outcome;

    fn with<M: Model + 'static, H: History<M> + 'static>(
        self,
        mut engine: Engine<M, H>,
    ) -> Outcome {
        let mut outbox = All::default();
        let mut refusals = Vec::new();
        for input in self.0 {
            refusals.extend(feed(&mut engine, input, &mut outbox).err());
        }
        Outcome {
            estimates: outbox.0,
            counters: engine.tally().counters,
            reasons: engine.tally().rejected_by_reason,
            received: engine.tally().received,
            snapshot: engine.snapshot(),
            refusals,
        }
    }
}

/// The configuration in `text`.
pub fn parse(text: &str) -> Config {
    Config::from_toml_str(text, "test").unwrap_or_else(|faults| panic!("{faults}\n{text}"))
}

/// What a configuration makes of the inputs.
pub fn run_config(config: &Config, inputs: &[Input]) -> Outcome {
    build(config, Feed(inputs)).unwrap()
}

/// The same of its text.
pub fn run(text: &str, inputs: &[Input]) -> Outcome {
    run_config(&parse(text), inputs)
}

/// One filter of the configuration: its lines at the top, and what its tables need.
#[derive(Clone, Copy, Debug)]
pub struct Choice {
    pub name: &'static str,
    pub top: &'static str,
    /// Whether mismatches are declared, and with sigmas.
    pub mismatched: Option<bool>,
    pub tail: &'static str,
}

const fn choice(
    name: &'static str,
    top: &'static str,
    mismatched: Option<bool>,
    tail: &'static str,
) -> Choice {
    Choice {
        name,
        top,
        mismatched,
        tail,
    }
}

/// Every filter.
pub const CHOICES: [Choice; 12] = [
    choice("left", "estimator = \"inekf\"", None, ""),
    choice(
        "right",
        "estimator = \"inekf\"\ninvariance = \"right\"",
        None,
        "",
    ),
    choice("additive", "estimator = \"ekf\"", None, ""),
    choice(
        "hard left",
        "estimator = \"lc-inekf\"\nmismatch = \"hard\"",
        Some(false),
        "",
    ),
    choice(
        "hard right",
        "estimator = \"lc-inekf\"\ninvariance = \"right\"\nmismatch = \"hard\"",
        Some(false),
        "",
    ),
    choice(
        "hard additive",
        "estimator = \"lc-ekf\"\nmismatch = \"hard\"",
        Some(false),
        "",
    ),
    choice(
        "soft left",
        "estimator = \"lc-inekf\"\nmismatch = \"soft\"",
        Some(true),
        "",
    ),
    choice(
        "soft additive",
        "estimator = \"lc-ekf\"\nmismatch = \"soft\"",
        Some(true),
        "",
    ),
    choice(
        "hinf",
        "estimator = \"invariant-hinf\"",
        None,
        "[hinf]\ngamma = 0.02\nnoise_factor = 1.0\n",
    ),
    choice(
        "consider",
        "estimator = \"inekf\"\nmismatch = \"consider\"",
        Some(true),
        "",
    ),
    choice(
        "augmented",
        "estimator = \"inekf\"\nmismatch = \"augmented\"",
        Some(true),
        "",
    ),
    choice(
        "adaptive",
        "estimator = \"inekf\"\nmismatch = \"adaptive\"",
        Some(true),
        "",
    ),
];

/// The filter of this name.
pub fn named(name: &str) -> Choice {
    *CHOICES.iter().find(|choice| choice.name == name).unwrap()
}

/// Standard deviations of the declared mismatches: scale of the odometry, turn of source 0, scale of source 1.
pub const SIGMAS: [f64; 3] = [0.08, 0.03, 0.06];

impl Choice {
    /// The configuration: two sources that are stacked, three mismatches, `extra` at the end of the tables.
    pub fn text(&self, dimension: usize, extra: &str) -> String {
        let mut text = format!(
            "model = \"odometry{dimension}d\"\n{}\n[noise]\nrotation_density = 0.01\n\
             translation_density = 0.02\n[initial]\nheading_deg = 20.0\nheading_sigma_deg = 5.0\n\
             position_m = {}\nposition_sigma_m = 2.0\n[[position_source]]\nid = 0\n\
             [[position_source]]\nid = 1\n",
            self.top,
            if dimension == 2 {
                "[0.0, 0.0]"
            } else {
                "[0.0, 0.0, 0.0]"
            },
        );
        let declared = [
            ("odometry_scale", ""),
            (
                "measurement_rotation",
                if dimension == 2 {
                    "source = 0\n"
                } else {
                    "source = 0\naxis = \"z\"\n"
                },
            ),
            ("measurement_scale", "source = 1\n"),
        ];
        if let Some(with_sigma) = self.mismatched {
            for ((what, place), sigma) in declared.iter().zip(SIGMAS) {
                text += &format!("[[mismatched]]\nwhat = \"{what}\"\n{place}");
                if with_sigma {
                    text += &format!("sigma = {sigma}\n");
                }
            }
        }
        text + "[stacking]\nsources = [0, 1]\n" + self.tail + extra
    }
}

/// A header.
pub fn header(stamp_ns: u64, seq: u64) -> Header {
    Header {
        stamp_ns,
        seq,
        sent_ns: 0,
        epoch: 7,
    }
}

/// A row in the plane: `theta, x, y`.
pub fn plane(stamp_ns: u64, seq: u64, [dtheta_rad, dx, dy]: [f64; 3]) -> Input {
    Input::Plane(Odometry2d {
        header: header(stamp_ns, seq),
        dtheta_rad,
        translation_m: [dx, dy],
    })
}

/// A row in space: rotation vector and translation.
pub fn space(stamp_ns: u64, seq: u64, [rx, ry, rz, dx, dy, dz]: [f64; 6]) -> Input {
    Input::Space(Odometry3d {
        header: header(stamp_ns, seq),
        rotation_rad: [rx, ry, rz],
        translation_m: [dx, dy, dz],
    })
}

/// A fix; two coordinates make it planar. A variance of 0.04 on the first axis, 0.09 on the others.
pub fn fix(stamp_ns: u64, seq: u64, source: u32, at: &[f64]) -> Input {
    let mut position_w_m = [f64::NAN; 3];
    position_w_m[..at.len()].copy_from_slice(at);
    Input::Fix(PositionFix {
        header: header(stamp_ns, seq),
        source,
        dimension: at.len() as u32,
        position_w_m,
        covariance_w_m2: [
            0.04,
            0.0,
            0.0,
            0.0,
            0.09,
            0.0,
            0.0,
            0.0,
            if at.len() == 3 { 0.09 } else { f64::NAN },
        ],
    })
}

/// Heading of [`planar_state`], rad.
pub const PLANAR_HEADING: f64 = 0.3;

/// A state in the plane at the origin's side, with these variances.
pub fn planar_state(stamp_ns: u64, variances: [f64; 3]) -> StateVector {
    let mut state = StateVector {
        model: MODEL_ODOMETRY_2D,
        dimension: 3,
        stamp_ns,
        q_wb: [
            0.0,
            0.0,
            (PLANAR_HEADING / 2.0).sin(),
            (PLANAR_HEADING / 2.0).cos(),
        ],
        p_w_m: [4.0, -3.0, 0.0],
        ..StateVector::ZERO
    };
    for (i, variance) in variances.into_iter().enumerate() {
        state.covariance[triangle_index(i, i, 3).unwrap()] = variance;
    }
    state
}

/// A state in space with these variances, leaning a little.
pub fn spatial_state(stamp_ns: u64, variances: [f64; 6]) -> StateVector {
    let mut state = StateVector {
        model: MODEL_ODOMETRY_3D,
        dimension: 6,
        stamp_ns,
        q_wb: [0.02, -0.03, 0.15, 0.0],
        p_w_m: [4.0, -3.0, 1.0],
        ..StateVector::ZERO
    };
    let vector = state.q_wb[..3].iter().map(|x| x * x).sum::<f64>();
    state.q_wb[3] = (1.0 - vector).sqrt();
    for (i, variance) in variances.into_iter().enumerate() {
        state.covariance[triangle_index(i, i, 6).unwrap()] = variance;
    }
    state
}
