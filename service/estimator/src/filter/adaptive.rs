//! One filter for any mismatch: interacting multiple models over the augmented state.
//!
//! Every mode j is a hypothesis on how the P mismatches e behave: absent, constant, drawn anew each step,
//! coming and going. Each runs a left-invariant filter on `G x R^P`; its weight follows the likelihood of the
//! innovations, and a Markov chain with the rates of [`Switching`] lets modes follow each other. A mode that
//! stays keeps its mismatches; a mode that is entered draws them from its own prior:
//!
//! ```text
//! mixing      c_j = (stay_j + p_jj) mu_j + sum_{i != j} p_ij mu_i
//!             belief_j <- merge (stay_j mu_j: belief_j;  p_ij mu_i: belief_i, mismatches redrawn from mode j)
//! motion      xi+ = F xi + T (e + white_j) + w,   e+ = e + walk_j
//! update      N_j = N + H_e diag(white_j^2) H_e^T,   mu_j = c_j N(z_j; 0, S_j) / sum
//! estimate    merge_j (mu_j, belief_j)
//! ```
//!
//! F, T and H are those of [`Unknowns`] at the mode's own estimate of the mismatches, so that the bank has no
//! models of its own: it is a way to run [`update`] several times. Merging is that of [`mixture`]; the modes
//! that serve every pattern are [`standard_modes`]. Measured in `docs/adaptive-mismatch.md`.

use nalgebra::{SMatrix, SVector};

use super::belief::Belief;
use super::covariance::Covariance;
use super::gate::Gate;
use super::propagate::moved;
use super::side::Left;
use super::update::{UpdateError, UpdateOptions, Verdict, update};
use crate::lie::LieGroup;
use crate::model::{Augmented, Observation, OdometryStep, RigidPose, Unknowns};

pub mod mixture;
pub mod modes;

use mixture::{Chart, Local, merged, moments};
pub use modes::{Expected, Mode, STANDARD_MODES, Switching, standard_modes};

/// A bank of S augmented filters on `G x R^P`, `D = B + P`, with B the dimension of G.
///
/// ```
/// use inekf::filter::{Adaptive, Belief, Covariance, Expected, Left, UpdateOptions, standard_modes};
/// use inekf::lie::{LieGroup, SE2};
/// use nalgebra::Vector3;
///
/// let p = Covariance::from_variances(&Vector3::new(0.01, 1.0, 1.0));
/// let prior = Belief::<SE2, Left, 3>::new(SE2::identity(), p);
/// let wheel = Expected { sigma: 0.03, burst_sigma: 0.2, of_motion: true };
/// let (modes, switching) = standard_modes(&[wheel], 0.1);
/// let bank = Adaptive::<SE2, 3, 1, 4, 9>::new(&prior, modes, switching, UpdateOptions::ITERATED);
/// // Nothing has been seen: the pose is the prior's, the weights are those of the start.
/// assert_eq!(bank.weights(), &switching.initial);
/// let estimate = bank.estimate();
/// assert!((estimate.covariance.matrix()[(1, 1)] - 1.0).abs() < 1e-9);
/// assert_eq!(estimate.mean.parameters[0], 0.0);
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Adaptive<G, const B: usize, const P: usize, const D: usize, const S: usize> {
    modes: [Mode<P>; S],
    switching: Switching<S>,
    options: UpdateOptions,
    beliefs: [Belief<Augmented<G, B, P, D>, Left, D>; S],
    weights: [f64; S],
    /// Time since the modes were last mixed, s.
    unmixed_s: f64,
    /// Whether a measurement came since the modes were last mixed.
    measured: bool,
}

