//! What a smoother is given: a chain of states of one group, a prior on the first, motions between neighbours and
//! observations of single states.
//!
//! ```text
//! chi_0 ~ prior      chi_{i+1} = f_i(chi_i) exp(w_i),  w_i ~ N(0, Q_i)      y_k = h_k(chi_{i_k}) + v_k
//! ```
//!
//! Q is the covariance of the left-invariant (body) error, in the group's tangent order; Q and the covariance of
//! the prior may be singular or zero. \[IS\] (5), with noise.

use nalgebra::SMatrix;

use crate::filter::Belief;
use crate::lie::{LieGroup, SE23};
use crate::model::{Automorphism, GroupAffineStep, ImuStep, OdometryStep};

/// A motion from one state to the next.
///
/// ```
/// use inekf::lie::{LieGroup, SE2};
/// use inekf::model::OdometryStep;
/// use inekf::smoother::Motion;
/// use nalgebra::Vector3;
///
/// let step = OdometryStep::<SE2>::new(&Vector3::new(0.1, 1.0, 0.0), 1.0);
/// let (chi, xi) = (SE2::exp(&Vector3::new(0.5, 3.0, 1.0)), Vector3::new(0.2, -0.1, 0.3));
/// // f(chi exp(xi)) = f(chi) exp(F xi), for an error of any size.
/// let moved = Motion::apply(&step, &chi.compose(&SE2::exp(&xi)));
/// let f = Motion::left_jacobian(&step, &chi);
/// assert!((Motion::apply(&step, &chi).between(&moved).log() - f * xi).norm() < 1e-12);
/// ```
pub trait Motion<G: LieGroup<D>, const D: usize> {
    /// `f(chi)`.
    ///
    /// ```
    /// # use inekf::model::{PlanarFix, PointFix};
    /// # use nalgebra::{Matrix2, Vector2};
    /// use inekf::filter::{Belief, Covariance, Left};
    /// use inekf::lie::{LieGroup, SE2};
    /// use inekf::model::OdometryStep;
    /// use inekf::smoother::{Chain, Motion};
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
    ///
    /// // An odometry step from where the body is.
    /// let chi = SE2::exp(&Vector3::new(0.5, 3.0, 1.0));
    /// assert_eq!(Motion::apply(&ahead, &chi), chi * ahead.kappa);
    /// ```
    fn apply(&self, chi: &G) -> G;

    /// F, D x D, with `f(chi exp(xi)) = f(chi) exp(F xi)`: exact, and the same at every `chi`, where f is
    /// group-affine (\[IS\] (7)); to first order otherwise.
    ///
    /// ```
    /// # use inekf::model::{PlanarFix, PointFix};
    /// # use nalgebra::{Matrix2, Vector2};
    /// use inekf::filter::{Belief, Covariance, Left};
    /// use inekf::lie::{LieGroup, SE2};
    /// use inekf::model::OdometryStep;
    /// use inekf::smoother::{Chain, Motion};
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
    ///
    /// // Group-affine: the same everywhere.
    /// let chi = SE2::exp(&Vector3::new(0.5, 3.0, 1.0));
    /// assert_eq!(Motion::left_jacobian(&ahead, &chi), Motion::left_jacobian(&ahead, &SE2::identity()));
    /// ```
    fn left_jacobian(&self, chi: &G) -> SMatrix<f64, D, D>;
}

impl<G: LieGroup<D>, A: Automorphism<G, D>, const D: usize> Motion<G, D>
    for GroupAffineStep<G, A, D>
{
    fn apply(&self, chi: &G) -> G {
        Self::apply(self, chi)
    }

    fn left_jacobian(&self, _chi: &G) -> SMatrix<f64, D, D> {
        Self::left_jacobian(self)
    }
}

impl<G: LieGroup<D>, const D: usize> Motion<G, D> for OdometryStep<G> {
    fn apply(&self, chi: &G) -> G {
        Self::apply(self, chi)
    }

