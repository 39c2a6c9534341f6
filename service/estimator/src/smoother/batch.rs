//! Smoothing of a whole trajectory by Gauss-Newton on a Lie group: \[IS\] (12)-(14), \[PAR\] (32)-(34).
//!
//! Each iteration linearises the cost at the trajectory, solves the linear problem exactly, and moves every state
//! by its retraction. The parametrisation is the type S: [`Left`](crate::filter::Left) is invariant smoothing,
//! [`Right`](crate::filter::Right) the same with errors in the world,
//! [`Gtsam`](crate::filter::Gtsam) and [`Forster`](crate::filter::Forster) are \[IS\] (23) and (22),
//! [`Additive`](crate::filter::Additive) the conventional smoother. Where residuals and retractions are the same but
//! for a change of coordinates, so is the trajectory of every iteration (\[PAR\], Proposition 3): of Left and Right,
//! and of Gtsam and Forster.
//!
//! With group-affine motions without noise, invariant smoothing keeps `chi_{i+1} = f_i(chi_i)` at every iteration,
//! and stays in what the prior can reach (\[IS\], Theorem 1); the others do not.

use core::marker::PhantomData;

use nalgebra::SVector;

use super::chain::{Chain, Motion};
use super::cost::{Cost, check_length, cost, is_acceptable};
use super::linearise::{self, Jacobians};
use super::solver::{SmootherError, Solver};
use crate::filter::{Covariance, Side};
use crate::lie::LieGroup;
use crate::model::Observation;

/// How a trajectory is smoothed.
///
/// ```
/// use inekf::smoother::{BatchOptions, Jacobians};
///
/// let papers = BatchOptions { jacobians: Jacobians::Frozen, step_control: false, ..BatchOptions::default() };
/// assert_eq!(papers.iterations, BatchOptions::default().iterations);
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BatchOptions {
    /// Most Gauss-Newton iterations.
    pub iterations: usize,
    /// Iterating stops when no component of any state moves by more than this, rad, m/s and m alike.
    pub tolerance: f64,
    /// Which derivatives are used.
    pub jacobians: Jacobians,
    /// Whether a step that raises the cost is shortened, by halves.
    pub step_control: bool,
}

impl Default for BatchOptions {
    /// At most 50 exact steps, down to 1e-9, none of which raises the cost.
    fn default() -> Self {
        Self {
            iterations: 50,
            tolerance: 1e-9,
            jacobians: Jacobians::Exact,
            step_control: true,
        }
    }
}

/// One Gauss-Newton iteration.
///
/// ```
/// # use inekf::model::{PlanarFix, PointFix};
/// # use inekf::smoother::SmootherError;
/// # use nalgebra::{Matrix2, Vector2};
/// use inekf::filter::{Belief, Covariance, Left};
/// use inekf::lie::{LieGroup, SE2};
/// use inekf::model::OdometryStep;
/// use inekf::smoother::{Batch, BatchOptions, Chain};
/// use nalgebra::{Matrix3, Vector3};
///
/// # let seen = |x_m: f64| PlanarFix::new([PointFix {
/// #     position_w: Vector2::new(x_m, 0.0),
/// #     covariance_w: Matrix2::identity(),
/// #     lever_arm_b: Vector2::zeros(),
/// #     scale_error: 0.0,
/// # }]);
/// let ahead = OdometryStep::<SE2>::new(&Vector3::new(0.0, 1.0, 0.0), 1.0);
/// let p = Covariance::from_variances(&Vector3::new(0.01, 1.0, 1.0));
/// let prior = Belief::<SE2, Left, 3>::new(SE2::identity(), p);
/// let mut chain = Chain::with_capacity(prior, 2, 1);
/// chain.advance(ahead, Matrix3::identity() * 0.01);
/// chain.observe(seen(2.0));
/// let mut batch = Batch::<SE2, Left, 3, 2>::with_capacity(2, 1);
/// batch.dead_reckon(&chain);
/// let step = batch.iterate(&chain, &BatchOptions::default())?;
/// // A metre farther than expected, half of it believed; the whole step lowered the cost.
/// assert!((step.largest - 0.5).abs() < 0.01 && step.share == 1.0);
/// # Ok::<(), SmootherError>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Step {
    /// The largest component by which a state moved, rad, m/s and m alike.
    pub largest: f64,
    /// The share of the full step that was taken; 0 where no share of it lowers the cost.
    pub share: f64,
}

