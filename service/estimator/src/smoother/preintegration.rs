//! All IMU samples between two updates as one step: preintegration as composition on SE_2(3).
//!
//! Frames, order and side as in [`model::imu`](crate::model::imu): left-invariant error in the body frame at the end
//! of the motion; rotation, velocity, position, gyro bias, accelerometer bias; SI units.
//!
//! Group-affine steps `chi -> W phi(chi) U` (\[IS\] (6)) compose to one of their kind, whatever the discretisation:
//! the second after the first is
//!
//! ```text
//! W = W2 phi2(W1)    phi = phi2 phi1    U = phi2(U1) U2    F = F2 F1    Q = F2 Q1 F2^T + Q2    B = F2 B1 + B2
//! ```
//!
//! so that nothing is approximated for a state without biases, and the motion does not depend on where it began.
//! The biases in the samples are removed at a reference; B, the Jacobian of the inputs, carries the motion from
//! there to other biases to first order, `U(b) = U(b_ref) exp(-B (b - b_ref))`.

use nalgebra::{SMatrix, SVector, Vector3};

use crate::filter::{Belief, Covariance, Left};
use crate::lie::{LieGroup, SE23};
use crate::model::{
    Automorphism, Discretisation, FreeMotion, GroupAffineStep, ImuInput, ImuNoise, ImuStep,
    InertialState,
};
use crate::smoother::Motion;

/// The motion of a body over any number of IMU intervals.
///
/// ```
/// use inekf::lie::{LieGroup, SE23};
/// use inekf::model::{Discretisation, ImuInput, ImuNoise, InertialState};
/// use inekf::smoother::Preintegration;
/// use nalgebra::Vector3;
///
/// let noise = ImuNoise { gyro_psd: 1e-6, accel_psd: 1e-4, gyro_bias_psd: 0.0, accel_bias_psd: 0.0 };
/// let g_w = Vector3::new(0.0, 0.0, -9.80665);
/// let start = SE23 { velocity: Vector3::new(5.0, 0.0, 0.0), ..SE23::identity() };
/// let (mut whole, mut step_by_step) = (Preintegration::new(&start), start);
/// for i in 0..50 {
///     let sample = ImuInput {
///         omega_b: Vector3::new(0.0, 0.1, 0.01 * f64::from(i)),
///         force_b: Vector3::new(0.5, 0.0, 9.8),
///     };
///     whole.push(&sample, &g_w, 0.01, Discretisation::ZeroOrderHold, &noise);
///     let step = step_by_step.imu_step(&sample, &g_w, 0.01, Discretisation::ZeroOrderHold);
///     step_by_step = step.apply(&step_by_step);
/// }
/// // Fifty samples as one motion, from any state.
/// assert!((whole.dt_s() - 0.5).abs() < 1e-12);
/// let (moved, _) = whole.transition(&start);
/// assert!(moved.between(&step_by_step).log().norm() < 1e-10);
/// ```
#[derive(Clone, Copy, Debug)]
pub struct Preintegration<G, const D: usize> {
    /// A state with the biases that were removed; its pose is without meaning.
    reference: G,
    /// All steps as one.
    motion: ImuStep,
    /// Q, D x D, of the whole.
    noise: Covariance<D>,
}

/// The step `second` after the step `first`.
fn composed(first: &ImuStep, second: &ImuStep) -> ImuStep {
    let (one, two) = (&first.step, &second.step);
    let after = &two.automorphism;
    ImuStep {
        step: GroupAffineStep::new(
            two.world.compose(&after.apply(&one.world)),
            FreeMotion {
                dt_s: one.automorphism.dt_s + after.dt_s,
            },
            after.apply(&one.body).compose(&two.body),
        ),
        input_jacobian: two.left_jacobian() * first.input_jacobian + second.input_jacobian,
        dt_s: first.dt_s + second.dt_s,
    }
}

