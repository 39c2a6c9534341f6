//! Whether hard constraints on the gain can be met: an update has no more of them than it has outputs.
//!
//! `L Delta = T` asks for one independent row of outputs for each parameter; a rotation about any axis is of rank 2.

use super::choice::{Mismatch, Model};
use super::mismatched::{Mismatched, Wrong};
use super::section::Section;
use super::sources::PositionSource;
use super::stacking::Stacking;

/// Refuses hard mismatches that no gain can be blind to, for the first update that they are too many for.
pub(super) fn check(
    root: &mut Section<'_, '_>,
    model: Model,
    mismatched: &[Mismatched],
    sources: &[PositionSource],
    stacking: Option<&Stacking>,
) {
    let dimension = if model == Model::Odometry2d { 2 } else { 3 };
    for ids in updates(sources, stacking) {
        let outputs = dimension * ids.len();
        let constraints: usize = mismatched
            .iter()
            .filter(|one| one.what.source().is_none_or(|id| ids.contains(&id)))
            .map(|one| rank(one.what))
            .sum();
        if constraints > outputs {
            let who: Vec<String> = ids.iter().map(u32::to_string).collect();
            let problem = format!(
                "{constraints} hard constraints have no solution on the {outputs} outputs of position source {}: \
                 declare fewer, stack sources, or say mismatch = \"{}\"",
                who.join(" with "),
                Mismatch::Soft
            );
            return root.refuse("mismatched", &problem);
        }
    }
}

/// The sources of each constrained update: the stacked ones together, each other one by itself. What is stacked is
/// never constrained alone.
fn updates(sources: &[PositionSource], stacking: Option<&Stacking>) -> Vec<Vec<u32>> {
    let stacked = stacking.map(|stacking| stacking.sources.to_vec());
    let is_stacked = |id: u32| stacked.iter().any(|ids| ids.contains(&id));
    let alone = sources.iter().map(|source| source.id);
    let alone = alone.filter(|&id| !is_stacked(id)).map(|id| vec![id]);
    let alone: Vec<Vec<u32>> = alone.collect();
    stacked.iter().cloned().chain(alone).collect()
}

/// How many independent constraints a mismatch is.
fn rank(what: Wrong) -> usize {
    match what {
        Wrong::MeasurementRotation { axis: None, .. } => 2,
        _ => 1,
    }
}
