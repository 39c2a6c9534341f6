//! Comparing estimates with the truth.
//!
//! Errors are estimate minus truth: position and velocity in the world frame (ENU), heading wrapped
//! to `(-pi, pi]`, attitude as the angle of `R_true^T R_hat`. The truth is interpolated at the
//! estimate's stamps, linearly in position and velocity and along the shortest arc in attitude; it
//! is never extrapolated, and not interpolated over gaps longer than the caller allows.
//!
//! ```
//! use inekf_client::evaluate::{DEFAULT_MAX_GAP_NS, Pose, Trajectory, errors, summarise};
//! use nalgebra::{UnitQuaternion, Vector3};
//!
//! let drive = |off_m: f64| {
//!     let pose = |i: u64| Pose {
//!         stamp_ns: i * 10_000_000,
//!         q_wb: UnitQuaternion::identity(),
//!         v_w_mps: None,
//!         p_w_m: Vector3::new(i as f64 * 0.1, off_m, 0.0),
//!     };
//!     Trajectory::new((0..100).map(pose).collect())
//! };
//! let errors = errors(&drive(0.3), &drive(0.0), DEFAULT_MAX_GAP_NS);
//! let summary = summarise(&errors, 0).expect("they have time in common");
//! assert!((summary.position_rmse_m - Vector3::new(0.0, 0.3, 0.0)).norm() < 1e-12);
//! ```

use nalgebra::{DMatrix, DVector, Matrix3, Quaternion, UnitQuaternion, Vector3};

use crate::dataset::Truth;
use crate::table::estimate::triangle_len;
use crate::table::{EstimateRow, EstimateState, Layout};

/// A motion at one time, from the truth or an estimate. In the plane z is 0, and attitude a turn
/// about z.
///
/// ```
/// use inekf_client::evaluate::Pose;
/// use nalgebra::{UnitQuaternion, Vector3};
///
/// let north = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), 90_f64.to_radians());
/// let pose = Pose { stamp_ns: 0, q_wb: north, v_w_mps: None, p_w_m: Vector3::zeros() };
/// // Body to world: forwards is north, left is west.
/// assert!((pose.q_wb * Vector3::x() - Vector3::y()).norm() < 1e-15);
/// assert!((pose.heading_rad().to_degrees() - 90.0).abs() < 1e-12);
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pose {
    /// Stamp, ns.
    pub stamp_ns: u64,
    /// Attitude, body to world.
    pub q_wb: UnitQuaternion<f64>,
    /// Velocity, m/s, world frame, if known.
    pub v_w_mps: Option<Vector3<f64>>,
    /// Position, m, world frame.
    pub p_w_m: Vector3<f64>,
}

impl Pose {
    /// Heading of the body x axis, rad, counter-clockwise from the world x axis.
    ///
    /// ```
    /// use inekf_client::evaluate::estimate_pose;
    /// use inekf_client::table::EstimateState;
    ///
    /// let pose = estimate_pose(0, &EstimateState::Plane { theta_rad: 2.0, p_w_m: [0.0; 2] });
    /// assert!((pose.heading_rad() - 2.0).abs() < 1e-12);
    /// ```
    pub fn heading_rad(&self) -> f64 {
        heading_rad(&self.q_wb)
    }

    /// The pose seen in the plane: z and its velocity dropped, attitude cut down to the heading.
    fn flattened(&self) -> Self {
        let flat = |vector: &Vector3<f64>| Vector3::new(vector.x, vector.y, 0.0);
        let p_w_m = flat(&self.p_w_m);
        let pose = planar(self.stamp_ns, self.heading_rad(), [p_w_m.x, p_w_m.y]);
        Self {
            v_w_mps: self.v_w_mps.as_ref().map(flat),
            ..pose
        }
    }