/// What smoothing did.
///
/// ```
/// # use inekf::model::{PlanarFix, PointFix};
/// # use inekf::smoother::SmootherError;
/// # use nalgebra::{Matrix2, Vector2};
/// use inekf::filter::{Belief, Covariance, Left};
/// use inekf::lie::{LieGroup, SE2};
/// use inekf::model::OdometryStep;
/// use inekf::smoother::{Batch, BatchOptions, Chain};
/// use nalgebra::{Matrix3, Vector3};
///
/// # let seen = |x_m: f64| PlanarFix::new([PointFix {
/// #     position_w: Vector2::new(x_m, 0.0),
/// #     covariance_w: Matrix2::identity(),
/// #     lever_arm_b: Vector2::zeros(),
/// #     scale_error: 0.0,
/// # }]);
/// let ahead = OdometryStep::<SE2>::new(&Vector3::new(0.0, 1.0, 0.0), 1.0);
/// let p = Covariance::from_variances(&Vector3::new(0.01, 1.0, 1.0));
/// let prior = Belief::<SE2, Left, 3>::new(SE2::identity(), p);
/// let mut chain = Chain::with_capacity(prior, 2, 1);
/// chain.advance(ahead, Matrix3::identity() * 0.01);
/// chain.observe(seen(2.0));
/// let mut batch = Batch::<SE2, Left, 3, 2>::with_capacity(2, 1);
/// batch.dead_reckon(&chain);
/// let options = BatchOptions { iterations: 1, ..BatchOptions::default() };
/// // One iteration: whether it was the last is not known. Then it is.
/// assert!(!batch.smooth(&chain, &options)?.converged);
/// assert!(batch.smooth(&chain, &options)?.converged);
/// # Ok::<(), SmootherError>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Smoothed {
    /// Iterations done.
    pub iterations: usize,
    /// Whether the last step was below the tolerance.
    pub converged: bool,
}

/// How many shares of a step are tried, each half of the one before.
const MAX_TRIALS: usize = 11;

/// A trajectory, and the room to smooth it in.
///
/// G is the group, S the parametrisation, D the dimension of the group, M that of an observation.
///
/// ```
/// use inekf::filter::{Belief, Covariance, Left};
/// use inekf::lie::{LieGroup, SE2};
/// use inekf::model::{OdometryStep, PlanarFix, PointFix};
/// use inekf::smoother::{Batch, BatchOptions, Chain};
/// use nalgebra::{Matrix2, Matrix3, Vector2, Vector3};
///
/// let seen = |x_m| PlanarFix::new([PointFix {
///     position_w: Vector2::new(x_m, 0.0),
///     covariance_w: Matrix2::identity(),
///     lever_arm_b: Vector2::zeros(),
///     scale_error: 0.0,
/// }]);
/// // A metre ahead without any noise; seen where it began, and where it ended two metres too far.
/// let p = Covariance::from_variances(&Vector3::new(0.0, 1e6, 1e6));
/// let mut chain = Chain::with_capacity(Belief::<SE2, Left, 3>::new(SE2::identity(), p), 2, 2);
/// chain.observe(seen(0.0));
/// chain.advance(OdometryStep::new(&Vector3::new(0.0, 1.0, 0.0), 1.0), Matrix3::zeros());
/// chain.observe(seen(3.0));
/// let mut batch = Batch::<SE2, Left, 3, 2>::with_capacity(2, 2);
/// batch.dead_reckon(&chain);
/// assert!(batch.smooth(&chain, &BatchOptions::default())?.converged);
/// // The difference is shared, and the motion holds exactly, although its covariance has no inverse.
/// let [first, last] = batch.states() else { panic!("two states") };
/// assert!((first.position.x - 1.0).abs() < 1e-3);
/// assert!((last.position.x - first.position.x - 1.0).abs() < 1e-9);
/// # Ok::<(), inekf::smoother::SmootherError>(())
/// ```
#[derive(Clone, Debug)]
pub struct Batch<G, S, const D: usize, const M: usize> {
    states: Vec<G>,
    trial: Vec<G>,
    solver: Solver<D, M>,
    parametrisation: PhantomData<S>,
}

