//! What is wrong with a configuration: every fault of a file at once, one line of text each.

use std::fmt;

/// One fault of a configuration.
///
/// ```
/// use inekf_service::config::Config;
///
/// let text = "model = 'imu'\n[noise]\ngyro_density = -1\naccel_density = 2e-2\n";
/// let faults = Config::from_toml_str(text, "example").expect_err("less than nothing");
/// let fault = &faults.faults[0];
/// // Key, line, value, unit and what may be.
/// assert_eq!((fault.key.as_str(), fault.line), ("noise.gyro_density", Some(3)));
/// assert_eq!(fault.unit, Some("rad/s/sqrt(Hz)"));
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Fault {
    /// Dotted path of the key, such as `position_source[1].lever_arm_m[2]`. Empty if the fault belongs to no key:
    /// a file that cannot be read, or a line that is not TOML.
    pub key: String,
    /// Line of the file, from 1. For a missing key, the line of the table it is missing from. None if there is
    /// no such line.
    pub line: Option<usize>,
    /// The value as written, shortened to one line; for a line that is not TOML, that line. None if nothing was
    /// written.
    pub value: Option<String>,
    /// What is wrong, and where it is not plain, what to do about it.
    pub problem: String,
    /// The unit of the key. None if it has none.
    pub unit: Option<&'static str>,
    /// What the key accepts, in words. None if that is not the point.
    pub allowed: Option<String>,
}

impl Fault {
    /// A fault that belongs to no key and no line.
    pub(super) fn of_file(problem: String) -> Self {
        Self {
            key: String::new(),
            line: None,
            value: None,
            problem,
            unit: None,
            allowed: None,
        }
    }
}

impl fmt::Display for Fault {
    /// One line: `line 12: initial.heading_deg = 400: out of range (allowed: -360 to 360 deg)`.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if let Some(line) = self.line {
            write!(f, "line {line}: ")?;
        }
        match (self.key.as_str(), &self.value) {
            ("", None) => {}
            ("", Some(text)) => write!(f, "`{text}`: ")?,
            (key, None) => write!(f, "{key}: ")?,
            (key, Some(value)) => write!(f, "{key} = {value}: ")?,
        }
        f.write_str(&self.problem)?;
        match (&self.allowed, self.unit) {
            (Some(allowed), Some(unit)) => write!(f, " (allowed: {allowed} {unit})"),
            (Some(allowed), None) => write!(f, " (allowed: {allowed})"),
            (None, Some(unit)) => write!(f, " (unit: {unit})"),
            (None, None) => Ok(()),
        }
    }
}

/// All faults of one configuration, in the order of their lines.
///
/// ```
/// use inekf_service::config::Config;
///
/// // Everything at once: what is misspelt, what is missing, what cannot be.
/// let faults = Config::from_toml_str("modle = 'imu'\n", "example").expect_err("misspelt");
/// assert!(faults.faults.len() >= 2);
/// assert!(faults.to_string().starts_with("example: "));
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct ConfigFaults {
    /// Where the configuration came from: the path of the file, or the name the caller gave.
    pub origin: String,
    /// The faults: at least one, those without a line first.
    pub faults: Vec<Fault>,
}

impl ConfigFaults {
    /// The faults of `origin`, sorted by line.
    pub(super) fn new(origin: &str, mut faults: Vec<Fault>) -> Self {
        faults.sort_by_key(|fault| fault.line);
        Self {
            origin: origin.to_owned(),
            faults,
        }
    }
}

impl fmt::Display for ConfigFaults {
    /// A heading with the origin and the number of faults, then one line per fault; no newline at the end.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let count = self.faults.len();
        write!(
            f,
            "{}: {count} {}",
            self.origin,
            if count == 1 { "fault" } else { "faults" }
        )?;
        self.faults
            .iter()
            .try_for_each(|fault| write!(f, "\n  {fault}"))
    }
}

impl std::error::Error for ConfigFaults {}
