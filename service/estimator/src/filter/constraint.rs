//! The algebra of linear constraints on a gain: the best L with `L Delta = T`, \[LC\] (19) and (22).
//!
//! ```text
//! Gamma = T - K Delta    Psi = Delta^T S^-1 Delta    L = K + Gamma Psi^-1 Delta^T S^-1
//! ```
//!
//! Psi is never formed: it squares the condition. With `S = C C^T`, `W = C^-1 Delta` and `V = P H^T C^-T`, the
//! columns of (W, T) are made orthonormal in W together, `W = Q R` and `T = U R`, so that `Psi = R^T R` and
//!
//! ```text
//! L = (V + (U - V Q) Q^T) C^-1        P+ = P - V V^T + (U - V Q)(U - V Q)^T
//! ```
//!
//! The columns come in blocks, one for each mismatch. Each block is first scaled to one in (Delta, T) together:
//! an odometry column of one metre beside a frame column of a kilometre is no less a constraint. A block of no
//! size says nothing and is dropped; a column that follows from others (the third axis of a rotation) too.
//!
//! A block with a finite sigma is a soft constraint: sigma^2 is the variance of its parameters, added to the
//! model as `P H^T + sigma^2 T Delta^T` and `S + sigma^2 Delta Delta^T`. The limit of a large sigma is (22).
//! Like the hard one it forgets: the parameters are drawn anew for each update. A state that remembers them is
//! an [`Augmented`](crate::model::Augmented) one.

use nalgebra::{SMatrix, SVector};

use super::covariance::Covariance;
use super::factor::Factor;
use super::gain::Judgement;
use super::linearised::Linearised;
use super::update::UpdateError;
use crate::lie::LieGroup;
use crate::model::Columns;

/// Most columns that a set of constraints holds.
pub const MAX_COLUMNS: usize = 16;

/// A block whose columns are all smaller than this (metres, radians) has no direction.
const NO_SIZE: f64 = 1e-9;

/// A column whose part outside the others is below this share of its block follows from them.
const RANK_TOLERANCE: f64 = 1e-9;

/// How well T of a dependent column must follow from the others, relative to the largest T.
const CONSISTENCY_TOLERANCE: f64 = 1e-6;

/// One parameter of a mismatch.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Column<const D: usize, const M: usize> {
    delta: SVector<f64, M>,
    t: SVector<f64, D>,
    sigma: f64,
    /// Index of the first column of its block.
    block: usize,
}

/// The columns of `L Delta = T`, on the stack.
///
/// ```
/// use inekf::filter::{Belief, Constraints, Covariance, Left, Linearised};
/// use inekf::lie::{LieGroup, SE2};
/// use inekf::model::{Columns, PlanarFix, PointFix};
/// use nalgebra::{Matrix2, SVector, Vector2, Vector3};
///
/// let p = Covariance::from_variances(&Vector3::new(0.01, 1.0, 1.0));
/// let belief = Belief::<SE2, Left, 3>::new(SE2::identity(), p);
/// let fix = PlanarFix::new([PointFix {
///     position_w: Vector2::new(1.0, 1.0),
///     covariance_w: Matrix2::identity(),
///     lever_arm_b: Vector2::zeros(),
///     scale_error: 0.0,
/// }]);
/// let noise = fix.noise_covariance();
/// let linearised =
///     Linearised::at(&belief, &fix, &belief.mean, &SVector::zeros(), &noise).expect("definite");
/// // Nothing is known of what the sensor shows along x: no gain may follow it there.
/// let mut constraints = Constraints::<3, 2>::default();
/// let (along_x, no_motion) = (Columns::one(Vector2::x()), Columns::one(Vector3::zeros()));
/// constraints.push(&along_x, &no_motion, f64::INFINITY)?;
/// let gain = constraints.gain(&linearised)?;
/// assert!((gain * Vector2::x()).norm() < 1e-12 && (gain * Vector2::y()).norm() > 0.1);
/// // It takes one of the two dimensions of the innovation.
/// assert_eq!((constraints.rank()?, constraints.judge(&linearised)?.degrees), (1, 1));
/// # Ok::<(), inekf::filter::UpdateError>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Constraints<const D: usize, const M: usize> {
    columns: [Column<D, M>; MAX_COLUMNS],
    count: usize,
}