impl<G: LieGroup<D>, S: Side, const D: usize, const M: usize> Batch<G, S, D, M> {
    /// An empty trajectory, with room for this many states and observations. More grow the room, which allocates.
    ///
    /// ```
    /// use inekf::filter::Left;
    /// use inekf::lie::SE2;
    /// use inekf::smoother::Batch;
    ///
    /// assert!(Batch::<SE2, Left, 3, 2>::with_capacity(100, 10).states().is_empty());
    /// ```
    pub fn with_capacity(states: usize, observations: usize) -> Self {
        Self {
            states: Vec::with_capacity(states),
            trial: Vec::with_capacity(states),
            solver: Solver::with_capacity(states, observations),
            parametrisation: PhantomData,
        }
    }

    /// The trajectory, oldest state first.
    ///
    /// ```
    /// # use inekf::model::{PlanarFix, PointFix};
    /// # use inekf::smoother::SmootherError;
    /// # use nalgebra::{Matrix2, Vector2};
    /// use inekf::filter::{Belief, Covariance, Left};
    /// use inekf::lie::{LieGroup, SE2};
    /// use inekf::model::OdometryStep;
    /// use inekf::smoother::{Batch, BatchOptions, Chain};
    /// use nalgebra::{Matrix3, Vector3};
    ///
    /// # let seen = |x_m: f64| PlanarFix::new([PointFix {
    /// #     position_w: Vector2::new(x_m, 0.0),
    /// #     covariance_w: Matrix2::identity(),
    /// #     lever_arm_b: Vector2::zeros(),
    /// #     scale_error: 0.0,
    /// # }]);
    /// let ahead = OdometryStep::<SE2>::new(&Vector3::new(0.0, 1.0, 0.0), 1.0);
    /// let p = Covariance::from_variances(&Vector3::new(0.01, 1.0, 1.0));
    /// let prior = Belief::<SE2, Left, 3>::new(SE2::identity(), p);
    /// let mut chain = Chain::with_capacity(prior, 2, 1);
    /// chain.advance(ahead, Matrix3::identity() * 0.01);
    /// chain.observe(seen(2.0));
    /// let mut batch = Batch::<SE2, Left, 3, 2>::with_capacity(2, 1);
    /// batch.dead_reckon(&chain);
    /// batch.smooth(&chain, &BatchOptions::default())?;
    /// let [first, last] = batch.states() else { panic!("two states") };
    /// // A fix of the last tells of the first as well: the odometry between them is good.
    /// assert!(first.position.x > 0.4 && last.position.x > 1.4);
    /// # Ok::<(), SmootherError>(())
    /// ```
    pub fn states(&self) -> &[G] {
        &self.states
    }