    fn left_jacobian(&self, _chi: &G) -> SMatrix<f64, D, D> {
        Self::left_jacobian(self)
    }
}

impl Motion<SE23, 9> for ImuStep {
    fn apply(&self, chi: &SE23) -> SE23 {
        self.step.apply(chi)
    }

    fn left_jacobian(&self, _chi: &SE23) -> SMatrix<f64, 9, 9> {
        self.step.left_jacobian()
    }
}

/// A motion with its noise.
///
/// ```
/// # use inekf::model::{PlanarFix, PointFix};
/// # use nalgebra::{Matrix2, Vector2};
/// use inekf::filter::{Belief, Covariance, Left};
/// use inekf::lie::{LieGroup, SE2};
/// use inekf::model::OdometryStep;
/// use inekf::smoother::Chain;
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
/// let link = chain.links()[0];
/// assert_eq!((link.motion, link.noise[(0, 0)]), (ahead, 0.01));
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Link<T, const D: usize> {
    /// f.
    pub motion: T,
    /// Q, D x D, symmetric, of the left-invariant error at the end of the motion.
    pub noise: SMatrix<f64, D, D>,
}

/// The observation of one state.
///
/// ```
/// # use inekf::model::{PlanarFix, PointFix};
/// # use nalgebra::{Matrix2, Vector2};
/// use inekf::filter::{Belief, Covariance, Left};
/// use inekf::lie::{LieGroup, SE2};
/// use inekf::model::OdometryStep;
/// use inekf::smoother::Chain;
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
/// // Of the second state, behind the motion.
/// assert_eq!(chain.sightings()[0].state, 1);
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sighting<O> {
    /// Index of the state, 0 for the first.
    pub state: usize,
    /// What was observed.
    pub observation: O,
}

/// A chain that grows at its end.
///
/// G is the group, P the side of the prior's error, T the motion, O the observation.
///
/// ```
/// use inekf::filter::{Belief, Covariance, Left};
/// use inekf::lie::{LieGroup, SE2};
/// use inekf::model::{OdometryStep, PlanarFix};
/// use inekf::smoother::Chain;
/// use nalgebra::{Matrix3, Vector3};
///
/// let p = Covariance::from_variances(&Vector3::repeat(1.0));
/// let mut chain: Chain<SE2, Left, OdometryStep<SE2>, PlanarFix, 3> =
///     Chain::with_capacity(Belief::new(SE2::identity(), p), 3, 0);
/// chain.advance(OdometryStep::new(&Vector3::new(0.0, 1.0, 0.0), 1.0), Matrix3::identity());
/// chain.advance(OdometryStep::new(&Vector3::new(0.1, 1.0, 0.0), 1.0), Matrix3::identity());
/// // A state more than there are motions.
/// assert_eq!((chain.links().len(), chain.states()), (2, 3));
/// ```
#[derive(Clone, Debug)]
pub struct Chain<G, P, T, O, const D: usize> {
    prior: Belief<G, P, D>,
    links: Vec<Link<T, D>>,
    sightings: Vec<Sighting<O>>,
}

impl<G, P, T, O, const D: usize> Chain<G, P, T, O, D> {
    /// A chain of one state, with room for this many states and observations. More grow the room, which allocates.
    ///
    /// ```
    /// # use inekf::model::{PlanarFix, PointFix};
    /// # use nalgebra::{Matrix2, Vector2};
    /// use inekf::filter::{Belief, Covariance, Left};
    /// use inekf::lie::{LieGroup, SE2};
    /// use inekf::model::OdometryStep;
    /// use inekf::smoother::Chain;
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
    /// // One state, and one for each motion.
    /// assert_eq!(chain.states(), 2);
    /// ```
    pub fn with_capacity(prior: Belief<G, P, D>, states: usize, observations: usize) -> Self {
        Self {
            prior,
            links: Vec::with_capacity(states),
            sightings: Vec::with_capacity(observations),
        }
    }