    /// The pose at `stamp_ns` on the way from `self` to `other`, which has a later stamp.
    fn towards(&self, other: &Self, stamp_ns: u64) -> Self {
        let whole = (other.stamp_ns - self.stamp_ns) as f64;
        let share = (stamp_ns - self.stamp_ns) as f64 / whole;
        let turn = (self.q_wb.inverse() * other.q_wb).scaled_axis();
        Self {
            stamp_ns,
            q_wb: self.q_wb * UnitQuaternion::from_scaled_axis(turn * share),
            v_w_mps: self
                .v_w_mps
                .zip(other.v_w_mps)
                .map(|(v, to)| v.lerp(&to, share)),
            p_w_m: self.p_w_m.lerp(&other.p_w_m, share),
        }
    }
}

/// Poses in the order of their stamps, which differ.
///
/// ```
/// use inekf_client::evaluate::{Trajectory, estimate_pose};
/// use inekf_client::table::EstimateState;
///
/// let pose = |stamp_ns, x_m| {
///     estimate_pose(stamp_ns, &EstimateState::Plane { theta_rad: 0.0, p_w_m: [x_m, 0.0] })
/// };
/// // Sorted, and of two with one stamp the first.
/// let way = Trajectory::new_planar(vec![pose(20, 2.0), pose(10, 1.0), pose(10, 7.0)]);
/// assert_eq!(way.poses(), [pose(10, 1.0), pose(20, 2.0)]);
/// ```
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Trajectory {
    poses: Vec<Pose>,
    planar: bool,
}

impl Trajectory {
    /// Makes a trajectory; poses are sorted, and of poses with one stamp the first is kept.
    ///
    /// ```
    /// use inekf_client::evaluate::{Trajectory, estimate_pose};
    /// use inekf_client::table::EstimateState;
    ///
    /// let level = |x_m| EstimateState::Pose { q_wb: [0.0, 0.0, 0.0, 1.0], p_w_m: [x_m, 0.0, 0.0] };
    /// let way = Trajectory::new(vec![estimate_pose(20, &level(2.0)), estimate_pose(10, &level(1.0))]);
    /// assert_eq!(way.poses()[0].stamp_ns, 10);
    /// ```
    pub fn new(mut poses: Vec<Pose>) -> Self {
        poses.sort_by_key(|pose| pose.stamp_ns);
        poses.dedup_by_key(|pose| pose.stamp_ns);
        Self {
            poses,
            planar: false,
        }
    }

    /// A trajectory in the plane; [`errors`] then looks at the other one in the plane, too.
    ///
    /// ```
    /// use inekf_client::evaluate::{DEFAULT_MAX_GAP_NS, Trajectory, errors, estimate_pose};
    /// use inekf_client::table::EstimateState;
    ///
    /// // An estimate in the plane is not blamed for the hill that the truth climbs.
    /// let flat = EstimateState::Plane { theta_rad: 0.0, p_w_m: [1.0, 0.0] };
    /// let hill = EstimateState::Pose { q_wb: [0.0, 0.0, 0.0, 1.0], p_w_m: [1.0, 0.0, 30.0] };
    /// let estimate = Trajectory::new_planar(vec![estimate_pose(0, &flat)]);
    /// let truth = Trajectory::new(vec![estimate_pose(0, &hill)]);
    /// assert_eq!(errors(&estimate, &truth, DEFAULT_MAX_GAP_NS)[0].position_m.norm(), 0.0);
    /// ```
    pub fn new_planar(poses: Vec<Pose>) -> Self {
        Self {
            planar: true,
            ..Self::new(poses)
        }
    }

