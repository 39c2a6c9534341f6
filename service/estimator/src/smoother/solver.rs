//! The linear core of the smoothers: a chain of Gaussian unknowns, solved in linear time without a matrix inversion
//! but that of the innovation covariances.
//!
//! ```text
//! xi_0 ~ N(m, P)      xi_{i+1} = F_i xi_i + a_i + w_i,  w_i ~ N(0, Q_i)      z_k = H_k xi_k + v_k,  v_k ~ N(0, N_k)
//! ```
//!
//! Forward, a Kalman filter with innovations `e_k`, their covariances `S_k` and gains `K_k`. Backward, the adjoint
//! `r` (Bryson and Frazier), zero behind the last measurement:
//!
//! ```text
//! r_k <- r_k + H_k^T (S_k^-1 e_k - K_k^T r_k)      at a measurement
//! r_i  = F_i^T r_{i+1}                             over a link
//! ```
//!
//! Forward again, the unknowns from the smoothed disturbances (de Jong and Koopman):
//! `xi_0 = m + P r_0`, `xi_{i+1} = F_i xi_i + a_i + Q_i r_{i+1}`. This is the minimiser of \[IS\] (14), the same as
//! the dense \[IS\] (28), and it stays exact where P and Q are singular or zero: a link without noise holds to
//! rounding. The normal equations, which invert P and Q, lose every digit there.
//!
//! Nothing allocates once the chain has had its length before.

use core::fmt;

use nalgebra::{Cholesky, Const, SMatrix, SVector};

use crate::filter::Covariance;

/// A normal distribution of D numbers.
///
/// ```
/// use inekf::filter::Covariance;
/// use inekf::smoother::{Gaussian, Solver};
/// use nalgebra::Vector1;
///
/// let one = Covariance::from_variances(&Vector1::new(1.0));
/// let known = Gaussian { mean: Vector1::new(0.0), covariance: one };
/// let mut solver = Solver::<1, 1>::with_capacity(1, 0);
/// solver.start(&known);
/// // Where nothing is measured the prior is the answer.
/// assert_eq!(solver.newest(), &known);
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Gaussian<const D: usize> {
    /// Mean, D.
    pub mean: SVector<f64, D>,
    /// Covariance, D x D; may be singular.
    pub covariance: Covariance<D>,
}

/// `xi+ = F xi + a + w`, w of covariance Q.
///
/// ```
/// use inekf::filter::Covariance;
/// use inekf::smoother::{Gaussian, LinearMotion, Solver};
/// use nalgebra::{Matrix1, Vector1};
///
/// let one = Covariance::from_variances(&Vector1::new(1.0));
/// let known = Gaussian { mean: Vector1::new(0.0), covariance: one };
/// let walks = LinearMotion { transition: Matrix1::new(1.0), offset: Vector1::new(0.0), noise: Matrix1::new(3.0) };
/// let mut solver = Solver::<1, 1>::with_capacity(2, 0);
/// solver.start(&known);
/// // A random walk: its variance joins that of the start.
/// solver.advance(&walks);
/// assert_eq!(solver.newest().covariance.matrix()[(0, 0)], 1.0 + 3.0);
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LinearMotion<const D: usize> {
    /// F, D x D.
    pub transition: SMatrix<f64, D, D>,
    /// a, D.
    pub offset: SVector<f64, D>,
    /// Q, D x D, symmetric; may be singular or zero.
    pub noise: SMatrix<f64, D, D>,
}

