//! Gauss-Newton over the window, at once or in slices.
//!
//! An iteration goes forward over all states (the Kalman filter of the linearised window) and back (the disturbance
//! smoother, which moves each estimate as it passes). It can stop behind any state and go on later: a [`Solve`] says how
//! far it has come, everything else is kept with the states. What a slice may do is counted in units of work, which are
//! about the same time each; a count, so that where a slice ends does not depend on any clock.
//!
//! A fix has a say in the forward pass at the newest state only. All before that, and the marginalisation of the state
//! that will leave, is known as soon as the update before is done: [`Window::anticipate`] does it.

use nalgebra::SVector;

use super::knot::{Knot, Passage};
use super::{Fix, Window, WindowCorrection, WindowError};
use crate::filter::{Side, Verdict};
use crate::model::InertialState;

/// How far an update has come.
#[derive(Clone, Copy, Debug)]
pub(super) struct Solve<const D: usize> {
    /// Iterations that have moved the states, or begun to.
    steps: usize,
    pass: Pass<D>,
    correction: WindowCorrection,
}

/// How far the forward pass of an update has come whose fix is not there yet.
#[derive(Clone, Copy, Debug)]
pub(super) struct Ahead {
    /// The states before it have been passed.
    pub next: usize,
    /// Whether their gains were computed.
    fresh: bool,
}

#[derive(Clone, Copy, Debug)]
enum Pass<const D: usize> {
    /// The states before `next` have been passed.
    Forward { next: usize },
    /// The states from `end` on have been passed.
    Back {
        end: usize,
        adjoint: SVector<f64, D>,
        /// Of all corrections: not finite if one of them is not.
        sum: f64,
    },
}

/// What became of a slice.
type Outcome = Option<Result<WindowCorrection, WindowError>>;

impl<G: InertialState<D>, S: Side, const D: usize> Window<G, S, D> {
    /// Takes in a fix of the newest state and smooths the window.
    ///
    /// # Errors
    /// [`WindowError`]; the states are then unchanged, as they are when the fix is gated.
    ///
    /// ```
    /// # use inekf::smoother::WindowError;
    /// # use nalgebra::Matrix3;
    /// use inekf::filter::{Belief, Covariance, Left, Verdict};
    /// use inekf::lie::{LieGroup, SE23};
    /// use inekf::model::PositionObservation;
    /// use inekf::smoother::{Window, WindowOptions};
    /// use nalgebra::{SVector, Vector3};
    ///
    /// let first = Belief::new(SE23::identity(), Covariance::from_variances(&SVector::repeat(0.1)));
    /// # let seen_at = |x_m: f64| PositionObservation {
    /// #     position_w: Vector3::new(x_m, 0.0, 0.0),
    /// #     covariance_w: Matrix3::identity() * 0.01,
    /// #     lever_arm_b: Vector3::zeros(),
    /// # };
    /// let mut window = Window::<SE23, Left, 9>::new(&first, &WindowOptions::new(3));
    /// // Half a metre to the left, which is the world's y.
    /// let fix = PositionObservation { position_w: Vector3::new(0.0, 0.5, 0.0), ..seen_at(0.0) };
    /// let correction = window.update(fix)?;
    /// assert_eq!(correction.verdict, Verdict::Accepted);
    /// // 0.5^2 / (0.1 + 0.01).
    /// assert!((correction.nis - 0.25 / 0.11).abs() < 1e-9);
    /// # Ok::<(), WindowError>(())
    /// ```
    pub fn update(&mut self, fix: impl Into<Fix>) -> Result<WindowCorrection, WindowError> {
        self.begin(fix)?;
        self.finish().unwrap_or(Err(WindowError::NotFinite))
    }

