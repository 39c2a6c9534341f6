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

/// Declares an enum of named settings, with `as_str` and `Display`.
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
            pub(super) const fn as_str(self) -> &'static str {
                match self { $($Name::$Variant => $name,)+ }
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
    /// assert_eq!(Model::Odometry2d.to_string(), "odometry2d");
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
    ///
    /// ```
    #[doc = include_str!("example.txt")]
    /// let text = format!("estimator = 'smoother'\n{IMU}[smoother]\nprior = 'linear'\n");
    /// assert_eq!(read(text)?.smoother.map(|smoother| smoother.prior), Some(Prior::Linear));
    /// # Ok::<(), ConfigFaults>(())
    /// ```
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
    ///
    /// ```
    #[doc = include_str!("example.txt")]
    /// let text = format!("estimator = 'smoother'\n{IMU}[smoother]\nparametrisation = 'gtsam'\n");
    /// assert_eq!(read(text)?.smoother.map(|smoother| smoother.parametrisation), Some(Parametrisation::Gtsam));
    /// # Ok::<(), ConfigFaults>(())
    /// ```
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
    ///
    /// ```
    #[doc = include_str!("example.txt")]
    /// let text = format!("estimator = 'smoother'\n{IMU}[smoother]\njacobians = 'exact'\n");
    /// assert_eq!(read(text)?.smoother.map(|smoother| smoother.jacobians), Some(Jacobians::Exact));
    /// # Ok::<(), ConfigFaults>(())
    /// ```
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
    ///
    /// ```
    #[doc = include_str!("example.txt")]
    /// let text = format!("mismatch = 'augmented'\n{ODOMETRY}[[mismatched]]\nwhat = 'odometry_scale'\nsigma = 0.05\n");
    /// assert_eq!(read(text)?.mismatch, Mismatch::Augmented);
    /// // With nothing declared the model is taken to be right.
    /// assert_eq!(read(ODOMETRY.to_owned())?.mismatch, Mismatch::None);
    /// # Ok::<(), ConfigFaults>(())
    /// ```
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
    ///
    /// ```
    #[doc = include_str!("example.txt")]
    /// assert_eq!(MismatchKind::OdometryScale.to_string(), "odometry_scale");
    /// let text = format!("mismatch = 'augmented'\n{ODOMETRY}[[mismatched]]\nwhat = 'odometry_scale'\nsigma = 0.05\n");
    /// assert_eq!(read(text)?.mismatched[0].what, Wrong::OdometryScale);
    /// # Ok::<(), ConfigFaults>(())
    /// ```
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
    ///
    /// ```
    #[doc = include_str!("example.txt")]
    /// // In the plane there is one axis to turn about.
    /// let text = format!("mismatch = 'augmented'\n{ODOMETRY}[[mismatched]]\nwhat = 'odometry_rotation_bias'\nsigma = 0.01\n");
    /// assert_eq!(read(text)?.mismatched[0].what, Wrong::OdometryRotationBias { axis: Axis::Z });
    /// # Ok::<(), ConfigFaults>(())
    /// ```
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
    ///
    /// ```
    #[doc = include_str!("example.txt")]
    /// assert_eq!(MissingPartner::Skip.to_string(), "skip");
    /// # Ok::<(), ConfigFaults>(())
    /// ```
    pub enum MissingPartner {
        /// It is fused alone, with the ordinary gain.
        Unconstrained = "unconstrained",
        /// It is dropped and counted.
        Skip = "skip",
    }
}

choice! {
    /// Which gain goes with the covariance of the H-infinity filter.
    ///
    /// ```
    #[doc = include_str!("example.txt")]
    /// let text = format!("estimator = 'invariant-hinf'\n{ODOMETRY}[hinf]\ngamma = 0.01\ngain = 'kalman'\n");
    /// assert_eq!(read(text)?.hinf.map(|hinf| hinf.gain), Some(HinfGain::Kalman));
    /// # Ok::<(), ConfigFaults>(())
    /// ```
    pub enum HinfGain {
        /// The gain that belongs to the widened covariance.
        Widened = "widened",
        /// The Kalman gain of the prior; only the covariance is widened.
        Kalman = "kalman",
    }
}

