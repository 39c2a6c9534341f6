//! Instances and topics: every service of an instance is called `inekf/<instance>/<topic>`, so several instances run
//! side by side on one host.

use core::fmt;
use core::str::FromStr;

/// Longest name of an instance, in characters.
pub const INSTANCE_MAX_LEN: usize = 64;

/// The name of one daemon and of all that talk to it: 1 to [`INSTANCE_MAX_LEN`] of `A-Z a-z 0-9 _ -`.
///
/// The characters make it safe as one component of a service name and of a file name: it holds no separator and no
/// dot, so it cannot leave a directory.
///
/// ```
/// use inekf_shared::topic::{Instance, Topic};
///
/// let car: Instance = "car-7".parse()?;
/// assert_eq!(Topic::Estimate.service_name(&car), "inekf/car-7/estimate");
/// assert_eq!(Instance::default().as_str(), "default");
/// # Ok::<(), inekf_shared::topic::InstanceError>(())
/// ```
#[derive(Clone, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct Instance(String);

/// A refused name of an instance.
///
/// ```
/// use inekf_shared::topic::Instance;
///
/// let error = Instance::new("../car").expect_err("it would leave its folder");
/// assert!(error.to_string().starts_with("instance name \"../car\" contains '.'"));
/// ```
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error(
    "instance name {name:?} {fault}; an instance name has 1 to {INSTANCE_MAX_LEN} characters out of A-Z, a-z, 0-9, \
     '_' and '-'"
)]
pub struct InstanceError {
    name: String,
    fault: String,
}

impl Instance {
    /// Checks a name. The error says what is wrong with it and what is allowed.
    ///
    /// ```
    /// use inekf_shared::topic::{INSTANCE_MAX_LEN, Instance};
    ///
    /// assert!(Instance::new("a").is_ok());
    /// for refused in ["", "two words", "a/b", &"a".repeat(INSTANCE_MAX_LEN + 1)] {
    ///     assert!(Instance::new(refused).is_err());
    /// }
    /// ```
    pub fn new(name: &str) -> Result<Self, InstanceError> {
        let refuse = |fault: String| InstanceError {
            name: name.to_owned(),
            fault,
        };
        if name.is_empty() {
            return Err(refuse("is empty".to_owned()));
        }
        let allowed = |c: char| c.is_ascii_alphanumeric() || c == '_' || c == '-';
        if let Some(bad) = name.chars().find(|&c| !allowed(c)) {
            return Err(refuse(format!("contains {bad:?}")));
        }
        if name.len() > INSTANCE_MAX_LEN {
            return Err(refuse(format!("has {} characters", name.len())));
        }
        Ok(Self(name.to_owned()))
    }

    /// The name.
    ///
    /// ```
    /// use inekf_shared::topic::Instance;
    ///
    /// assert_eq!(Instance::new("car-7")?.as_str(), "car-7");
    /// # Ok::<(), inekf_shared::topic::InstanceError>(())
    /// ```
    #[must_use]
    pub fn as_str(&self) -> &str {
        &self.0
    }
}

impl Default for Instance {
    /// The instance used when none is named: `default`.
    fn default() -> Self {
        Self("default".to_owned())
    }
}

impl fmt::Display for Instance {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str(&self.0)
    }
}

impl FromStr for Instance {
    type Err = InstanceError;

    fn from_str(name: &str) -> Result<Self, Self::Err> {
        Self::new(name)
    }
}

/// What is said on one service of an instance.
///
/// ```
/// use inekf_shared::topic::{Instance, Topic};
///
/// let instance = Instance::default();
/// let mut names: Vec<String> = Topic::ALL.iter().map(|topic| topic.service_name(&instance)).collect();
/// names.sort();
/// names.dedup();
/// assert_eq!(names.len(), Topic::ALL.len());
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Topic {
    /// Inertial samples, clients to daemon.
    Imu,
    /// Planar odometry increments, clients to daemon.
    Odometry2d,
    /// Spatial odometry increments, clients to daemon.
    Odometry3d,
    /// Position fixes, clients to daemon.
    Position,
    /// Velocity fixes, clients to daemon.
    Velocity,
    /// Heading fixes, clients to daemon.
    Heading,
    /// Estimates in order, daemon to all. The payload depends on the model.
    Estimate,
    /// The newest estimate only, daemon to all.
    Latest,
    /// States that have left the window of a smoother, and on request those in it, daemon to all.
    Smoothed,
    /// Health of the daemon, daemon to all.
    Health,
    /// Everything that the daemon's engine took, in the order in which it took it; daemon to recorders, if it is asked
    /// to.
    Journal,
    /// Requests of clients and the daemon's responses.
    Control,
    /// Wakes a daemon that sleeps between inputs; carries no data.
    Wake,
}