    /// Begins an update with a fix of the newest state, for [`advance`](Self::advance) to go on with. Until that is
    /// done the estimates are on their way.
    ///
    /// # Errors
    /// [`WindowError::AlreadySeen`]; nothing has begun then.
    ///
    /// ```
    /// # use inekf::model::{Discretisation, ImuInput, ImuNoise, PositionObservation};
    /// # use inekf::smoother::Preintegration;
    /// # use nalgebra::{Matrix3, Vector3};
    /// use inekf::filter::{Belief, Covariance, Left};
    /// use inekf::lie::{LieGroup, SE23};
    /// use inekf::smoother::{Window, WindowError, WindowOptions};
    /// use nalgebra::SVector;
    ///
    /// let first = Belief::new(SE23::identity(), Covariance::from_variances(&SVector::repeat(0.1)));
    /// # let second_of_rest = {
    /// #     let at_rest = ImuInput { omega_b: Vector3::zeros(), force_b: Vector3::new(0.0, 0.0, 9.80665) };
    /// #     let noise = ImuNoise { gyro_psd: 1e-6, accel_psd: 1e-4, gyro_bias_psd: 0.0, accel_bias_psd: 0.0 };
    /// #     let g_w = Vector3::new(0.0, 0.0, -9.80665);
    /// #     let mut motion = Preintegration::new(&SE23::identity());
    /// #     motion.push(&at_rest, &g_w, 1.0, Discretisation::ZeroOrderHold, &noise);
    /// #     motion
    /// # };
    /// # let seen_at = |x_m: f64| PositionObservation {
    /// #     position_w: Vector3::new(x_m, 0.0, 0.0),
    /// #     covariance_w: Matrix3::identity() * 0.01,
    /// #     lever_arm_b: Vector3::zeros(),
    /// # };
    /// let mut window = Window::<SE23, Left, 9>::new(&first, &WindowOptions::new(3));
    /// window.push(&second_of_rest);
    /// window.begin(seen_at(0.3))?;
    /// assert!(window.is_solving());
    /// // One fix a state: what was begun is finished first.
    /// assert_eq!(window.begin(seen_at(0.3)), Err(WindowError::AlreadySeen));
    /// assert!(!window.is_solving());
    /// # Ok::<(), WindowError>(())
    /// ```
    pub fn begin(&mut self, fix: impl Into<Fix>) -> Result<(), WindowError> {
        self.finish();
        let fix = fix.into();
        let last = self.knots.len() - 1;
        if self.knots[last].fix.is_some() {
            return Err(WindowError::AlreadySeen);
        }
        self.cover.forget();
        self.knots[last].fix = Some(fix);
        self.anisotropic += usize::from(!fix.is_isotropic());
        let fresh = self.must_linearise();
        let ahead = self.ahead.take();
        let known = ahead.filter(|ahead| ahead.fresh || !fresh);
        self.solve = Some(Solve {
            steps: 0,
            pass: Pass::Forward {
                next: known.map_or(0, |ahead| ahead.next.min(last)),
            },
            correction: WindowCorrection {
                verdict: Verdict::Accepted,
                nis: f64::NAN,
                iterations: self.options.iterations,
            },
        });
        self.kept = fresh.then(|| self.passages[last].predicted);
        Ok(())
    }

    /// Does of the next update what does not depend on its fix, while `budget` units of work are left, and takes what it
    /// did from them. Whether there is nothing left of that.
    ///
    /// ```
    /// # use inekf::model::{Discretisation, ImuInput, ImuNoise, PositionObservation};
    /// # use inekf::smoother::{Preintegration, WindowError};
    /// # use nalgebra::{Matrix3, Vector3};
    /// use inekf::filter::{Belief, Covariance, Left};
    /// use inekf::lie::{LieGroup, SE23};
    /// use inekf::smoother::{Window, WindowOptions};
    /// use nalgebra::SVector;
    ///
    /// let first = Belief::new(SE23::identity(), Covariance::from_variances(&SVector::repeat(0.1)));
    /// # let second_of_rest = {
    /// #     let at_rest = ImuInput { omega_b: Vector3::zeros(), force_b: Vector3::new(0.0, 0.0, 9.80665) };
    /// #     let noise = ImuNoise { gyro_psd: 1e-6, accel_psd: 1e-4, gyro_bias_psd: 0.0, accel_bias_psd: 0.0 };
    /// #     let g_w = Vector3::new(0.0, 0.0, -9.80665);
    /// #     let mut motion = Preintegration::new(&SE23::identity());
    /// #     motion.push(&at_rest, &g_w, 1.0, Discretisation::ZeroOrderHold, &noise);
    /// #     motion
    /// # };
    /// # let seen_at = |x_m: f64| PositionObservation {
    /// #     position_w: Vector3::new(x_m, 0.0, 0.0),
    /// #     covariance_w: Matrix3::identity() * 0.01,
    /// #     lever_arm_b: Vector3::zeros(),
    /// # };
    /// let mut window = Window::<SE23, Left, 9>::new(&first, &WindowOptions::new(3));
    /// window.push(&second_of_rest);
    /// window.update(seen_at(0.3))?;
    /// // In the time until the next fix.
    /// let mut budget = 1000;
    /// assert!(window.anticipate(&mut budget) && budget < 1000);
    /// // There is nothing more of it.
    /// let left = budget;
    /// assert!(window.anticipate(&mut budget) && budget == left);
    /// # Ok::<(), WindowError>(())
    /// ```
    pub fn anticipate(&mut self, budget: &mut i64) -> bool {
        // A newest state that nothing has seen may still get its fix, with the oldest one in the window.
        let may_be_seen = self.is_full() && self.newest_knot().fix.is_none();
        if self.is_solving() || self.is_single() || may_be_seen {
            return true;
        }
        if *budget <= 0 {
            return false;
        }
        if self.is_full() && !self.gone {
            self.marginalise();
            self.gone = true;
            *budget -= self.work_of_push();
        }
        let mut ahead = self.ahead.unwrap_or(Ahead {
            next: usize::from(self.gone),
            fresh: self.must_linearise(),
        });
        let done = self.forward(&mut ahead.next, budget);
        // What cannot be done is tried again with the fix, and the error told.
        self.ahead = done.is_ok().then_some(ahead);
        done.unwrap_or(true)
    }

