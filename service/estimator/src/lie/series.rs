//! The scalar functions behind every closed form on rotations, and the navigation integrals made of them.
//!
//! With `t = theta^2`, in rad^2, the functions
//!
//! ```text
//! S_k(t) = sum_n (-1)^n t^n / (2n + k)!        S_0 = cos(theta), S_1 = sin(theta) / theta,
//!                                              S_2 = (1 - cos(theta)) / theta^2, ...
//! S_k    = 1/k! - t S_{k+2}
//! S_k'   = -(S_{k+1} - k S_{k+2}) / 2          (derivative by t)
//! ```
//!
//! are entire, so that nothing special happens at `theta = 0`. For a rotation vector `phi` (radians, body
//! axes) they give
//!
//! ```text
//! Gamma_m(phi) = sum_n hat(phi)^n / (n + m)! = I/m! + S_{m+1} hat(phi) + S_{m+2} hat(phi)^2
//! ```
//!
//! `Gamma_0 = Exp(phi)`, `Gamma_1` is the left Jacobian of SO(3), and with a constant rate of turn and a
//! constant specific force `Gamma_1 a dt` and `Gamma_2 a dt^2` are the exact increments of velocity and
//! position over a sample.

use nalgebra::{Matrix3, Vector3};

use super::so3::hat;

/// How many of the functions `S_k` are evaluated together: `S_0 ..= S_6`.
pub const COUNT: usize = 7;

/// Up to here (0.25 rad: every IMU sample) five terms of the series are exact to double precision.
const T_SMALL: f64 = 0.0625;
const TERMS_SMALL: usize = 5;

/// Up to here (just over pi) thirteen terms are: they decrease from the first one on, so that nothing
/// cancels. The closed forms, which divide differences by powers of `t`, are only sound beyond.
const T_MIDDLE: f64 = 10.0;
const TERMS_MIDDLE: usize = 13;

/// `1/k!`.
const fn reciprocal_factorial(k: usize) -> f64 {
    let mut factorial = 1.0;
    let mut i = 2;
    while i <= k {
        factorial *= i as f64;
        i += 1;
    }
    1.0 / factorial
}

/// `1/0! ..= 1/6!`.
const RECIPROCAL_FACTORIAL: [f64; COUNT] = {
    let mut table = [0.0; COUNT];
    let mut k = 0;
    while k < COUNT {
        table[k] = reciprocal_factorial(k);
        k += 1;
    }
    table
};

/// The coefficients `(-1)^n / (2n + k)!` of `S_k`.
const fn coefficients<const TERMS: usize>(k: usize) -> [f64; TERMS] {
    let mut table = [0.0; TERMS];
    let mut n = 0;
    while n < TERMS {
        let sign = if n % 2 == 0 { 1.0 } else { -1.0 };
        table[n] = sign * reciprocal_factorial(2 * n + k);
        n += 1;
    }
    table
}

#[inline]
fn horner<const TERMS: usize>(coefficients: &[f64; TERMS], t: f64) -> f64 {
    coefficients.iter().rev().fold(0.0, |sum, c| sum * t + c)
}

/// `S_0 ..= S_6` at `t = theta^2 >= 0`, each to double precision.
///
/// ```
/// use inekf::lie::series::entire;
///
/// let theta = 0.7_f64;
/// let s = entire(theta * theta);
/// assert!((s[0] - theta.cos()).abs() < 1e-15 && (s[1] - theta.sin() / theta).abs() < 1e-15);
/// // At zero they are 1/k!, without a division by zero.
/// assert_eq!(entire(0.0)[..4], [1.0, 1.0, 0.5, 1.0 / 6.0]);
/// ```
#[inline]
#[must_use]
pub fn entire(t: f64) -> [f64; COUNT] {
    const C5_SMALL: [f64; TERMS_SMALL] = coefficients(5);
    const C6_SMALL: [f64; TERMS_SMALL] = coefficients(6);
    const C5_MIDDLE: [f64; TERMS_MIDDLE] = coefficients(5);
    const C6_MIDDLE: [f64; TERMS_MIDDLE] = coefficients(6);

    let mut s = [0.0; COUNT];
    if t <= T_MIDDLE {
        (s[5], s[6]) = if t <= T_SMALL {
            (horner(&C5_SMALL, t), horner(&C6_SMALL, t))
        } else {
            (horner(&C5_MIDDLE, t), horner(&C6_MIDDLE, t))
        };
        for k in (0..COUNT - 2).rev() {
            s[k] = RECIPROCAL_FACTORIAL[k] - t * s[k + 2];
        }
    } else {
        (s[0], s[1]) = cos_sinc(t);
        for k in 2..COUNT {
            s[k] = (RECIPROCAL_FACTORIAL[k - 2] - s[k - 2]) / t;
        }
    }
    s
}