/// `z = H xi + v`, v of covariance N.
///
/// ```
/// # use inekf::smoother::SmootherError;
/// use inekf::filter::Covariance;
/// use inekf::smoother::{Gaussian, LinearMeasurement, Solver};
/// use nalgebra::{Matrix1, Vector1};
///
/// let one = Covariance::from_variances(&Vector1::new(1.0));
/// let known = Gaussian { mean: Vector1::new(0.0), covariance: one };
/// let seen = LinearMeasurement { value: Vector1::new(5.0), jacobian: Matrix1::new(1.0), noise: Matrix1::new(1.0) };
/// let mut solver = Solver::<1, 1>::with_capacity(1, 1);
/// solver.start(&known);
/// // As well as it was known: half way from 0 to 5.
/// solver.measure(&seen)?;
/// assert!((solver.newest().mean.x - 2.5).abs() < 1e-12);
/// # Ok::<(), SmootherError>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LinearMeasurement<const D: usize, const M: usize> {
    /// z, M.
    pub value: SVector<f64, M>,
    /// H, M x D.
    pub jacobian: SMatrix<f64, M, D>,
    /// N, M x M, symmetric positive definite.
    pub noise: SMatrix<f64, M, M>,
}

/// Why a chain could not be solved.
///
/// ```
/// use inekf::smoother::{LinearMeasurement, SmootherError, Solver};
/// use nalgebra::{Matrix1, Vector1};
///
/// let mut solver = Solver::<1, 1>::with_capacity(1, 1);
/// let broken = LinearMeasurement {
///     value: Vector1::new(1.0),
///     jacobian: Matrix1::new(1.0),
///     noise: Matrix1::new(-1.0),
/// };
/// let refused = solver.measure(&broken);
/// assert_eq!(refused, Err(SmootherError::InnovationNotPositiveDefinite { state: 0 }));
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SmootherError {
    /// An innovation covariance is not positive definite.
    InnovationNotPositiveDefinite {
        /// Index of the state that the measurement is of.
        state: usize,
    },
    /// The solution is not finite.
    NotFinite,
    /// The trajectory has not one state for every state of the chain.
    WrongLength {
        /// States of the trajectory.
        states: usize,
        /// States of the chain.
        expected: usize,
    },
}

impl fmt::Display for SmootherError {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::InnovationNotPositiveDefinite { state } => write!(
                formatter,
                "the innovation covariance of a measurement of state {state} is not positive definite: check \
                 the measurement's covariance"
            ),
            Self::NotFinite => formatter.write_str(
                "the smoothed states are not finite: check the measurements and the motions between them",
            ),
            Self::WrongLength { states, expected } => write!(
                formatter,
                "the trajectory has {states} states and the chain {expected}: start from dead_reckon"
            ),
        }
    }
}

impl core::error::Error for SmootherError {}

/// The gain of one measurement, and what the way back needs of it. It depends on covariances alone.
#[derive(Clone, Copy, Debug)]
struct Gain<const D: usize, const M: usize> {
    /// H, M x D.
    jacobian: SMatrix<f64, M, D>,
    /// K, D x M.
    gain: SMatrix<f64, D, M>,
    /// Cholesky factor of `S = H P H^T + N`.
    innovation: Cholesky<f64, Const<M>>,
}

impl<const D: usize, const M: usize> Gain<D, M> {
    /// The gain under the prior covariance `prior`, with the covariance after the measurement. `None` if the
    /// innovation covariance is not positive definite.
    fn new(
        prior: &Covariance<D>,
        jacobian: &SMatrix<f64, M, D>,
        noise: &SMatrix<f64, M, M>,
    ) -> Option<(Self, Covariance<D>)> {
        let p_ht = prior.times_transposed(jacobian);
        let innovation = Cholesky::new(jacobian * p_ht + noise)?;
        let gain = innovation.solve(&p_ht.transpose()).transpose();
        let corrected = prior.corrected(&gain, jacobian, noise);
        let factored = Self {
            jacobian: *jacobian,
            gain,
            innovation,
        };
        Some((factored, corrected))
    }

    /// The mean after the measured `value`, and the weighted innovation `S^-1 e`.
    fn correct(
        &self,
        mean: &SVector<f64, D>,
        value: &SVector<f64, M>,
    ) -> (SVector<f64, D>, SVector<f64, M>) {
        let innovation = value - self.jacobian * mean;
        (
            mean + self.gain * innovation,
            self.innovation.solve(&innovation),
        )
    }