impl<const D: usize, const M: usize> Default for Constraints<D, M> {
    fn default() -> Self {
        Self {
            columns: [Column {
                delta: SVector::zeros(),
                t: SVector::zeros(),
                sigma: 0.0,
                block: 0,
            }; MAX_COLUMNS],
            count: 0,
        }
    }
}

/// (W, T) with W orthonormal; columns beyond the rank are zero.
struct Basis<const D: usize, const M: usize> {
    q: SMatrix<f64, M, M>,
    u: SMatrix<f64, D, M>,
    rank: usize,
}

/// `P H^T` and the factor of S with the soft constraints in them.
struct Softened<const D: usize, const M: usize> {
    p_ht: SMatrix<f64, D, M>,
    innovation: Factor<M>,
}

impl<const D: usize, const M: usize> Constraints<D, M> {
    /// Adds the columns of one mismatch: `delta` (M rows) and `t` (D rows), as many of each. A sigma of
    /// infinity makes the constraint hard.
    ///
    /// # Errors
    /// [`UpdateError::TooManyConstraints`] beyond [`MAX_COLUMNS`]; nothing is added then.
    ///
    /// ```
    /// use inekf::filter::{Constraints, UpdateError};
    /// use inekf::filter::constraint::MAX_COLUMNS;
    /// use inekf::model::Columns;
    /// use nalgebra::{Vector2, Vector3};
    ///
    /// let (along_x, no_motion) = (Columns::one(Vector2::x()), Columns::one(Vector3::zeros()));
    /// let mut constraints = Constraints::<3, 2>::default();
    ///
    /// for _ in 0..MAX_COLUMNS {
    ///     constraints.push(&along_x, &no_motion, 0.1)?;
    /// }
    /// // There is no room for more.
    /// assert_eq!(constraints.push(&along_x, &no_motion, 0.1), Err(UpdateError::TooManyConstraints));
    /// # Ok::<(), UpdateError>(())
    /// ```
    pub fn push(
        &mut self,
        delta: &Columns<M>,
        t: &Columns<D>,
        sigma: f64,
    ) -> Result<(), UpdateError> {
        let added = delta.as_slice().iter().zip(t.as_slice());
        if self.count + added.len() > MAX_COLUMNS {
            return Err(UpdateError::TooManyConstraints);
        }
        let block = self.count;
        for (delta, t) in added {
            self.columns[self.count] = Column {
                delta: *delta,
                t: *t,
                sigma,
                block,
            };
            self.count += 1;
        }
        Ok(())
    }

    /// The columns of (Delta, T), as they were added.
    ///
    /// ```
    /// # use inekf::filter::UpdateError;
    /// use inekf::filter::Constraints;
    /// use inekf::model::Columns;
    /// use nalgebra::{Vector2, Vector3};
    ///
    /// let (along_x, no_motion) = (Columns::one(Vector2::x()), Columns::one(Vector3::zeros()));
    /// let mut constraints = Constraints::<3, 2>::default();
    /// constraints.push(&along_x, &Columns::one(Vector3::y()), f64::INFINITY)?;
    /// assert_eq!(constraints.columns().next(), Some((&Vector2::x(), &Vector3::y())));
    /// # Ok::<(), UpdateError>(())
    /// ```
    pub fn columns(&self) -> impl Iterator<Item = (&SVector<f64, M>, &SVector<f64, D>)> {
        self.all().iter().map(|column| (&column.delta, &column.t))
    }

    fn all(&self) -> &[Column<D, M>] {
        &self.columns[..self.count]
    }

    fn soft(&self) -> impl Iterator<Item = &Column<D, M>> {
        self.all().iter().filter(|column| column.sigma.is_finite())
    }