/// `S_0 = cos(theta)` and `S_1 = sin(theta) / theta` alone, at `t = theta^2 >= 0`.
///
/// ```
/// use inekf::lie::series::cos_sinc;
///
/// assert_eq!(cos_sinc(0.0), (1.0, 1.0));
/// let (cos, sinc) = cos_sinc(4.0);
/// assert!((cos - 2_f64.cos()).abs() < 1e-15 && (sinc - 2_f64.sin() / 2.0).abs() < 1e-15);
/// ```
#[inline]
#[must_use]
pub fn cos_sinc(t: f64) -> (f64, f64) {
    const TERMS: usize = 7;
    const C0: [f64; TERMS] = coefficients(0);
    const C1: [f64; TERMS] = coefficients(1);

    if t <= T_SMALL {
        (horner(&C0, t), horner(&C1, t))
    } else {
        let theta = t.sqrt();
        let (sin, cos) = theta.sin_cos();
        (cos, sin / theta)
    }
}

/// The coefficient `c` of `Gamma_1(phi)^-1 = I - hat(phi)/2 + c hat(phi)^2`, at `t = theta^2`.
///
/// `c = (1 - (theta/2) cot(theta/2)) / t`, written with `u = t/4` as `(S_2(u) - S_3(u)) / (4 S_1(u))`: no
/// difference of nearly equal numbers at 0, and no division by `sin(pi)`. It is infinite at 2 pi.
///
/// ```
/// use inekf::lie::series::inverse_jacobian_coefficient;
///
/// assert!((inverse_jacobian_coefficient(0.0) - 1.0 / 12.0).abs() < 1e-15);
/// // Also where sin(theta) vanishes.
/// let pi = std::f64::consts::PI;
/// assert!((inverse_jacobian_coefficient(pi * pi) - 1.0 / (pi * pi)).abs() < 1e-15);
/// ```
#[inline]
#[must_use]
pub fn inverse_jacobian_coefficient(t: f64) -> f64 {
    // |B_2n| / (2n)!, of which the next is 5e-10: below one rounding here.
    const SMALL: [f64; 5] = [
        1.0 / 12.0,
        1.0 / 720.0,
        1.0 / 30_240.0,
        1.0 / 1_209_600.0,
        1.0 / 47_900_160.0,
    ];
    if t <= 1e-2 {
        return horner(&SMALL, t);
    }
    let s = entire(0.25 * t);
    0.25 * (s[2] - s[3]) / s[1]
}

/// The functions `S_k` at one rotation vector, ready for any of the integrals `Gamma_m`.
///
/// `M` is the index of `Gamma_M`: 0, 1 or 2 (another one does not compile).
///
/// ```
/// use inekf::lie::series::RotationSeries;
/// use inekf::lie::{LieGroup, SO3};
/// use nalgebra::Vector3;
///
/// // Gamma_0 is the rotation, Gamma_1 the left Jacobian.
/// let phi = Vector3::new(0.3, -0.5, 0.8);
/// let series = RotationSeries::at(&phi);
/// assert!((series.gamma::<0>() - SO3::exp(&phi).matrix()).norm() < 1e-14);
/// assert!((series.gamma::<1>() - SO3::left_jacobian(&phi)).norm() < 1e-14);
/// ```
#[derive(Debug, Clone, Copy)]
pub struct RotationSeries {
    phi: Vector3<f64>,
    s: [f64; COUNT],
}

impl RotationSeries {
    /// Evaluates the functions at the rotation vector `phi`, in radians.
    ///
    /// ```
    /// use inekf::lie::series::RotationSeries;
    /// use nalgebra::Vector3;
    ///
    /// // No division by the angle: at zero as anywhere else, S_k = 1 / k!.
    /// let series = RotationSeries::at(&Vector3::zeros());
    /// assert_eq!(series.values()[..4], [1.0, 1.0, 0.5, 1.0 / 6.0]);
    /// ```
    #[inline]
    #[must_use]
    pub fn at(phi: &Vector3<f64>) -> Self {
        Self {
            phi: *phi,
            s: entire(phi.norm_squared()),
        }
    }

    /// The rotation vector, rad.
    ///
    /// ```
    /// use inekf::lie::series::RotationSeries;
    /// use nalgebra::Vector3;
    ///
    /// let phi = Vector3::new(0.3, -0.5, 0.8);
    /// assert_eq!(RotationSeries::at(&phi).phi(), &phi);
    /// ```
    #[inline]
    #[must_use]
    pub fn phi(&self) -> &Vector3<f64> {
        &self.phi
    }

