//! The one update core: an iterated, gated Kalman update on a Lie group.
//!
//! Gauss-Newton on `xi^T P^-1 xi + z(chi)^T N^-1 z(chi)`, `chi = retract(chi_hat, xi)`, with the
//! prior frozen at `chi_hat` (\[PAR\], Corollary 1). At the iterate `xi_i` the observation is
//! linearised as `H_i = H(chi_i) J(xi_i)`, J the right (left error) or left (right error) Jacobian
//! of the group, and
//!
//! ```text
//! xi_{i+1} = P H_i^T (H_i P H_i^T + N)^-1 (z_i + H_i xi_i)
//! ```
//!
//! Only the innovation covariance is inverted, so P may be singular. A step that would raise the
//! cost is shortened; if no share of it lowers the cost, the iteration is at its end. After it the
//! covariance is carried to the new estimate by J(xi) (\[PAR\], Proposition 2): without that, a
//! precise fix on a wrong heading breaks the filter.
//! `iterations = 1` with [`Transport::None`] is the plain filter of the papers.

use core::fmt;

use nalgebra::SVector;

use super::belief::Belief;
use super::factor::Factor;
use super::gain::{GainRule, Iterate, Judgement, Kalman};
use super::gate::{Gate, MAX_DEGREES};
use super::linearised::Linearised;
use super::side::Side;
use crate::lie::LieGroup;
use crate::model::Observation;

/// What happens to the covariance when the estimate moves.
///
/// ```
/// use inekf::filter::{Transport, UpdateOptions};
///
/// // The papers' plain filter leaves it; this library's default carries it.
/// assert_eq!(UpdateOptions::PLAIN.transport, Transport::None);
/// assert_ne!(UpdateOptions::ITERATED.transport, UpdateOptions::PLAIN.transport);
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Transport {
    /// Carried to the new linearisation point by the Jacobian of the correction.
    Jacobian,
    /// Left as it is, as in the papers' plain filters.
    None,
}

/// How an update is done.
///
/// ```
/// use inekf::filter::{Gate, UpdateOptions};
///
/// let options = UpdateOptions { gate: Gate::of_probability(0.99), ..UpdateOptions::ITERATED };
/// assert!(options.iterations > UpdateOptions::PLAIN.iterations);
/// assert_eq!(UpdateOptions::PLAIN.iterations, 1);
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct UpdateOptions {
    /// Most Gauss-Newton iterations; 1 is the plain Kalman update.
    pub iterations: usize,
    /// Iterating stops when no component of the step exceeds this many of its own prior standard
    /// deviations.
    pub tolerance: f64,
    /// What happens to the covariance.
    pub transport: Transport,
    /// What innovation is refused, by the degrees of freedom that the rule leaves it.
    pub gate: Gate,
}

impl UpdateOptions {
    /// The plain filter of the papers: one pass, no transport, no gate.
    pub const PLAIN: Self = Self {
        iterations: 1,
        tolerance: 0.0,
        transport: Transport::None,
        gate: Gate::OPEN,
    };

    /// The default of this library: iterated, with transport.
    pub const ITERATED: Self = Self {
        iterations: 10,
        tolerance: 1e-6,
        transport: Transport::Jacobian,
        gate: Gate::OPEN,
    };
}

/// Whether an observation was used.
///
/// ```
/// use inekf::filter::{Belief, Covariance, Gate, Left, UpdateOptions, Verdict, update};
/// use inekf::lie::{LieGroup, SE23};
/// use inekf::model::VelocityObservation;
/// use nalgebra::{Matrix3, SVector, Vector3};
///
/// let mut belief =
///     Belief::<SE23, Left, 9>::new(SE23::identity(), Covariance::from_variances(&SVector::repeat(0.01)));
/// let before = belief;
/// // 50 m/s too fast, where 0.1 m/s were sure: refused, and nothing is changed.
/// let wrong = VelocityObservation { velocity_w: Vector3::new(50.0, 0.0, 0.0), covariance_w: Matrix3::identity() };
/// let options = UpdateOptions { gate: Gate::of_probability(0.999), ..UpdateOptions::ITERATED };
/// assert_eq!(update(&mut belief, &wrong, &options)?.verdict, Verdict::Gated);
/// assert_eq!(belief, before);
/// # Ok::<(), inekf::filter::UpdateError>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Verdict {
    /// The belief was corrected.
    Accepted,
    /// The innovation was beyond the gate; the belief is unchanged.
    Gated,
}

