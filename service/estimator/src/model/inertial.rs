//! States that an IMU drives: the pose on SE_2(3) alone (9), or with biases (15).
//!
//! The interface lets one filter, one update core and one set of observations serve both.

use nalgebra::{SMatrix, Vector3};

use super::drift::Drift;
use super::group_affine::{Automorphism, FreeMotion};
use super::imu::{Discretisation, ImuInput, ImuNoise, ImuStep};
use super::increment::ImuIncrement;
use super::transition::Transition;
use crate::lie::{LieGroup, SE23};

/// A Lie group whose first nine tangent coordinates are those of SE_2(3).
///
/// ```
/// use inekf::lie::{LieGroup, SE23};
/// use inekf::model::{InertialState, NavState};
/// use nalgebra::Vector3;
///
/// /// Whatever the state carries beside the pose.
/// fn speed_mps<G: InertialState<D>, const D: usize>(state: &G) -> f64 {
///     state.pose().velocity.norm()
/// }
///
/// let pose = SE23 { velocity: Vector3::new(3.0, 4.0, 0.0), ..SE23::identity() };
/// let biased = NavState::from_parts(pose, Vector3::repeat(0.01), Vector3::zeros());
/// assert_eq!((speed_mps(&pose), speed_mps(&biased)), (5.0, 5.0));
/// // A state without biases has none.
/// assert_eq!(pose.gyro_bias(), Vector3::zeros());
/// ```
pub trait InertialState<const D: usize>: LieGroup<D> {
    /// Attitude, velocity and position.
    ///
    /// ```
    /// use inekf::lie::{LieGroup, SE23};
    /// use inekf::model::{InertialState, NavState};
    /// use nalgebra::Vector3;
    ///
    /// let pose = SE23 { velocity: Vector3::new(5.0, 0.0, 0.0), ..SE23::identity() };
    /// let state = NavState::from_parts(pose, Vector3::repeat(0.01), Vector3::repeat(0.1));
    /// assert_eq!((state.pose(), pose.pose()), (&pose, &pose));
    /// ```
    fn pose(&self) -> &SE23;

    /// Gyroscope bias, rad/s, body frame; zero where the state has none.
    ///
    /// ```
    /// use inekf::lie::{LieGroup, SE23};
    /// use inekf::model::{InertialState, NavState};
    /// use nalgebra::Vector3;
    ///
    /// let pose = SE23 { velocity: Vector3::new(5.0, 0.0, 0.0), ..SE23::identity() };
    /// let state = NavState::from_parts(pose, Vector3::repeat(0.01), Vector3::repeat(0.1));
    /// assert_eq!((state.gyro_bias(), pose.gyro_bias()), (Vector3::repeat(0.01), Vector3::zeros()));
    /// ```
    fn gyro_bias(&self) -> Vector3<f64>;

    /// Accelerometer bias, m/s^2, body frame; zero where the state has none.
    ///
    /// ```
    /// use inekf::lie::{LieGroup, SE23};
    /// use inekf::model::{InertialState, NavState};
    /// use nalgebra::Vector3;
    ///
    /// let pose = SE23 { velocity: Vector3::new(5.0, 0.0, 0.0), ..SE23::identity() };
    /// let state = NavState::from_parts(pose, Vector3::repeat(0.01), Vector3::repeat(0.1));
    /// assert_eq!((state.accel_bias(), pose.accel_bias()), (Vector3::repeat(0.1), Vector3::zeros()));
    /// ```
    fn accel_bias(&self) -> Vector3<f64>;

    /// The state with these parts; biases are dropped where the state has none.
    ///
    /// ```
    /// use inekf::lie::{LieGroup, SE23};
    /// use inekf::model::InertialState;
    /// use nalgebra::Vector3;
    ///
    /// let pose = SE23 { velocity: Vector3::new(5.0, 0.0, 0.0), ..SE23::identity() };
    /// // A state without biases drops them.
    /// assert_eq!(SE23::from_parts(pose, Vector3::repeat(0.01), Vector3::repeat(0.1)), pose);
    /// ```
    fn from_parts(pose: SE23, gyro_bias: Vector3<f64>, accel_bias: Vector3<f64>) -> Self;

