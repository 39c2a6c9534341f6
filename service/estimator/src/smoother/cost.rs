//! What a trajectory costs: the deviations from prior, motions and observations, in their standard deviations, \[IS\] (12).

use nalgebra::{Cholesky, SVector};

use super::chain::{Chain, Motion};
use super::deviation::{Deviation, deviation};
use super::linearise;
use super::solver::SmootherError;
use crate::filter::Side;
use crate::lie::LieGroup;
use crate::model::Observation;

/// The minus log-likelihood of a trajectory, times two and up to a constant.
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
/// // Half a metre to the side of where the odometry leads, which it knows to 0.1 m; and a metre off the fix, known to 1 m.
/// let mut aside = ahead.apply(&SE2::identity());
/// aside.position.y = 0.5;
/// batch.set_states(&[SE2::identity(), aside]);
/// let cost = batch.cost(&chain)?;
/// assert!((cost.square - (25.0 + 1.0 + 0.25)).abs() < 1e-9 && cost.outside == 0.0);
/// # Ok::<(), SmootherError>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cost {
    /// The sum of the squared deviations, each in its own standard deviations.
    pub square: f64,
    /// The largest deviation that no noise explains: of a link without noise, or outside the prior; rad, m/s or m.
    pub outside: f64,
}

/// What counts as no deviation at all where no noise explains one, rad, m/s and m.
const FEASIBLE: f64 = 1e-9;

/// How much larger a cost may come out by rounding, relative: the residual of an almost noise-free link is
/// rounding, divided by a tiny standard deviation.
const COST_ROUNDING: f64 = 1e-9;

/// Whether a step may be taken that led from one cost to another.
pub(super) fn is_acceptable(before: Option<Cost>, after: Option<Cost>) -> bool {
    match (before, after) {
        (Some(before), Some(after)) if before.outside <= FEASIBLE => {
            after.square <= before.square * (1.0 + COST_ROUNDING)
        }
        // What no noise explains must be mended, whatever the rest costs; and without control nothing is judged.
        _ => true,
    }
}

/// Refuses a trajectory that is not one of `chain`.
pub(super) fn check_length<G, P, T, O, const D: usize>(
    states: &[G],
    chain: &Chain<G, P, T, O, D>,
) -> Result<(), SmootherError> {
    if states.len() == chain.states() {
        return Ok(());
    }
    Err(SmootherError::WrongLength {
        states: states.len(),
        expected: chain.states(),
    })
}

/// The cost of `states`, with the residuals of the links in the chart of S.
pub(super) fn cost<G, S, P, T, O, const D: usize, const M: usize>(
    chain: &Chain<G, P, T, O, D>,
    states: &[G],
) -> Result<Cost, SmootherError>
where
    G: LieGroup<D>,
    S: Side,
    P: Side,
    T: Motion<G, D>,
    O: Observation<G, D, M>,
{
    check_length(states, chain)?;
    let prior = chain.prior();
    let mut cost = Cost {
        square: 0.0,
        outside: 0.0,
    };
    let mut add = |term: Deviation| {
        cost.square += term.square;
        cost.outside = cost.outside.max(term.outside);
    };
    let residual = P::difference(&prior.mean, &states[0]);
    add(deviation(&residual, prior.covariance.matrix()));
    for (link, pair) in chain.links().iter().zip(states.windows(2)) {
        let residual = linearise::departure::<G, S, T, D>(&link.motion, &pair[0], &pair[1]);
        add(deviation(&residual, &link.noise));
    }
    for sighting in chain.sightings() {
        let residual: SVector<f64, M> = sighting.observation.residual(&states[sighting.state]);
        let noise = Cholesky::new(sighting.observation.noise()).ok_or(
            SmootherError::InnovationNotPositiveDefinite {
                state: sighting.state,
            },
        )?;
        add(Deviation {
            square: residual.dot(&noise.solve(&residual)),
            outside: 0.0,
        });
    }
    Ok(cost)
}