    /// Whether all has been done that does not depend on the next fix, if `fix` is the one, of a state to be pushed.
    ///
    /// ```
    /// # use inekf::model::{Discretisation, ImuInput, ImuNoise, PositionObservation};
    /// # use inekf::smoother::{Preintegration, WindowError};
    /// # use nalgebra::{Matrix3, Vector3};
    /// use inekf::filter::{Belief, Covariance, Left};
    /// use inekf::lie::{LieGroup, SE23};
    /// use inekf::smoother::{Fix, Window, WindowOptions};
    /// use nalgebra::SVector;
    ///
    /// let first = Belief::new(SE23::identity(), Covariance::from_variances(&SVector::repeat(0.1)));
    /// # let second_of_rest = {
    /// #     let at_rest = ImuInput { omega_b: Vector3::zeros(), force_b: Vector3::new(0.0, 0.0, 9.80665) };
    /// #     let noise = ImuNoise { gyro_psd: 1e-6, accel_psd: 1e-4, gyro_bias_psd: 0.0, accel_bias_psd: 0.0 };
    /// #     let g_w = Vector3::new(0.0, 0.0, -9.80665);
    /// #     let mut motion = Preintegration::new(&SE23::identity());
    /// #     motion.push(&at_rest, &g_w, 1.0, Discretisation::ZeroOrderHold, &noise);
    /// #     motion
    /// # };
    /// # let seen_at = |x_m: f64| PositionObservation {
    /// #     position_w: Vector3::new(x_m, 0.0, 0.0),
    /// #     covariance_w: Matrix3::identity() * 0.01,
    /// #     lever_arm_b: Vector3::zeros(),
    /// # };
    /// let mut window = Window::<SE23, Left, 9>::new(&first, &WindowOptions::new(3));
    /// window.push(&second_of_rest);
    /// window.update(seen_at(0.3))?;
    /// let next = Fix::Position(seen_at(0.4));
    /// assert!(!window.is_ready_for(&next));
    /// window.anticipate(&mut 1000);
    /// assert!(window.is_ready_for(&next));
    /// # Ok::<(), WindowError>(())
    /// ```
    pub fn is_ready_for(&self, fix: &Fix) -> bool {
        let constant = self.gains_hold && self.is_constant() && fix.is_isotropic();
        let is_done = |ahead: &Ahead| ahead.next == self.knots.len() && (ahead.fresh || constant);
        !self.is_solving() && (self.is_single() || self.ahead.as_ref().is_some_and(is_done))
    }

    /// Whether the next state leaves no other in the window: then there is nothing to anticipate.
    fn is_single(&self) -> bool {
        self.options.capacity == 1
    }