    /// The state after one increment; biases stay.
    ///
    /// ```
    /// use inekf::lie::{LieGroup, SE23};
    /// use inekf::model::{Discretisation, ImuIncrement, ImuInput, InertialState, NavState};
    /// use nalgebra::Vector3;
    ///
    /// let g_w = Vector3::new(0.0, 0.0, -9.80665);
    /// let push = ImuInput { omega_b: Vector3::new(0.1, 0.2, 0.5), force_b: Vector3::new(1.0, 0.0, 9.8) };
    /// let pose = SE23 { velocity: Vector3::new(5.0, 0.0, 0.0), ..SE23::identity() };
    /// let increment = ImuIncrement::new(&push, &g_w, 0.1, Discretisation::ZeroOrderHold);
    /// let state = NavState::from_parts(pose, Vector3::repeat(0.01), Vector3::repeat(0.1));
    /// // The pose moves, the biases stay.
    /// let moved = state.moved(&increment);
    /// assert_eq!((moved.pose(), moved.gyro_bias()), (&increment.apply(&pose), state.gyro_bias()));
    /// ```
    #[inline(always)]
    fn moved(&self, increment: &ImuIncrement) -> Self {
        Self::from_parts(
            increment.apply(self.pose()),
            self.gyro_bias(),
            self.accel_bias(),
        )
    }

    /// Makes the symmetric P `F P F^T + Q`, for the transition of the error of any side; exactly symmetric.
    ///
    /// ```
    /// use inekf::lie::{LieGroup, SE23};
    /// use inekf::model::{Discretisation, ImuInput, ImuNoise, InertialState, NavState};
    /// use nalgebra::{SMatrix, Vector3};
    ///
    /// let zoh = Discretisation::ZeroOrderHold;
    /// let g_w = Vector3::new(0.0, 0.0, -9.80665);
    /// let push = ImuInput { omega_b: Vector3::new(0.1, 0.2, 0.5), force_b: Vector3::new(1.0, 0.0, 9.8) };
    /// let noise = ImuNoise { gyro_psd: 1e-6, accel_psd: 1e-4, gyro_bias_psd: 1e-9, accel_bias_psd: 1e-8 };
    /// let pose = SE23 { velocity: Vector3::new(5.0, 0.0, 0.0), ..SE23::identity() };
    /// let state = NavState::from_parts(pose, Vector3::repeat(0.01), Vector3::repeat(0.1));
    /// let (_, f, q) = state.advance(&state.imu_step(&push, &g_w, 0.1, zoh), &noise);
    /// // By blocks what the products of matrices give.
    /// let before = SMatrix::<f64, 15, 15>::identity();
    /// let mut p = before;
    /// NavState::carry(&state.increment(&push, &g_w, 0.1, zoh).left_transition(), &mut p, &noise);
    /// assert!((p - (f * before * f.transpose() + q)).norm() < 1e-6);
    /// ```
    fn carry(transition: &Transition, p: &mut SMatrix<f64, D, D>, noise: &ImuNoise);

    /// Whether a step is group-affine on the whole state, so that F does not depend on the state.
    const IS_GROUP_AFFINE: bool;

    /// phi of its [`free_fall`](Self::free_fall).
    type FreeMotion: Automorphism<Self, D>;

    /// What `dt_s` seconds under gravity `g_w` (m/s^2) do to the state by themselves, whatever held samples the IMU
    /// gave meanwhile; `None` where its steps are not group-affine.
    ///
    /// ```
    /// use inekf::lie::{LieGroup, SE23};
    /// use inekf::model::{InertialState, NavState};
    /// use nalgebra::Vector3;
    ///
    /// let g_w = Vector3::new(0.0, 0.0, -9.80665);
    /// let fallen = SE23::free_fall(&g_w, 1.0).map(|drift| drift.apply(&SE23::identity()));
    /// assert!(fallen.is_some_and(|fallen| (fallen.velocity - g_w).norm() < 1e-12));
    /// // With biases the steps are not group-affine.
    /// assert!(NavState::free_fall(&g_w, 1.0).is_none());
    /// ```
    fn free_fall(g_w: &Vector3<f64>, dt_s: f64) -> Option<Drift<Self, Self::FreeMotion, D>>;