    /// The trajectory of a truth.
    ///
    /// ```
    /// use inekf_client::evaluate::Trajectory;
    /// use inekf_client::simulate::{Scenario, SimulationOptions, simulate};
    ///
    /// let options = SimulationOptions { duration_s: 1.0, ..SimulationOptions::default() };
    /// let truth = Trajectory::from_truth(&simulate(Scenario::DroneLoops, &options)?.truth);
    /// let first = truth.poses()[0];
    /// assert!((first.p_w_m - Scenario::DroneLoops.at(0.0).p_w_m).norm() < 1e-12);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn from_truth(truth: &Truth) -> Self {
        match truth {
            Truth::None => Self::default(),
            Truth::Planar(rows) => {
                let poses = rows
                    .iter()
                    .map(|row| planar(row.stamp_ns, row.theta_rad, row.p_w_m));
                Self::new_planar(poses.collect())
            }
            Truth::Spatial(rows) => {
                let poses = rows.iter().map(|row| Pose {
                    stamp_ns: row.stamp_ns,
                    q_wb: quaternion(row.q_wb),
                    v_w_mps: Some(row.v_w_mps.into()),
                    p_w_m: row.p_w_m.into(),
                });
                Self::new(poses.collect())
            }
        }
    }

    /// The trajectory of an estimate CSV.
    ///
    /// ```
    /// use inekf_client::evaluate::Trajectory;
    /// use inekf_client::table::read_estimates;
    ///
    /// let table = read_estimates("estimate.csv", &b"t_ns,theta,x,y\n10,0.5,1.0,2.0\n"[..])?;
    /// let trajectory = Trajectory::from_estimates(&table.rows);
    /// assert_eq!(trajectory.poses()[0].p_w_m.y, 2.0);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn from_estimates(rows: &[EstimateRow]) -> Self {
        let poses = rows
            .iter()
            .map(|row| estimate_pose(row.stamp_ns, &row.state))
            .collect();
        match rows.first().map(|row| row.state.layout()) {
            Some(Layout::Plane) => Self::new_planar(poses),
            _ => Self::new(poses),
        }
    }

    /// The poses, by stamp.
    ///
    /// ```
    /// use inekf_client::evaluate::Trajectory;
    ///
    /// assert!(Trajectory::default().poses().is_empty());
    /// ```
    pub fn poses(&self) -> &[Pose] {
        &self.poses
    }

    /// The pose at a stamp: exact where there is one, else interpolated between the two around it
    /// if they are at most `max_gap_ns` apart. `None` outside the trajectory and in longer gaps.
    ///
    /// ```
    /// use inekf_client::evaluate::{Trajectory, estimate_pose};
    /// use inekf_client::table::EstimateState;
    ///
    /// let pose = |stamp_ns, theta_deg: f64| {
    ///     let theta_rad = theta_deg.to_radians();
    ///     estimate_pose(stamp_ns, &EstimateState::Plane { theta_rad, p_w_m: [0.0, 0.0] })
    /// };
    /// // From 170 to -170 degrees the shorter way leads over 180.
    /// let turn = Trajectory::new_planar(vec![pose(0, 170.0), pose(100, -170.0)]);
    /// let half = turn.at(50, 100).expect("between them");
    /// assert!((half.heading_rad().to_degrees().abs() - 180.0).abs() < 1e-9);
    /// // Never over longer gaps, never beyond the end.
    /// assert!(turn.at(50, 99).is_none() && turn.at(101, 1000).is_none());
    /// ```
    pub fn at(&self, stamp_ns: u64, max_gap_ns: u64) -> Option<Pose> {
        let after = self.poses.partition_point(|pose| pose.stamp_ns < stamp_ns);
        let next = self.poses.get(after)?;
        if next.stamp_ns == stamp_ns {
            return Some(*next);
        }
        let previous = self.poses.get(after.checked_sub(1)?)?;
        let gap_ns = next.stamp_ns - previous.stamp_ns;
        (gap_ns <= max_gap_ns).then(|| previous.towards(next, stamp_ns))
    }
}

/// The pose that an estimate's mean is.
///
/// ```
/// use inekf_client::evaluate::estimate_pose;
/// use inekf_client::table::EstimateState;
///
/// let pose = estimate_pose(3, &EstimateState::Plane { theta_rad: 0.5, p_w_m: [1.0, 2.0] });
/// // In the plane z is zero, and a velocity is not estimated.
/// assert_eq!((pose.p_w_m.z, pose.v_w_mps), (0.0, None));
/// assert!((pose.heading_rad() - 0.5).abs() < 1e-15);
/// ```
pub fn estimate_pose(stamp_ns: u64, state: &EstimateState) -> Pose {
    match *state {
        EstimateState::Navigation {
            q_wb,
            v_w_mps,
            p_w_m,
            ..
        } => Pose {
            stamp_ns,
            q_wb: quaternion(q_wb),
            v_w_mps: Some(v_w_mps.into()),
            p_w_m: p_w_m.into(),
        },
        EstimateState::Pose { q_wb, p_w_m } => Pose {
            stamp_ns,
            q_wb: quaternion(q_wb),
            v_w_mps: None,
            p_w_m: p_w_m.into(),
        },
        EstimateState::Plane { theta_rad, p_w_m } => planar(stamp_ns, theta_rad, p_w_m),
    }
}