    fn softened<G: LieGroup<D>>(
        &self,
        linearised: &Linearised<G, D, M>,
    ) -> Result<Softened<D, M>, UpdateError> {
        let mut p_ht = linearised.p_ht;
        let mut innovation = linearised.innovation;
        if self.soft().next().is_some() {
            let mut s = linearised.innovation_covariance();
            for column in self.soft() {
                let variance = column.sigma * column.sigma;
                p_ht += column.t * column.delta.transpose() * variance;
                s += column.delta * column.delta.transpose() * variance;
            }
            innovation = Factor::new(&s).ok_or(UpdateError::InnovationNotPositiveDefinite)?;
        }
        Ok(Softened { p_ht, innovation })
    }

    /// The hard columns, whitened by `factor` (C, lower), each block scaled to one.
    fn scaled(
        &self,
        factor: &SMatrix<f64, M, M>,
    ) -> Result<([Column<D, M>; MAX_COLUMNS], usize), UpdateError> {
        let mut scaled = self.columns;
        let mut count = 0;
        let mut rest = self.all();
        while let Some(first) = rest.first() {
            let length = rest.iter().take_while(|c| c.block == first.block).count();
            let (block, others) = rest.split_at(length);
            rest = others;
            let size = |part: &dyn Fn(&Column<D, M>) -> f64| {
                block
                    .iter()
                    .map(part)
                    .fold(0.0, |largest: f64, part| largest.max(part))
            };
            let in_delta = size(&|column| column.delta.norm());
            let jointly = in_delta.hypot(size(&|column| column.t.norm()));
            if first.sigma.is_finite() || jointly <= NO_SIZE {
                continue;
            }
            if in_delta <= RANK_TOLERANCE * jointly {
                return Err(UpdateError::UnsolvableConstraints);
            }
            let begin = count;
            for column in block {
                scaled[count] = *column;
                factor.solve_lower_triangular_mut(&mut scaled[count].delta);
                count += 1;
            }
            let whitened = &mut scaled[begin..count];
            let largest = whitened.iter().map(|c| c.delta.norm()).fold(0.0, f64::max);
            for column in whitened {
                column.delta /= largest;
                column.t /= largest;
            }
        }
        Ok((scaled, count))
    }

    fn basis(&self, factor: &SMatrix<f64, M, M>) -> Result<Basis<D, M>, UpdateError> {
        let (mut columns, count) = self.scaled(factor)?;
        let columns = &mut columns[..count];
        let largest_t = columns.iter().map(|c| c.t.norm()).fold(0.0, f64::max);
        let mut basis = Basis {
            q: SMatrix::zeros(),
            u: SMatrix::zeros(),
            rank: 0,
        };
        for done in 0..count {
            let longest = (done..count).max_by(|a, b| {
                columns[*a]
                    .delta
                    .norm()
                    .total_cmp(&columns[*b].delta.norm())
            });
            columns.swap(done, longest.unwrap_or(done));
            let length = columns[done].delta.norm();
            if length <= RANK_TOLERANCE || basis.rank == M {
                let unexplained = columns[done..].iter().map(|c| c.t.norm());
                let unexplained = unexplained.fold(0.0, f64::max);
                return if unexplained <= CONSISTENCY_TOLERANCE * largest_t {
                    Ok(basis)
                } else {
                    Err(UpdateError::UnsolvableConstraints)
                };
            }
            let (q, u) = (columns[done].delta / length, columns[done].t / length);
            basis.q.set_column(basis.rank, &q);
            basis.u.set_column(basis.rank, &u);
            basis.rank += 1;
            for column in &mut columns[done + 1..] {
                // Against all of the basis, not the newest alone, and twice, which is enough.
                for k in (0..basis.rank).chain(0..basis.rank) {
                    let share = basis.q.column(k).dot(&column.delta);
                    column.delta -= basis.q.column(k) * share;
                    column.t -= basis.u.column(k) * share;
                }
            }
        }
        Ok(basis)
    }