    /// Goes on with the update that has just begun, to where the newest state has taken its first step: the last, if
    /// there is one iteration. [`newest`](Self::newest) is then what the filter over the window makes of it.
    ///
    /// ```
    /// # use inekf::model::{Discretisation, ImuInput, ImuNoise, PositionObservation};
    /// # use inekf::smoother::{Preintegration, WindowError};
    /// # use nalgebra::{Matrix3, Vector3};
    /// use inekf::filter::{Belief, Covariance, Left};
    /// use inekf::lie::{LieGroup, SE23};
    /// use inekf::smoother::{Window, WindowOptions};
    /// use nalgebra::SVector;
    ///
    /// let first = Belief::new(SE23::identity(), Covariance::from_variances(&SVector::repeat(0.1)));
    /// # let second_of_rest = {
    /// #     let at_rest = ImuInput { omega_b: Vector3::zeros(), force_b: Vector3::new(0.0, 0.0, 9.80665) };
    /// #     let noise = ImuNoise { gyro_psd: 1e-6, accel_psd: 1e-4, gyro_bias_psd: 0.0, accel_bias_psd: 0.0 };
    /// #     let g_w = Vector3::new(0.0, 0.0, -9.80665);
    /// #     let mut motion = Preintegration::new(&SE23::identity());
    /// #     motion.push(&at_rest, &g_w, 1.0, Discretisation::ZeroOrderHold, &noise);
    /// #     motion
    /// # };
    /// # let seen_at = |x_m: f64| PositionObservation {
    /// #     position_w: Vector3::new(x_m, 0.0, 0.0),
    /// #     covariance_w: Matrix3::identity() * 0.01,
    /// #     lever_arm_b: Vector3::zeros(),
    /// # };
    /// let mut window = Window::<SE23, Left, 9>::new(&first, &WindowOptions::new(3));
    /// window.push(&second_of_rest);
    /// window.push(&second_of_rest);
    /// let mut at_once = window.clone();
    /// at_once.update(seen_at(0.3))?;
    /// window.begin(seen_at(0.3))?;
    /// // The newest state is ready, the others follow.
    /// assert!(window.lead().is_none());
    /// assert_eq!(window.newest(), at_once.newest());
    /// window.finish();
    /// assert!(window.states().eq(at_once.states()));
    /// # Ok::<(), WindowError>(())
    /// ```
    pub fn lead(&mut self) -> Outcome {
        let Some(Solve {
            pass: Pass::Forward { next },
            ..
        }) = &self.solve
        else {
            return self.advance(&mut 0);
        };
        // One unit is enough for the last state of a pass, and no state of the next is begun.
        let all_but_last = (self.knots.len() - next - 1) as i64;
        let mut forward = 1 + all_but_last * self.work_forward();
        let mut back = 1;
        self.advance(&mut forward)
            .or_else(|| self.advance(&mut back))
    }

    /// Goes on with the update that is under way while `budget` units of work are left, and takes what it did from
    /// them; the last state may overdraw it. Gives what came of the update once it is done.
    ///
    /// ```
    /// # use inekf::model::{Discretisation, ImuInput, ImuNoise, PositionObservation};
    /// # use inekf::smoother::{Preintegration, WindowError};
    /// # use nalgebra::{Matrix3, Vector3};
    /// use inekf::filter::{Belief, Covariance, Left};
    /// use inekf::lie::{LieGroup, SE23};
    /// use inekf::smoother::{Window, WindowOptions};
    /// use nalgebra::SVector;
    ///
    /// let first = Belief::new(SE23::identity(), Covariance::from_variances(&SVector::repeat(0.1)));
    /// # let second_of_rest = {
    /// #     let at_rest = ImuInput { omega_b: Vector3::zeros(), force_b: Vector3::new(0.0, 0.0, 9.80665) };
    /// #     let noise = ImuNoise { gyro_psd: 1e-6, accel_psd: 1e-4, gyro_bias_psd: 0.0, accel_bias_psd: 0.0 };
    /// #     let g_w = Vector3::new(0.0, 0.0, -9.80665);
    /// #     let mut motion = Preintegration::new(&SE23::identity());
    /// #     motion.push(&at_rest, &g_w, 1.0, Discretisation::ZeroOrderHold, &noise);
    /// #     motion
    /// # };
    /// # let seen_at = |x_m: f64| PositionObservation {
    /// #     position_w: Vector3::new(x_m, 0.0, 0.0),
    /// #     covariance_w: Matrix3::identity() * 0.01,
    /// #     lever_arm_b: Vector3::zeros(),
    /// # };
    /// let mut window = Window::<SE23, Left, 9>::new(&first, &WindowOptions::new(3));
    /// window.push(&second_of_rest);
    /// window.push(&second_of_rest);
    /// let mut at_once = window.clone();
    /// let expected = at_once.update(seen_at(0.3));
    /// window.begin(seen_at(0.3))?;
    /// // A state in each slice, and the same in the end.
    /// let mut slices = 1;
    /// let outcome = loop {
    ///     match window.advance(&mut 1) {
    ///         Some(outcome) => break outcome,
    ///         None => slices += 1,
    ///     }
    /// };
    /// assert!(slices > 1 && outcome == expected);
    /// # Ok::<(), WindowError>(())
    /// ```
    pub fn advance(&mut self, budget: &mut i64) -> Outcome {
        let mut solve = self.solve.take()?;
        let outcome = self.go_on(&mut solve, budget);
        match outcome {
            None => self.solve = Some(solve),
            Some(Ok(correction)) if correction.verdict == Verdict::Accepted => {}
            Some(_) => self.take_back(solve.steps),
        }
        outcome
    }