/// Gap over which a truth is still interpolated by default, ns: 1 s.
pub const DEFAULT_MAX_GAP_NS: u64 = 1_000_000_000;

/// The error of an estimate at one stamp.
///
/// ```
/// use inekf_client::evaluate::{ErrorSample, estimate_pose};
/// use inekf_client::table::EstimateState;
///
/// let pose = |theta_deg: f64, x_m| {
///     let theta_rad = theta_deg.to_radians();
///     estimate_pose(0, &EstimateState::Plane { theta_rad, p_w_m: [x_m, 0.0] })
/// };
/// // Estimate minus truth, wrapped: 179 degrees against -179 are two degrees too little.
/// let error = ErrorSample::between(&pose(179.0, 1.0), &pose(-179.0, 1.5));
/// assert!((error.heading_rad.to_degrees() + 2.0).abs() < 1e-9);
/// assert!((error.position_m.x + 0.5).abs() < 1e-15);
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ErrorSample {
    /// Stamp, ns.
    pub stamp_ns: u64,
    /// Position, estimate minus truth, m, world frame.
    pub position_m: Vector3<f64>,
    /// Velocity, estimate minus truth, m/s, world frame; if both are known.
    pub velocity_mps: Option<Vector3<f64>>,
    /// Heading, estimate minus truth, rad, wrapped to `(-pi, pi]`.
    pub heading_rad: f64,
    /// Angle between the two attitudes, rad, 0 to pi.
    pub attitude_rad: f64,
}

impl ErrorSample {
    /// The error of `estimate` against the truth at the same time.
    ///
    /// ```
    /// use inekf_client::evaluate::{ErrorSample, Pose};
    /// use nalgebra::{UnitQuaternion, Vector3};
    ///
    /// let level = Pose {
    ///     stamp_ns: 0,
    ///     q_wb: UnitQuaternion::identity(),
    ///     v_w_mps: None,
    ///     p_w_m: Vector3::zeros(),
    /// };
    /// let rolled = Pose { q_wb: UnitQuaternion::from_euler_angles(0.1, 0.0, 0.0), ..level };
    /// // A roll is an error of attitude, not of heading; a velocity that one does not know is none.
    /// let error = ErrorSample::between(&rolled, &level);
    /// assert!((error.attitude_rad - 0.1).abs() < 1e-12 && error.heading_rad.abs() < 1e-15);
    /// assert!(error.velocity_mps.is_none());
    /// ```
    pub fn between(estimate: &Pose, truth: &Pose) -> Self {
        let velocity = estimate.v_w_mps.zip(truth.v_w_mps);
        Self {
            stamp_ns: estimate.stamp_ns,
            position_m: estimate.p_w_m - truth.p_w_m,
            velocity_mps: velocity.map(|(estimate, truth)| estimate - truth),
            heading_rad: wrap_angle(estimate.heading_rad() - truth.heading_rad()),
            attitude_rad: (truth.q_wb.inverse() * estimate.q_wb).angle(),
        }
    }
}

