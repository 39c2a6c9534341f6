//! Second-order jets: a value with its first two time derivatives.
//!
//! Trajectories are written once, as functions of time; evaluated on jets they yield velocity,
//! acceleration and body rate exactly, without a derivative worked out by hand. The rules are those
//! of Leibniz (products) and Faa di Bruno (compositions), cut after the second order.

use std::ops::{Add, Mul, Neg, Sub};

/// A scalar function of time at one instant.
///
/// ```
/// use inekf_client::simulate::Jet;
///
/// // t^2 at 3 s: 9, with the derivatives 2 t and 2.
/// let t = Jet::time(3.0);
/// assert_eq!(t * t, Jet { value: 9.0, rate: 6.0, second: 2.0 });
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Jet {
    /// The value.
    pub value: f64,
    /// Its first derivative, per second.
    pub rate: f64,
    /// Its second derivative, per second squared.
    pub second: f64,
}

impl Jet {
    /// Time itself.
    ///
    /// ```
    /// use inekf_client::simulate::Jet;
    ///
    /// assert_eq!(Jet::time(5.0), Jet { value: 5.0, rate: 1.0, second: 0.0 });
    /// ```
    pub fn time(t_s: f64) -> Self {
        Self {
            value: t_s,
            rate: 1.0,
            second: 0.0,
        }
    }

    /// A constant.
    ///
    /// ```
    /// use inekf_client::simulate::Jet;
    ///
    /// assert_eq!(Jet::constant(5.0), Jet { value: 5.0, rate: 0.0, second: 0.0 });
    /// ```
    pub fn constant(value: f64) -> Self {
        Self {
            value,
            rate: 0.0,
            second: 0.0,
        }
    }

    /// `f(self)`, from the value of `f` and of its first two derivatives there.
    ///
    /// ```
    /// use inekf_client::simulate::Jet;
    ///
    /// // exp is its own derivative: of exp(2 t) at 0 they are 1, 2 and 4.
    /// let twice = Jet::time(0.0) * 2.0;
    /// let e = twice.value.exp();
    /// assert_eq!(twice.chain(e, e, e), Jet { value: 1.0, rate: 2.0, second: 4.0 });
    /// ```
    pub fn chain(self, f: f64, df: f64, ddf: f64) -> Self {
        Self {
            value: f,
            rate: df * self.rate,
            second: ddf * self.rate * self.rate + df * self.second,
        }
    }

    /// Sine.
    ///
    /// ```
    /// use inekf_client::simulate::Jet;
    ///
    /// // sin'' = -sin.
    /// let wave = Jet::time(0.7).sin();
    /// assert!((wave.second + wave.value).abs() < 1e-15);
    /// ```
    pub fn sin(self) -> Self {
        let (sin, cos) = self.value.sin_cos();
        self.chain(sin, cos, -sin)
    }

    /// Cosine.
    ///
    /// ```
    /// use inekf_client::simulate::Jet;
    ///
    /// let t = Jet::time(0.7);
    /// let one = t.sin() * t.sin() + t.cos() * t.cos();
    /// // Constant: neither derivative is left.
    /// assert!((one.value - 1.0).abs() < 1e-15 && one.rate.abs() < 1e-15 && one.second.abs() < 1e-15);
    /// ```
    pub fn cos(self) -> Self {
        let (sin, cos) = self.value.sin_cos();
        self.chain(cos, -sin, -cos)
    }

    /// `1 / sqrt(self)`, for a value above zero.
    ///
    /// ```
    /// use inekf_client::simulate::Jet;
    ///
    /// let t = Jet::time(4.0);
    /// let root = t.inverse_sqrt();
    /// // 1/sqrt(t) squared, times t, is one, and stays one.
    /// let one = root * root * t;
    /// assert!((one.value - 1.0).abs() < 1e-15 && one.rate.abs() < 1e-15);
    /// ```
    pub fn inverse_sqrt(self) -> Self {
        let f = self.value.sqrt().recip();
        let df = -0.5 * f / self.value;
        self.chain(f, df, -1.5 * df / self.value)
    }
}

impl Add for Jet {
    type Output = Self;

    fn add(self, other: Self) -> Self {
        Self {
            value: self.value + other.value,
            rate: self.rate + other.rate,
            second: self.second + other.second,
        }
    }
}

