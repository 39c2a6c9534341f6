//! Which rows of a dataset a daemon's model takes.
//!
//! A folder may hold more than one model can use: the model `imu` takes IMU samples, position, velocity and heading
//! fixes; the models `odometry3d` and `odometry2d` take odometry rows of their kind and position fixes. What is of no
//! use to the model is not sent. What the model cannot do without is refused.

use super::events::Events;
use super::{Dataset, Odometry};
use crate::model::Model;

/// Why a daemon's model cannot be fed with a dataset. `Display` is one line.
///
/// ```
/// use inekf_client::dataset::{Dataset, Unfit};
/// use inekf_client::model::Model;
///
/// let empty = Dataset::default();
/// let unfit = empty.events_for(Model::Imu).expect_err("it has no samples");
/// assert!(matches!(unfit, Unfit::NoMotion { file: "imu.csv", .. }));
/// // One line, with the remedy.
/// assert!(unfit.to_string().ends_with("add it"));
/// ```
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum Unfit {
    /// The samples that move the state are missing.
    #[error("there is no {file} with {columns}, which the daemon's model {model} needs: {remedy}")]
    NoMotion {
        /// The daemon's model.
        model: Model,
        /// The file.
        file: &'static str,
        /// Its columns.
        columns: &'static str,
        /// What to do.
        remedy: String,
    },
    /// A fix lies in the plane, the model in space.
    #[error(
        "position.csv has a fix without z (source {source_id}, {stamp_ns} ns), but the daemon's model {model} \
         needs x, y and z: fill in z and sz, or use a configuration with model = 'odometry2d'"
    )]
    PlanarFix {
        /// The daemon's model.
        model: Model,
        /// The fix's sensor.
        source_id: u32,
        /// The fix's stamp, ns.
        stamp_ns: u64,
    },
}

impl Dataset {
    /// The rows that a daemon of `model` takes, in feeding order, with at least one that moves its state.
    ///
    /// # Errors
    /// [`Unfit`] if the samples that move the state are missing, or a fix has fewer dimensions than the model. A fix
    /// with more is sent as it is: a planar daemon leaves z aside.
    ///
    /// ```
    /// use inekf_client::dataset::Event;
    /// use inekf_client::model::Model;
    /// use inekf_client::simulate::{Scenario, SimulationOptions, VelocityOptions, simulate};
    ///
    /// let options = SimulationOptions {
    ///     duration_s: 1.0,
    ///     velocity: Some(VelocityOptions::default()),
    ///     ..SimulationOptions::default()
    /// };
    /// let drive = simulate(Scenario::RoadCircuit, &options)?;
    /// assert_eq!(drive.events_for(Model::Imu)?.len(), drive.events().len());
    /// // There is no wheel to drive an odometry model with.
    /// assert!(drive.events_for(Model::Odometry2d).is_err());
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn events_for(&self, model: Model) -> Result<Events<'_>, Unfit> {
        if !self.models().contains(&model) {
            return Err(self.no_motion(model));
        }
        if model != Model::Odometry2d
            && let Some(fix) = self.position.iter().find(|fix| fix.dimension != 3)
        {
            return Err(Unfit::PlanarFix {
                model,
                source_id: fix.source,
                stamp_ns: fix.stamp_ns,
            });
        }
        Ok(Events::of_model(self, model))
    }

    /// The models whose state this dataset can move.
    ///
    /// ```
    /// use inekf_client::model::Model;
    /// use inekf_client::simulate::{PlanarOptions, simulate_planar};
    ///
    /// let drive = simulate_planar(&PlanarOptions { duration_s: 1.0, ..PlanarOptions::default() })?;
    /// assert_eq!(drive.models(), [Model::Odometry2d]);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn models(&self) -> Vec<Model> {
        let odometry = match &self.odometry {
            Odometry::Planar(rows) if !rows.is_empty() => Some(Model::Odometry2d),
            Odometry::Spatial(rows) if !rows.is_empty() => Some(Model::Odometry3d),
            _ => None,
        };
        let imu = (!self.imu.is_empty()).then_some(Model::Imu);
        imu.into_iter().chain(odometry).collect()
    }

    fn no_motion(&self, model: Model) -> Unfit {
        let (file, columns) = match model {
            Model::Imu => ("imu.csv", super::load::IMU),
            Model::Odometry3d => ("odometry.csv", super::load::ODOMETRY_3D),
            Model::Odometry2d => ("odometry.csv", super::load::ODOMETRY_2D),
        };
        let others: Vec<String> = self
            .models()
            .into_iter()
            .map(|other| format!("model = '{other}'"))
            .collect();
        let remedy = match others.as_slice() {
            [] => "add it".to_owned(),
            others => format!(
                "add it, or use a configuration with {}",
                others.join(" or ")
            ),
        };
        Unfit::NoMotion {
            model,
            file,
            columns,
            remedy,
        }
    }
}