    /// Does the rest of the update that is under way; `None` if there is none.
    ///
    /// ```
    /// # use inekf::model::PositionObservation;
    /// # use inekf::smoother::WindowError;
    /// # use nalgebra::{Matrix3, Vector3};
    /// use inekf::filter::{Belief, Covariance, Left, Verdict};
    /// use inekf::lie::{LieGroup, SE23};
    /// use inekf::smoother::{Window, WindowOptions};
    /// use nalgebra::SVector;
    ///
    /// let first = Belief::new(SE23::identity(), Covariance::from_variances(&SVector::repeat(0.1)));
    /// # let seen_at = |x_m: f64| PositionObservation {
    /// #     position_w: Vector3::new(x_m, 0.0, 0.0),
    /// #     covariance_w: Matrix3::identity() * 0.01,
    /// #     lever_arm_b: Vector3::zeros(),
    /// # };
    /// let mut window = Window::<SE23, Left, 9>::new(&first, &WindowOptions::new(3));
    /// assert!(window.finish().is_none());
    /// window.begin(seen_at(0.3))?;
    /// let correction = window.finish().expect("one was under way")?;
    /// assert_eq!(correction.verdict, Verdict::Accepted);
    /// # Ok::<(), WindowError>(())
    /// ```
    pub fn finish(&mut self) -> Outcome {
        let mut budget = i64::MAX;
        self.advance(&mut budget)
    }

    /// Whether an update is under way.
    ///
    /// ```
    /// # use inekf::model::PositionObservation;
    /// # use inekf::smoother::WindowError;
    /// # use nalgebra::{Matrix3, Vector3};
    /// use inekf::filter::{Belief, Covariance, Left};
    /// use inekf::lie::{LieGroup, SE23};
    /// use inekf::smoother::{Window, WindowOptions};
    /// use nalgebra::SVector;
    ///
    /// let first = Belief::new(SE23::identity(), Covariance::from_variances(&SVector::repeat(0.1)));
    /// # let seen_at = |x_m: f64| PositionObservation {
    /// #     position_w: Vector3::new(x_m, 0.0, 0.0),
    /// #     covariance_w: Matrix3::identity() * 0.01,
    /// #     lever_arm_b: Vector3::zeros(),
    /// # };
    /// let mut window = Window::<SE23, Left, 9>::new(&first, &WindowOptions::new(3));
    /// window.begin(seen_at(0.3))?;
    /// assert!(window.is_solving());
    /// window.finish();
    /// assert!(!window.is_solving());
    /// # Ok::<(), WindowError>(())
    /// ```
    pub fn is_solving(&self) -> bool {
        self.solve.is_some()
    }

    /// Undoes an update of so many steps.
    fn take_back(&mut self, steps: usize) {
        let last = self.knots.len() - 1;
        if let Some(predicted) = &self.kept {
            self.passages[last].predicted = *predicted;
        }
        if let Some(fix) = &self.knots[last].fix {
            self.anisotropic -= usize::from(!fix.is_isotropic());
        }
        self.knots[last].unsee(&self.passages[last]);
        if steps > 0 {
            for knot in self.knots.iter_mut() {
                (knot.chi, knot.is_predicted) = knot.before;
            }
        }
    }