/// What an observation did to a bank.
///
/// ```
/// # use inekf::model::{PlanarFix, PointFix, ProcessMismatch, Unknowns};
/// # use nalgebra::{Matrix2, Vector2};
/// use inekf::filter::{Adaptive, Belief, Covariance, Expected, Gate, Left, UpdateOptions, Verdict, standard_modes};
/// use inekf::lie::{LieGroup, SE2};
/// use nalgebra::Vector3;
///
/// let p = Covariance::from_variances(&Vector3::new(0.01, 1.0, 1.0));
/// let prior = Belief::<SE2, Left, 3>::new(SE2::identity(), p);
/// let wheel = Expected { sigma: 0.03, burst_sigma: 0.2, of_motion: true };
/// let (modes, switching) = standard_modes(&[wheel], 0.1);
/// # let unknowns = Unknowns::new::<2, 1>(&[ProcessMismatch::OdometryScale], &[]).expect("one");
/// # let fix_at = |x_m: f64| unknowns.observe(PlanarFix::new([PointFix {
/// #     position_w: Vector2::new(x_m, 0.0),
/// #     covariance_w: Matrix2::identity(),
/// #     lever_arm_b: Vector2::zeros(),
/// #     scale_error: 0.0,
/// # }]));
/// let mut bank = Adaptive::<SE2, 3, 1, 4, 9>::new(&prior, modes, switching, UpdateOptions::PLAIN);
///
/// // Two metres off where the variance of that is 1 + 1, in every mode.
/// let weighed = bank.update_through(&fix_at(2.0), &Gate::OPEN)?;
/// assert!(weighed.verdict == Verdict::Accepted && (weighed.nis - 2.0).abs() < 1e-9);
/// # Ok::<(), inekf::filter::UpdateError>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Weighed {
    /// Whether it was used.
    pub verdict: Verdict,
    /// The normalised innovation squared of the mode that foretold it best.
    pub nis: f64,
}

/// An observation with the noise that a mode adds to it.
struct WithNoise<'a, O, const M: usize> {
    inner: &'a O,
    noise: SMatrix<f64, M, M>,
}

impl<G, O, const D: usize, const M: usize> Observation<G, D, M> for WithNoise<'_, O, M>
where
    G: LieGroup<D>,
    O: Observation<G, D, M>,
{
    fn residual(&self, chi: &G) -> SVector<f64, M> {
        self.inner.residual(chi)
    }

    fn left_jacobian(&self, chi: &G) -> SMatrix<f64, M, D> {
        self.inner.left_jacobian(chi)
    }

    fn noise(&self) -> SMatrix<f64, M, M> {
        self.noise
    }
}

