//! The window of any parametrisation behind one face, so that there is one engine for all of them.

use core::fmt::Debug;

use inekf::filter::{Belief, Covariance, Forster, Gtsam, Left, Right, Side};
use inekf::lie::{LieGroup, SE23};
use inekf::model::InertialState;
use inekf::smoother::{Fix, Preintegration, Window, WindowCorrection, WindowError, WindowOptions};
use nalgebra::{SVector, Vector3};

use super::super::settings::SmootherSettings;
use crate::config::Parametrisation;

/// A [`Window`] of some parametrisation; its methods say what these do.
pub trait AnyWindow<G, const D: usize>: Debug {
    /// [`Window::restart`].
    fn restart(&mut self, first: &Belief<G, Left, D>);

    /// [`Window::push`]; with the covariance of the state that leaves.
    fn push(&mut self, motion: &Preintegration<G, D>) -> Option<Belief<G, Left, D>>;

    /// [`Window::is_full`].
    fn is_full(&self) -> bool;

    /// [`Window::cover_oldest`].
    fn cover_oldest(&mut self, budget: &mut i64) -> bool;

    /// Hands over [`Window::covariances`].
    fn covariances(&self, give: &mut dyn FnMut(usize, &Covariance<D>));

    /// [`Window::begin`].
    ///
    /// # Errors
    /// As there.
    fn begin(&mut self, fix: Fix) -> Result<(), WindowError>;

    /// [`Window::is_ready_for`].
    fn is_ready_for(&self, fix: &Fix) -> bool;

    /// [`Window::lead`].
    fn lead(&mut self) -> Option<Result<WindowCorrection, WindowError>>;

    /// [`Window::anticipate`].
    fn anticipate(&mut self, budget: &mut i64) -> bool;

    /// [`Window::advance`].
    fn advance(&mut self, budget: &mut i64) -> Option<Result<WindowCorrection, WindowError>>;

    /// [`Window::work`].
    fn work(&self) -> i64;

    /// [`Window::work_of_push`].
    fn work_of_push(&self) -> i64;

    /// [`Window::newest`].
    fn newest(&self) -> Belief<G, Left, D>;

    /// Hands over [`Window::states`].
    fn each(&self, give: &mut dyn FnMut(&G));
}

impl<G: InertialState<D>, S: Side, const D: usize> AnyWindow<G, D> for Window<G, S, D> {
    fn restart(&mut self, first: &Belief<G, Left, D>) {
        Self::restart(self, first);
    }

    fn push(&mut self, motion: &Preintegration<G, D>) -> Option<Belief<G, Left, D>> {
        let leaving = self.is_full().then(|| self.oldest());
        Self::push(self, motion);
        leaving
    }

    fn is_full(&self) -> bool {
        Self::is_full(self)
    }

    fn cover_oldest(&mut self, budget: &mut i64) -> bool {
        Self::cover_oldest(self, budget)
    }

    fn covariances(&self, give: &mut dyn FnMut(usize, &Covariance<D>)) {
        Self::covariances(self, give);
    }

    fn begin(&mut self, fix: Fix) -> Result<(), WindowError> {
        Self::begin(self, fix)
    }

    fn is_ready_for(&self, fix: &Fix) -> bool {
        Self::is_ready_for(self, fix)
    }

    fn lead(&mut self) -> Option<Result<WindowCorrection, WindowError>> {
        Self::lead(self)
    }

    fn anticipate(&mut self, budget: &mut i64) -> bool {
        Self::anticipate(self, budget)
    }

    fn advance(&mut self, budget: &mut i64) -> Option<Result<WindowCorrection, WindowError>> {
        Self::advance(self, budget)
    }

    fn work(&self) -> i64 {
        Self::work(self)
    }

    fn work_of_push(&self) -> i64 {
        Self::work_of_push(self)
    }

    fn newest(&self) -> Belief<G, Left, D> {
        Self::newest(self)
    }

    fn each(&self, give: &mut dyn FnMut(&G)) {
        self.states().for_each(give);
    }
}

/// What is believed before there is a state: it holds the place, and is never published.
pub(super) fn nowhere<G: InertialState<D>, const D: usize>() -> Belief<G, Left, D> {
    Belief::new(
        G::from_parts(SE23::identity(), Vector3::zeros(), Vector3::zeros()),
        Covariance::from_variances(&SVector::zeros()),
    )
}

/// The window that `settings` ask for, with all the memory it will ever use.
pub fn of<G: InertialState<D> + 'static, const D: usize>(
    settings: &SmootherSettings,
) -> Box<dyn AnyWindow<G, D>> {
    fn sided<G: InertialState<D> + 'static, S: Side + 'static, const D: usize>(
        options: &WindowOptions,
    ) -> Box<dyn AnyWindow<G, D>> {
        Box::new(Window::<G, S, D>::new(&nowhere(), options))
    }
    let options = &settings.window;
    match settings.parametrisation {
        Parametrisation::Exponential => sided::<G, Left, D>(options),
        Parametrisation::Right => sided::<G, Right, D>(options),
        Parametrisation::Gtsam => sided::<G, Gtsam, D>(options),
        Parametrisation::Forster => sided::<G, Forster, D>(options),
    }
}
