//! `estimator`, `invariance`, `mismatch`: which filter runs, and which of their combinations are built.

use super::choice::{Estimator, Invariance, Mismatch, Model};
use super::section::Section;

/// The filter: what it is called, its error, and what it does about mismatches.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Filter {
    pub(super) estimator: Estimator,
    /// None: the error is additive.
    pub(super) invariance: Option<Invariance>,
    pub(super) mismatch: Mismatch,
}

impl Estimator {
    /// Whether its error is additive, `theta` and `x` by themselves, instead of an element of the group.
    const fn is_additive(self) -> bool {
        matches!(self, Self::Ekf | Self::LcEkf)
    }

    /// Whether its gain is constrained against mismatches.
    const fn is_constrained(self) -> bool {
        matches!(self, Self::LcInekf | Self::LcEkf)
    }

    /// What it can do about mismatches; the first is the default.
    const fn treatments(self) -> &'static [Mismatch] {
        match self {
            Self::Inekf => &[
                Mismatch::None,
                Mismatch::Consider,
                Mismatch::Augmented,
                Mismatch::Adaptive,
            ],
            Self::LcInekf | Self::LcEkf => &[Mismatch::Hard, Mismatch::Soft],
            Self::Ekf | Self::InvariantHinf | Self::Smoother => &[Mismatch::None],
        }
    }
}

impl Filter {
    /// Reads the three keys. `model` is None if it is not known: then nothing is held against it.
    pub(super) fn read(root: &mut Section<'_, '_>, model: Option<Model>) -> Self {
        let estimator = root.choice("estimator", Estimator::Inekf);
        let is_smoother = estimator == Estimator::Smoother;
        if model == Some(Model::Imu) && !(is_smoother || estimator == Estimator::Inekf) {
            root.refuse(
                "estimator",
                "not built for model \"imu\", which has \"inekf\" and \"smoother\" only in this version",
            );
        } else if model.is_some_and(Model::is_odometry) && is_smoother {
            root.refuse("estimator", "built for model \"imu\" only in this version");
        }
        let invariance = root.choice("invariance", Invariance::Left);
        let mismatch = root.varying_choice("mismatch", default_treatment(estimator));
        if root.is_sound("estimator") {
            refuse_invariance(root, estimator, invariance);
            refuse_mismatch(root, model, estimator, mismatch);
        }
        if root.is_sound("invariance")
            && root.is_sound("mismatch")
            && invariance == Invariance::Right
            && matches!(
                mismatch,
                Mismatch::Consider | Mismatch::Augmented | Mismatch::Adaptive
            )
        {
            let reason = format!("mismatch = \"{mismatch}\" needs invariance = \"left\"");
            root.refuse("mismatch", &reason);
        }
        Self {
            estimator,
            invariance: (!estimator.is_additive()).then_some(invariance),
            mismatch,
        }
    }
}

/// What `estimator` does about mismatches if nothing is said.
fn default_treatment(estimator: Estimator) -> Mismatch {
    if estimator.is_constrained() {
        Mismatch::Hard
    } else {
        Mismatch::None
    }
}

fn refuse_invariance(root: &mut Section<'_, '_>, estimator: Estimator, invariance: Invariance) {
    if estimator.is_additive() {
        let reason = format!("the error of estimator = \"{estimator}\" is additive: remove this");
        root.refuse("invariance", &reason);
    } else if estimator == Estimator::InvariantHinf && invariance != Invariance::Left {
        root.refuse(
            "invariance",
            "estimator = \"invariant-hinf\" is built with \"left\" only",
        );
    } else if estimator == Estimator::Smoother && invariance != Invariance::Left {
        root.refuse(
            "invariance",
            "estimator = \"smoother\" is written with \"left\"; say [smoother] parametrisation = \"right\"",
        );
    }
}

fn refuse_mismatch(
    root: &mut Section<'_, '_>,
    model: Option<Model>,
    estimator: Estimator,
    mismatch: Mismatch,
) {
    if model == Some(Model::Imu) && mismatch != Mismatch::None {
        root.refuse(
            "mismatch",
            "not built for model \"imu\", which has \"none\" only in this version",
        );
    } else if !estimator.treatments().contains(&mismatch) {
        let names: Vec<String> = estimator
            .treatments()
            .iter()
            .map(|treatment| format!("\"{treatment}\""))
            .collect();
        let reason = format!(
            "estimator = \"{estimator}\" cannot do that, but {}",
            names.join(", ")
        );
        root.refuse("mismatch", &reason);
    }
}
