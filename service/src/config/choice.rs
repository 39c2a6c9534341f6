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
    pub enum Model {
        /// Inertial navigation: attitude, velocity, position and biases from an IMU.
        Imu = "imu",
    }
    not built: "odometry3d", "odometry2d";
}

choice! {
    /// Which estimator runs.
    pub enum Estimator {
        /// The invariant extended Kalman filter, iterated if so configured.
        Inekf = "inekf",
    }
    not built: "lc-inekf", "ekf", "lc-ekf", "invariant-hinf", "smoother";
}

choice! {
    /// On which side the estimation error is invariant.
    pub enum Invariance {
        /// `chi = chi_hat exp(xi)`: the error in body coordinates.
        Left = "left",
    }
    not built: "right";
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
    /// What happens when the IMU was silent for longer than `imu.max_gap_s`.
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
    /// How the daemon waits for samples.
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
        names_are_one_to_one(Discretisation::as_str, Discretisation::parse);
        names_are_one_to_one(Hold::as_str, Hold::parse);
        names_are_one_to_one(GapPolicy::as_str, GapPolicy::parse);
        names_are_one_to_one(Level::as_str, Level::parse);
        names_are_one_to_one(Transport::as_str, Transport::parse);
        names_are_one_to_one(WaitMode::as_str, WaitMode::parse);
    }
}