impl<G, const B: usize, const P: usize, const D: usize, const S: usize> Adaptive<G, B, P, D, S>
where
    G: LieGroup<B>,
{
    /// The bank whose modes all start from `prior`, each with mismatches from its own prior. The gate of
    /// `options` is the bank's, see [`update`](Self::update).
    ///
    /// ```
    /// use inekf::filter::{Adaptive, Belief, Covariance, Expected, Left, UpdateOptions, standard_modes};
    /// use inekf::lie::{LieGroup, SE2};
    /// use nalgebra::Vector3;
    ///
    /// let p = Covariance::from_variances(&Vector3::new(0.01, 1.0, 1.0));
    /// let prior = Belief::<SE2, Left, 3>::new(SE2::identity(), p);
    /// let wheel = Expected { sigma: 0.03, burst_sigma: 0.2, of_motion: true };
    /// let (modes, switching) = standard_modes(&[wheel], 0.1);
    /// let bank = Adaptive::<SE2, 3, 1, 4, 9>::new(&prior, modes, switching, UpdateOptions::PLAIN);
    /// // The scale is known as the modes expect it, each by its weight.
    /// let variances = modes.iter().map(|mode| mode.entry_sigma[0].powi(2));
    /// let expected: f64 = variances.zip(&switching.initial).map(|(variance, weight)| variance * weight).sum();
    /// assert!((bank.estimate().covariance.matrix()[(3, 3)] - expected).abs() < 1e-12);
    /// ```
    pub fn new(
        prior: &Belief<G, Left, B>,
        modes: [Mode<P>; S],
        switching: Switching<S>,
        options: UpdateOptions,
    ) -> Self {
        let chart = Chart {
            reference: Augmented::new(prior.mean, SVector::zeros()),
        };
        let mut bare = Local {
            xi: SVector::zeros(),
            covariance: SMatrix::<f64, D, D>::zeros(),
        };
        add_block(prior.covariance.matrix(), &mut bare.covariance);
        Self {
            modes,
            switching,
            options,
            beliefs: modes.map(|mode| {
                let mut entered = bare;
                redraw(&mut entered, &chart, &mode);
                chart.leave(&entered)
            }),
            weights: switching.initial,
            unmixed_s: 0.0,
            measured: false,
        }
    }

    /// The bank whose modes all start from `belief` in pose and mismatches, with these `weights`: what is known of a bank
    /// from its [`estimate`](Self::estimate) and [`weights`](Self::weights), which are then those of the new one. How the
    /// modes differed is forgotten; measurements tell them apart again.
    ///
    /// The weights are not negative, and not all zero; they are made to add up to one.
    ///
    /// ```
    /// use inekf::filter::{Adaptive, Belief, Covariance, Expected, Left, UpdateOptions, standard_modes};
    /// use inekf::lie::{LieGroup, SE2};
    /// use nalgebra::Vector3;
    ///
    /// let p = Covariance::from_variances(&Vector3::new(0.01, 1.0, 1.0));
    /// let prior = Belief::<SE2, Left, 3>::new(SE2::identity(), p);
    /// let wheel = Expected { sigma: 0.03, burst_sigma: 0.2, of_motion: true };
    /// let (modes, switching) = standard_modes(&[wheel], 0.1);
    /// let bank = Adaptive::<SE2, 3, 1, 4, 9>::new(&prior, modes, switching, UpdateOptions::PLAIN);
    /// let known = bank.estimate();
    /// let resumed = Adaptive::resumed(&known, [2.0; 9], modes, switching, UpdateOptions::PLAIN);
    /// // The weights are made to add up to one; what was known is known.
    /// assert!(resumed.weights().iter().all(|weight| (weight - 1.0 / 9.0).abs() < 1e-15));
    /// assert!((resumed.estimate().covariance.matrix() - known.covariance.matrix()).norm() < 1e-12);
    /// ```
    pub fn resumed(
        belief: &Belief<Augmented<G, B, P, D>, Left, D>,
        weights: [f64; S],
        modes: [Mode<P>; S],
        switching: Switching<S>,
        options: UpdateOptions,
    ) -> Self {
        let total: f64 = weights.iter().sum();
        Self {
            modes,
            switching,
            options,
            beliefs: [*belief; S],
            weights: weights.map(|weight| weight / total),
            unmixed_s: 0.0,
            measured: false,
        }
    }

    /// Moves every mode by one step of odometry, seen with its own mismatches; `q` is the covariance of the
    /// step's noise, B x B, of the left-invariant error.
    ///
    /// ```
    /// use inekf::filter::{Adaptive, Belief, Covariance, Expected, Left, UpdateOptions, standard_modes};
    /// use inekf::lie::{LieGroup, SE2};
    /// use inekf::model::{OdometryStep, ProcessMismatch, Unknowns};
    /// use nalgebra::{Matrix3, Vector3};
    ///
    /// let p = Covariance::from_variances(&Vector3::new(0.01, 1.0, 1.0));
    /// let prior = Belief::<SE2, Left, 3>::new(SE2::identity(), p);
    /// let wheel = Expected { sigma: 0.03, burst_sigma: 0.2, of_motion: true };
    /// let (modes, switching) = standard_modes(&[wheel], 0.1);
    /// let unknowns = Unknowns::new::<2, 1>(&[ProcessMismatch::OdometryScale], &[]).expect("one");
    /// let mut bank = Adaptive::<SE2, 3, 1, 4, 9>::new(&prior, modes, switching, UpdateOptions::PLAIN);
    /// let ahead = OdometryStep::new(&Vector3::new(0.0, 10.0, 0.0), 1.0);
    /// bank.advance(&unknowns, &ahead, &Matrix3::zeros());
    /// // Ten metres as it is seen; what is not known of the wheel joins what was not known of the place.
    /// let estimate = bank.estimate();
    /// assert!((estimate.mean.pose.position.x - 10.0).abs() < 1e-9);
    /// assert!(estimate.covariance.matrix()[(1, 1)] > 1.1);
    /// ```
    pub fn advance<const N: usize>(
        &mut self,
        unknowns: &Unknowns,
        step: &OdometryStep<G>,
        q: &SMatrix<f64, B, B>,
    ) where
        G: RigidPose<B, N>,
    {
        // Between two measurements nothing tells the modes apart: they are mixed once.
        if self.measured {
            self.mix();
            self.measured = false;
        }
        for (belief, mode) in self.beliefs.iter_mut().zip(&self.modes) {
            let actual = unknowns.step(step, &belief.mean);
            let mean = Augmented::new(actual.step.apply(&belief.mean.pose), belief.mean.parameters);
            let mut noise = mode.noise_of_motion(&actual.left_jacobian, step.dt_s);
            add_block(q, &mut noise);
            *belief = moved(belief, mean, &actual.left_jacobian, &noise);
        }
        self.unmixed_s += step.dt_s;
    }

    /// Corrects every mode with `observation` and weighs it by how well it foretold it.
    ///
    /// The observation is refused if it is beyond the gate of every mode: one that some mode can explain is
    /// evidence for that mode, not an outlier.
    ///
    /// # Errors
    /// [`UpdateError`] if a mode could not be corrected; the bank is then unchanged, as it is when the
    /// observation is gated.
    ///
    /// ```
    /// # use inekf::model::{PlanarFix, PointFix, ProcessMismatch, Unknowns};
    /// # use nalgebra::{Matrix2, Vector2};
    /// use inekf::filter::{Adaptive, Belief, Covariance, Expected, Left, UpdateOptions, Verdict, standard_modes};
    /// use inekf::lie::{LieGroup, SE2};
    /// use nalgebra::Vector3;
    ///
    /// let p = Covariance::from_variances(&Vector3::new(0.01, 1.0, 1.0));
    /// let prior = Belief::<SE2, Left, 3>::new(SE2::identity(), p);
    /// let wheel = Expected { sigma: 0.03, burst_sigma: 0.2, of_motion: true };
    /// let (modes, switching) = standard_modes(&[wheel], 0.1);
    /// # let unknowns = Unknowns::new::<2, 1>(&[ProcessMismatch::OdometryScale], &[]).expect("one");
    /// # let fix_at = |x_m: f64| unknowns.observe(PlanarFix::new([PointFix {
    /// #     position_w: Vector2::new(x_m, 0.0),
    /// #     covariance_w: Matrix2::identity(),
    /// #     lever_arm_b: Vector2::zeros(),
    /// #     scale_error: 0.0,
    /// # }]));
    /// let mut bank = Adaptive::<SE2, 3, 1, 4, 9>::new(&prior, modes, switching, UpdateOptions::PLAIN);
    ///
    /// // A fix as good as what was known: half way.
    /// assert_eq!(bank.update(&fix_at(0.5))?, Verdict::Accepted);
    /// assert!((bank.estimate().mean.pose.position.x - 0.25).abs() < 1e-9);
    /// # Ok::<(), inekf::filter::UpdateError>(())
    /// ```
    pub fn update<O, const M: usize>(&mut self, observation: &O) -> Result<Verdict, UpdateError>
    where
        O: Observation<Augmented<G, B, P, D>, D, M>,
    {
        let gate = self.options.gate;
        Ok(self.update_through(observation, &gate)?.verdict)
    }

    /// The same through another gate than the bank's own.
    ///
    /// # Errors
    /// As [`update`](Self::update).
    ///
    /// ```
    /// # use inekf::model::{PlanarFix, PointFix, ProcessMismatch, Unknowns};
    /// # use nalgebra::{Matrix2, Vector2};
    /// use inekf::filter::{Adaptive, Belief, Covariance, Expected, Gate, Left, UpdateOptions, Verdict, standard_modes};
    /// use inekf::lie::{LieGroup, SE2};
    /// use nalgebra::Vector3;
    ///
    /// let p = Covariance::from_variances(&Vector3::new(0.01, 1.0, 1.0));
    /// let prior = Belief::<SE2, Left, 3>::new(SE2::identity(), p);
    /// let wheel = Expected { sigma: 0.03, burst_sigma: 0.2, of_motion: true };
    /// let (modes, switching) = standard_modes(&[wheel], 0.1);
    /// # let unknowns = Unknowns::new::<2, 1>(&[ProcessMismatch::OdometryScale], &[]).expect("one");
    /// # let fix_at = |x_m: f64| unknowns.observe(PlanarFix::new([PointFix {
    /// #     position_w: Vector2::new(x_m, 0.0),
    /// #     covariance_w: Matrix2::identity(),
    /// #     lever_arm_b: Vector2::zeros(),
    /// #     scale_error: 0.0,
    /// # }]));
    /// let mut bank = Adaptive::<SE2, 3, 1, 4, 9>::new(&prior, modes, switching, UpdateOptions::PLAIN);
    ///
    /// // A hundred metres off, which no mode explains.
    /// let before = bank;
    /// let weighed = bank.update_through(&fix_at(100.0), &Gate::of_probability(0.99))?;
    /// assert_eq!((weighed.verdict, bank), (Verdict::Gated, before));
    /// # Ok::<(), inekf::filter::UpdateError>(())
    /// ```
    pub fn update_through<O, const M: usize>(
        &mut self,
        observation: &O,
        gate: &Gate,
    ) -> Result<Weighed, UpdateError>
    where
        O: Observation<Augmented<G, B, P, D>, D, M>,
    {
        let ungated = UpdateOptions {
            gate: Gate::OPEN,
            ..self.options
        };
        let mut beliefs = self.beliefs;
        let mut logs = [f64::NEG_INFINITY; S];
        let mut nis = f64::INFINITY;
        for (j, belief) in beliefs.iter_mut().enumerate() {
            let h = observation.left_jacobian(&belief.mean);
            let noisy = WithNoise {
                inner: observation,
                noise: observation.noise() + self.modes[j].noise_of_measurement(&h),
            };
            let correction = update(belief, &noisy, &ungated)?;
            nis = nis.min(correction.nis);
            logs[j] = self.weights[j].ln() - 0.5 * (correction.nis + correction.log_determinant);
        }
        if !gate.admits(nis, M) {
            return Ok(Weighed {
                verdict: Verdict::Gated,
                nis,
            });
        }
        let best = logs.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        let likelihoods = logs.map(|log| (log - best).exp());
        let total: f64 = likelihoods.iter().sum();
        self.weights = likelihoods.map(|likelihood| likelihood / total);
        self.beliefs = beliefs;
        self.measured = true;
        Ok(Weighed {
            verdict: Verdict::Accepted,
            nis,
        })
    }

    /// The same bank with the covariance of every mode as `f` makes it.
    ///
    /// ```
    /// use inekf::filter::{Adaptive, Belief, Covariance, Expected, Left, UpdateOptions, standard_modes};
    /// use inekf::lie::{LieGroup, SE2};
    /// use nalgebra::Vector3;
    ///
    /// let p = Covariance::from_variances(&Vector3::new(0.01, 1.0, 1.0));
    /// let prior = Belief::<SE2, Left, 3>::new(SE2::identity(), p);
    /// let wheel = Expected { sigma: 0.03, burst_sigma: 0.2, of_motion: true };
    /// let (modes, switching) = standard_modes(&[wheel], 0.1);
    /// let bank = Adaptive::<SE2, 3, 1, 4, 9>::new(&prior, modes, switching, UpdateOptions::PLAIN);
    /// // All standard deviations twice as large.
    /// let wider = bank.with_covariances(|p| p.scaled(4.0));
    /// assert_eq!(wider.weights(), bank.weights());
    /// assert!((wider.estimate().covariance.matrix()[(1, 1)] - 4.0).abs() < 1e-9);
    /// ```
    #[must_use]
    pub fn with_covariances(&self, f: impl Fn(&Covariance<D>) -> Covariance<D>) -> Self {
        let beliefs = self.beliefs.each_ref();
        Self {
            beliefs: beliefs.map(|belief| Belief::new(belief.mean, f(&belief.covariance))),
            ..*self
        }
    }

    /// The weights of the modes, which add up to one.
    ///
    /// ```
    /// # use inekf::model::{PlanarFix, PointFix};
    /// # use nalgebra::{Matrix2, Vector2};
    /// use inekf::filter::{Adaptive, Belief, Covariance, Expected, Left, UpdateOptions, standard_modes};
    /// use inekf::lie::{LieGroup, SE2};
    /// use inekf::model::{OdometryStep, ProcessMismatch, Unknowns};
    /// use nalgebra::{Matrix3, Vector3};
    ///
    /// let p = Covariance::from_variances(&Vector3::new(0.01, 1.0, 1.0));
    /// let prior = Belief::<SE2, Left, 3>::new(SE2::identity(), p);
    /// let wheel = Expected { sigma: 0.03, burst_sigma: 0.2, of_motion: true };
    /// let (modes, switching) = standard_modes(&[wheel], 0.1);
    /// let unknowns = Unknowns::new::<2, 1>(&[ProcessMismatch::OdometryScale], &[]).expect("one");
    /// # let fix_at = |x_m: f64| unknowns.observe(PlanarFix::new([PointFix {
    /// #     position_w: Vector2::new(x_m, 0.0),
    /// #     covariance_w: Matrix2::identity(),
    /// #     lever_arm_b: Vector2::zeros(),
    /// #     scale_error: 0.0,
    /// # }]));
    /// let mut bank = Adaptive::<SE2, 3, 1, 4, 9>::new(&prior, modes, switching, UpdateOptions::PLAIN);
    /// let ahead = OdometryStep::new(&Vector3::new(0.0, 10.0, 0.0), 1.0);
    /// bank.advance(&unknowns, &ahead, &Matrix3::zeros());
    /// bank.update(&fix_at(20.0))?;
    /// // Twice as far as the wheel says: "no mismatch at all" is refuted.
    /// assert!(bank.weights()[0] < 1e-3);
    /// assert!((bank.weights().iter().sum::<f64>() - 1.0).abs() < 1e-12);
    /// # Ok::<(), inekf::filter::UpdateError>(())
    /// ```
    pub fn weights(&self) -> &[f64; S] {
        &self.weights
    }

    /// The estimate of pose and mismatches: the one Gaussian with the moments of the bank.
    ///
    /// ```
    /// # use inekf::model::{PlanarFix, PointFix};
    /// # use nalgebra::{Matrix2, Vector2};
    /// use inekf::filter::{Adaptive, Belief, Covariance, Expected, Left, UpdateOptions, standard_modes};
    /// use inekf::lie::{LieGroup, SE2};
    /// use inekf::model::{OdometryStep, ProcessMismatch, Unknowns};
    /// use nalgebra::{Matrix3, Vector3};
    ///
    /// let p = Covariance::from_variances(&Vector3::new(0.01, 1.0, 1.0));
    /// let prior = Belief::<SE2, Left, 3>::new(SE2::identity(), p);
    /// let wheel = Expected { sigma: 0.03, burst_sigma: 0.2, of_motion: true };
    /// let (modes, switching) = standard_modes(&[wheel], 0.1);
    /// let unknowns = Unknowns::new::<2, 1>(&[ProcessMismatch::OdometryScale], &[]).expect("one");
    /// # let fix_at = |x_m: f64| unknowns.observe(PlanarFix::new([PointFix {
    /// #     position_w: Vector2::new(x_m, 0.0),
    /// #     covariance_w: Matrix2::identity(),
    /// #     lever_arm_b: Vector2::zeros(),
    /// #     scale_error: 0.0,
    /// # }]));
    /// let mut bank = Adaptive::<SE2, 3, 1, 4, 9>::new(&prior, modes, switching, UpdateOptions::PLAIN);
    /// let ahead = OdometryStep::new(&Vector3::new(0.0, 10.0, 0.0), 1.0);
    /// bank.advance(&unknowns, &ahead, &Matrix3::zeros());
    /// bank.update(&fix_at(15.0))?;
    /// // Farther than the wheel says: it is taken to show too little.
    /// assert!(bank.estimate().mean.parameters[0] > 0.05);
    /// # Ok::<(), inekf::filter::UpdateError>(())
    /// ```
    pub fn estimate(&self) -> Belief<Augmented<G, B, P, D>, Left, D> {
        merged(&self.weights, &self.beliefs).unwrap_or(self.beliefs[0])
    }

    /// Lets modes follow each other over the time since this was last done.
    fn mix(&mut self) {
        let dt_s = self.unmixed_s;
        self.unmixed_s = 0.0;
        let chart = Chart::at_heaviest(&self.weights, &self.beliefs);
        let locals = self.beliefs.each_ref().map(|belief| chart.enter(belief));
        let mut weights = [0.0; S];
        for j in 0..S {
            let stay = self.weights[j] * self.switching.staying(j, dt_s);
            let come: [f64; S] =
                core::array::from_fn(|i| self.weights[i] * self.switching.probability(i, j, dt_s));
            let coming: f64 = come.iter().sum();
            weights[j] = stay + coming;
            let Some(mut entered) = moments(come.into_iter().zip(&locals)) else {
                continue;
            };
            redraw(&mut entered, &chart, &self.modes[j]);
            let parts = [(stay, &locals[j]), (coming, &entered)];
            if let Some(mixed) = moments(parts.into_iter()) {
                self.beliefs[j] = chart.leave(&mixed);
            }
        }
        self.weights = weights;
    }
}

/// Adds `block` to the upper left corner of `whole`.
fn add_block<const B: usize, const D: usize>(
    block: &SMatrix<f64, B, B>,
    whole: &mut SMatrix<f64, D, D>,
) {
    let mut corner = whole.fixed_view_mut::<B, B>(0, 0);
    corner += block;
}

/// Draws the mismatches of `local` anew from the prior of `mode`, independent of the pose.
fn redraw<G, const B: usize, const P: usize, const D: usize>(
    local: &mut Local<D>,
    chart: &Chart<Augmented<G, B, P, D>>,
    mode: &Mode<P>,
) {
    for k in 0..P {
        for other in 0..D {
            local.covariance[(other, B + k)] = 0.0;
            local.covariance[(B + k, other)] = 0.0;
        }
        local.covariance[(B + k, B + k)] = mode.entry_sigma[k] * mode.entry_sigma[k];
        // A mismatch of zero, in coordinates relative to the reference.
        local.xi[B + k] = -chart.reference.parameters[k];
    }
}
