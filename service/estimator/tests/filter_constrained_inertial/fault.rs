//! What a wrong gyroscope or accelerometer means, in its own words.

use inekf::model::{ImuInput, InertialMismatch, InertialScale, MeanMismatch, OutputMismatch};
use nalgebra::Vector3;

/// One of a source, beside them.
pub const SCALE: OutputMismatch = OutputMismatch::MeasurementScale { source: 1 };
pub const GYRO_SCALE: InertialMismatch = InertialMismatch::Scale(InertialScale::Gyro);
pub const ACCEL_SCALE: InertialMismatch = InertialMismatch::Scale(InertialScale::Accel);

pub fn gyro_bias(axis_b: Vector3<f64>) -> InertialMismatch {
    InertialMismatch::GyroBias { axis_b }
}

pub fn accel_bias(axis_b: Vector3<f64>) -> InertialMismatch {
    InertialMismatch::AccelBias { axis_b }
}

pub fn every_kind() -> [InertialMismatch; 4] {
    let oblique = Vector3::new(0.6, -0.48, 0.64);
    [
        gyro_bias(oblique),
        accel_bias(oblique),
        GYRO_SCALE,
        ACCEL_SCALE,
    ]
}

/// What a mismatch m means, both ways.
pub trait Fault: MeanMismatch {
    /// What acts on the body where the sensors, and the biases of the state, say `assumed`.
    fn actual(&self, assumed: &ImuInput, m: f64) -> ImuInput;

    /// What the sensors say where `actual` acts.
    fn measured(&self, actual: &ImuInput, m: f64) -> ImuInput;
}

impl Fault for InertialMismatch {
    fn actual(&self, assumed: &ImuInput, m: f64) -> ImuInput {
        let mut actual = *assumed;
        match self {
            Self::GyroBias { axis_b } => actual.omega_b += axis_b * m,
            Self::AccelBias { axis_b } => actual.force_b += axis_b * m,
            Self::Scale(scale) => return scale.actual(assumed, m),
        }
        actual
    }

    fn measured(&self, actual: &ImuInput, m: f64) -> ImuInput {
        match self {
            Self::Scale(scale) => scale.measured(actual, m),
            _ => self.actual(actual, -m),
        }
    }
}

impl Fault for InertialScale {
    fn actual(&self, assumed: &ImuInput, m: f64) -> ImuInput {
        let mut actual = *assumed;
        match self {
            Self::Gyro => actual.omega_b *= 1.0 + m,
            Self::Accel => actual.force_b *= 1.0 + m,
        }
        actual
    }

    fn measured(&self, actual: &ImuInput, m: f64) -> ImuInput {
        self.actual(actual, 1.0 / (1.0 + m) - 1.0)
    }
}