    /// The adjoint before the measurement, from the one behind it and the weighted innovation.
    fn adjoint(&self, behind: &SVector<f64, D>, weighted: &SVector<f64, M>) -> SVector<f64, D> {
        behind + self.jacobian.tr_mul(&(weighted - self.gain.tr_mul(behind)))
    }
}

/// One measurement, taken in.
#[derive(Clone, Copy, Debug)]
struct Taken<const D: usize, const M: usize> {
    gain: Gain<D, M>,
    weighted_innovation: SVector<f64, M>,
}

/// One link, taken in, with how many measurements came before it.
#[derive(Clone, Copy, Debug)]
struct Passed<const D: usize> {
    motion: LinearMotion<D>,
    measurements_before: usize,
}

/// A chain that grows at its end, filtered as it grows and smoothed on request.
///
/// D is the dimension of an unknown, M that of a measurement.
///
/// ```
/// use inekf::filter::Covariance;
/// use inekf::smoother::{Gaussian, LinearMeasurement, LinearMotion, Solver};
/// use nalgebra::{Matrix1, Vector1};
///
/// let mut solver = Solver::<1, 1>::with_capacity(2, 2);
/// solver.start(&Gaussian {
///     mean: Vector1::new(0.0),
///     covariance: Covariance::from_variances(&Vector1::new(1.0)),
/// });
/// // It stays what it is, exactly; and then it is measured, as well as it was known.
/// let stays = LinearMotion {
///     transition: Matrix1::new(1.0),
///     offset: Vector1::new(0.0),
///     noise: Matrix1::new(0.0),
/// };
/// solver.advance(&stays);
/// let measured = LinearMeasurement {
///     value: Vector1::new(1.0),
///     jacobian: Matrix1::new(1.0),
///     noise: Matrix1::new(1.0),
/// };
/// solver.measure(&measured)?;
/// assert!((solver.newest().covariance.matrix()[(0, 0)] - 0.5).abs() < 1e-15);
/// // What came later tells of what was before.
/// assert!(solver.solve().iter().all(|xi| (xi[0] - 0.5).abs() < 1e-15));
/// # Ok::<(), inekf::smoother::SmootherError>(())
/// ```
#[derive(Clone, Debug)]
pub struct Solver<const D: usize, const M: usize> {
    prior: Gaussian<D>,
    newest: Gaussian<D>,
    links: Vec<Passed<D>>,
    measurements: Vec<Taken<D, M>>,
    /// The solution; on the way back it holds the adjoints.
    solution: Vec<SVector<f64, D>>,
}

impl<const D: usize, const M: usize> Solver<D, M> {
    /// A chain of one unknown, known to be zero, with room for this many. More grow the room, which allocates.
    ///
    /// ```
    /// use inekf::smoother::Solver;
    /// use nalgebra::Vector1;
    ///
    /// // One unknown, which is zero.
    /// assert_eq!(Solver::<1, 1>::with_capacity(10, 10).solve(), [Vector1::new(0.0)]);
    /// ```
    pub fn with_capacity(states: usize, measurements: usize) -> Self {
        let zero = Gaussian {
            mean: SVector::zeros(),
            covariance: Covariance::from_variances(&SVector::zeros()),
        };
        Self {
            prior: zero,
            newest: zero,
            links: Vec::with_capacity(states),
            measurements: Vec::with_capacity(measurements),
            solution: Vec::with_capacity(states),
        }
    }

