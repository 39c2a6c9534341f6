//! Dataset folders: recorded or simulated sensor data as CSV files and a `meta.json`.
//!
//! | file | columns |
//! |---|---|
//! | `imu.csv` | `t_ns,gx,gy,gz,ax,ay,az`: rad/s; specific force, m/s^2; body FLU |
//! | `odometry.csv` | planar `t_ns,dtheta,dx,dy`, spatial `t_ns,rx,ry,rz,dx,dy,dz`: body motion since the previous row |
//! | `position.csv` | `t_ns,x,y,z,sx,sy,sz[,source]`: world ENU, m, one sigma; `z` and `sz` empty in the plane |
//! | | or `t_ns,lat,lon,alt,sx,sy,sz[,source]`: degrees and metres above the ellipsoid (WGS 84), sigmas in ENU metres; the world's origin is `origin_lat_lon_alt` of `meta.json`, else the first fix |
//! | `velocity.csv` | `t_ns,vx,vy,vz,sx,sy,sz[,source]`: world ENU, m/s, one sigma |
//! | `heading.csv` | `t_ns,heading,sigma[,source]`: rad, counter-clockwise from east |
//! | `truth.csv` | `t_ns,qw,qx,qy,qz,vx,vy,vz,x,y,z` (may add `bgx,bgy,bgz,bax,bay,baz`), or planar `t_ns,theta,x,y` |
//! | `meta.json` | see [`Meta`] |
//!
//! One of `imu.csv` and `odometry.csv` is required, everything else is optional. Columns are found
//! by name, others are ignored. `t_ns` is a whole number of nanoseconds of the sensor clock.
//!
//! ```
//! use inekf_client::dataset::{Dataset, Event, ImuRow, PositionRow};
//!
//! let imu = |stamp_ns| ImuRow { stamp_ns, gyro_rps: [0.0; 3], accel_mps2: [0.0, 0.0, 9.80665] };
//! let fix = PositionRow {
//!     stamp_ns: 15,
//!     source: 0,
//!     dimension: 3,
//!     position_w_m: [1.0, 2.0, 3.0],
//!     sigma_m: [0.5; 3],
//! };
//! let dataset = Dataset { imu: vec![imu(10), imu(20)], position: vec![fix], ..Dataset::default() };
//! let stamps: Vec<u64> = dataset.events().map(|event| event.stamp_ns()).collect();
//! assert_eq!(stamps, [10, 15, 20]);
//! assert!(matches!(dataset.events().nth(1), Some(Event::Position(_))));
//! ```

mod events;
mod fit;
mod geodetic;
mod load;
mod meta;
mod rows;
mod save;

use std::io;
use std::path::PathBuf;

pub use events::{Event, Events};
pub use fit::Unfit;
pub use load::{LoadOptions, read_truth};
pub use meta::{ImuNoise, Initial, Meta};
pub use rows::{
    HeadingRow, ImuBias, ImuRow, Odometry2dRow, Odometry3dRow, PositionRow, Truth2dRow, TruthRow,
    VelocityRow,
};
pub use save::save_truth;

use crate::table::Faults;

/// A dataset in memory. Every list is sorted by stamp, fixes with one stamp by source; loading and
/// simulating guarantee it, and [`Dataset::sort`] restores it after changes by hand.
///
/// ```
/// use inekf_client::dataset::{Dataset, ImuRow};
///
/// let sample = |stamp_ns| ImuRow { stamp_ns, gyro_rps: [0.0; 3], accel_mps2: [0.0, 0.0, 9.81] };
/// let mut drive = Dataset { imu: vec![sample(20), sample(10)], ..Dataset::default() };
/// drive.sort();
/// assert_eq!(drive.events().map(|event| event.stamp_ns()).collect::<Vec<_>>(), [10, 20]);
/// ```
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Dataset {
    /// What is known about the recording.
    pub meta: Meta,
    /// IMU samples.
    pub imu: Vec<ImuRow>,
    /// Wheel or visual odometry.
    pub odometry: Odometry,
    /// Position fixes of all sources.
    pub position: Vec<PositionRow>,
    /// Velocity fixes of all sources.
    pub velocity: Vec<VelocityRow>,
    /// Heading fixes of all sources.
    pub heading: Vec<HeadingRow>,
    /// The truth, if known.
    pub truth: Truth,
}

/// Odometry rows, in the plane or in space.
///
/// ```
/// use inekf_client::dataset::{Dataset, Odometry, Odometry2dRow};
/// use inekf_client::model::Model;
///
/// let row = Odometry2dRow { stamp_ns: 1, dtheta_rad: 0.1, translation_m: [1.0, 0.0] };
/// let planar = Dataset { odometry: Odometry::Planar(vec![row]), ..Dataset::default() };
/// assert_eq!(planar.models(), [Model::Odometry2d]);
/// assert_eq!(Dataset::default().odometry, Odometry::None);
/// ```
#[derive(Clone, Debug, Default, PartialEq)]
pub enum Odometry {
    /// The dataset has none.
    #[default]
    None,
    /// Increments on SE(2).
    Planar(Vec<Odometry2dRow>),
    /// Increments on SE(3).
    Spatial(Vec<Odometry3dRow>),
}