    /// Takes `states` as the trajectory.
    ///
    /// ```
    /// # use inekf::model::{PlanarFix, PointFix};
    /// # use nalgebra::{Matrix2, Vector2};
    /// use inekf::filter::{Belief, Covariance, Left};
    /// use inekf::lie::{LieGroup, SE2};
    /// use inekf::model::OdometryStep;
    /// use inekf::smoother::{Batch, BatchOptions, Chain, SmootherError};
    /// use nalgebra::{Matrix3, Vector3};
    ///
    /// # let seen = |x_m: f64| PlanarFix::new([PointFix {
    /// #     position_w: Vector2::new(x_m, 0.0),
    /// #     covariance_w: Matrix2::identity(),
    /// #     lever_arm_b: Vector2::zeros(),
    /// #     scale_error: 0.0,
    /// # }]);
    /// let ahead = OdometryStep::<SE2>::new(&Vector3::new(0.0, 1.0, 0.0), 1.0);
    /// let p = Covariance::from_variances(&Vector3::new(0.01, 1.0, 1.0));
    /// let prior = Belief::<SE2, Left, 3>::new(SE2::identity(), p);
    /// let mut chain = Chain::with_capacity(prior, 2, 1);
    /// chain.advance(ahead, Matrix3::identity() * 0.01);
    /// chain.observe(seen(2.0));
    /// let mut batch = Batch::<SE2, Left, 3, 2>::with_capacity(2, 1);
    /// // The chain has two states.
    /// batch.set_states(&[SE2::identity()]);
    /// let refused = batch.smooth(&chain, &BatchOptions::default());
    /// assert_eq!(refused, Err(SmootherError::WrongLength { states: 1, expected: 2 }));
    /// ```
    pub fn set_states(&mut self, states: &[G]) {
        self.states.clear();
        self.states.extend_from_slice(states);
    }

    /// Covariance of the left-invariant error of the newest state given all observations, where the last iteration
    /// linearised.
    ///
    /// ```
    /// # use inekf::model::{PlanarFix, PointFix};
    /// # use inekf::smoother::SmootherError;
    /// # use nalgebra::{Matrix2, Vector2};
    /// use inekf::filter::{Belief, Covariance, Left};
    /// use inekf::lie::{LieGroup, SE2};
    /// use inekf::model::OdometryStep;
    /// use inekf::smoother::{Batch, BatchOptions, Chain};
    /// use nalgebra::{Matrix3, Vector3};
    ///
    /// # let seen = |x_m: f64| PlanarFix::new([PointFix {
    /// #     position_w: Vector2::new(x_m, 0.0),
    /// #     covariance_w: Matrix2::identity(),
    /// #     lever_arm_b: Vector2::zeros(),
    /// #     scale_error: 0.0,
    /// # }]);
    /// let ahead = OdometryStep::<SE2>::new(&Vector3::new(0.0, 1.0, 0.0), 1.0);
    /// let p = Covariance::from_variances(&Vector3::new(0.01, 1.0, 1.0));
    /// let prior = Belief::<SE2, Left, 3>::new(SE2::identity(), p);
    /// let mut chain = Chain::with_capacity(prior, 2, 1);
    /// chain.advance(ahead, Matrix3::identity() * 0.01);
    /// chain.observe(seen(2.0));
    /// let mut batch = Batch::<SE2, Left, 3, 2>::with_capacity(2, 1);
    /// batch.dead_reckon(&chain);
    /// batch.smooth(&chain, &BatchOptions::default())?;
    /// // 1 of the prior and 0.01 of the motion, beside 1 of the fix.
    /// let variance = batch.newest_covariance().matrix()[(1, 1)];
    /// assert!((variance - 1.01 / 2.01).abs() < 1e-9);
    /// # Ok::<(), SmootherError>(())
    /// ```
    pub fn newest_covariance(&self) -> &Covariance<D> {
        &self.solver.newest().covariance
    }