    /// Begins a new chain, of one unknown with this prior.
    ///
    /// ```
    /// use inekf::filter::Covariance;
    /// use inekf::smoother::{Gaussian, LinearMotion, Solver};
    /// use nalgebra::{Matrix1, Vector1};
    ///
    /// let one = Covariance::from_variances(&Vector1::new(1.0));
    /// let known = Gaussian { mean: Vector1::new(0.0), covariance: one };
    /// let walks = LinearMotion { transition: Matrix1::new(1.0), offset: Vector1::new(0.0), noise: Matrix1::new(3.0) };
    /// let mut solver = Solver::<1, 1>::with_capacity(2, 1);
    /// solver.start(&known);
    /// solver.advance(&walks);
    /// // Another chain: what was is forgotten.
    /// solver.start(&known);
    /// assert_eq!(solver.solve().len(), 1);
    /// ```
    pub fn start(&mut self, prior: &Gaussian<D>) {
        self.prior = *prior;
        self.newest = *prior;
        self.links.clear();
        self.measurements.clear();
    }

    /// Takes in a measurement of the newest unknown.
    ///
    /// # Errors
    /// [`SmootherError::InnovationNotPositiveDefinite`]; the chain is then as it was.
    ///
    /// ```
    /// # use inekf::smoother::SmootherError;
    /// use inekf::filter::Covariance;
    /// use inekf::smoother::{Gaussian, LinearMeasurement, Solver};
    /// use nalgebra::{Matrix1, Vector1};
    ///
    /// let one = Covariance::from_variances(&Vector1::new(1.0));
    /// let known = Gaussian { mean: Vector1::new(0.0), covariance: one };
    /// let seen = LinearMeasurement { value: Vector1::new(5.0), jacobian: Matrix1::new(1.0), noise: Matrix1::new(1.0) };
    /// let mut solver = Solver::<1, 1>::with_capacity(1, 2);
    /// solver.start(&known);
    /// // Three of weight one, two of which say 5.
    /// solver.measure(&seen)?;
    /// solver.measure(&seen)?;
    /// assert!((solver.newest().mean.x - 10.0 / 3.0).abs() < 1e-12);
    /// # Ok::<(), SmootherError>(())
    /// ```
    pub fn measure(&mut self, measurement: &LinearMeasurement<D, M>) -> Result<(), SmootherError> {
        let (gain, covariance) = Gain::new(
            &self.newest.covariance,
            &measurement.jacobian,
            &measurement.noise,
        )
        .ok_or(SmootherError::InnovationNotPositiveDefinite {
            state: self.links.len(),
        })?;
        let (mean, weighted_innovation) = gain.correct(&self.newest.mean, &measurement.value);
        self.newest = Gaussian { mean, covariance };
        self.measurements.push(Taken {
            gain,
            weighted_innovation,
        });
        Ok(())
    }

    /// Adds an unknown at the end.
    ///
    /// ```
    /// use inekf::filter::Covariance;
    /// use inekf::smoother::{Gaussian, LinearMotion, Solver};
    /// use nalgebra::{Matrix1, Vector1};
    ///
    /// let one = Covariance::from_variances(&Vector1::new(1.0));
    /// let known = Gaussian { mean: Vector1::new(0.0), covariance: one };
    /// let walks = LinearMotion { transition: Matrix1::new(1.0), offset: Vector1::new(0.0), noise: Matrix1::new(3.0) };
    /// let mut solver = Solver::<1, 1>::with_capacity(2, 0);
    /// solver.start(&known);
    /// solver.advance(&LinearMotion { offset: Vector1::new(2.0), ..walks });
    /// // One unknown more, two ahead of the one before.
    /// assert_eq!(solver.solve(), [Vector1::new(0.0), Vector1::new(2.0)]);
    /// ```
    pub fn advance(&mut self, motion: &LinearMotion<D>) {
        self.newest = Gaussian {
            mean: motion.transition * self.newest.mean + motion.offset,
            covariance: self
                .newest
                .covariance
                .transformed(&motion.transition)
                .plus(&motion.noise),
        };
        self.links.push(Passed {
            motion: *motion,
            measurements_before: self.measurements.len(),
        });
    }

