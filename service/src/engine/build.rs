//! From a configuration to an engine of the model and filter that it asks for.

use inekf::filter::{Left, Right, UpdateError};
use inekf::lie::SE23;
use inekf::model::NavState;

use super::driver::Engine;
use super::history::History;
use super::inertial::InertialEngine;
use super::model::Model;
use super::odometry;
use super::settings::Settings;
use super::smoothing::SmoothingEngine;
use crate::config::{Config, Invariance, Motion};

/// What is done with an engine, whatever its type.
///
/// ```
/// use inekf_service::config::Config;
/// use inekf_service::engine::{Engine, History, Model, Use, build};
/// use inekf_shared::message::EstimateMessage;
///
/// /// Says which estimates an engine gives, whatever its type.
/// struct WhichModel;
///
/// impl Use for WhichModel {
///     type Output = u32;
///
///     fn with<M: Model + 'static, H: History<M> + 'static>(self, _engine: Engine<M, H>) -> u32 {
///         M::Estimate::MODEL
///     }
/// }
///
/// let text = "model = 'imu'\n[noise]\ngyro_density = 3e-4\naccel_density = 2e-2\n";
/// let config = Config::from_toml_str(text, "example")?;
/// assert_eq!(build(&config, WhichModel)?, inekf_shared::message::MODEL_IMU);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub trait Use {
    /// What comes of it.
    type Output;

    /// Does it.
    ///
    /// ```
    /// use inekf_service::config::Config;
    /// use inekf_service::engine::{Engine, History, Model, Use, build};
    ///
    /// struct IsWaiting;
    ///
    /// impl Use for IsWaiting {
    ///     type Output = bool;
    ///
    ///     fn with<M: Model, H: History<M>>(self, engine: Engine<M, H>) -> bool {
    ///         engine.snapshot().is_none()
    ///     }
    /// }
    ///
    /// let text = "model = 'odometry2d'\n[noise]\nrotation_density = 3e-3\ntranslation_density = 1e-2\n";
    /// assert!(build(&Config::from_toml_str(text, "example")?, IsWaiting)?);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    fn with<M: Model + 'static, H: History<M> + 'static>(
        self,
        engine: Engine<M, H>,
    ) -> Self::Output;
}

/// Hands an engine of the configured model and filter to `user`.
///
/// # Errors
/// The declared mismatches cannot be constrained with the configured sources; the error says why.
///
/// ```
/// use inekf_service::config::Config;
/// use inekf_service::engine::{Engine, History, Model, Use, build};
/// use inekf_shared::message::{EstimateMessage, MODEL_ODOMETRY_3D};
///
/// /// How a sample reaches the daemon, and an estimate its readers.
/// struct Code;
///
/// impl Use for Code {
///     type Output = u32;
///
///     fn with<M: Model, H: History<M>>(self, _engine: Engine<M, H>) -> u32 {
///         M::Estimate::MODEL
///     }
/// }
///
/// let text = "model = 'odometry3d'\n[noise]\nrotation_density = 3e-3\ntranslation_density = 1e-2\n";
/// assert_eq!(build(&Config::from_toml_str(text, "example")?, Code)?, MODEL_ODOMETRY_3D);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn build<U: Use>(config: &Config, user: U) -> Result<U::Output, UpdateError> {
    let settings = Settings::new(config);
    let inertial = match &config.motion {
        Motion::Inertial(inertial) => inertial,
        Motion::Odometry(odometry) => {
            let Settings {
                initial, fusion, ..
            } = settings;
            return odometry::build::build(config, odometry, initial, fusion, user);
        }
    };
    if let Some(smoother) = settings.smoother {
        return Ok(if inertial.biases {
            user.with(SmoothingEngine::<NavState, 15>::smoothing(
                settings, &smoother,
            ))
        } else {
            user.with(SmoothingEngine::<SE23, 9>::smoothing(settings, &smoother))
        });
    }
    let right = config.invariance == Some(Invariance::Right);
    Ok(match (right, inertial.biases) {
        (false, true) => user.with(InertialEngine::<NavState, Left, 15>::new(settings)),
        (false, false) => user.with(InertialEngine::<SE23, Left, 9>::new(settings)),
        (true, true) => user.with(InertialEngine::<NavState, Right, 15>::new(settings)),
        (true, false) => user.with(InertialEngine::<SE23, Right, 9>::new(settings)),
    })
}