/// Truth rows, in the plane or in space.
///
/// ```
/// use inekf_client::dataset::{Truth, Truth2dRow};
/// use inekf_client::evaluate::Trajectory;
///
/// let truth = Truth::Planar(vec![Truth2dRow { stamp_ns: 3, theta_rad: 1.0, p_w_m: [2.0, 0.0] }]);
/// let trajectory = Trajectory::from_truth(&truth);
/// assert!((trajectory.poses()[0].heading_rad() - 1.0).abs() < 1e-15);
/// ```
#[derive(Clone, Debug, Default, PartialEq)]
pub enum Truth {
    /// The dataset has none.
    #[default]
    None,
    /// Poses on SE(2).
    Planar(Vec<Truth2dRow>),
    /// Attitude, velocity and position, perhaps biases.
    Spatial(Vec<TruthRow>),
}

impl Dataset {
    /// Sorts every list by stamp, and fixes with one stamp by source.
    ///
    /// ```
    /// use inekf_client::dataset::{Dataset, HeadingRow};
    ///
    /// let fix = |stamp_ns, source| HeadingRow { stamp_ns, source, heading_rad: 0.0, sigma_rad: 0.1 };
    /// let mut drive = Dataset { heading: vec![fix(5, 1), fix(5, 0), fix(2, 1)], ..Dataset::default() };
    /// drive.sort();
    /// assert_eq!(drive.heading, [fix(2, 1), fix(5, 0), fix(5, 1)]);
    /// ```
    pub fn sort(&mut self) {
        self.imu.sort_by_key(|row| row.stamp_ns);
        match &mut self.odometry {
            Odometry::None => {}
            Odometry::Planar(rows) => rows.sort_by_key(|row| row.stamp_ns),
            Odometry::Spatial(rows) => rows.sort_by_key(|row| row.stamp_ns),
        }
        self.position.sort_by_key(|row| (row.stamp_ns, row.source));
        self.velocity.sort_by_key(|row| (row.stamp_ns, row.source));
        self.heading.sort_by_key(|row| (row.stamp_ns, row.source));
        match &mut self.truth {
            Truth::None => {}
            Truth::Planar(rows) => rows.sort_by_key(|row| row.stamp_ns),
            Truth::Spatial(rows) => rows.sort_by_key(|row| row.stamp_ns),
        }
    }

    /// All sensor rows in the order in which they are to be fed: by stamp, and at one stamp
    /// position (by source), then velocity, then heading, then the IMU sample, then odometry, so
    /// that a fix is there when the sample that reaches its stamp arrives. A daemon of one model
    /// takes [`Dataset::events_for`] that model.
    ///
    /// ```
    /// use inekf_client::simulate::{Scenario, SimulationOptions, simulate};
    ///
    /// let options = SimulationOptions { duration_s: 1.0, ..SimulationOptions::default() };
    /// let drive = simulate(Scenario::RoadCircuit, &options)?;
    /// // Each row once, in the order of time.
    /// let stamps_ns: Vec<u64> = drive.events().map(|event| event.stamp_ns()).collect();
    /// assert_eq!(stamps_ns.len(), drive.imu.len() + drive.position.len());
    /// assert!(stamps_ns.is_sorted());
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn events(&self) -> Events<'_> {
        Events::new(self)
    }
}

/// Why a dataset folder could not be read or written. `Display` is one line.
///
/// ```
/// use inekf_client::dataset::{Dataset, DatasetError};
///
/// let folder = tempfile::tempdir()?;
/// std::fs::write(folder.path().join("imu.csv"), "t_ns,gx,gy,gz,ax,ay,az\n0,0,0,x,0,0,9.8\n")?;
/// // The fault names the file, the line and the column.
/// let Err(DatasetError::Faults { faults, .. }) = Dataset::load(folder.path()) else {
///     panic!("x is no number")
/// };
/// assert!(faults.to_string().starts_with("imu.csv line 2 gz: "));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug, thiserror::Error)]
pub enum DatasetError {
    /// The folder is not there or cannot be read.
    #[error("{}: {cause}; name a folder that holds imu.csv or odometry.csv", path.display())]
    Folder {
        /// The folder.
        path: PathBuf,
        /// What the system says.
        cause: io::Error,
    },
    /// A file cannot be opened or written.
    #[error("{}: {cause}", path.display())]
    File {
        /// The file.
        path: PathBuf,
        /// What the system says.
        cause: io::Error,
    },
    /// The files have faults; the list has all of them.
    #[error("{}: {faults}", path.display())]
    Faults {
        /// The folder or file.
        path: PathBuf,
        /// What is wrong, where, and how to mend it.
        faults: Faults,
    },
}