/// `J_r(xi) B`, by the blocks of J_r that are not zero.
fn carried_inputs(xi: &SVector<f64, 9>, b: &SMatrix<f64, 9, 6>) -> SMatrix<f64, 9, 6> {
    let j = SE23::right_jacobian(xi);
    let block = |row, column| j.fixed_view::<3, 3>(row, column);
    let of = |row| b.fixed_view::<3, 6>(row, 0);
    let mut carried = SMatrix::<f64, 9, 6>::zeros();
    let turned = block(0, 0) * of(0);
    carried.fixed_view_mut::<3, 6>(0, 0).copy_from(&turned);
    for row in [3, 6] {
        let sum = block(row, 0) * of(0) + block(row, row) * of(row);
        carried.fixed_view_mut::<3, 6>(row, 0).copy_from(&sum);
    }
    carried
}

impl<G: InertialState<D>, const D: usize> Preintegration<G, D> {
    /// No motion yet, to be integrated with the biases of `reference`.
    ///
    /// ```
    /// use inekf::lie::{LieGroup, SE23};
    /// use inekf::smoother::Preintegration;
    /// use nalgebra::SVector;
    ///
    /// // No motion: it leads nowhere.
    /// let chi = SE23::exp(&SVector::repeat(0.3));
    /// let (stays, f) = Preintegration::new(&chi).transition(&chi);
    /// assert!(stays.between(&chi).log().norm() < 1e-12 && f.is_identity(1e-12));
    /// ```
    pub fn new(reference: &G) -> Self {
        Self {
            reference: G::from_parts(
                SE23::identity(),
                reference.gyro_bias(),
                reference.accel_bias(),
            ),
            motion: ImuStep {
                step: GroupAffineStep::new(
                    SE23::identity(),
                    FreeMotion { dt_s: 0.0 },
                    SE23::identity(),
                ),
                input_jacobian: SMatrix::zeros(),
                dt_s: 0.0,
            },
            noise: Covariance::from_upper(SMatrix::zeros()),
        }
    }

    /// Adds `dt_s` seconds with the raw sample `measured` under gravity `g_w`, m/s^2.
    ///
    /// ```
    /// use inekf::lie::{LieGroup, SE23};
    /// use inekf::model::{Discretisation, ImuInput, ImuNoise};
    /// use inekf::smoother::Preintegration;
    /// use nalgebra::Vector3;
    ///
    /// let zoh = Discretisation::ZeroOrderHold;
    /// let g_w = Vector3::new(0.0, 0.0, -9.80665);
    /// let noise = ImuNoise { gyro_psd: 1e-6, accel_psd: 1e-4, gyro_bias_psd: 0.0, accel_bias_psd: 0.0 };
    /// let push = ImuInput { omega_b: Vector3::zeros(), force_b: Vector3::new(2.0, 0.0, 9.80665) };
    /// let mut motion = Preintegration::new(&SE23::identity());
    /// motion.push(&push, &g_w, 0.5, zoh, &noise);
    /// motion.push(&push, &g_w, 0.5, zoh, &noise);
    /// // A second of 2 m/s^2 from rest: 2 m/s and a metre.
    /// let (moved, _) = motion.transition(&SE23::identity());
    /// assert!((moved.velocity.x - 2.0).abs() < 1e-12 && (moved.position.x - 1.0).abs() < 1e-12);
    /// ```
    pub fn push(
        &mut self,
        measured: &ImuInput,
        g_w: &Vector3<f64>,
        dt_s: f64,
        discretisation: Discretisation,
        noise: &ImuNoise,
    ) {
        let step = self.reference.imu_step(measured, g_w, dt_s, discretisation);
        let (_, f, q) = self.reference.advance(&step, noise);
        self.noise = self.noise.transformed(&f).plus(&q);
        self.motion = composed(&self.motion, &step);
    }