    /// Adds a state at the end: `chi_{n+1} = f(chi_n) exp(w)`, w of covariance `noise` (D x D, left-invariant).
    ///
    /// ```
    /// # use inekf::model::{PlanarFix, PointFix};
    /// # use nalgebra::{Matrix2, Vector2};
    /// use inekf::filter::{Belief, Covariance, Left};
    /// use inekf::lie::{LieGroup, SE2};
    /// use inekf::model::OdometryStep;
    /// use inekf::smoother::Chain;
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
    /// // Without noise: then it holds exactly.
    /// chain.advance(ahead, Matrix3::zeros());
    /// assert_eq!(chain.states(), 3);
    /// ```
    pub fn advance(&mut self, motion: T, noise: SMatrix<f64, D, D>) {
        self.links.push(Link { motion, noise });
    }

    /// Adds an observation of the newest state.
    ///
    /// ```
    /// # use inekf::model::{PlanarFix, PointFix};
    /// # use nalgebra::{Matrix2, Vector2};
    /// use inekf::filter::{Belief, Covariance, Left};
    /// use inekf::lie::{LieGroup, SE2};
    /// use inekf::model::OdometryStep;
    /// use inekf::smoother::Chain;
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
    /// // Several of one state are allowed.
    /// chain.observe(seen(2.5));
    /// let states: Vec<usize> = chain.sightings().iter().map(|sighting| sighting.state).collect();
    /// assert_eq!(states, [1, 1]);
    /// ```
    pub fn observe(&mut self, observation: O) {
        self.sightings.push(Sighting {
            state: self.links.len(),
            observation,
        });
    }

    /// The belief in the first state.
    ///
    /// ```
    /// # use inekf::model::{PlanarFix, PointFix};
    /// # use nalgebra::{Matrix2, Vector2};
    /// use inekf::filter::{Belief, Covariance, Left};
    /// use inekf::lie::{LieGroup, SE2};
    /// use inekf::model::OdometryStep;
    /// use inekf::smoother::Chain;
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
    /// assert_eq!(chain.prior(), &prior);
    /// ```
    pub fn prior(&self) -> &Belief<G, P, D> {
        &self.prior
    }

    /// The motions, link i from state i to state i + 1.
    ///
    /// ```
    /// # use inekf::model::{PlanarFix, PointFix};
    /// # use nalgebra::{Matrix2, Vector2};
    /// use inekf::filter::{Belief, Covariance, Left};
    /// use inekf::lie::{LieGroup, SE2};
    /// use inekf::model::OdometryStep;
    /// use inekf::smoother::Chain;
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
    /// assert_eq!(chain.links().len(), chain.states() - 1);
    /// ```
    pub fn links(&self) -> &[Link<T, D>] {
        &self.links
    }

    /// The observations, in the order of their states.
    ///
    /// ```
    /// # use inekf::model::{PlanarFix, PointFix};
    /// # use nalgebra::{Matrix2, Vector2};
    /// use inekf::filter::{Belief, Covariance, Left};
    /// use inekf::lie::{LieGroup, SE2};
    /// use inekf::model::OdometryStep;
    /// use inekf::smoother::Chain;
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
    /// assert_eq!(chain.sightings()[0].observation, seen(2.0));
    /// ```
    pub fn sightings(&self) -> &[Sighting<O>] {
        &self.sightings
    }

    /// How many states there are; one at least.
    ///
    /// ```
    /// # use inekf::model::{PlanarFix, PointFix};
    /// # use nalgebra::{Matrix2, Vector2};
    /// use inekf::filter::{Belief, Covariance, Left};
    /// use inekf::lie::{LieGroup, SE2};
    /// use inekf::model::OdometryStep;
    /// use inekf::smoother::Chain;
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
    /// chain.advance(ahead, Matrix3::identity());
    /// assert_eq!(chain.states(), 3);
    /// ```
    pub fn states(&self) -> usize {
        self.links.len() + 1
    }
}