    /// Whether a gain exists, and how many dimensions of the measurement the constraints take.
    ///
    /// # Errors
    /// [`UpdateError::UnsolvableConstraints`].
    ///
    /// ```
    /// use inekf::filter::{Constraints, UpdateError};
    /// use inekf::model::Columns;
    /// use nalgebra::{Vector2, Vector3};
    ///
    /// let (along_x, no_motion) = (Columns::one(Vector2::x()), Columns::one(Vector3::zeros()));
    /// let mut constraints = Constraints::<3, 2>::default();
    /// constraints.push(&along_x, &no_motion, f64::INFINITY)?;
    /// constraints.push(&Columns::one(2.0 * Vector2::x()), &no_motion, f64::INFINITY)?;
    /// // The second says what the first says.
    /// assert_eq!(constraints.rank()?, 1);
    /// // Along x a gain cannot lead nowhere and somewhere.
    /// constraints.push(&along_x, &Columns::one(Vector3::y()), f64::INFINITY)?;
    /// assert_eq!(constraints.rank(), Err(UpdateError::UnsolvableConstraints));
    /// # Ok::<(), UpdateError>(())
    /// ```
    pub fn rank(&self) -> Result<usize, UpdateError> {
        Ok(self.basis(&SMatrix::identity())?.rank)
    }

    /// L, D x M.
    ///
    /// # Errors
    /// [`UpdateError::UnsolvableConstraints`], or that S with the soft constraints is not positive definite.
    ///
    /// ```
    /// # use inekf::filter::UpdateError;
    /// # use inekf::model::{PlanarFix, PointFix};
    /// # use nalgebra::Matrix2;
    /// use inekf::filter::{Belief, Constraints, Covariance, Left, Linearised};
    /// use inekf::lie::{LieGroup, SE2};
    /// use inekf::model::Columns;
    /// use nalgebra::{SVector, Vector2, Vector3};
    ///
    /// let p = Covariance::from_variances(&Vector3::new(0.01, 1.0, 1.0));
    /// let belief = Belief::<SE2, Left, 3>::new(SE2::identity(), p);
    /// # let fix = PlanarFix::new([PointFix {
    /// #     position_w: Vector2::new(1.0, 1.0),
    /// #     covariance_w: Matrix2::identity(),
    /// #     lever_arm_b: Vector2::zeros(),
    /// #     scale_error: 0.0,
    /// # }]);
    /// let noise = fix.noise_covariance();
    /// let linearised = Linearised::at(&belief, &fix, &belief.mean, &SVector::zeros(), &noise).expect("definite");
    /// let (along_x, no_motion) = (Columns::one(Vector2::x()), Columns::one(Vector3::zeros()));
    /// let mut constraints = Constraints::<3, 2>::default();
    /// // Soft: a variance more along x, P / (P + N + sigma^2).
    /// constraints.push(&along_x, &no_motion, 1.0)?;
    /// let gain = constraints.gain(&linearised)?;
    /// assert!((gain[(1, 0)] - 1.0 / 3.0).abs() < 1e-12 && (gain[(2, 1)] - 0.5).abs() < 1e-12);
    /// # Ok::<(), UpdateError>(())
    /// ```
    pub fn gain<G: LieGroup<D>>(
        &self,
        linearised: &Linearised<G, D, M>,
    ) -> Result<SMatrix<f64, D, M>, UpdateError> {
        let softened = self.softened(linearised)?;
        let factor = softened.innovation.l();
        let basis = self.basis(&factor)?;
        // C V^T = (P H^T)^T, then C^T L^T = (V + (U - V Q) Q^T)^T.
        let mut transposed = softened.p_ht.transpose();
        factor.solve_lower_triangular_mut(&mut transposed);
        let v = transposed.transpose();
        let mut gain = (v + (basis.u - v * basis.q) * basis.q.transpose()).transpose();
        factor.tr_solve_lower_triangular_mut(&mut gain);
        Ok(gain.transpose())
    }