    /// Length of the motion, s.
    ///
    /// ```
    /// use inekf::lie::{LieGroup, SE23};
    /// use inekf::model::{Discretisation, ImuInput, ImuNoise};
    /// use inekf::smoother::Preintegration;
    /// use nalgebra::Vector3;
    ///
    /// let zoh = Discretisation::ZeroOrderHold;
    /// let g_w = Vector3::new(0.0, 0.0, -9.80665);
    /// let noise = ImuNoise { gyro_psd: 1e-6, accel_psd: 1e-4, gyro_bias_psd: 0.0, accel_bias_psd: 0.0 };
    /// let push = ImuInput { omega_b: Vector3::zeros(), force_b: Vector3::new(2.0, 0.0, 9.80665) };
    /// let mut motion = Preintegration::new(&SE23::identity());
    /// motion.push(&push, &g_w, 0.5, zoh, &noise);
    /// motion.push(&push, &g_w, 0.25, zoh, &noise);
    /// assert_eq!(motion.dt_s(), 0.75);
    /// ```
    pub fn dt_s(&self) -> f64 {
        self.motion.dt_s
    }

    /// The motion as one step, at the biases of the reference. Its body part U holds what is called the
    /// preintegrated measurements, its `input_jacobian` their derivative B by the inputs (that by the biases is -B).
    ///
    /// ```
    /// use inekf::lie::{LieGroup, SE23};
    /// use inekf::model::{Discretisation, ImuInput, ImuNoise};
    /// use inekf::smoother::Preintegration;
    /// use nalgebra::Vector3;
    ///
    /// let zoh = Discretisation::ZeroOrderHold;
    /// let g_w = Vector3::new(0.0, 0.0, -9.80665);
    /// let noise = ImuNoise { gyro_psd: 1e-6, accel_psd: 1e-4, gyro_bias_psd: 0.0, accel_bias_psd: 0.0 };
    /// let push = ImuInput { omega_b: Vector3::zeros(), force_b: Vector3::new(2.0, 0.0, 9.80665) };
    /// let mut motion = Preintegration::new(&SE23::identity());
    /// motion.push(&push, &g_w, 0.5, zoh, &noise);
    /// // What the body felt, without gravity: the preintegrated velocity.
    /// let felt = motion.motion().step.body;
    /// assert!((felt.velocity - push.force_b * 0.5).norm() < 1e-12);
    /// ```
    pub fn motion(&self) -> &ImuStep {
        &self.motion
    }

    /// Q, D x D, of the left-invariant error: what the noise of all samples adds.
    ///
    /// ```
    /// use inekf::lie::{LieGroup, SE23};
    /// use inekf::model::{Discretisation, ImuInput, ImuNoise};
    /// use inekf::smoother::Preintegration;
    /// use nalgebra::Vector3;
    ///
    /// let zoh = Discretisation::ZeroOrderHold;
    /// let g_w = Vector3::new(0.0, 0.0, -9.80665);
    /// let noise = ImuNoise { gyro_psd: 1e-6, accel_psd: 1e-4, gyro_bias_psd: 0.0, accel_bias_psd: 0.0 };
    /// let push = ImuInput { omega_b: Vector3::zeros(), force_b: Vector3::new(2.0, 0.0, 9.80665) };
    /// let mut motion = Preintegration::new(&SE23::identity());
    /// motion.push(&push, &g_w, 0.5, zoh, &noise);
    /// // The attitude is a random walk: the density by the time.
    /// assert!((motion.noise().matrix()[(0, 0)] - noise.gyro_psd * 0.5).abs() < 1e-12);
    /// ```
    pub fn noise(&self) -> &Covariance<D> {
        &self.noise
    }