    /// The values `S_0 ..= S_6`.
    ///
    /// ```
    /// use inekf::lie::series::RotationSeries;
    /// use nalgebra::Vector3;
    ///
    /// // cos, and sin by the angle.
    /// let (phi, angle) = (Vector3::new(0.0, 0.6, 0.8), 1_f64);
    /// let [s_0, s_1, ..] = *RotationSeries::at(&phi).values();
    /// assert!((s_0 - angle.cos()).abs() < 1e-15 && (s_1 - angle.sin() / angle).abs() < 1e-15);
    /// ```
    #[inline]
    #[must_use]
    pub fn values(&self) -> &[f64; COUNT] {
        &self.s
    }

    /// `dS_k/dt` for `k <= 4`.
    #[inline]
    fn derivative(&self, k: usize) -> f64 {
        -0.5 * (self.s[k + 1] - k as f64 * self.s[k + 2])
    }

    /// The matrix `Gamma_M(phi)`.
    ///
    /// ```
    /// use inekf::lie::series::RotationSeries;
    /// use nalgebra::{Matrix3, Vector3};
    ///
    /// // Without a turn: 1/m!.
    /// let series = RotationSeries::at(&Vector3::zeros());
    /// assert_eq!(series.gamma::<2>(), Matrix3::identity() * 0.5);
    /// ```
    #[must_use]
    #[inline]
    pub fn gamma<const M: usize>(&self) -> Matrix3<f64> {
        Matrix3::from(self.gamma_columns::<M>())
    }

    /// [`gamma`](Self::gamma) by columns.
    #[inline(always)]
    pub(crate) fn gamma_columns<const M: usize>(&self) -> [[f64; 3]; 3] {
        const { assert!(M <= 2) };
        let (b, c) = (self.s[M + 1], self.s[M + 2]);
        // hat(phi)^2 = phi phi^T - t I
        let diagonal = RECIPROCAL_FACTORIAL[M] - c * self.phi.norm_squared();
        let [x, y, z] = [self.phi.x, self.phi.y, self.phi.z];
        let [cx, cy, cz] = [c * x, c * y, c * z];
        let [bx, by, bz] = [b * x, b * y, b * z];
        let (xy, xz, yz) = (cx * y, cx * z, cy * z);
        [
            [diagonal + cx * x, xy + bz, xz - by],
            [xy - bz, diagonal + cy * y, yz + bx],
            [xz + by, yz - bx, diagonal + cz * z],
        ]
    }

    /// The vector `Gamma_M(phi) a`, without forming the matrix.
    ///
    /// ```
    /// use inekf::lie::series::RotationSeries;
    /// use nalgebra::Vector3;
    ///
    /// let (phi, a) = (Vector3::new(0.3, -0.5, 0.8), Vector3::new(1.0, 2.0, 3.0));
    /// let series = RotationSeries::at(&phi);
    /// assert!((series.gamma_times::<2>(&a) - series.gamma::<2>() * a).norm() < 1e-14);
    /// ```
    #[inline]
    #[must_use]
    pub fn gamma_times<const M: usize>(&self, a: &Vector3<f64>) -> Vector3<f64> {
        const { assert!(M <= 2) };
        let p_a = self.phi.cross(a);
        RECIPROCAL_FACTORIAL[M] * a + self.s[M + 1] * p_a + self.s[M + 2] * self.phi.cross(&p_a)
    }

    /// The derivative of the vector `Gamma_M(phi) a` by `phi`, with `a` held.
    ///
    /// Column `j` is the change of the vector per radian of `phi_j`.
    ///
    /// ```
    /// use inekf::lie::series::RotationSeries;
    /// use nalgebra::Vector3;
    ///
    /// let (phi, a) = (Vector3::new(0.3, -0.5, 0.8), Vector3::new(1.0, 2.0, 3.0));
    /// let value = |phi: Vector3<f64>| RotationSeries::at(&phi).gamma_times::<1>(&a);
    /// let slope = (value(phi + Vector3::x() * 1e-6) - value(phi - Vector3::x() * 1e-6)) / 2e-6;
    /// let derivative = RotationSeries::at(&phi).gamma_times_derivative::<1>(&a);
    /// assert!((derivative.column(0) - slope).norm() < 1e-8);
    /// ```
    #[must_use]
    #[inline]
    pub fn gamma_times_derivative<const M: usize>(&self, a: &Vector3<f64>) -> Matrix3<f64> {
        Matrix3::from(self.gamma_times_derivative_columns::<M>(a))
    }