    /// The newest unknown given all measurements: its smoothed and filtered distribution.
    ///
    /// ```
    /// # use inekf::smoother::SmootherError;
    /// use inekf::filter::Covariance;
    /// use inekf::smoother::{Gaussian, LinearMeasurement, LinearMotion, Solver};
    /// use nalgebra::{Matrix1, Vector1};
    ///
    /// let one = Covariance::from_variances(&Vector1::new(1.0));
    /// let known = Gaussian { mean: Vector1::new(0.0), covariance: one };
    /// let walks = LinearMotion { transition: Matrix1::new(1.0), offset: Vector1::new(0.0), noise: Matrix1::new(3.0) };
    /// let seen = LinearMeasurement { value: Vector1::new(5.0), jacobian: Matrix1::new(1.0), noise: Matrix1::new(1.0) };
    /// let mut solver = Solver::<1, 1>::with_capacity(2, 1);
    /// solver.start(&known);
    /// solver.advance(&walks);
    /// solver.measure(&seen)?;
    /// // Four fifths of the way: of variance 4 before, beside 1.
    /// assert!((solver.newest().mean.x - 4.0).abs() < 1e-12);
    /// assert!((solver.newest().covariance.matrix()[(0, 0)] - 0.8).abs() < 1e-12);
    /// # Ok::<(), SmootherError>(())
    /// ```
    pub fn newest(&self) -> &Gaussian<D> {
        &self.newest
    }

    /// The minimiser, one D-vector for each unknown, oldest first.
    ///
    /// ```
    /// # use inekf::smoother::SmootherError;
    /// use inekf::filter::Covariance;
    /// use inekf::smoother::{Gaussian, LinearMeasurement, LinearMotion, Solver};
    /// use nalgebra::{Matrix1, Vector1};
    ///
    /// let one = Covariance::from_variances(&Vector1::new(1.0));
    /// let known = Gaussian { mean: Vector1::new(0.0), covariance: one };
    /// let walks = LinearMotion { transition: Matrix1::new(1.0), offset: Vector1::new(0.0), noise: Matrix1::new(3.0) };
    /// let seen = LinearMeasurement { value: Vector1::new(5.0), jacobian: Matrix1::new(1.0), noise: Matrix1::new(1.0) };
    /// let mut solver = Solver::<1, 1>::with_capacity(2, 1);
    /// solver.start(&known);
    /// solver.advance(&walks);
    /// solver.measure(&seen)?;
    /// // The five are shared by what may have been wrong: the start by one, the walk by three, the measurement by one.
    /// let [first, last] = solver.solve() else { panic!("two unknowns") };
    /// assert!((first.x - 1.0).abs() < 1e-12 && (last.x - 4.0).abs() < 1e-12);
    /// # Ok::<(), SmootherError>(())
    /// ```
    pub fn solve(&mut self) -> &[SVector<f64, D>] {
        self.solution.clear();
        let mut adjoint = SVector::zeros();
        let mut unseen = self.measurements.as_slice();
        for link in self.links.iter().rev() {
            let (before, of_this) = unseen.split_at(link.measurements_before);
            adjoint = through(of_this, &adjoint);
            self.solution.push(adjoint);
            adjoint = link.motion.transition.tr_mul(&adjoint);
            unseen = before;
        }
        self.solution.push(through(unseen, &adjoint));
        self.solution.reverse();

        let mut smoothed = self.solution.iter_mut();
        let Some(first) = smoothed.next() else {
            return &[];
        };
        let mut unknown = self.prior.mean + self.prior.covariance.matrix() * *first;
        *first = unknown;
        for (entry, link) in smoothed.zip(&self.links) {
            let motion = &link.motion;
            unknown = motion.transition * unknown + motion.offset + motion.noise * *entry;
            *entry = unknown;
        }
        &self.solution
    }
}

/// The adjoint before the `measurements` of one unknown, from the one behind them.
fn through<const D: usize, const M: usize>(
    measurements: &[Taken<D, M>],
    behind: &SVector<f64, D>,
) -> SVector<f64, D> {
    measurements.iter().rev().fold(*behind, |adjoint, taken| {
        taken.gain.adjoint(&adjoint, &taken.weighted_innovation)
    })
}