    /// Where the motion leads from `chi`, and the transition matrix F of the left-invariant error, D x D.
    ///
    /// Exact without biases. With them, of first order in what the biases of `chi` differ from the reference;
    /// F is the exact derivative of that.
    ///
    /// ```
    /// use inekf::lie::{LieGroup, SE23};
    /// use inekf::model::{Discretisation, ImuInput, ImuNoise};
    /// use inekf::smoother::Preintegration;
    /// use nalgebra::{SVector, Vector3};
    ///
    /// let zoh = Discretisation::ZeroOrderHold;
    /// let g_w = Vector3::new(0.0, 0.0, -9.80665);
    /// let noise = ImuNoise { gyro_psd: 1e-6, accel_psd: 1e-4, gyro_bias_psd: 0.0, accel_bias_psd: 0.0 };
    /// let push = ImuInput { omega_b: Vector3::zeros(), force_b: Vector3::new(2.0, 0.0, 9.80665) };
    /// let mut motion = Preintegration::new(&SE23::identity());
    /// motion.push(&push, &g_w, 0.5, zoh, &noise);
    /// // f(chi exp(xi)) = f(chi) exp(F xi): without biases for an error of any size.
    /// let chi = SE23::exp(&SVector::repeat(0.3));
    /// let xi = SVector::<f64, 9>::from_fn(|i, _| 0.2 - 0.04 * i as f64);
    /// let (moved, f) = motion.transition(&chi);
    /// let (wrong, _) = motion.transition(&chi.compose(&SE23::exp(&xi)));
    /// assert!((moved.between(&wrong).log() - f * xi).norm() < 1e-12);
    /// ```
    pub fn transition(&self, chi: &G) -> (G, SMatrix<f64, D, D>) {
        chi.transition(&self.motion_of(chi))
    }

    /// The motion at the biases of `chi`.
    pub(super) fn motion_of(&self, chi: &G) -> ImuStep {
        if G::IS_GROUP_AFFINE {
            return self.motion;
        }
        let gyro = chi.gyro_bias() - self.reference.gyro_bias();
        let accel = chi.accel_bias() - self.reference.accel_bias();
        let bias = SVector::<f64, 6>::from_fn(|i, _| if i < 3 { gyro[i] } else { accel[i - 3] });
        let xi = -(self.motion.input_jacobian * bias);
        let mut corrected = self.motion;
        corrected.step.body = corrected.step.body.compose(&SE23::exp(&xi));
        corrected.input_jacobian = carried_inputs(&xi, &self.motion.input_jacobian);
        corrected
    }

    /// `belief` after the motion: `chi = f(chi_hat)`, `P+ = F P F^T + Q`.
    ///
    /// ```
    /// use inekf::filter::{Belief, Covariance, Left};
    /// use inekf::lie::{LieGroup, SE23};
    /// use inekf::model::{Discretisation, ImuInput, ImuNoise};
    /// use inekf::smoother::Preintegration;
    /// use nalgebra::{SVector, Vector3};
    ///
    /// let zoh = Discretisation::ZeroOrderHold;
    /// let g_w = Vector3::new(0.0, 0.0, -9.80665);
    /// let noise = ImuNoise { gyro_psd: 1e-6, accel_psd: 1e-4, gyro_bias_psd: 0.0, accel_bias_psd: 0.0 };
    /// let push = ImuInput { omega_b: Vector3::zeros(), force_b: Vector3::new(2.0, 0.0, 9.80665) };
    /// let mut motion = Preintegration::new(&SE23::identity());
    /// motion.push(&push, &g_w, 0.5, zoh, &noise);
    /// // Of a state that is known exactly, what is not known afterwards is the noise.
    /// let exact = Belief::<SE23, Left, 9>::new(SE23::identity(), Covariance::from_variances(&SVector::zeros()));
    /// assert!((motion.carry(&exact).covariance.matrix() - motion.noise().matrix()).norm() < 1e-15);
    /// ```
    pub fn carry(&self, belief: &Belief<G, Left, D>) -> Belief<G, Left, D> {
        let (mean, f) = self.transition(&belief.mean);
        let covariance = belief.covariance.transformed(&f).plus(self.noise.matrix());
        Belief::new(mean, covariance)
    }
}

impl<G: InertialState<D>, const D: usize> Motion<G, D> for Preintegration<G, D> {
    fn apply(&self, chi: &G) -> G {
        let pose = self.motion_of(chi).step.apply(chi.pose());
        G::from_parts(pose.normalized(), chi.gyro_bias(), chi.accel_bias())
    }

    fn left_jacobian(&self, chi: &G) -> SMatrix<f64, D, D> {
        self.transition(chi).1
    }
}
