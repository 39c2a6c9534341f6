//! `meta.json`: what is known about a recording.
//!
//! | key | meaning |
//! |---|---|
//! | `name`, `kind` | text |
//! | `gravity` | magnitude, m/s^2 |
//! | `lever_arm_flu_m` | IMU to antenna, body FLU, m, for every position source |
//! | `lever_arms` | instead: one `[x, y, z]` or `[x, y]` per source, source 0 first |
//! | `imu_noise` | `gyro_nd` rad/s/sqrt(Hz), `accel_nd` m/s^2/sqrt(Hz), `gyro_bias_rw` rad/s^2/sqrt(Hz), `accel_bias_rw` m/s^3/sqrt(Hz) |
//! | `initial` | the state to start from: plane `t_ns,theta,x,y`; space `t_ns,qw,qx,qy,qz,vx,vy,vz,x,y,z`, perhaps `bgx,bgy,bgz,bax,bay,baz`; or as arrays `q_wb` (x, y, z, w), `v_w`, `p_w`, `gyro_bias`, `accel_bias` |
//! | `P0_diag` | variances of the initial left-invariant error: 3 (plane: theta, x, y), 6 (rotation, position), 9 (rotation, velocity, position) or 15 (and gyro and accelerometer bias) |
//!
//! `origin_lat_lon_alt` (degrees, degrees, m above the ellipsoid) is where the world has its zero, for positions by
//! latitude and longitude. All other keys are kept and written back.

use serde_json::{Map, Value, json};

use crate::table::{Fault, Faults};

const FILE: &str = "meta.json";

/// Densities of the IMU's noise.
///
/// ```
/// use inekf_client::dataset::Meta;
/// use inekf_client::table::Faults;
///
/// let mut faults = Faults::new();
/// let meta = Meta::parse(r#"{ "imu_noise": { "gyro_nd": 1e-4, "accel_nd": 2e-3 } }"#, &mut faults);
/// let noise = meta.imu_noise.expect("it is there");
/// // White noise of a sample is its density by the root of the rate: at 100 Hz 1e-3 rad/s.
/// assert!((noise.gyro_density * 100_f64.sqrt() - 1e-3).abs() < 1e-15);
/// // What is not given is zero.
/// assert_eq!(noise.gyro_bias_walk, 0.0);
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ImuNoise {
    /// White noise of the gyro, rad/s/sqrt(Hz).
    pub gyro_density: f64,
    /// White noise of the accelerometer, m/s^2/sqrt(Hz).
    pub accel_density: f64,
    /// Random walk of the gyro bias, rad/s^2/sqrt(Hz).
    pub gyro_bias_walk: f64,
    /// Random walk of the accelerometer bias, m/s^3/sqrt(Hz).
    pub accel_bias_walk: f64,
}

/// The state to start from.
///
/// ```
/// use inekf_client::dataset::{Initial, Meta};
/// use inekf_client::table::Faults;
///
/// let text = r#"{ "initial": { "t_ns": 5, "theta": 0.5, "x": 1.0, "y": 2.0 }, "P0_diag": [0.01, 9, 9] }"#;
/// let mut faults = Faults::new();
/// let initial = Meta::parse(text, &mut faults).initial;
/// assert_eq!(initial, Some(Initial::Planar { stamp_ns: 5, theta_rad: 0.5, p_w_m: [1.0, 2.0] }));
/// assert!(faults.is_empty());
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Initial {
    /// In the plane.
    Planar {
        /// Stamp, ns.
        stamp_ns: u64,
        /// Heading, rad, counter-clockwise from the world x axis.
        theta_rad: f64,
        /// Position, m.
        p_w_m: [f64; 2],
    },
    /// In space.
    Spatial {
        /// Stamp, ns.
        stamp_ns: u64,
        /// Attitude `[x, y, z, w]`, body to world.
        q_wb: [f64; 4],
        /// Velocity, m/s, world frame; zero if the file has none.
        v_w_mps: [f64; 3],
        /// Position, m, world frame.
        p_w_m: [f64; 3],
        /// Gyro bias, rad/s; zero if the file has none.
        gyro_bias_rps: [f64; 3],
        /// Accelerometer bias, m/s^2; zero if the file has none.
        accel_bias_mps2: [f64; 3],
    },
}