/// The errors at every stamp of the estimate at which the truth is known. If one of the two is in
/// the plane, both are compared there: no height, no tilt.
///
/// ```
/// use inekf_client::evaluate::{DEFAULT_MAX_GAP_NS, Trajectory, errors};
/// use inekf_client::simulate::{Scenario, SimulationOptions, simulate};
///
/// let options = SimulationOptions { duration_s: 1.0, ..SimulationOptions::default() };
/// let truth = Trajectory::from_truth(&simulate(Scenario::RoadCircuit, &options)?.truth);
/// // Against itself: as many as there are poses, all zero.
/// let errors = errors(&truth, &truth, DEFAULT_MAX_GAP_NS);
/// assert_eq!(errors.len(), truth.poses().len());
/// assert!(errors.iter().all(|error| error.position_m.norm() == 0.0));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn errors(estimate: &Trajectory, truth: &Trajectory, max_gap_ns: u64) -> Vec<ErrorSample> {
    let planar = estimate.planar || truth.planar;
    let error = |estimate: &Pose| {
        let truth = truth.at(estimate.stamp_ns, max_gap_ns)?;
        Some(if planar {
            ErrorSample::between(&estimate.flattened(), &truth.flattened())
        } else {
            ErrorSample::between(estimate, &truth)
        })
    };
    estimate.poses().iter().filter_map(error).collect()
}

/// Figures over a run. RMSE is the root of the mean square, not reduced by the mean.
///
/// ```
/// use inekf_client::evaluate::{ErrorSample, summarise};
/// use nalgebra::Vector3;
///
/// let off = |x_m, y_m| ErrorSample {
///     stamp_ns: 0,
///     position_m: Vector3::new(x_m, y_m, 0.0),
///     velocity_mps: None,
///     heading_rad: 0.0,
///     attitude_rad: 0.0,
/// };
/// // A constant error is not taken off: the root of the mean square, by axis and as a distance.
/// let summary = summarise(&[off(3.0, 4.0), off(3.0, -4.0)], 0).expect("two errors");
/// assert_eq!(summary.position_rmse_m, Vector3::new(3.0, 4.0, 0.0));
/// assert_eq!((summary.horizontal_rmse_m, summary.distance_max_m), (5.0, 5.0));
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Summary {
    /// Number of errors they are taken over.
    pub count: usize,
    /// RMSE of position by axis (east, north, up), m.
    pub position_rmse_m: Vector3<f64>,
    /// RMSE of the horizontal distance, m.
    pub horizontal_rmse_m: f64,
    /// RMSE of the distance in space, m.
    pub distance_rmse_m: f64,
    /// Largest distance in space, m.
    pub distance_max_m: f64,
    /// RMSE of velocity by axis, m/s, over the errors that have one; `None` if none has.
    pub velocity_rmse_mps: Option<Vector3<f64>>,
    /// RMSE of heading, rad.
    pub heading_rmse_rad: f64,
    /// Largest heading error, rad, without sign.
    pub heading_max_rad: f64,
    /// RMSE of the attitude angle, rad.
    pub attitude_rmse_rad: f64,
    /// Largest attitude angle, rad.
    pub attitude_max_rad: f64,
}