    /// [`gamma_times_derivative`](Self::gamma_times_derivative) by columns.
    #[inline(always)]
    pub(crate) fn gamma_times_derivative_columns<const M: usize>(
        &self,
        a: &Vector3<f64>,
    ) -> [[f64; 3]; 3] {
        const { assert!(M <= 2) };
        let p = &self.phi;
        let (b, c) = (self.s[M + 1], self.s[M + 2]);
        let (db, dc) = (self.derivative(M + 1), self.derivative(M + 2));
        let p_a = p.cross(a);
        let p_p_a = p.cross(&p_a);
        // phi x (phi x a) changes by d x (phi x a) + phi x (d x a), and
        // hat(phi) hat(a) = a phi^T - (phi . a) I.
        let u = 2.0 * (db * p_a + dc * p_p_a) - c * a;
        let w = b * a + c * p_a;
        let diagonal = c * p.dot(a);
        [
            [u.x * p.x + diagonal, u.y * p.x - w.z, u.z * p.x + w.y],
            [u.x * p.y + w.z, u.y * p.y + diagonal, u.z * p.y - w.x],
            [u.x * p.z - w.y, u.y * p.z + w.x, u.z * p.z + diagonal],
        ]
    }

    /// The directional derivative of the matrix, `d/ds Gamma_M(phi + s rho)` at `s = 0`.
    ///
    /// For `M = 1` this is the off-diagonal block `Q(phi, rho)` of the left Jacobian of SE(3)
    /// (Barfoot and Furgale 2014), whose quartic products collapse by
    /// `hat(a) hat(b) hat(a) = -(a . b) hat(a)`.
    ///
    /// ```
    /// use inekf::lie::series::RotationSeries;
    /// use nalgebra::Vector3;
    ///
    /// let (phi, rho) = (Vector3::new(0.3, -0.5, 0.8), Vector3::new(1.0, 2.0, 3.0));
    /// let value = |s: f64| RotationSeries::at(&(phi + rho * s)).gamma::<1>();
    /// let slope = (value(1e-6) - value(-1e-6)) / 2e-6;
    /// assert!((RotationSeries::at(&phi).gamma_along::<1>(&rho) - slope).norm() < 1e-8);
    /// ```
    #[must_use]
    #[inline]
    pub fn gamma_along<const M: usize>(&self, rho: &Vector3<f64>) -> Matrix3<f64> {
        const { assert!(M <= 2) };
        let p = &self.phi;
        let (b, c) = (self.s[M + 1], self.s[M + 2]);
        let dot = p.dot(rho);
        let db = 2.0 * dot * self.derivative(M + 1);
        let dc = 2.0 * dot * self.derivative(M + 2);
        // d(hat(phi)^2) = phi rho^T + rho phi^T - 2 (phi . rho) I
        let half = 0.5 * dc * p + c * rho;
        let mut along = half * p.transpose() + p * half.transpose() + hat(&(db * p + b * rho));
        let diagonal = -(2.0 * c * dot + dc * p.norm_squared());
        along[(0, 0)] += diagonal;
        along[(1, 1)] += diagonal;
        along[(2, 2)] += diagonal;
        along
    }
}

/// The matrix `Gamma_M(phi)`, `phi` in radians; see [`RotationSeries::gamma`].
///
/// ```
/// use inekf::lie::series::gamma;
/// use nalgebra::Vector3;
///
/// // Under a constant turn and force the velocity grows by Gamma_1(w dt) a dt: along the axis as if there were no turn.
/// let phi = Vector3::new(0.0, 0.0, 1.0);
/// assert!((gamma::<1>(&phi) * Vector3::z() - Vector3::z()).norm() < 1e-15);
/// ```
#[must_use]
pub fn gamma<const M: usize>(phi: &Vector3<f64>) -> Matrix3<f64> {
    RotationSeries::at(phi).gamma::<M>()
}

/// The derivative of `Gamma_M(phi) a` by `phi`; see [`RotationSeries::gamma_times_derivative`].
///
/// ```
/// use inekf::lie::series::gamma_times_derivative;
/// use inekf::lie::hat;
/// use nalgebra::Vector3;
///
/// // At zero d(Exp(phi) a) = -hat(a) d phi.
/// let a = Vector3::new(1.0, 2.0, 3.0);
/// assert!((gamma_times_derivative::<0>(&Vector3::zeros(), &a) + hat(&a)).norm() < 1e-15);
/// ```
#[must_use]
#[inline]
pub fn gamma_times_derivative<const M: usize>(
    phi: &Vector3<f64>,
    a: &Vector3<f64>,
) -> Matrix3<f64> {
    RotationSeries::at(phi).gamma_times_derivative::<M>(a)
}
