//! A body that odometry moves, in the plane and in space: its messages, and how its state is written in them.

use core::fmt::Debug;

use inekf::filter::{Belief, Covariance, Left};
use inekf::lie::{SE2, SE3, SE23, SO2, SO3};
use inekf::model::RigidPose;
use inekf_shared::message::{
    EstimateMessage, EstimateSe2, EstimateSe3, INPUT_ODOMETRY_2D, INPUT_ODOMETRY_3D,
    MAX_MISMATCHES, MODEL_ODOMETRY_2D, MODEL_ODOMETRY_3D, Odometry2d, Odometry3d, StateVector,
    Zero,
};
use inekf_shared::transport::InputMessage;
use nalgebra::{SVector, Vector3};

use super::filter::Report;

/// How far the attitude of a planar state may lean, rad.
const MAX_LEAN_RAD: f64 = 1e-3;

/// A pose with the messages of its model.
pub trait Vehicle<const D: usize, const N: usize>: RigidPose<D, N> + Debug {
    /// The message of its odometry.
    type Row: InputMessage;
    /// The message of its estimate.
    type Estimate: EstimateMessage;
    /// The `INPUT_*` index of the odometry.
    const INPUT: usize;
    /// The `MODEL_*` code.
    const MODEL: u32;
    /// Where its error lies in that of navigation: rotation, velocity, position.
    const IN_NAVIGATION: [usize; D];

    /// `(rotation vector, translation)` of a row, rad and m.
    fn increment(row: &Self::Row) -> SVector<f64, D>;

    /// The pose of this attitude and position, as far as it has them.
    fn of_navigation(r_wb: &SO3, position_w: &Vector3<f64>) -> Self;

    /// The pose that a state of its model describes.
    ///
    /// # Errors
    /// A sentence that names the fault.
    fn of_state(r_wb: &SO3, state: &StateVector) -> Result<Self, &'static str>;

    /// Attitude, and position with z = 0 in the plane.
    fn in_space(&self) -> (SO3, Vector3<f64>);

    /// Writes the belief and what the filter reports into the message.
    fn write(belief: &Belief<Self, Left, D>, report: &Report, message: &mut Self::Estimate);
}

/// The belief of navigation, less what a vehicle does not have.
pub fn marginal<G: Vehicle<D, N>, const D: usize, const N: usize>(
    navigation: &Belief<SE23, Left, 9>,
) -> Belief<G, Left, D> {
    let pose = &navigation.mean;
    let p = navigation.covariance.matrix();
    let own = nalgebra::SMatrix::from_fn(|row, column| {
        p[(G::IN_NAVIGATION[row], G::IN_NAVIGATION[column])]
    });
    Belief::new(
        G::of_navigation(&pose.rotation, &pose.position),
        Covariance::from_upper(own),
    )
}

/// A belief as a snapshot answers it.
pub fn snapshot<G: Vehicle<D, N>, const D: usize, const N: usize>(
    stamp_ns: u64,
    belief: &Belief<G, Left, D>,
) -> StateVector {
    let (r_wb, position_w) = belief.mean.in_space();
    let mut state = StateVector {
        model: G::MODEL,
        dimension: D as u32,
        stamp_ns,
        q_wb: r_wb.quaternion_xyzw(),
        p_w_m: position_w.into(),
        ..StateVector::ZERO
    };
    belief
        .covariance
        .write_upper_triangle(&mut state.covariance);
    state
}

/// A turn about the vertical.
fn turn(heading: f64) -> SO3 {
    SO3::from_roll_pitch_heading(0.0, 0.0, heading)
}

impl Vehicle<3, 2> for SE2 {
    type Row = Odometry2d;
    type Estimate = EstimateSe2;
    const INPUT: usize = INPUT_ODOMETRY_2D;
    const MODEL: u32 = MODEL_ODOMETRY_2D;
    const IN_NAVIGATION: [usize; 3] = [2, 6, 7];

    fn increment(row: &Odometry2d) -> Vector3<f64> {
        let [dx, dy] = row.translation_m;
        Vector3::new(row.dtheta_rad, dx, dy)
    }

    fn of_navigation(r_wb: &SO3, position_w: &Vector3<f64>) -> Self {
        Self {
            rotation: SO2::from_angle(r_wb.heading_rad()),
            position: position_w.xy(),
        }
    }

    fn of_state(r_wb: &SO3, state: &StateVector) -> Result<Self, &'static str> {
        let up_w = r_wb.rotate(&Vector3::z());
        if up_w.xy().norm() > MAX_LEAN_RAD || up_w.z < 0.0 {
            return Err("the attitude of a planar state must be a turn about the vertical");
        }
        Ok(Self::of_navigation(r_wb, &state.p_w_m.into()))
    }

    fn in_space(&self) -> (SO3, Vector3<f64>) {
        (
            turn(self.rotation.angle_rad()),
            Vector3::new(self.position.x, self.position.y, 0.0),
        )
    }

    fn write(belief: &Belief<Self, Left, 3>, report: &Report, message: &mut EstimateSe2) {
        message.theta_rad = belief.mean.rotation.angle_rad();
        message.p_w_m = belief.mean.position.into();
        belief
            .covariance
            .write_upper_triangle(&mut message.covariance);
        note(report, &mut message.mismatch, &mut message.mismatch_sigma);
    }
}

impl Vehicle<6, 3> for SE3 {
    type Row = Odometry3d;
    type Estimate = EstimateSe3;
    const INPUT: usize = INPUT_ODOMETRY_3D;
    const MODEL: u32 = MODEL_ODOMETRY_3D;
    const IN_NAVIGATION: [usize; 6] = [0, 1, 2, 6, 7, 8];

    fn increment(row: &Odometry3d) -> SVector<f64, 6> {
        let ([rx, ry, rz], [dx, dy, dz]) = (row.rotation_rad, row.translation_m);
        SVector::from([rx, ry, rz, dx, dy, dz])
    }

    fn of_navigation(r_wb: &SO3, position_w: &Vector3<f64>) -> Self {
        Self {
            rotation: *r_wb,
            position: *position_w,
        }
    }

    fn of_state(r_wb: &SO3, state: &StateVector) -> Result<Self, &'static str> {
        Ok(Self::of_navigation(r_wb, &state.p_w_m.into()))
    }

    fn in_space(&self) -> (SO3, Vector3<f64>) {
        (self.rotation, self.position)
    }

    fn write(belief: &Belief<Self, Left, 6>, report: &Report, message: &mut EstimateSe3) {
        message.q_wb = belief.mean.rotation.quaternion_xyzw();
        message.p_w_m = belief.mean.position.into();
        belief
            .covariance
            .write_upper_triangle(&mut message.covariance);
        note(report, &mut message.mismatch, &mut message.mismatch_sigma);
    }
}

fn note(report: &Report, mismatch: &mut [f64; MAX_MISMATCHES], sigma: &mut [f64; MAX_MISMATCHES]) {
    *mismatch = report.parameters;
    *sigma = report.sigmas;
}