/// Sums up the errors from `start_ns` on; `None` if there are none.
///
/// ```
/// use inekf_client::evaluate::{ErrorSample, summarise};
/// use nalgebra::Vector3;
///
/// let off = |stamp_ns, x_m| ErrorSample {
///     stamp_ns,
///     position_m: Vector3::new(x_m, 0.0, 0.0),
///     velocity_mps: None,
///     heading_rad: 0.0,
///     attitude_rad: 0.0,
/// };
/// // What came before the filter had converged can be left out.
/// let run = [off(0, 50.0), off(10, 1.0), off(20, 1.0)];
/// assert_eq!(summarise(&run, 10).map(|summary| summary.distance_rmse_m), Some(1.0));
/// assert!(summarise(&run, 30).is_none());
/// ```
pub fn summarise(errors: &[ErrorSample], start_ns: u64) -> Option<Summary> {
    let late: Vec<&ErrorSample> = errors.iter().filter(|e| e.stamp_ns >= start_ns).collect();
    if late.is_empty() {
        return None;
    }
    let squares = late
        .iter()
        .map(|e| e.position_m.component_mul(&e.position_m));
    let mean_square = squares.sum::<Vector3<f64>>() / late.len() as f64;
    let velocities: Vec<Vector3<f64>> = late.iter().filter_map(|e| e.velocity_mps).collect();
    let velocity_squares = velocities
        .iter()
        .map(|v| v.component_mul(v))
        .sum::<Vector3<f64>>();
    let velocity_rmse_mps = (!velocities.is_empty())
        .then(|| (velocity_squares / velocities.len() as f64).map(f64::sqrt));
    let max = |value: fn(&ErrorSample) -> f64| late.iter().map(|e| value(e)).fold(0.0, f64::max);
    let rms = |value: fn(&ErrorSample) -> f64| {
        (late.iter().map(|e| value(e).powi(2)).sum::<f64>() / late.len() as f64).sqrt()
    };
    Some(Summary {
        count: late.len(),
        position_rmse_m: mean_square.map(f64::sqrt),
        horizontal_rmse_m: (mean_square.x + mean_square.y).sqrt(),
        distance_rmse_m: mean_square.sum().sqrt(),
        distance_max_m: max(|e| e.position_m.norm()),
        velocity_rmse_mps,
        heading_rmse_rad: rms(|e| e.heading_rad),
        heading_max_rad: max(|e| e.heading_rad.abs()),
        attitude_rmse_rad: rms(|e| e.attitude_rad),
        attitude_max_rad: max(|e| e.attitude_rad),
    })
}

/// One-sigma deviations of an estimate in world axes, to first order of its error.
///
/// ```
/// use inekf_client::evaluate::deviations;
/// use inekf_client::table::{EstimateRow, EstimateState};
///
/// let row = EstimateRow {
///     stamp_ns: 0,
///     state: EstimateState::Plane { theta_rad: 0.0, p_w_m: [0.0; 2] },
///     covariance: vec![0.04, 0.0, 0.0, 4.0, 0.0, 9.0],
/// };
/// // Roots of variances.
/// let sigma = deviations(&row).expect("a covariance");
/// assert!((sigma.heading_rad - 0.2).abs() < 1e-15);
/// assert!((sigma.position_m.y - 3.0).abs() < 1e-15);
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Deviations {
    /// Position by axis, m; z is 0 in the plane.
    pub position_m: Vector3<f64>,
    /// Heading, rad.
    pub heading_rad: f64,
}

/// Turns the covariance of a row (left-invariant, body coordinates) into deviations in the world;
/// `None` if the row has no covariance, or one of a size that is not its model's.
///
/// Position: `R P_pp R^T`. Heading: the turn about the world's vertical, `(R P_rr R^T)_zz`, which is
/// the heading's variance while the body x axis is near the horizon.
///
/// ```
/// use inekf_client::evaluate::deviations;
/// use inekf_client::table::{EstimateRow, EstimateState};
///
/// // Turned to north, with 3 m along the body and 1 m across: 1 m east, 3 m north.
/// let row = EstimateRow {
///     stamp_ns: 0,
///     state: EstimateState::Plane { theta_rad: 90_f64.to_radians(), p_w_m: [0.0; 2] },
///     covariance: vec![0.01, 0.0, 0.0, 9.0, 0.0, 1.0],
/// };
/// let sigma = deviations(&row).expect("it has a covariance").position_m;
/// assert!((sigma.x - 1.0).abs() < 1e-12 && (sigma.y - 3.0).abs() < 1e-12);
/// ```
pub fn deviations(row: &EstimateRow) -> Option<Deviations> {
    let pose = estimate_pose(row.stamp_ns, &row.state);
    let rotation = pose.q_wb.to_rotation_matrix();
    let (dimension, position_at) = match row.state {
        EstimateState::Plane { .. } => (3, 1),
        EstimateState::Pose { .. } => (6, 3),
        EstimateState::Navigation { .. } if row.covariance.len() == triangle_len(9) => (9, 6),
        EstimateState::Navigation { .. } => (15, 6),
    };
    let covariance = symmetric(&row.covariance, dimension)?;
    let block = |at: usize, size: usize| {
        let inside = |i: usize| i < size;
        Matrix3::from_fn(|i, j| match inside(i) && inside(j) {
            true => covariance[(at + i, at + j)],
            false => 0.0,
        })
    };
    let turned = |block: Matrix3<f64>| rotation.matrix() * block * rotation.matrix().transpose();
    let root = |variance: f64| variance.max(0.0).sqrt();
    Some(if dimension == 3 {
        let position = turned(block(position_at, 2));
        Deviations {
            position_m: position.diagonal().map(root),
            heading_rad: root(covariance[(0, 0)]),
        }
    } else {
        let position = turned(block(position_at, 3));
        let attitude = turned(block(0, 3));
        Deviations {
            position_m: position.diagonal().map(root),
            heading_rad: root(attitude[(2, 2)]),
        }
    })
}