impl Neg for Jet {
    type Output = Self;

    fn neg(self) -> Self {
        self * -1.0
    }
}

impl Sub for Jet {
    type Output = Self;

    fn sub(self, other: Self) -> Self {
        self + -other
    }
}

impl Mul for Jet {
    type Output = Self;

    fn mul(self, other: Self) -> Self {
        Self {
            value: self.value * other.value,
            rate: self.rate * other.value + self.value * other.rate,
            second: self.second * other.value
                + 2.0 * self.rate * other.rate
                + self.value * other.second,
        }
    }
}

impl Mul<f64> for Jet {
    type Output = Self;

    fn mul(self, factor: f64) -> Self {
        Self {
            value: self.value * factor,
            rate: self.rate * factor,
            second: self.second * factor,
        }
    }
}

/// A vector function of time.
///
/// ```
/// use inekf_client::simulate::{Jet, JetVector};
///
/// // A point on the unit circle at 1 rad/s is as fast as it is far out.
/// let t = Jet::time(0.3);
/// let point: JetVector = [t.cos(), t.sin(), Jet::constant(2.0)];
/// let speed = point[0].rate.hypot(point[1].rate);
/// assert!((speed - 1.0).abs() < 1e-15 && point[2].rate == 0.0);
/// ```
pub type JetVector = [Jet; 3];

/// A constant vector.
pub fn constant(vector: [f64; 3]) -> JetVector {
    vector.map(Jet::constant)
}

/// Scalar product.
pub fn dot(a: &JetVector, b: &JetVector) -> Jet {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// Vector product.
pub fn cross(a: &JetVector, b: &JetVector) -> JetVector {
    [
        a[1] * b[2] - a[2] * b[1],
        a[2] * b[0] - a[0] * b[2],
        a[0] * b[1] - a[1] * b[0],
    ]
}

/// Product with a scalar.
pub fn scale(a: &JetVector, factor: Jet) -> JetVector {
    a.map(|entry| entry * factor)
}

/// Sum.
pub fn sum(a: &JetVector, b: &JetVector) -> JetVector {
    [a[0] + b[0], a[1] + b[1], a[2] + b[2]]
}

/// The direction of a vector that is not zero.
pub fn unit(a: &JetVector) -> JetVector {
    scale(a, dot(a, a).inverse_sqrt())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// `exp(-t) = 1/sqrt(exp(2t))`, against the derivatives known in closed form.
    #[test]
    fn inverse_root_of_an_exponential_has_its_derivatives() {
        let e = (2.0_f64 * 0.3).exp();
        let jet = Jet::time(0.3).chain(e, 2.0 * e, 4.0 * e).inverse_sqrt();
        let expected = (-0.3_f64).exp();
        for (found, expected) in [
            (jet.value, expected),
            (jet.rate, -expected),
            (jet.second, expected),
        ] {
            assert!((found - expected).abs() < 1e-15, "{found} {expected}");
        }
    }

    /// `t sin(t^2)` against its derivatives by hand.
    #[test]
    fn product_and_composition_follow_leibniz_and_faa_di_bruno() {
        let t = 0.7_f64;
        let time = Jet::time(t);
        let jet = time * (time * time).sin();
        let (s, c) = (t * t).sin_cos();
        assert!((jet.rate - (s + 2.0 * t * t * c)).abs() < 1e-15);
        let second = 6.0 * t * c - 4.0 * t.powi(3) * s;
        assert!((jet.second - second).abs() < 1e-14);
    }

    /// A unit vector stays a unit vector: its rate is orthogonal to it.
    #[test]
    fn direction_has_length_one_and_an_orthogonal_rate() {
        let t = Jet::time(1.1);
        let u = unit(&[t.sin(), t * t, t.cos() * 3.0]);
        let length = dot(&u, &u);
        assert!((length.value - 1.0).abs() < 1e-15);
        assert!(length.rate.abs() < 1e-14 && length.second.abs() < 1e-13);
        let w = cross(&u, &constant([0.0, 0.0, 1.0]));
        assert!(dot(&u, &w).value.abs() < 1e-16 && dot(&u, &w).second.abs() < 1e-14);
    }
}