/// What is known about a recording; see the module's table of keys.
///
/// ```
/// use inekf_client::dataset::Meta;
/// use inekf_client::table::Faults;
///
/// let mut faults = Faults::new();
/// let meta = Meta::parse(r#"{ "name": "lap", "gravity": 9.81, "driver": "Anna" }"#, &mut faults);
/// assert_eq!((meta.name.as_str(), meta.gravity_mps2), ("lap", Some(9.81)));
/// // A key that means nothing here is kept, and written back.
/// assert!(meta.to_json().contains("\"driver\": \"Anna\""));
/// ```
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Meta {
    /// Name of the dataset.
    pub name: String,
    /// What it holds, such as `imu+position`.
    pub kind: String,
    /// Magnitude of gravity, m/s^2.
    pub gravity_mps2: Option<f64>,
    /// IMU to antenna, body FLU, m, by position source; one alone stands for every source; empty if
    /// not known.
    pub lever_arms_m: Vec<[f64; 3]>,
    /// The IMU's noise.
    pub imu_noise: Option<ImuNoise>,
    /// The state to start from.
    pub initial: Option<Initial>,
    /// Variances of the initial error, in the order of the model.
    pub p0_diag: Option<Vec<f64>>,
    /// Every other key.
    pub other: Map<String, Value>,
}

impl Meta {
    /// The lever arm of a position source, m, body FLU; zero if none is known.
    ///
    /// ```
    /// use inekf_client::dataset::Meta;
    ///
    /// let mut meta = Meta { lever_arms_m: vec![[0.5, 0.0, 1.0]], ..Meta::default() };
    /// // One alone stands for every source.
    /// assert_eq!(meta.lever_arm_m(3), [0.5, 0.0, 1.0]);
    /// meta.lever_arms_m.push([-0.5, 0.0, 1.0]);
    /// assert_eq!(meta.lever_arm_m(1), [-0.5, 0.0, 1.0]);
    /// assert_eq!(meta.lever_arm_m(2), [0.0; 3]);
    /// ```
    pub fn lever_arm_m(&self, source: u32) -> [f64; 3] {
        match self.lever_arms_m.as_slice() {
            [only] => *only,
            arms => usize::try_from(source)
                .ok()
                .and_then(|index| arms.get(index))
                .copied()
                .unwrap_or_default(),
        }
    }

    /// Reads the text of a `meta.json`; faults are added to `faults`.
    ///
    /// ```
    /// use inekf_client::dataset::Meta;
    /// use inekf_client::table::Faults;
    ///
    /// // Every fault is told, each with its key and remedy.
    /// let mut faults = Faults::new();
    /// Meta::parse(r#"{ "gravity": -9.81, "P0_diag": [1, 2] }"#, &mut faults);
    /// assert_eq!(faults.len(), 2);
    /// assert!(faults.list()[0].to_string().starts_with("meta.json gravity: -9.81 is not a magnitude"));
    /// ```
    pub fn parse(text: &str, faults: &mut Faults) -> Self {
        let mut other = match serde_json::from_str::<Value>(text) {
            Ok(Value::Object(map)) => map,
            Ok(_) => {
                faults.push(Fault::in_file(
                    FILE,
                    "it holds no object",
                    "write `{ \"name\": \"...\" }`",
                ));
                return Self::default();
            }
            Err(error) => {
                let line = u64::try_from(error.line()).unwrap_or_default();
                let fault = Fault::in_file(
                    FILE,
                    format!("not JSON: {error}"),
                    "mend it at this line, or delete it",
                );
                faults.push(if line > 0 { fault.at_line(line) } else { fault });
                return Self::default();
            }
        };
        let mut keys = Keys { faults };
        Self {
            name: keys.text(&mut other, "name"),
            kind: keys.text(&mut other, "kind"),
            gravity_mps2: keys.gravity(&mut other),
            lever_arms_m: keys.lever_arms(&mut other),
            imu_noise: keys.imu_noise(&mut other),
            initial: keys.initial(&mut other),
            p0_diag: keys.p0_diag(&mut other),
            other,
        }
    }

    /// The text of a `meta.json`, keys sorted, every double exact.
    ///
    /// ```
    /// use inekf_client::dataset::Meta;
    /// use inekf_client::table::Faults;
    ///
    /// let meta = Meta { name: "lap".to_owned(), gravity_mps2: Some(9.80665), ..Meta::default() };
    /// let mut faults = Faults::new();
    /// assert_eq!(Meta::parse(&meta.to_json(), &mut faults), meta);
    /// ```
    pub fn to_json(&self) -> String {
        let mut map = self.other.clone();
        map.insert("name".to_owned(), json!(self.name));
        map.insert("kind".to_owned(), json!(self.kind));
        if let Some(gravity) = self.gravity_mps2 {
            map.insert("gravity".to_owned(), json!(gravity));
        }
        match self.lever_arms_m.as_slice() {
            [] => {}
            [only] => drop(map.insert("lever_arm_flu_m".to_owned(), json!(only))),
            arms => drop(map.insert("lever_arms".to_owned(), json!(arms))),
        }
        if let Some(noise) = &self.imu_noise {
            let entry = map.entry("imu_noise").or_insert_with(|| json!({}));
            if let Value::Object(entry) = entry {
                entry.insert("gyro_nd".to_owned(), json!(noise.gyro_density));
                entry.insert("accel_nd".to_owned(), json!(noise.accel_density));
                entry.insert("gyro_bias_rw".to_owned(), json!(noise.gyro_bias_walk));
                entry.insert("accel_bias_rw".to_owned(), json!(noise.accel_bias_walk));
            }
        }
        if let Some(initial) = &self.initial {
            map.insert("initial".to_owned(), initial.to_json());
        }
        if let Some(p0_diag) = &self.p0_diag {
            map.insert("P0_diag".to_owned(), json!(p0_diag));
        }
        // `{:#}` of a `Value` is indented JSON and cannot fail.
        format!("{:#}\n", Value::Object(map))
    }
}