/// What an update did.
///
/// ```
/// use inekf::filter::{Belief, Covariance, Left, UpdateOptions, update};
/// use inekf::lie::{LieGroup, SE23};
/// use inekf::model::VelocityObservation;
/// use nalgebra::{Matrix3, SVector, Vector3};
///
/// let mut belief =
///     Belief::<SE23, Left, 9>::new(SE23::identity(), Covariance::from_variances(&SVector::repeat(1.0)));
/// let fix = VelocityObservation { velocity_w: Vector3::new(2.0, 0.0, 0.0), covariance_w: Matrix3::identity() };
/// let correction = update(&mut belief, &fix, &UpdateOptions::PLAIN)?;
/// // S = P + N = 2 on each axis: z^T S^-1 z = 4 / 2; half of the innovation is taken over.
/// assert!((correction.nis - 2.0).abs() < 1e-12 && correction.degrees == 3);
/// assert!((correction.log_determinant - 8_f64.ln()).abs() < 1e-12);
/// assert!((correction.xi[3] - 1.0).abs() < 1e-12);
/// # Ok::<(), inekf::filter::UpdateError>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Correction<const D: usize> {
    /// Whether the observation was used.
    pub verdict: Verdict,
    /// Normalised innovation squared, `z^T S^-1 z` at the prior (of what hard constraints leave of z);
    /// chi-square with `degrees` degrees of freedom where the filter is consistent.
    pub nis: f64,
    /// Degrees of freedom of the innovation: M, less what hard constraints take.
    pub degrees: usize,
    /// `ln det S` at the prior: with `nis`, the likelihood of the innovation up to a constant.
    pub log_determinant: f64,
    /// The correction in the error of the belief's side; zero if gated.
    pub xi: SVector<f64, D>,
    /// Gauss-Newton iterations done.
    pub iterations: usize,
}

/// Why an update could not be computed; the belief is unchanged.
///
/// ```
/// use inekf::filter::{Belief, Covariance, Left, UpdateOptions, update};
/// use inekf::lie::{LieGroup, SE23};
/// use inekf::model::VelocityObservation;
/// use nalgebra::{Matrix3, SVector, Vector3};
///
/// let mut belief =
///     Belief::<SE23, Left, 9>::new(SE23::identity(), Covariance::from_variances(&SVector::repeat(1.0)));
/// let before = belief;
/// // A noise that is none: the update says so, and leaves the belief as it was.
/// let broken = VelocityObservation { velocity_w: Vector3::zeros(), covariance_w: Matrix3::identity() * -2.0 };
/// assert!(update(&mut belief, &broken, &UpdateOptions::PLAIN).is_err());
/// assert_eq!(belief, before);
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum UpdateError {
    /// The innovation covariance is not positive definite: a noise that is not, or a broken P.
    InnovationNotPositiveDefinite,
    /// The result is not finite.
    NotFinite,
    /// No gain satisfies the hard constraints.
    UnsolvableConstraints,
    /// More mismatches are declared than a set of constraints holds.
    TooManyConstraints,
    /// A mismatch names a source that is not there.
    NoSuchSource {
        /// Index that was named.
        source: usize,
        /// How many sources there are.
        sources: usize,
    },
    /// The H-infinity filter does not exist for this gamma.
    InfeasibleGamma {
        /// gamma must be below this, the inverse of the largest variance after the update.
        bound: f64,
    },
}

impl fmt::Display for UpdateError {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str(match self {
            Self::InnovationNotPositiveDefinite => {
                "the innovation covariance is not positive definite: check the measurement's \
                 covariance"
            }
            Self::NotFinite => "the corrected state is not finite: check the measurement",
            Self::UnsolvableConstraints => {
                "no gain satisfies the declared mismatches: the measurement has not enough independent \
                 outputs for them; declare fewer, add a position source, or give some a sigma"
            }
            Self::TooManyConstraints => {
                "more mismatches are declared than an update can hold: declare fewer"
            }
            Self::NoSuchSource { source, sources } => {
                return write!(
                    formatter,
                    "a mismatch names position source {source}, and there are {sources}: count from 0"
                );
            }
            Self::InfeasibleGamma { bound } => {
                return write!(
                    formatter,
                    "gamma is infeasible for the H-infinity filter: it must be below {bound}, the inverse \
                     of the largest variance after this update"
                );
            }
        })
    }
}

