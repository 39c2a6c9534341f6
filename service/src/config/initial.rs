//! `[initial]`: the first estimate and how much it is trusted.
//!
//! Angles are kept in degrees, as people write them. Heading is counter-clockwise from
//! east, `atan2(R10, R00)` of the body-to-world rotation; roll and pitch complete it as `R = Rz(heading) Ry(pitch)
//! Rx(roll)`. Standard deviations are per axis.

use super::choice::{Level, Model};
use super::interval::Interval;
use super::motion::ONLY_IMU;
use super::section::Section;

/// The initial state and its standard deviations.
///
/// ```
#[doc = include_str!("example.txt")]
/// let initial = read(format!("{IMU}[initial]\nheading_deg = 90.0\nheading_sigma_deg = 5.0\n"))?.initial;
/// // North, as counted from east; where it is comes from the first position fix.
/// assert_eq!((initial.heading_deg, initial.position_m), (90.0, None));
/// # Ok::<(), ConfigFaults>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Initial {
    /// Heading, deg counter-clockwise from east.
    pub heading_deg: f64,
    /// Its standard deviation, deg; 180 says that it is unknown.
    pub heading_sigma_deg: f64,
    /// Where roll and pitch come from.
    pub level: Level,
    /// Roll, deg; used with [`Level::Given`].
    pub roll_deg: f64,
    /// Pitch, deg, positive with the nose down (body FLU); used with [`Level::Given`].
    pub pitch_deg: f64,
    /// Standard deviation of roll and of pitch, deg.
    pub level_sigma_deg: f64,
    /// How long the accelerometer is averaged over, s; used with [`Level::Accelerometer`].
    pub level_window_s: f64,
    /// Position of the body (of the IMU, with one) in the world, m; z is 0 in the plane. None: from the first
    /// position fix.
    pub position_m: Option<[f64; 3]>,
    /// Its standard deviation, m; used when `position_m` is given.
    pub position_sigma_m: f64,
    /// Velocity in the world, m/s.
    pub velocity_mps: [f64; 3],
    /// Its standard deviation, m/s.
    pub velocity_sigma_mps: f64,
    /// Bias of the gyroscope, rad/s.
    pub gyro_bias_rps: [f64; 3],
    /// Its standard deviation, rad/s.
    pub gyro_bias_sigma_rps: f64,
    /// Bias of the accelerometer, m/s^2.
    pub accel_bias_mps2: [f64; 3],
    /// Its standard deviation, m/s^2.
    pub accel_bias_sigma_mps2: f64,
    /// Whether only a set-state request initialises the estimate.
    pub wait_for_request: bool,
}