    /// Takes the prior's mean, moved without noise, as the trajectory.
    ///
    /// ```
    /// # use inekf::model::{PlanarFix, PointFix};
    /// # use nalgebra::{Matrix2, Vector2};
    /// use inekf::filter::{Belief, Covariance, Left};
    /// use inekf::lie::{LieGroup, SE2};
    /// use inekf::model::OdometryStep;
    /// use inekf::smoother::{Batch, Chain};
    /// use nalgebra::{Matrix3, Vector3};
    ///
    /// # let seen = |x_m: f64| PlanarFix::new([PointFix {
    /// #     position_w: Vector2::new(x_m, 0.0),
    /// #     covariance_w: Matrix2::identity(),
    /// #     lever_arm_b: Vector2::zeros(),
    /// #     scale_error: 0.0,
    /// # }]);
    /// let ahead = OdometryStep::<SE2>::new(&Vector3::new(0.0, 1.0, 0.0), 1.0);
    /// let p = Covariance::from_variances(&Vector3::new(0.01, 1.0, 1.0));
    /// let prior = Belief::<SE2, Left, 3>::new(SE2::identity(), p);
    /// let mut chain = Chain::with_capacity(prior, 2, 1);
    /// chain.advance(ahead, Matrix3::identity() * 0.01);
    /// chain.observe(seen(2.0));
    /// let mut batch = Batch::<SE2, Left, 3, 2>::with_capacity(2, 1);
    /// batch.dead_reckon(&chain);
    /// // The observations have no say.
    /// assert_eq!(batch.states(), [SE2::identity(), ahead.apply(&SE2::identity())]);
    /// ```
    pub fn dead_reckon<P, T, O>(&mut self, chain: &Chain<G, P, T, O, D>)
    where
        T: Motion<G, D>,
    {
        self.states.clear();
        let mut chi = chain.prior().mean;
        self.states.push(chi);
        for link in chain.links() {
            chi = link.motion.apply(&chi);
            self.states.push(chi);
        }
    }

    /// Iterates from the trajectory as it is.
    ///
    /// # Errors
    /// [`SmootherError`]; the trajectory is then that of the last iteration that succeeded.
    ///
    /// ```
    /// # use inekf::model::{PlanarFix, PointFix};
    /// # use inekf::smoother::SmootherError;
    /// # use nalgebra::{Matrix2, Vector2};
    /// use inekf::filter::{Belief, Covariance, Left};
    /// use inekf::lie::{LieGroup, SE2};
    /// use inekf::model::OdometryStep;
    /// use inekf::smoother::{Batch, BatchOptions, Chain};
    /// use nalgebra::{Matrix3, Vector3};
    ///
    /// # let seen = |x_m: f64| PlanarFix::new([PointFix {
    /// #     position_w: Vector2::new(x_m, 0.0),
    /// #     covariance_w: Matrix2::identity(),
    /// #     lever_arm_b: Vector2::zeros(),
    /// #     scale_error: 0.0,
    /// # }]);
    /// let ahead = OdometryStep::<SE2>::new(&Vector3::new(0.0, 1.0, 0.0), 1.0);
    /// let p = Covariance::from_variances(&Vector3::new(0.01, 1.0, 1.0));
    /// let prior = Belief::<SE2, Left, 3>::new(SE2::identity(), p);
    /// let mut chain = Chain::with_capacity(prior, 2, 1);
    /// chain.advance(ahead, Matrix3::identity() * 0.01);
    /// chain.observe(seen(2.0));
    /// let mut batch = Batch::<SE2, Left, 3, 2>::with_capacity(2, 1);
    /// batch.dead_reckon(&chain);
    /// let before = batch.cost(&chain)?;
    /// assert!(batch.smooth(&chain, &BatchOptions::default())?.converged);
    /// assert!(batch.cost(&chain)?.square < before.square);
    /// // Between what the odometry says, a metre, and the fix: weighed by their variances.
    /// assert!((batch.states()[1].position.x - (1.0 + 1.01 / 2.01)).abs() < 1e-9);
    /// # Ok::<(), SmootherError>(())
    /// ```
    pub fn smooth<P, T, O>(
        &mut self,
        chain: &Chain<G, P, T, O, D>,
        options: &BatchOptions,
    ) -> Result<Smoothed, SmootherError>
    where
        P: Side,
        T: Motion<G, D>,
        O: Observation<G, D, M>,
    {
        let mut cost = self.judged(chain, options)?;
        for iterations in 1..=options.iterations {
            let step;
            (step, cost) = self.step_from(chain, options, cost)?;
            if step.largest <= options.tolerance {
                return Ok(Smoothed {
                    iterations,
                    converged: true,
                });
            }
        }
        Ok(Smoothed {
            iterations: options.iterations,
            converged: false,
        })
    }