impl Initial {
    fn to_json(self) -> Value {
        match self {
            Self::Planar {
                stamp_ns,
                theta_rad,
                p_w_m: [x, y],
            } => {
                json!({ "t_ns": stamp_ns, "theta": theta_rad, "x": x, "y": y })
            }
            Self::Spatial {
                stamp_ns,
                q_wb,
                v_w_mps,
                p_w_m,
                gyro_bias_rps,
                accel_bias_mps2,
            } => json!({
                "t_ns": stamp_ns,
                "qw": q_wb[3], "qx": q_wb[0], "qy": q_wb[1], "qz": q_wb[2],
                "vx": v_w_mps[0], "vy": v_w_mps[1], "vz": v_w_mps[2],
                "x": p_w_m[0], "y": p_w_m[1], "z": p_w_m[2],
                "bgx": gyro_bias_rps[0], "bgy": gyro_bias_rps[1], "bgz": gyro_bias_rps[2],
                "bax": accel_bias_mps2[0], "bay": accel_bias_mps2[1], "baz": accel_bias_mps2[2],
            }),
        }
    }
}

/// Takes the known keys out of the JSON object and says what is wrong with them.
struct Keys<'a> {
    faults: &'a mut Faults,
}

impl Keys<'_> {
    fn fault(&mut self, key: &str, problem: impl Into<String>, remedy: impl Into<String>) {
        self.faults
            .push(Fault::in_file(FILE, problem, remedy).at_column(key));
    }

    fn text(&mut self, map: &mut Map<String, Value>, key: &str) -> String {
        match map.remove(key) {
            None => String::new(),
            Some(Value::String(text)) => text,
            Some(value) => {
                self.fault(key, format!("{value} is not text"), "put it in quotes");
                String::new()
            }
        }
    }

    fn gravity(&mut self, map: &mut Map<String, Value>) -> Option<f64> {
        let value = map.remove("gravity")?;
        let gravity = value.as_f64().filter(|gravity| *gravity >= 0.0);
        if gravity.is_none() {
            self.fault(
                "gravity",
                format!("{value} is not a magnitude"),
                "write it in m/s^2, such as 9.80665",
            );
        }
        gravity
    }

    /// A list of numbers whose length is one of `lengths`.
    fn numbers(&mut self, key: &str, value: &Value, lengths: &[usize]) -> Option<Vec<f64>> {
        let numbers: Option<Vec<f64>> = value
            .as_array()
            .and_then(|entries| entries.iter().map(Value::as_f64).collect());
        let numbers = numbers.filter(|numbers| lengths.contains(&numbers.len()));
        if numbers.is_none() {
            let wanted: Vec<String> = lengths.iter().map(usize::to_string).collect();
            self.fault(
                key,
                format!("{value} does not fit"),
                format!("write a list of {} numbers", wanted.join(" or ")),
            );
        }
        numbers
    }

    fn lever_arms(&mut self, map: &mut Map<String, Value>) -> Vec<[f64; 3]> {
        let (arms, key) = match (map.remove("lever_arms"), map.remove("lever_arm_flu_m")) {
            (Some(Value::Array(arms)), _) => (arms, "lever_arms"),
            (Some(value), _) => {
                self.fault(
                    "lever_arms",
                    format!("{value} is not a list"),
                    "write one [x, y, z] per source",
                );
                return Vec::new();
            }
            (None, Some(arm)) => (vec![arm], "lever_arm_flu_m"),
            (None, None) => return Vec::new(),
        };
        arms.iter()
            .filter_map(|arm| self.numbers(key, arm, &[2, 3]))
            .map(|arm| [arm[0], arm[1], arm.get(2).copied().unwrap_or(0.0)])
            .collect()
    }

    fn imu_noise(&mut self, map: &mut Map<String, Value>) -> Option<ImuNoise> {
        let Some(Value::Object(entry)) = map.get_mut("imu_noise") else {
            if let Some(value) = map.remove("imu_noise") {
                self.fault(
                    "imu_noise",
                    format!("{value} is not an object"),
                    "write `{ \"gyro_nd\": 1e-4, ... }`",
                );
            }
            return None;
        };
        let mut density = |key: &str| match entry.remove(key) {
            None => 0.0,
            Some(value) => value
                .as_f64()
                .filter(|density| *density >= 0.0)
                .unwrap_or_else(|| {
                    let problem = format!("{value} is not a density");
                    self.fault(
                        &format!("imu_noise.{key}"),
                        problem,
                        "write a number from 0 up",
                    );
                    0.0
                }),
        };
        let noise = ImuNoise {
            gyro_density: density("gyro_nd"),
            accel_density: density("accel_nd"),
            gyro_bias_walk: density("gyro_bias_rw"),
            accel_bias_walk: density("accel_bias_rw"),
        };
        if entry.is_empty() {
            map.remove("imu_noise");
        }
        Some(noise)
    }

    fn p0_diag(&mut self, map: &mut Map<String, Value>) -> Option<Vec<f64>> {
        let value = map.remove("P0_diag")?;
        let variances = self.numbers("P0_diag", &value, &[3, 6, 9, 15])?;
        if variances.iter().all(|variance| *variance >= 0.0) {
            return Some(variances);
        }
        self.fault(
            "P0_diag",
            format!("{value} has a negative entry"),
            "variances are 0 or more",
        );
        None
    }

    fn initial(&mut self, map: &mut Map<String, Value>) -> Option<Initial> {
        let Value::Object(entry) = map.remove("initial")? else {
            self.fault(
                "initial",
                "it is not an object",
                "write `{ \"t_ns\": 0, \"theta\": ... }`",
            );
            return None;
        };
        let stamp_ns = entry.get("t_ns").and_then(Value::as_u64);
        if stamp_ns.is_none() {
            self.fault(
                "initial.t_ns",
                "missing, or not a whole number of nanoseconds",
                "write the stamp of the state",
            );
        }
        if entry.contains_key("theta") {
            let numbers = self.group(&entry, "", ["theta", "x", "y"], None);
            let [theta_rad, x, y] = numbers?;
            return Some(Initial::Planar {
                stamp_ns: stamp_ns?,
                theta_rad,
                p_w_m: [x, y],
            });
        }
        let q_wb = self.group(&entry, "q_wb", ["qx", "qy", "qz", "qw"], None);
        let v_w_mps = self.group(&entry, "v_w", ["vx", "vy", "vz"], Some([0.0; 3]));
        let p_w_m = self.group(&entry, "p_w", ["x", "y", "z"], None);
        let gyro_bias_rps = self.group(&entry, "gyro_bias", ["bgx", "bgy", "bgz"], Some([0.0; 3]));
        let accel_bias_mps2 =
            self.group(&entry, "accel_bias", ["bax", "bay", "baz"], Some([0.0; 3]));
        let q_wb = q_wb?;
        let norm = q_wb.iter().map(|value| value * value).sum::<f64>().sqrt();
        if (norm - 1.0).abs() > 1e-3 {
            self.fault(
                "initial",
                format!("the quaternion's norm is {norm:.6}"),
                "write a unit quaternion",
            );
            return None;
        }
        Some(Initial::Spatial {
            stamp_ns: stamp_ns?,
            q_wb,
            v_w_mps: v_w_mps?,
            p_w_m: p_w_m?,
            gyro_bias_rps: gyro_bias_rps?,
            accel_bias_mps2: accel_bias_mps2?,
        })
    }

    /// Numbers of `initial`, from one array or from single keys; `default` if none of them is
    /// there.
    fn group<const N: usize>(
        &mut self,
        entry: &Map<String, Value>,
        array: &str,
        keys: [&str; N],
        default: Option<[f64; N]>,
    ) -> Option<[f64; N]> {
        if let Some(value) = entry.get(array) {
            let numbers = self.numbers(&format!("initial.{array}"), value, &[N])?;
            return <[f64; N]>::try_from(numbers).ok();
        }
        if default.is_some() && keys.iter().all(|key| !entry.contains_key(*key)) {
            return default;
        }
        let mut numbers = [0.0; N];
        let mut good = true;
        for (number, key) in numbers.iter_mut().zip(keys) {
            match entry.get(key).and_then(Value::as_f64) {
                Some(value) => *number = value,
                None => {
                    self.fault(
                        &format!("initial.{key}"),
                        "missing, or not a number",
                        "write a number",
                    );
                    good = false;
                }
            }
        }
        good.then_some(numbers)
    }
}