impl Initial {
    /// Reads the table for `model`, None if it is not known; `biases` tells whether biases are part of the state.
    pub(super) fn read(initial: &mut Section<'_, '_>, model: Option<Model>, biases: bool) -> Self {
        let usual_level = match model {
            Some(Model::Odometry3d | Model::Odometry2d) => Level::Given,
            Some(Model::Imu) | None => Level::Accelerometer,
        };
        let turn = Interval::closed(-360.0, 360.0);
        let half_turn = Interval::closed(-180.0, 180.0);
        let quarter_turn = Interval::closed(-90.0, 90.0);
        let spread = Interval::closed(0.0, 180.0);
        let window = Interval::above(0.0, 60.0);
        let anywhere = Interval::closed(-1e7, 1e7);
        let any_speed = Interval::closed(-1e4, 1e4);
        let any_rate = Interval::closed(-10.0, 10.0);
        let any_force = Interval::closed(-100.0, 100.0);

        let read = Self {
            heading_deg: initial.float("heading_deg", "deg", turn, 0.0),
            heading_sigma_deg: initial.float("heading_sigma_deg", "deg", spread, 180.0),
            level: initial.varying_choice("level", usual_level),
            roll_deg: initial.float("roll_deg", "deg", half_turn, 0.0),
            pitch_deg: initial.float("pitch_deg", "deg", quarter_turn, 0.0),
            level_sigma_deg: initial.float("level_sigma_deg", "deg", spread, 5.0),
            level_window_s: initial.float("level_window_s", "s", window, 0.2),
            position_m: initial.optional_place(
                "position_m",
                "m",
                anywhere,
                position_lengths(model),
            ),
            position_sigma_m: initial.float(
                "position_sigma_m",
                "m",
                Interval::closed(0.0, 1e7),
                10.0,
            ),
            velocity_mps: initial.vector3("velocity_mps", "m/s", any_speed),
            velocity_sigma_mps: initial.float(
                "velocity_sigma_mps",
                "m/s",
                Interval::closed(0.0, 1e4),
                10.0,
            ),
            gyro_bias_rps: initial.vector3("gyro_bias_rps", "rad/s", any_rate),
            gyro_bias_sigma_rps: initial.float(
                "gyro_bias_sigma_rps",
                "rad/s",
                Interval::closed(0.0, 10.0),
                0.01,
            ),
            accel_bias_mps2: initial.vector3("accel_bias_mps2", "m/s^2", any_force),
            accel_bias_sigma_mps2: initial.float(
                "accel_bias_sigma_mps2",
                "m/s^2",
                Interval::closed(0.0, 100.0),
                0.1,
            ),
            wait_for_request: initial.boolean("wait_for_request", false),
        };
        refuse_foreign(initial, model, read.level);
        read.refuse_contradictions(initial, biases);
        read
    }

    /// Refuses what is given of the state and would be thrown away. (A mere setting of something that is switched
    /// off, such as `level_window_s` beside a given level, is harmless and may stay.)
    fn refuse_contradictions(&self, initial: &mut Section<'_, '_>, biases: bool) {
        if self.level == Level::Accelerometer && initial.is_sound("level") {
            for angle in ["roll_deg", "pitch_deg"] {
                initial.refuse(
                    angle,
                    "contradicts level = \"accelerometer\": remove it, or say level = \"given\"",
                );
            }
        }
        if !initial.has("position_m") {
            initial.refuse("position_sigma_m", "needs position_m, which is missing");
        }
        if !biases {
            for (bias, value) in [
                ("gyro_bias_rps", self.gyro_bias_rps),
                ("accel_bias_mps2", self.accel_bias_mps2),
            ] {
                if value != [0.0; 3] {
                    initial.refuse(
                        bias,
                        "contradicts biases = false: remove it, or estimate biases",
                    );
                }
            }
        }
    }
}

/// How many numbers a position has.
fn position_lengths(model: Option<Model>) -> &'static [usize] {
    match model {
        Some(Model::Odometry2d) => &[2],
        Some(Model::Odometry3d | Model::Imu) => &[3],
        None => &[2, 3],
    }
}

/// Refuses what the state of `model` does not have.
fn refuse_foreign(initial: &mut Section<'_, '_>, model: Option<Model>, level: Level) {
    let Some(model) = model.filter(|model| model.is_odometry()) else {
        return;
    };
    if model == Model::Odometry2d {
        let tilt = ["level", "roll_deg", "pitch_deg", "level_sigma_deg"];
        initial.refuse_all(&tilt, "there is no tilt in the plane: remove it");
    } else if level == Level::Accelerometer {
        initial.refuse("level", "odometry has no accelerometer: say \"given\"");
    }
    initial.refuse_all(
        &[
            "level_window_s",
            "velocity_mps",
            "velocity_sigma_mps",
            "gyro_bias_rps",
            "gyro_bias_sigma_rps",
            "accel_bias_mps2",
            "accel_bias_sigma_mps2",
        ],
        ONLY_IMU,
    );
}

impl Default for Initial {
    /// With the model `imu` and its biases.
    fn default() -> Self {
        Section::defaults(|initial| Self::read(initial, Some(Model::Imu), true))
    }
}