choice! {
    /// How the continuous motion is stepped over one sample.
    ///
    /// ```
    #[doc = include_str!("example.txt")]
    /// // Exact, unless the papers' steps are asked for.
    /// assert_eq!(inertial(IMU.to_owned())?.discretisation, Discretisation::Zoh);
    /// assert_eq!(inertial(format!("discretisation = 'euler'\n{IMU}"))?.discretisation, Discretisation::Euler);
    /// # Ok::<(), ConfigFaults>(())
    /// ```
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
    #[doc = include_str!("example.txt")]
    /// assert_eq!(inertial(IMU.to_owned())?.hold, Hold::Backward);
    /// assert_eq!(inertial(format!("hold = 'midpoint'\n{IMU}"))?.hold, Hold::Midpoint);
    /// # Ok::<(), ConfigFaults>(())
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
    ///
    /// ```
    #[doc = include_str!("example.txt")]
    /// let text = format!("{IMU}[imu]\non_gap = 'reinitialise'\n");
    /// assert_eq!(inertial(text)?.imu.on_gap, GapPolicy::Reinitialise);
    /// # Ok::<(), ConfigFaults>(())
    /// ```
    pub enum GapPolicy {
        /// Propagate over the gap with inflated noise.
        Inflate = "inflate",
        /// Forget the state and initialise again.
        Reinitialise = "reinitialise",
    }
}

choice! {
    /// Where the initial roll and pitch come from.
    ///
    /// ```
    #[doc = include_str!("example.txt")]
    /// // An accelerometer feels which way is up; odometry does not.
    /// assert_eq!(read(IMU.to_owned())?.initial.level, Level::Accelerometer);
    /// assert_eq!(read(ODOMETRY.to_owned())?.initial.level, Level::Given);
    /// # Ok::<(), ConfigFaults>(())
    /// ```
    pub enum Level {
        /// The direction of the mean specific force over `initial.level_window_s`.
        Accelerometer = "accelerometer",
        /// `initial.roll_deg` and `initial.pitch_deg`.
        Given = "given",
    }
}

choice! {
    /// How the covariance reaches the new linearisation point after an update.
    ///
    /// ```
    #[doc = include_str!("example.txt")]
    /// let text = format!("{IMU}[update]\niterations = 1\ntransport = 'none'\n");
    /// assert_eq!(read(text)?.update.transport, Transport::None);
    /// # Ok::<(), ConfigFaults>(())
    /// ```
    pub enum Transport {
        /// By the right Jacobian of the group.
        Jacobian = "jacobian",
        /// Not at all, as in the paper's plain filter.
        None = "none",
    }
}

choice! {
    /// How a fix that comes after later samples is fused.
    ///
    /// ```
    #[doc = include_str!("example.txt")]
    /// assert_eq!(read(format!("{IMU}[late]\nmethod = 'replay'\n"))?.late.method, LateMethod::Replay);
    /// # Ok::<(), ConfigFaults>(())
    /// ```
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

    fn names_are_one_to_one<T: Choice + std::fmt::Display>() {
        let not_built = T::NOT_BUILT.iter().copied();
        let mut names: Vec<&str> = not_built.collect();
        for &(setting, name) in T::NAMES {
            assert_eq!(setting.to_string(), name);
            assert_eq!(name, name.to_lowercase());
            assert!(!names.contains(&name), "{name} twice");
            names.push(name);
        }
    }

    #[test]
    fn no_two_settings_have_one_name() {
        names_are_one_to_one::<Model>();
        names_are_one_to_one::<Estimator>();
        names_are_one_to_one::<Invariance>();
        names_are_one_to_one::<Mismatch>();
        names_are_one_to_one::<MismatchKind>();
        names_are_one_to_one::<Prior>();
        names_are_one_to_one::<Parametrisation>();
        names_are_one_to_one::<Jacobians>();
        names_are_one_to_one::<Axis>();
        names_are_one_to_one::<MissingPartner>();
        names_are_one_to_one::<HinfGain>();
        names_are_one_to_one::<Discretisation>();
        names_are_one_to_one::<Hold>();
        names_are_one_to_one::<GapPolicy>();
        names_are_one_to_one::<Level>();
        names_are_one_to_one::<Transport>();
        names_are_one_to_one::<LateMethod>();
        names_are_one_to_one::<WaitMode>();
    }
}
