//! The keys that take one of a few names: an enum each, with its table of names in one place.
//!
//! A variant exists only for what this version can run, so a [`Config`](super::Config) never asks for something
//! that is not built. Names that the schema reserves but this version does not build are listed beside the enum:
//! the reader knows them, and refuses them as such rather than as misspelt.

/// A setting that is written as a name.
pub(super) trait Choice: Copy + 'static {
    /// Every value and its name.
    const NAMES: &'static [(Self, &'static str)];
    /// Names that belong to the schema and are not built in this version.
    const NOT_BUILT: &'static [&'static str];
}

/// Declares an enum of named settings, with `as_str`, `parse` and `Display`.
macro_rules! choice {
    (
        $(#[$doc:meta])*
        pub enum $Name:ident { $($(#[$variant_doc:meta])* $Variant:ident = $name:literal,)+ }
        $(not built: $($reserved:literal),+;)?
    ) => {
        $(#[$doc])*
        #[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
        pub enum $Name { $($(#[$variant_doc])* $Variant,)+ }

        impl Choice for $Name {
            const NAMES: &'static [(Self, &'static str)] = &[$(($Name::$Variant, $name)),+];
            const NOT_BUILT: &'static [&'static str] = &[$($($reserved),+)?];
        }

        impl $Name {
            /// The name as the configuration file has it.
            pub const fn as_str(self) -> &'static str {
                match self { $($Name::$Variant => $name,)+ }
            }

            /// The setting of that name; None for any other text.
            pub fn parse(name: &str) -> Option<Self> {
                Self::NAMES.iter().find(|(_, known)| *known == name).map(|&(setting, _)| setting)
            }
        }

        impl std::fmt::Display for $Name {
            fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
                f.write_str(self.as_str())
            }
        }
    };
}

choice! {
    /// Which motion is estimated, and from what.
    ///
    /// ```
    /// use inekf_service::config::Model;
    ///
    /// // As the file has it: `model = "odometry2d"`.
    /// assert_eq!(Model::parse("odometry2d"), Some(Model::Odometry2d));
    /// assert_eq!(Model::Odometry2d.to_string(), "odometry2d");
    /// assert_eq!(Model::parse("boat"), None);
    /// ```
    pub enum Model {
        /// Inertial navigation: attitude, velocity, position and biases from an IMU.
        Imu = "imu",
        /// Rotation and position in space, from increments of odometry.
        Odometry3d = "odometry3d",
        /// Heading and position in the plane, from increments of odometry.
        Odometry2d = "odometry2d",
    }
}

choice! {
    /// Which estimator runs.
    ///
    /// ```
    /// use inekf_service::config::{Config, Estimator};
    ///
    /// let text = "model = 'imu'\n[noise]\ngyro_density = 3e-4\naccel_density = 2e-2\n";
    /// // The invariant filter, if nothing else is asked for.
    /// assert_eq!(Config::from_toml_str(text, "example")?.estimator, Estimator::Inekf);
    /// let smoother = format!("estimator = 'smoother'\n{text}");
    /// assert_eq!(Config::from_toml_str(&smoother, "example")?.estimator, Estimator::Smoother);
    /// # Ok::<(), inekf_service::config::ConfigFaults>(())
    /// ```
    pub enum Estimator {
        /// The invariant extended Kalman filter, iterated if so configured.
        Inekf = "inekf",
        /// The invariant filter whose gain is constrained against the declared mismatches.
        LcInekf = "lc-inekf",
        /// The extended Kalman filter with an additive error, for comparison.
        Ekf = "ekf",
        /// The same with a constrained gain, for comparison.
        LcEkf = "lc-ekf",
        /// The invariant extended H-infinity filter, for comparison.
        InvariantHinf = "invariant-hinf",
        /// The invariant smoother over the newest fixes.
        Smoother = "smoother",
    }
}

choice! {
    /// What the states that have left the smoother's window leave behind.
    pub enum Prior {
        /// A mean on the group, and a frozen covariance.
        Group = "group",
        /// A mean in the coordinates at the point of marginalisation, and a frozen covariance.
        Linear = "linear",
        /// A mean on the group, and a covariance that is carried along; for comparison.
        Recentred = "recentred",
    }
}

choice! {
    /// How the smoother attaches a correction to a state.
    pub enum Parametrisation {
        /// By the exponential of the group, in body coordinates: invariant smoothing.
        Exponential = "exponential",
        /// By the exponential of the group, in world coordinates.
        Right = "right",
        /// Rotation, velocity and position by themselves, the vectors in body axes.
        Gtsam = "gtsam",
        /// Rotation, velocity and position by themselves, the vectors in world axes.
        Forster = "forster",
    }
}

choice! {
    /// How the smoother takes the derivatives of the residuals of motions and of its first prior.
    pub enum Jacobians {
        /// As if the residuals were zero: the gains are constants where the state has no biases.
        Frozen = "frozen",
        /// At the residuals.
        Exact = "exact",
    }
}

choice! {
    /// On which side the estimation error is invariant.
    ///
    /// ```
    /// use inekf_service::config::{Config, Invariance};
    ///
    /// let text = "model = 'imu'\n[noise]\ngyro_density = 3e-4\naccel_density = 2e-2\n";
    /// assert_eq!(Config::from_toml_str(text, "example")?.invariance, Some(Invariance::Left));
    /// # Ok::<(), inekf_service::config::ConfigFaults>(())
    /// ```
    pub enum Invariance {
        /// `chi = chi_hat exp(xi)`: the error in body coordinates.
        Left = "left",
        /// `chi = exp(zeta) chi_hat`: the error in world coordinates.
        Right = "right",
    }
}

choice! {
    /// What the estimator does about the declared mismatches.
    pub enum Mismatch {
        /// The model is taken to be right.
        None = "none",
        /// The gain is made blind to them, whatever their size.
        Hard = "hard",
        /// The gain weighs them by their sigmas, anew at each update.
        Soft = "soft",
        /// They are unknown constants that the gain allows for and does not estimate.
        Consider = "consider",
        /// They are estimated as part of the state.
        Augmented = "augmented",
        /// They are estimated by a bank of hypotheses: absent, constant, or coming in bursts.
        Adaptive = "adaptive",
    }
}

choice! {
    /// What a declared mismatch is about.
    pub enum MismatchKind {
        /// The translation of every row is too long or too short by one factor.
        OdometryScale = "odometry_scale",
        /// The rotation of every row is too large or too small by one factor.
        OdometryTurnScale = "odometry_turn_scale",
        /// The rotation of every row gains a constant rate about one body axis.
        OdometryRotationBias = "odometry_rotation_bias",
        /// A source of position sees the world enlarged by one factor.
        MeasurementScale = "measurement_scale",
        /// A source of position sees the world turned.
        MeasurementRotation = "measurement_rotation",
    }
}

choice! {
    /// An axis of the body or of the world.
    pub enum Axis {
        /// Forward, or east.
        X = "x",
        /// Left, or north.
        Y = "y",
        /// Up.
        Z = "z",
    }
}

choice! {
    /// What happens to a fix whose stacking partner does not come.
    pub enum MissingPartner {
        /// It is fused alone, with the ordinary gain.
        Unconstrained = "unconstrained",
        /// It is dropped and counted.
        Skip = "skip",
    }
}

choice! {
    /// Which gain goes with the covariance of the H-infinity filter.
    pub enum HinfGain {
        /// The gain that belongs to the widened covariance.
        Widened = "widened",
        /// The Kalman gain of the prior; only the covariance is widened.
        Kalman = "kalman",
    }
}

choice! {
    /// How the continuous motion is stepped over one sample.
    pub enum Discretisation {
        /// Exact for an input that is constant over the interval.
        Zoh = "zoh",
        /// First order in the interval, as the papers print it.
        Euler = "euler",
    }
}

choice! {
    /// Which interval an IMU sample speaks for.
    ///
    /// ```
    /// use inekf_service::config::Hold;
    ///
    /// assert_eq!(Hold::parse("backward").map(Hold::as_str), Some("backward"));
    /// ```
    pub enum Hold {
        /// The interval that ends at its stamp.
        Backward = "backward",
        /// The interval that begins at its stamp.
        Forward = "forward",
        /// The mean of the samples at both ends of the interval.
        Midpoint = "midpoint",
    }
}

choice! {
    /// What happens when the IMU or the odometry was silent for longer than its `max_gap_s`.
    pub enum GapPolicy {
        /// Propagate over the gap with inflated noise.
        Inflate = "inflate",
        /// Forget the state and initialise again.
        Reinitialise = "reinitialise",
    }
}

choice! {
    /// Where the initial roll and pitch come from.
    pub enum Level {
        /// The direction of the mean specific force over `initial.level_window_s`.
        Accelerometer = "accelerometer",
        /// `initial.roll_deg` and `initial.pitch_deg`.
        Given = "given",
    }
}

choice! {
    /// How the covariance reaches the new linearisation point after an update.
    pub enum Transport {
        /// By the right Jacobian of the group.
        Jacobian = "jacobian",
        /// Not at all, as in the paper's plain filter.
        None = "none",
    }
}

choice! {
    /// How a fix that comes after later samples is fused.
    pub enum LateMethod {
        /// What it corrects is carried to the newest state in constant time where that is exact and cheaper; elsewhere
        /// the samples since are replayed.
        Carry = "carry",
        /// The samples since are replayed: the estimate is bit for bit what it would have been on time.
        Replay = "replay",
    }
}

choice! {
    /// How the daemon waits for samples.
    ///
    /// ```
    /// use inekf_service::config::{Config, WaitMode};
    ///
    /// let text = "model = 'imu'\n[noise]\ngyro_density = 3e-4\naccel_density = 2e-2\n[runtime]\nwait = 'event'\n";
    /// assert_eq!(Config::from_toml_str(text, "example")?.runtime.wait, WaitMode::Event);
    /// # Ok::<(), inekf_service::config::ConfigFaults>(())
    /// ```
    pub enum WaitMode {
        /// Asleep until a sender wakes it.
        Event = "event",
        /// Awake, asking again and again: lowest latency, one core in use.
        Spin = "spin",
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn names_are_one_to_one<T: Choice + PartialEq + std::fmt::Debug>(
        as_str: fn(T) -> &'static str,
        parse: fn(&str) -> Option<T>,
    ) {
        for &(setting, name) in T::NAMES {
            assert_eq!(as_str(setting), name);
            assert_eq!(parse(name), Some(setting));
            assert_eq!(parse(&name.to_uppercase()), None, "names are lower case");
        }
        for name in T::NOT_BUILT {
            assert_eq!(parse(name), None, "{name} is not built");
        }
        assert_eq!(parse(""), None);
    }

    #[test]
    fn every_enum_reads_back_its_own_names() {
        names_are_one_to_one(Model::as_str, Model::parse);
        names_are_one_to_one(Estimator::as_str, Estimator::parse);
        names_are_one_to_one(Invariance::as_str, Invariance::parse);
        names_are_one_to_one(Mismatch::as_str, Mismatch::parse);
        names_are_one_to_one(MismatchKind::as_str, MismatchKind::parse);
        names_are_one_to_one(Prior::as_str, Prior::parse);
        names_are_one_to_one(Parametrisation::as_str, Parametrisation::parse);
        names_are_one_to_one(Jacobians::as_str, Jacobians::parse);
        names_are_one_to_one(Axis::as_str, Axis::parse);
        names_are_one_to_one(MissingPartner::as_str, MissingPartner::parse);
        names_are_one_to_one(HinfGain::as_str, HinfGain::parse);
        names_are_one_to_one(Discretisation::as_str, Discretisation::parse);
        names_are_one_to_one(Hold::as_str, Hold::parse);
        names_are_one_to_one(GapPolicy::as_str, GapPolicy::parse);
        names_are_one_to_one(Level::as_str, Level::parse);
        names_are_one_to_one(Transport::as_str, Transport::parse);
        names_are_one_to_one(WaitMode::as_str, WaitMode::parse);
    }
}