    /// The state after one step, and the transition matrix F of the left-invariant error.
    ///
    /// ```
    /// use inekf::lie::{LieGroup, SE23};
    /// use inekf::model::{Discretisation, ImuInput, InertialState};
    /// use nalgebra::{SVector, Vector3};
    ///
    /// let zoh = Discretisation::ZeroOrderHold;
    /// let g_w = Vector3::new(0.0, 0.0, -9.80665);
    /// let push = ImuInput { omega_b: Vector3::new(0.1, 0.2, 0.5), force_b: Vector3::new(1.0, 0.0, 9.8) };
    /// let pose = SE23 { velocity: Vector3::new(5.0, 0.0, 0.0), ..SE23::identity() };
    /// // f(chi exp(xi)) = f(chi) exp(F xi): without biases for an error of any size.
    /// let step = pose.imu_step(&push, &g_w, 0.1, zoh);
    /// let (moved, f) = pose.transition(&step);
    /// let xi = SVector::<f64, 9>::from_fn(|i, _| 0.2 - 0.04 * i as f64);
    /// let (wrong, _) = pose.compose(&SE23::exp(&xi)).transition(&step);
    /// assert!((moved.between(&wrong).log() - f * xi).norm() < 1e-12);
    /// ```
    fn transition(&self, step: &ImuStep) -> (Self, SMatrix<f64, D, D>);

    /// The covariance Q (symmetric) that the noise of one interval adds to the left-invariant error.
    ///
    /// ```
    /// use inekf::model::{Discretisation, ImuInput, ImuNoise, ImuStep, InertialState, NavState};
    /// use nalgebra::Vector3;
    ///
    /// let g_w = Vector3::new(0.0, 0.0, -9.80665);
    /// let push = ImuInput { omega_b: Vector3::new(0.1, 0.2, 0.5), force_b: Vector3::new(1.0, 0.0, 9.8) };
    /// let noise = ImuNoise { gyro_psd: 1e-6, accel_psd: 1e-4, gyro_bias_psd: 1e-9, accel_bias_psd: 1e-8 };
    /// // A bias walks: its variance gains the density by the time.
    /// let step = ImuStep::new(&push, &g_w, 0.5, Discretisation::ZeroOrderHold);
    /// let q = NavState::process_noise(&step, &noise);
    /// assert!((q[(9, 9)] - noise.gyro_bias_psd * 0.5).abs() < 1e-15);
    /// assert!((q[(12, 12)] - noise.accel_bias_psd * 0.5).abs() < 1e-15);
    /// ```
    fn process_noise(step: &ImuStep, noise: &ImuNoise) -> SMatrix<f64, D, D>;

    /// The state after one step, with F and Q.
    ///
    /// ```
    /// use inekf::lie::{LieGroup, SE23};
    /// use inekf::model::{Discretisation, ImuInput, ImuNoise, InertialState};
    /// use nalgebra::Vector3;
    ///
    /// let zoh = Discretisation::ZeroOrderHold;
    /// let g_w = Vector3::new(0.0, 0.0, -9.80665);
    /// let push = ImuInput { omega_b: Vector3::new(0.1, 0.2, 0.5), force_b: Vector3::new(1.0, 0.0, 9.8) };
    /// let noise = ImuNoise { gyro_psd: 1e-6, accel_psd: 1e-4, gyro_bias_psd: 1e-9, accel_bias_psd: 1e-8 };
    /// let pose = SE23 { velocity: Vector3::new(5.0, 0.0, 0.0), ..SE23::identity() };
    /// let step = pose.imu_step(&push, &g_w, 0.1, zoh);
    /// let (moved, f, q) = pose.advance(&step, &noise);
    /// assert_eq!(((moved, f), q), (pose.transition(&step), SE23::process_noise(&step, &noise)));
    /// ```
    fn advance(
        &self,
        step: &ImuStep,
        noise: &ImuNoise,
    ) -> (Self, SMatrix<f64, D, D>, SMatrix<f64, D, D>) {
        let (next, f) = self.transition(step);
        (next, f, Self::process_noise(step, noise))
    }