    /// Gauss-Newton.
    fn go_on(&mut self, solve: &mut Solve<D>, budget: &mut i64) -> Outcome {
        loop {
            match &mut solve.pass {
                Pass::Forward { next } => {
                    match self.forward(next, budget) {
                        Ok(true) => {}
                        Ok(false) => return None,
                        Err(error) => return Some(Err(error)),
                    }
                    if solve.steps == 0 {
                        let newest = self.newest_knot();
                        let nis = newest.innovation.dot(&newest.weighted);
                        solve.correction.nis = nis;
                        if !nis.is_finite() {
                            return Some(Err(WindowError::NotFinite));
                        }
                        if nis > self.options.gate {
                            solve.correction.verdict = Verdict::Gated;
                            solve.correction.iterations = 0;
                            return Some(Ok(solve.correction));
                        }
                    }
                    solve.steps += 1;
                    solve.pass = Pass::Back {
                        end: self.knots.len(),
                        adjoint: SVector::zeros(),
                        sum: 0.0,
                    };
                }
                Pass::Back { end, adjoint, sum } => {
                    let first = solve.steps == 1;
                    if !self.back(end, adjoint, sum, first, budget) {
                        return None;
                    }
                    if !sum.is_finite() {
                        return Some(Err(WindowError::NotFinite));
                    }
                    if solve.steps >= self.options.iterations {
                        return Some(Ok(solve.correction));
                    }
                    solve.pass = Pass::Forward { next: 0 };
                }
            }
        }
    }

    /// The Kalman filter over the linearised window, from the state `next` on. Whether it has come to the end.
    fn forward(&mut self, next: &mut usize, budget: &mut i64) -> Result<bool, WindowError> {
        let fresh = self.must_linearise();
        let constant = self.is_constant();
        let tracked = self.is_tracked();
        let cost = self.work_forward();
        let first = usize::from(self.gone);
        let last = self.knots.len() - 1;
        for index in (*next).max(first)..=last {
            if *budget <= 0 {
                *next = index;
                return Ok(false);
            }
            *budget -= cost;
            let passage = &mut self.passages[index];
            let mean = if index == first {
                let knot = &mut self.knots[index];
                if fresh {
                    let prior = self.prior.at::<S>(&knot.chi);
                    knot.filtered = prior.covariance;
                    prior.mean
                } else {
                    self.prior.mean_at::<S>(&knot.chi)
                }
            } else {
                let (before, knot) = self.knots.with_previous(index);
                if tracked {
                    if !G::IS_GROUP_AFFINE {
                        knot.track = passage.track(&before.chi);
                    }
                    let Passage { motion, inputs, .. } = &*passage;
                    if fresh {
                        let (p, q) = (&before.filtered, motion.noise());
                        let track = &knot.track;
                        track.carry_covariance(p, q, inputs, &mut knot.filtered);
                    }
                    knot.track.carry(&before.correction, inputs) + knot.offset::<S>(&before.chi)
                } else {
                    let (offset, predicted) =
                        passage.link::<S>(&before.chi, &knot.chi, &before.filtered);
                    knot.filtered = predicted;
                    passage.transition * before.correction + offset
                }
            };
            let knot = &mut self.knots[index];
            if fresh && (constant || index == last) {
                passage.predicted = knot.filtered;
            } else if index == last {
                knot.filtered = passage.predicted;
            }
            if (fresh || index == last) && !knot.weigh() {
                self.gains_hold = false;
                return Err(WindowError::InnovationNotPositiveDefinite);
            }
            knot.correct(&mean);
        }
        self.gains_hold = constant;
        *next = last + 1;
        Ok(true)
    }

    /// The disturbance smoother, and the step of all estimates, from the state before `end` back to the oldest.
    /// Whether it has come there. The `first` of an update keeps what the estimates were.
    fn back(
        &mut self,
        end: &mut usize,
        adjoint: &mut SVector<f64, D>,
        sum: &mut f64,
        first: bool,
        budget: &mut i64,
    ) -> bool {
        let tracked = self.is_tracked();
        let cost = self.work_back();
        let last = self.knots.len() - 1;
        while *end > 0 {
            if *budget <= 0 {
                return false;
            }
            *budget -= cost;
            *end -= 1;
            let (knot, passage) = (&mut self.knots[*end], &self.passages[*end]);
            let start = knot.smooth(*adjoint, *end == last);
            *sum += knot.correction.sum();
            *adjoint = if tracked {
                knot.track.carry_back(&start, &passage.inputs)
            } else {
                passage.transition.tr_mul(&start)
            };
            if first {
                knot.before = (knot.chi, knot.is_predicted);
            }
            step::<G, S, D>(knot);
        }
        true
    }
}

/// Moves the estimate by its correction.
fn step<G: InertialState<D>, S: Side, const D: usize>(knot: &mut Knot<G, D>) {
    let xi = if S::IS_LEFT {
        knot.correction
    } else {
        S::from_left(&knot.chi) * knot.correction
    };
    knot.chi = S::retract(&knot.chi, &xi);
    knot.is_predicted = false;
}