impl core::error::Error for UpdateError {}

impl<const D: usize> Iterate<D> {
    /// The point at `fraction` of the way to `other`.
    fn towards(&self, other: &Self, fraction: f64) -> Self {
        if fraction == 1.0 {
            return *other;
        }
        Self {
            xi: self.xi * (1.0 - fraction) + other.xi * fraction,
            eta: self.eta * (1.0 - fraction) + other.eta * fraction,
        }
    }
}

/// How much larger a cost may come out by rounding alone. Without it the iteration would end where the cost
/// is flat to rounding, a hundred-millionth of a standard deviation from the minimum.
const COST_ROUNDING: f64 = 16.0 * f64::EPSILON;

/// How much larger a cost may come out without being told apart, in the units of chi-square: a step of a
/// millionth of a standard deviation. Far from the origin a residual is rounded by more than its own last digit.
const FLAT_COST: f64 = 1e-12;

/// How many shares of a Gauss-Newton step are tried, each half of the one before.
const MAX_TRIALS: usize = 11;

/// Corrects `belief` with `observation`, by the Kalman gain.
///
/// # Errors
/// [`UpdateError`]; the belief is then unchanged, as it is when the observation is gated.
///
/// ```
/// use inekf::filter::{Belief, Covariance, Left, UpdateOptions, update};
/// use inekf::lie::{LieGroup, SE2};
/// use inekf::model::{PlanarFix, PointFix};
/// use nalgebra::{Matrix2, Vector2, Vector3};
///
/// let p = Covariance::from_variances(&Vector3::new(0.01, 4.0, 4.0));
/// let mut belief = Belief::<SE2, Left, 3>::new(SE2::identity(), p);
/// let fix = PlanarFix::new([PointFix {
///     position_w: Vector2::new(1.0, 0.0),
///     covariance_w: Matrix2::identity() * 4.0,
///     lever_arm_b: Vector2::zeros(),
///     scale_error: 0.0,
/// }]);
/// update(&mut belief, &fix, &UpdateOptions::ITERATED)?;
/// // As good as what was known: half way.
/// assert!((belief.mean.position - Vector2::new(0.5, 0.0)).norm() < 1e-9);
/// assert!((belief.covariance.matrix()[(1, 1)] - 2.0).abs() < 1e-9);
/// # Ok::<(), inekf::filter::UpdateError>(())
/// ```
pub fn update<G, S, O, const D: usize, const M: usize>(
    belief: &mut Belief<G, S, D>,
    observation: &O,
    options: &UpdateOptions,
) -> Result<Correction<D>, UpdateError>
where
    G: LieGroup<D>,
    S: Side,
    O: Observation<G, D, M>,
{
    update_with(belief, observation, &Kalman, options)
}