    /// The motion that the raw sample `measured` says, the biases of this state removed.
    ///
    /// ```
    /// use inekf::lie::{LieGroup, SE23};
    /// use inekf::model::{Discretisation, ImuInput, InertialState, NavState};
    /// use nalgebra::Vector3;
    ///
    /// let zoh = Discretisation::ZeroOrderHold;
    /// let g_w = Vector3::new(0.0, 0.0, -9.80665);
    /// let pose = SE23 { velocity: Vector3::new(5.0, 0.0, 0.0), ..SE23::identity() };
    /// // A sample that shows what the biases alone would show.
    /// let state = NavState::from_parts(pose, Vector3::repeat(0.01), Vector3::repeat(0.1));
    /// let measured = ImuInput { omega_b: Vector3::repeat(0.01), force_b: Vector3::repeat(0.1) };
    /// let increment = state.increment(&measured, &g_w, 0.1, zoh);
    /// assert_eq!(increment.input, ImuInput { omega_b: Vector3::zeros(), force_b: Vector3::zeros() });
    /// ```
    #[inline(always)]
    fn increment(
        &self,
        measured: &ImuInput,
        g_w: &Vector3<f64>,
        dt_s: f64,
        discretisation: Discretisation,
    ) -> ImuIncrement {
        let input = ImuInput {
            omega_b: measured.omega_b - self.gyro_bias(),
            force_b: measured.force_b - self.accel_bias(),
        };
        ImuIncrement::new(&input, g_w, dt_s, discretisation)
    }

    /// The step that the raw sample `measured` makes from this state, its biases removed.
    ///
    /// ```
    /// use inekf::lie::{LieGroup, SE23};
    /// use inekf::model::{Discretisation, ImuInput, InertialState, NavState};
    /// use nalgebra::Vector3;
    ///
    /// // A gyroscope that shows nothing but its bias: the vehicle does not turn.
    /// let bias = Vector3::new(0.0, 0.0, 0.02);
    /// let state = NavState::from_parts(SE23::identity(), bias, Vector3::zeros());
    /// let measured = ImuInput { omega_b: bias, force_b: Vector3::new(0.0, 0.0, 9.80665) };
    /// let g_w = Vector3::new(0.0, 0.0, -9.80665);
    /// let step = state.imu_step(&measured, &g_w, 1.0, Discretisation::ZeroOrderHold);
    /// let (moved, _) = state.transition(&step);
    /// assert!(moved.log()[2].abs() < 1e-15);
    /// ```
    fn imu_step(
        &self,
        measured: &ImuInput,
        g_w: &Vector3<f64>,
        dt_s: f64,
        discretisation: Discretisation,
    ) -> ImuStep {
        ImuStep::from(&self.increment(measured, g_w, dt_s, discretisation))
    }
}

impl InertialState<9> for SE23 {
    #[inline]
    fn pose(&self) -> &SE23 {
        self
    }

    #[inline]
    fn gyro_bias(&self) -> Vector3<f64> {
        Vector3::zeros()
    }

    #[inline]
    fn accel_bias(&self) -> Vector3<f64> {
        Vector3::zeros()
    }

    #[inline]
    fn from_parts(pose: SE23, _gyro_bias: Vector3<f64>, _accel_bias: Vector3<f64>) -> Self {
        pose
    }

    #[inline(always)]
    fn carry(transition: &Transition, p: &mut SMatrix<f64, 9, 9>, noise: &ImuNoise) {
        transition.carry(p, noise);
    }

    const IS_GROUP_AFFINE: bool = true;

    type FreeMotion = FreeMotion;

    #[inline]
    fn free_fall(g_w: &Vector3<f64>, dt_s: f64) -> Option<Drift<Self, FreeMotion, 9>> {
        Some(Drift::free_fall(g_w, dt_s))
    }

    fn transition(&self, step: &ImuStep) -> (Self, SMatrix<f64, 9, 9>) {
        (step.apply(self), step.step.left_jacobian())
    }

    fn process_noise(step: &ImuStep, noise: &ImuNoise) -> SMatrix<f64, 9, 9> {
        step.noise_covariance(noise)
    }
}