    /// One Gauss-Newton iteration.
    ///
    /// With step control, a step is shortened by halves until the cost does not rise. Where the trajectory deviates
    /// from what noise can explain, the step that mends that is taken whole.
    ///
    /// # Errors
    /// [`SmootherError`]; the trajectory is then unchanged.
    ///
    /// ```
    /// # use inekf::model::{PlanarFix, PointFix};
    /// # use inekf::smoother::SmootherError;
    /// # use nalgebra::{Matrix2, Vector2};
    /// use inekf::filter::{Belief, Covariance, Left};
    /// use inekf::lie::{LieGroup, SE2};
    /// use inekf::model::OdometryStep;
    /// use inekf::smoother::{Batch, BatchOptions, Chain};
    /// use nalgebra::{Matrix3, Vector3};
    ///
    /// # let seen = |x_m: f64| PlanarFix::new([PointFix {
    /// #     position_w: Vector2::new(x_m, 0.0),
    /// #     covariance_w: Matrix2::identity(),
    /// #     lever_arm_b: Vector2::zeros(),
    /// #     scale_error: 0.0,
    /// # }]);
    /// let ahead = OdometryStep::<SE2>::new(&Vector3::new(0.0, 1.0, 0.0), 1.0);
    /// let p = Covariance::from_variances(&Vector3::new(0.01, 1.0, 1.0));
    /// let prior = Belief::<SE2, Left, 3>::new(SE2::identity(), p);
    /// let mut chain = Chain::with_capacity(prior, 2, 1);
    /// chain.advance(ahead, Matrix3::identity() * 0.01);
    /// chain.observe(seen(2.0));
    /// let mut batch = Batch::<SE2, Left, 3, 2>::with_capacity(2, 1);
    /// batch.dead_reckon(&chain);
    /// let options = BatchOptions::default();
    /// batch.iterate(&chain, &options)?;
    /// // Straight on the problem is linear: the second iteration has nothing left to do.
    /// assert!(batch.iterate(&chain, &options)?.largest < 1e-9);
    /// # Ok::<(), SmootherError>(())
    /// ```
    pub fn iterate<P, T, O>(
        &mut self,
        chain: &Chain<G, P, T, O, D>,
        options: &BatchOptions,
    ) -> Result<Step, SmootherError>
    where
        P: Side,
        T: Motion<G, D>,
        O: Observation<G, D, M>,
    {
        let before = self.judged(chain, options)?;
        Ok(self.step_from(chain, options, before)?.0)
    }

    /// The cost of the trajectory, where `options` ask for step control.
    fn judged<P, T, O>(
        &self,
        chain: &Chain<G, P, T, O, D>,
        options: &BatchOptions,
    ) -> Result<Option<Cost>, SmootherError>
    where
        P: Side,
        T: Motion<G, D>,
        O: Observation<G, D, M>,
    {
        if options.step_control {
            self.cost(chain).map(Some)
        } else {
            Ok(None)
        }
    }

    /// One iteration from a trajectory of the cost `before`; gives the cost after it too. Without a cost the step is
    /// not judged.
    fn step_from<P, T, O>(
        &mut self,
        chain: &Chain<G, P, T, O, D>,
        options: &BatchOptions,
        before: Option<Cost>,
    ) -> Result<(Step, Option<Cost>), SmootherError>
    where
        P: Side,
        T: Motion<G, D>,
        O: Observation<G, D, M>,
    {
        self.linearise(chain, options.jacobians)?;
        let steps = self.solver.solve();
        if !steps.iter().all(|xi| xi.iter().all(|x| x.is_finite())) {
            return Err(SmootherError::NotFinite);
        }
        let largest = steps
            .iter()
            .fold(0.0, |largest: f64, xi| largest.max(xi.amax()));
        let mut share = 1.0;
        for _ in 0..MAX_TRIALS {
            self.trial.clear();
            self.trial.extend(
                self.states
                    .iter()
                    .zip(steps)
                    .map(|(chi, xi)| moved::<G, S, D>(chi, &(xi * share))),
            );
            let after = match before {
                Some(_) => Some(cost::<G, S, P, T, O, D, M>(chain, &self.trial)?),
                None => None,
            };
            if is_acceptable(before, after) {
                core::mem::swap(&mut self.states, &mut self.trial);
                let step = Step {
                    largest: share * largest,
                    share,
                };
                return Ok((step, after));
            }
            share *= 0.5;
        }
        let none = Step {
            largest: 0.0,
            share: 0.0,
        };
        Ok((none, before))
    }