/// Corrects `belief` with `observation`, by the gain of `rule`.
///
/// # Errors
/// [`UpdateError`]; the belief is then unchanged, as it is when the observation is gated.
///
/// ```
/// use inekf::filter::{Belief, Covariance, Kalman, Left, UpdateOptions, update, update_with};
/// use inekf::lie::{LieGroup, SE23};
/// use inekf::model::HeadingObservation;
/// use nalgebra::SVector;
///
/// let start =
///     Belief::<SE23, Left, 9>::new(SE23::identity(), Covariance::from_variances(&SVector::repeat(0.1)));
/// let fix = HeadingObservation { heading: 0.2, sigma: 0.1 };
/// let (mut by_rule, mut plain) = (start, start);
/// update_with(&mut by_rule, &fix, &Kalman, &UpdateOptions::ITERATED)?;
/// update(&mut plain, &fix, &UpdateOptions::ITERATED)?;
/// // The Kalman gain is the default.
/// assert_eq!(by_rule, plain);
/// # Ok::<(), inekf::filter::UpdateError>(())
/// ```
pub fn update_with<G, S, O, L, const D: usize, const M: usize>(
    belief: &mut Belief<G, S, D>,
    observation: &O,
    rule: &L,
    options: &UpdateOptions,
) -> Result<Correction<D>, UpdateError>
where
    G: LieGroup<D>,
    S: Side,
    O: Observation<G, D, M>,
    L: GainRule<G, D, M>,
{
    const {
        assert!(
            M <= MAX_DEGREES,
            "a gate knows the quantiles of MAX_DEGREES at most"
        )
    };
    let noise = observation.noise();
    let noise_factor = Factor::new(&noise).ok_or(UpdateError::InnovationNotPositiveDefinite)?;
    let cost = |iterate: &Iterate<D>, chi: &G| {
        let mut square = noise_factor.normalised_square(&observation.residual(chi));
        for k in 0..D {
            square += iterate.xi[k] * iterate.eta[k];
        }
        square
    };

    let mut current = Iterate {
        xi: SVector::zeros(),
        eta: SVector::zeros(),
    };
    let mut chi = belief.mean;
    let mut judgement = Judgement {
        nis: 0.0,
        degrees: M,
    };
    let (mut log_determinant, mut current_cost) = (0.0, 0.0);
    let mut iterations = 0;
    let mut covariance = loop {
        let of_noise = (&noise, &noise_factor);
        let linearised = Linearised::with_noise(belief, observation, &chi, &current.xi, of_noise)
            .ok_or(UpdateError::InnovationNotPositiveDefinite)?;
        if iterations == 0 {
            judgement = rule.judge(&linearised)?;
            let Judgement { nis, degrees } = judgement;
            if !nis.is_finite() {
                return Err(UpdateError::NotFinite);
            }
            log_determinant = linearised.log_determinant();
            if !options.gate.admits(nis, degrees) {
                return Ok(Correction {
                    verdict: Verdict::Gated,
                    nis,
                    degrees,
                    log_determinant,
                    xi: SVector::zeros(),
                    iterations: 0,
                });
            }
            current_cost = noise_factor.normalised_square(&linearised.residual);
        }
        let target = linearised.target(&current.xi);
        let full = rule.step(&belief.covariance, &linearised, &target)?;
        iterations += 1;
        let moved = if options.iterations == 1 || !L::MINIMISES_COST {
            Some((full, S::retract(&belief.mean, &full.xi)))
        } else {
            let before = current_cost * (1.0 + COST_ROUNDING) + FLAT_COST;
            let mut share = 1.0;
            let mut trials = 0;
            loop {
                let iterate = current.towards(&full, share);
                let chi = S::retract(&belief.mean, &iterate.xi);
                let lower = cost(&iterate, &chi);
                if lower <= before {
                    current_cost = lower;
                    break Some((iterate, chi));
                }
                trials += 1;
                if trials == MAX_TRIALS {
                    break None;
                }
                share *= 0.5;
            }
        };
        let ended = match moved {
            Some((next, next_chi)) => {
                let step = next.xi - current.xi;
                current = next;
                chi = next_chi;
                iterations >= options.iterations || is_small(&step, belief, options.tolerance)
            }
            // At the minimum, as far as rounding lets it be told.
            None if S::retract(&belief.mean, &full.xi).is_finite() => true,
            None => return Err(UpdateError::NotFinite),
        };
        if ended {
            break rule.covariance(&belief.covariance, &linearised)?;
        }
    };
    let Judgement { nis, degrees } = judgement;
    if options.transport == Transport::Jacobian {
        covariance.transform_by::<G>(&S::jacobian::<G, D>(&current.xi));
    }
    let mean = chi.normalized();
    if !(mean.is_finite() && covariance.is_plausible()) {
        return Err(UpdateError::NotFinite);
    }
    belief.mean = mean;
    belief.covariance = covariance;
    Ok(Correction {
        verdict: Verdict::Accepted,
        nis,
        degrees,
        log_determinant,
        xi: current.xi,
        iterations,
    })
}

/// Whether `step` is below `tolerance` standard deviations of the prior in every component.
fn is_small<G: LieGroup<D>, S: Side, const D: usize>(
    step: &SVector<f64, D>,
    belief: &Belief<G, S, D>,
    tolerance: f64,
) -> bool {
    let variances = belief.covariance.matrix().diagonal();
    step.iter()
        .zip(variances.iter())
        .all(|(component, variance)| {
            component * component <= tolerance * tolerance * variance.max(0.0)
        })
}