impl Topic {
    /// Every topic.
    pub const ALL: [Self; 13] = [
        Self::Imu,
        Self::Odometry2d,
        Self::Odometry3d,
        Self::Position,
        Self::Velocity,
        Self::Heading,
        Self::Estimate,
        Self::Latest,
        Self::Smoothed,
        Self::Health,
        Self::Journal,
        Self::Control,
        Self::Wake,
    ];

    /// The last part of the service name.
    ///
    /// ```
    /// use inekf_shared::topic::{Instance, Topic};
    ///
    /// assert_eq!(Topic::Imu.name(), "imu");
    /// assert!(Topic::Imu.service_name(&Instance::default()).ends_with("/imu"));
    /// ```
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Imu => "imu",
            Self::Odometry2d => "odometry2d",
            Self::Odometry3d => "odometry3d",
            Self::Position => "position",
            Self::Velocity => "velocity",
            Self::Heading => "heading",
            Self::Estimate => "estimate",
            Self::Latest => "latest",
            Self::Smoothed => "smoothed",
            Self::Health => "health",
            Self::Journal => "journal",
            Self::Control => "control",
            Self::Wake => "wake",
        }
    }

    /// The name of the service: `inekf/<instance>/<topic>`.
    ///
    /// ```
    /// use inekf_shared::topic::{Instance, Topic};
    ///
    /// assert_eq!(Topic::Wake.service_name(&Instance::default()), "inekf/default/wake");
    /// ```
    #[must_use]
    pub fn service_name(self, instance: &Instance) -> String {
        format!("inekf/{instance}/{}", self.name())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn good_names_are_taken_as_they_are() {
        let longest = "x".repeat(INSTANCE_MAX_LEN);
        for name in ["a", "A-b_9", "default", "-", "_", "0", longest.as_str()] {
            assert_eq!(Instance::new(name).unwrap().as_str(), name);
            assert_eq!(name.parse::<Instance>().unwrap().to_string(), name);
        }
        assert_eq!(Instance::default(), Instance::new("default").unwrap());
    }

    #[test]
    fn bad_names_are_refused_with_the_fault_and_the_allowed_characters() {
        let too_long = "x".repeat(INSTANCE_MAX_LEN + 1);
        for (name, fault) in [
            ("", "is empty"),
            (".", "contains '.'"),
            ("..", "contains '.'"),
            ("../x", "contains '.'"),
            ("a/b", "contains '/'"),
            ("a\\b", "contains '\\\\'"),
            ("a b", "contains ' '"),
            ("a\0", "contains '\\0'"),
            ("a\n", "contains '\\n'"),
            ("caf\u{e9}", "contains '\u{e9}'"),
            ("\u{ff21}", "contains '\u{ff21}'"),
            ("a%2f", "contains '%'"),
            (too_long.as_str(), "has 65 characters"),
        ] {
            let text = Instance::new(name).unwrap_err().to_string();
            assert!(text.contains(fault), "{name:?}: {text}");
            assert!(text.contains("A-Z, a-z, 0-9, '_' and '-'"), "{text}");
        }
    }

    #[test]
    fn service_names_are_the_contract() {
        let instance = Instance::new("car-1").unwrap();
        let names: Vec<String> = Topic::ALL
            .iter()
            .map(|topic| topic.service_name(&instance))
            .collect();
        assert_eq!(
            names,
            [
                "inekf/car-1/imu",
                "inekf/car-1/odometry2d",
                "inekf/car-1/odometry3d",
                "inekf/car-1/position",
                "inekf/car-1/velocity",
                "inekf/car-1/heading",
                "inekf/car-1/estimate",
                "inekf/car-1/latest",
                "inekf/car-1/smoothed",
                "inekf/car-1/health",
                "inekf/car-1/journal",
                "inekf/car-1/control",
                "inekf/car-1/wake",
            ]
        );
    }
}