/// Normalised estimation error squared, `xi^T P^-1 xi`: chi-square with as many degrees of freedom
/// as `error` has entries, if the filter is consistent. `covariance_triangle` is the upper triangle,
/// row by row, in the order of `error`. `None` if the sizes differ or P is not positive definite.
///
/// ```
/// use inekf_client::evaluate::nees;
///
/// // Two standard deviations off on one of two axes.
/// assert_eq!(nees(&[2.0, 0.0], &[1.0, 0.0, 4.0]), Some(4.0));
/// ```
pub fn nees(error: &[f64], covariance_triangle: &[f64]) -> Option<f64> {
    let covariance = symmetric(covariance_triangle, error.len())?;
    let error = DVector::from_column_slice(error);
    let solved = covariance.cholesky()?.solve(&error);
    Some(error.dot(&solved))
}

/// The symmetric matrix with this upper triangle, if it has the right number of entries.
pub(crate) fn symmetric(triangle: &[f64], dimension: usize) -> Option<DMatrix<f64>> {
    if triangle.len() != triangle_len(dimension) {
        return None;
    }
    let mut matrix = DMatrix::zeros(dimension, dimension);
    let mut entries = triangle.iter();
    for i in 0..dimension {
        for j in i..dimension {
            let entry = *entries.next()?;
            matrix[(i, j)] = entry;
            matrix[(j, i)] = entry;
        }
    }
    Some(matrix)
}

/// Heading of the body x axis, rad, counter-clockwise from the world x axis, `(-pi, pi]`.
///
/// ```
/// use inekf_client::evaluate::heading_rad;
/// use nalgebra::UnitQuaternion;
///
/// // Counter-clockwise from east: 90 degrees is north.
/// let north = UnitQuaternion::from_euler_angles(0.0, 0.0, 90_f64.to_radians());
/// assert!((heading_rad(&north).to_degrees() - 90.0).abs() < 1e-9);
/// ```
pub fn heading_rad(q_wb: &UnitQuaternion<f64>) -> f64 {
    let nose_w = q_wb * Vector3::x();
    nose_w.y.atan2(nose_w.x)
}

/// The same angle in `(-pi, pi]`.
///
/// ```
/// use inekf_client::evaluate::wrap_angle;
///
/// assert!((wrap_angle(350_f64.to_radians()) + 10_f64.to_radians()).abs() < 1e-12);
/// ```
pub fn wrap_angle(angle_rad: f64) -> f64 {
    let turn = std::f64::consts::TAU;
    let wrapped = angle_rad.rem_euclid(turn);
    if wrapped > std::f64::consts::PI {
        wrapped - turn
    } else {
        wrapped
    }
}

fn planar(stamp_ns: u64, theta_rad: f64, p_w_m: [f64; 2]) -> Pose {
    Pose {
        stamp_ns,
        q_wb: UnitQuaternion::from_axis_angle(&Vector3::z_axis(), theta_rad),
        v_w_mps: None,
        p_w_m: Vector3::new(p_w_m[0], p_w_m[1], 0.0),
    }
}

/// From `[x, y, z, w]`, normalised: files hold rounded entries.
fn quaternion(xyzw: [f64; 4]) -> UnitQuaternion<f64> {
    UnitQuaternion::new_normalize(Quaternion::from(xyzw))
}