    /// How surprising the part of the innovation is that the hard constraints leave.
    ///
    /// # Errors
    /// As [`gain`](Self::gain).
    ///
    /// ```
    /// # use inekf::filter::UpdateError;
    /// # use inekf::model::{PlanarFix, PointFix};
    /// # use nalgebra::Matrix2;
    /// use inekf::filter::{Belief, Constraints, Covariance, Left, Linearised};
    /// use inekf::lie::{LieGroup, SE2};
    /// use inekf::model::Columns;
    /// use nalgebra::{SVector, Vector2, Vector3};
    ///
    /// let p = Covariance::from_variances(&Vector3::new(0.01, 1.0, 1.0));
    /// let belief = Belief::<SE2, Left, 3>::new(SE2::identity(), p);
    /// # let fix = PlanarFix::new([PointFix {
    /// #     position_w: Vector2::new(1.0, 1.0),
    /// #     covariance_w: Matrix2::identity(),
    /// #     lever_arm_b: Vector2::zeros(),
    /// #     scale_error: 0.0,
    /// # }]);
    /// let noise = fix.noise_covariance();
    /// let linearised = Linearised::at(&belief, &fix, &belief.mean, &SVector::zeros(), &noise).expect("definite");
    /// let (along_x, no_motion) = (Columns::one(Vector2::x()), Columns::one(Vector3::zeros()));
    /// let mut constraints = Constraints::<3, 2>::default();
    /// // A metre off along both axes, of variance 2. Along x nothing can be said: what is left is that along y.
    /// constraints.push(&along_x, &no_motion, f64::INFINITY)?;
    /// let judgement = constraints.judge(&linearised)?;
    /// assert!((judgement.nis - 0.5).abs() < 1e-12 && judgement.degrees == 1);
    /// # Ok::<(), UpdateError>(())
    /// ```
    pub fn judge<G: LieGroup<D>>(
        &self,
        linearised: &Linearised<G, D, M>,
    ) -> Result<Judgement, UpdateError> {
        let softened = self.softened(linearised)?;
        let factor = softened.innovation.l();
        let basis = self.basis(&factor)?;
        let mut whitened = linearised.residual;
        factor.solve_lower_triangular_mut(&mut whitened);
        let left = whitened - basis.q * (basis.q.transpose() * whitened);
        Ok(Judgement {
            nis: left.norm_squared(),
            degrees: M - basis.rank,
        })
    }

    /// The covariance after a correction with `gain`: Joseph's form with what the soft constraints add,
    /// `sigma^2 (T - L Delta)(T - L Delta)^T`. Hard constraints add nothing: there `L Delta = T`.
    ///
    /// ```
    /// # use inekf::filter::UpdateError;
    /// # use inekf::model::{PlanarFix, PointFix};
    /// # use nalgebra::Matrix2;
    /// use inekf::filter::{Belief, Constraints, Covariance, Left, Linearised};
    /// use inekf::lie::{LieGroup, SE2};
    /// use inekf::model::Columns;
    /// use nalgebra::{SVector, Vector2, Vector3};
    ///
    /// let p = Covariance::from_variances(&Vector3::new(0.01, 1.0, 1.0));
    /// let belief = Belief::<SE2, Left, 3>::new(SE2::identity(), p);
    /// # let fix = PlanarFix::new([PointFix {
    /// #     position_w: Vector2::new(1.0, 1.0),
    /// #     covariance_w: Matrix2::identity(),
    /// #     lever_arm_b: Vector2::zeros(),
    /// #     scale_error: 0.0,
    /// # }]);
    /// let noise = fix.noise_covariance();
    /// let linearised = Linearised::at(&belief, &fix, &belief.mean, &SVector::zeros(), &noise).expect("definite");
    /// let (along_x, no_motion) = (Columns::one(Vector2::x()), Columns::one(Vector3::zeros()));
    /// let mut constraints = Constraints::<3, 2>::default();
    /// constraints.push(&along_x, &no_motion, f64::INFINITY)?;
    /// let gain = constraints.gain(&linearised)?;
    /// // Nothing is learnt along x, half along y.
    /// let after = constraints.covariance(&p, &linearised, &gain);
    /// assert!((after.matrix().diagonal() - Vector3::new(0.01, 1.0, 0.5)).norm() < 1e-12);
    /// # Ok::<(), UpdateError>(())
    /// ```
    pub fn covariance<G: LieGroup<D>>(
        &self,
        prior: &Covariance<D>,
        linearised: &Linearised<G, D, M>,
        gain: &SMatrix<f64, D, M>,
    ) -> Covariance<D> {
        self.soft()
            .fold(linearised.josephs(prior, gain), |covariance, column| {
                let left = (column.t - gain * column.delta) * column.sigma;
                covariance.plus(&(left * left.transpose()))
            })
    }
}