    /// The cost of the trajectory.
    ///
    /// # Errors
    /// [`SmootherError`].
    ///
    /// ```
    /// # use inekf::model::{PlanarFix, PointFix};
    /// # use inekf::smoother::SmootherError;
    /// # use nalgebra::{Matrix2, Vector2};
    /// use inekf::filter::{Belief, Covariance, Left};
    /// use inekf::lie::{LieGroup, SE2};
    /// use inekf::model::OdometryStep;
    /// use inekf::smoother::{Batch, Chain};
    /// use nalgebra::{Matrix3, Vector3};
    ///
    /// # let seen = |x_m: f64| PlanarFix::new([PointFix {
    /// #     position_w: Vector2::new(x_m, 0.0),
    /// #     covariance_w: Matrix2::identity(),
    /// #     lever_arm_b: Vector2::zeros(),
    /// #     scale_error: 0.0,
    /// # }]);
    /// let ahead = OdometryStep::<SE2>::new(&Vector3::new(0.0, 1.0, 0.0), 1.0);
    /// let p = Covariance::from_variances(&Vector3::new(0.01, 1.0, 1.0));
    /// let prior = Belief::<SE2, Left, 3>::new(SE2::identity(), p);
    /// let mut chain = Chain::with_capacity(prior, 2, 1);
    /// chain.advance(ahead, Matrix3::identity() * 0.01);
    /// chain.observe(seen(2.0));
    /// let mut batch = Batch::<SE2, Left, 3, 2>::with_capacity(2, 1);
    /// batch.dead_reckon(&chain);
    /// // As the prior and the odometry say, a metre off a fix that is known to a metre.
    /// assert!((batch.cost(&chain)?.square - 1.0).abs() < 1e-12);
    /// # Ok::<(), SmootherError>(())
    /// ```
    pub fn cost<P, T, O>(&self, chain: &Chain<G, P, T, O, D>) -> Result<Cost, SmootherError>
    where
        P: Side,
        T: Motion<G, D>,
        O: Observation<G, D, M>,
    {
        cost::<G, S, P, T, O, D, M>(chain, &self.states)
    }

    /// Gives the solver the problem around the trajectory.
    fn linearise<P, T, O>(
        &mut self,
        chain: &Chain<G, P, T, O, D>,
        jacobians: Jacobians,
    ) -> Result<(), SmootherError>
    where
        P: Side,
        T: Motion<G, D>,
        O: Observation<G, D, M>,
    {
        check_length(&self.states, chain)?;
        let mut sightings = chain.sightings().iter().peekable();
        self.solver
            .start(&linearise::prior(chain.prior(), &self.states[0], jacobians));
        for (i, chi) in self.states.iter().enumerate() {
            if i > 0 {
                let (link, from) = (&chain.links()[i - 1], &self.states[i - 1]);
                self.solver
                    .advance(&linearise::motion::<G, S, T, D>(link, from, chi, jacobians));
            }
            while let Some(sighting) = sightings.next_if(|sighting| sighting.state == i) {
                self.solver
                    .measure(&linearise::measurement(&sighting.observation, chi))?;
            }
        }
        Ok(())
    }
}

/// `chi` after the left-invariant step `xi`, by the retraction of S.
fn moved<G: LieGroup<D>, S: Side, const D: usize>(chi: &G, xi: &SVector<f64, D>) -> G {
    if S::IS_LEFT {
        S::retract(chi, xi)
    } else {
        S::retract(chi, &(S::from_left(chi) * xi))
    }
}
