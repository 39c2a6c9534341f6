//! A smoother over the newest W states, \[IS\] section V: what leaves the window is marginalised into a prior.
//!
//! States `chi_i` on SE_2(3), without or with biases; [`Preintegration`] leads from one to the next, a [`Fix`]
//! sees some of them. An update linearises prior, motions and fixes at the estimates and solves
//! \[IS\] (14) in left-invariant coordinates, Kalman forward, disturbance smoother backward: only innovation
//! covariances are inverted, so that Q = 0 and singular priors are exact. The estimates move by the retraction of
//! side S: [`Left`] is invariant smoothing, [`Right`](crate::filter::Right) its other side,
//! [`Gtsam`](crate::filter::Gtsam) and [`Forster`](crate::filter::Forster) are \[IS\] (23) and (22).
//!
//! Where nothing that enters the covariances depends on the estimate, the gains are constants, and the recursion of
//! the covariance is the left-invariant Kalman filter's: one covariance step for each new state, and a few
//! matrix-vector products for each state of the window and iteration. That holds for a state without biases, with
//! a prior of frozen covariance ([`PriorForm`]), the Jacobian of the motion's residual left out, a parametrisation
//! that is left-invariant to first order, and fixes of position and velocity with equal noise on all axes. Everything else is
//! linearised anew at each iteration; the window sees by itself which it is.
//!
//! An update can be done at once, or in slices between other work; much of the next one can be done before its fix is
//! there ([`Window::anticipate`]), and then the newest state is smoothed as soon as a filter would correct it. The result
//! is the same bit for bit.
//!
//! All memory is taken at construction. A second fix of one moment is a state of its own, at the end of a
//! motion of no length: [`Preintegration::new`], pushed as it is.

use core::fmt;
use core::marker::PhantomData;

use nalgebra::SMatrix;

use crate::filter::{Belief, Covariance, Left, Side, Verdict};
use crate::model::InertialState;
use crate::smoother::{Jacobians, Preintegration};

mod fix;
mod knot;
mod marginal;
mod prior;
mod ring;
mod solve;
mod track;
mod work;

use knot::{Knot, Passage};
use marginal::Cover;
use prior::Prior;
use ring::Ring;
use solve::{Ahead, Solve};
use track::{InputJacobian, Track};

pub use fix::Fix;
pub use prior::PriorForm;

/// How a window is kept.
///
/// ```
/// use inekf::smoother::{Jacobians, PriorForm, WindowOptions};
///
/// // What is fast: one iteration, covariances that do not depend on the estimate.
/// let options = WindowOptions::new(10);
/// assert_eq!((options.capacity, options.iterations), (10, 1));
/// assert_eq!((options.jacobians, options.prior), (Jacobians::Frozen, PriorForm::GroupMean));
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WindowOptions {
    /// W, the most states that the window holds; at least 1.
    pub capacity: usize,
    /// Gauss-Newton iterations for each update; at least 1.
    pub iterations: usize,
    /// The form of the prior that the window begins with.
    pub first_prior: PriorForm,
    /// The form of the priors that marginalisation leaves.
    pub prior: PriorForm,
    /// The derivatives of the motions' residuals.
    pub jacobians: Jacobians,
    /// An innovation with a larger normalised square than this is refused; infinity accepts all.
    pub gate: f64,
}

impl WindowOptions {
    /// One iteration, frozen covariances, no gate: the gains are constants wherever the state allows it.
    ///
    /// ```
    /// use inekf::smoother::WindowOptions;
    ///
    /// // Constant gains, unless something else is asked for.
    /// let careful = WindowOptions { iterations: 3, ..WindowOptions::new(10) };
    /// assert_eq!((careful.capacity, careful.gate), (10, f64::INFINITY));
    /// ```
    pub const fn new(capacity: usize) -> Self {
        Self {
            capacity,
            iterations: 1,
            first_prior: PriorForm::GroupMean,
            prior: PriorForm::GroupMean,
            jacobians: Jacobians::Frozen,
            gate: f64::INFINITY,
        }
    }
}

/// What an update did.
///
/// ```
/// use inekf::filter::{Belief, Covariance, Left, Verdict};
/// use inekf::lie::{LieGroup, SE23};
/// use inekf::model::VelocityObservation;
/// use inekf::smoother::{Window, WindowOptions};
/// use nalgebra::{Matrix3, SVector, Vector3};
///
/// let first =
///     Belief::new(SE23::identity(), Covariance::from_variances(&SVector::<f64, 9>::repeat(1.0)));
/// let mut window = Window::<SE23, Left, 9>::new(&first, &WindowOptions { gate: 16.0, ..WindowOptions::new(5) });
/// // 50 m/s where 1 m/s was sure: refused, and said by how much.
/// let wrong = VelocityObservation { velocity_w: Vector3::new(50.0, 0.0, 0.0), covariance_w: Matrix3::identity() };
/// let correction = window.update(wrong)?;
/// assert!(correction.verdict == Verdict::Gated && (correction.nis - 1250.0).abs() < 1e-6);
/// # Ok::<(), inekf::smoother::WindowError>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WindowCorrection {
    /// Whether the fix was used.
    pub verdict: Verdict,
    /// Normalised innovation squared of the new fix given all before it: chi-square with 3 degrees of
    /// freedom, 1 for a heading.
    pub nis: f64,
    /// Gauss-Newton iterations done.
    pub iterations: usize,
}

/// Why an update could not be done; the window is unchanged.
///
/// ```
/// use inekf::filter::{Belief, Covariance, Left};
/// use inekf::lie::{LieGroup, SE23};
/// use inekf::model::HeadingObservation;
/// use inekf::smoother::{Window, WindowError, WindowOptions};
/// use nalgebra::SVector;
///
/// let first =
///     Belief::new(SE23::identity(), Covariance::from_variances(&SVector::<f64, 9>::repeat(1.0)));
/// let mut window = Window::<SE23, Left, 9>::new(&first, &WindowOptions::new(5));
/// let fix = HeadingObservation { heading: 0.1, sigma: 0.1 };
/// assert!(window.update(fix).is_ok());
/// // One fix a state.
/// assert_eq!(window.update(fix), Err(WindowError::AlreadySeen));
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum WindowError {
    /// The newest state has been seen already.
    AlreadySeen,
    /// An innovation covariance is not positive definite: a noise that is not, or a broken prior.
    InnovationNotPositiveDefinite,
    /// The corrected states are not finite.
    NotFinite,
}

impl fmt::Display for WindowError {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str(match self {
            Self::AlreadySeen => {
                "the newest state of the window has a measurement already: push the motion to the next one, \
                 or a motion of no length"
            }
            Self::InnovationNotPositiveDefinite => {
                "the innovation covariance is not positive definite: check the measurement's covariance"
            }
            Self::NotFinite => "the smoothed states are not finite: check the measurement",
        })
    }
}

impl core::error::Error for WindowError {}

/// The newest states of a trajectory, smoothed.
///
/// ```
/// use inekf::filter::{Belief, Covariance, Left};
/// use inekf::lie::{LieGroup, SE23};
/// use inekf::model::{Discretisation, ImuInput, ImuNoise, PositionObservation};
/// use inekf::smoother::{Preintegration, Window, WindowOptions};
/// use nalgebra::{Matrix3, SVector, Vector3};
///
/// let first = Belief::new(SE23::identity(), Covariance::from_variances(&SVector::repeat(0.1)));
/// let mut window = Window::<SE23, Left, 9>::new(&first, &WindowOptions::new(3));
/// let at_rest = ImuInput { omega_b: Vector3::zeros(), force_b: Vector3::new(0.0, 0.0, 9.80665) };
/// let noise = ImuNoise { gyro_psd: 1e-6, accel_psd: 1e-4, gyro_bias_psd: 0.0, accel_bias_psd: 0.0 };
/// let g_w = Vector3::new(0.0, 0.0, -9.80665);
/// for _ in 0..5 {
///     let mut motion = Preintegration::new(&window.newest().mean);
///     motion.push(&at_rest, &g_w, 0.2, Discretisation::ZeroOrderHold, &noise);
///     window.push(&motion);
///     window.update(PositionObservation {
///         position_w: Vector3::new(0.3, 0.0, 0.0),
///         covariance_w: Matrix3::identity() * 0.01,
///         lever_arm_b: Vector3::zeros(),
///     })?;
/// }
/// assert_eq!(window.len(), 3);
/// assert!((window.newest().mean.position.x - 0.3).abs() < 0.05);
/// # Ok::<(), inekf::smoother::WindowError>(())
/// ```
#[derive(Clone, Debug)]
pub struct Window<G, S, const D: usize> {
    options: WindowOptions,
    prior: Prior<G, D>,
    /// Never empty. One more finds room for a moment: a state enters before another leaves.
    knots: Ring<Knot<G, D>>,
    /// Of the same states.
    passages: Ring<Passage<G, D>>,
    /// How many fixes in the window have noise that differs by direction.
    anisotropic: usize,
    /// Whether the gains that are stored are those of terms which do not depend on the estimate.
    gains_hold: bool,
    /// The update that is under way.
    solve: Option<Solve<D>>,
    /// What was predicted for the newest state before that, if it changes that.
    kept: Option<Covariance<D>>,
    /// What has been done for the next update.
    ahead: Option<Ahead>,
    /// How far the covariance of the oldest state has come.
    cover: Cover<D>,
    /// Whether the oldest state has been marginalised: it is there to be looked at, until the next one comes.
    gone: bool,
    side: PhantomData<S>,
}

impl<G: InertialState<D>, S: Side, const D: usize> Window<G, S, D> {
    /// A window that holds one state, with `first` as its prior. The only place that allocates.
    ///
    /// ```
    /// use inekf::filter::{Belief, Covariance, Left};
    /// use inekf::lie::{LieGroup, SE23};
    /// use inekf::smoother::{Window, WindowOptions};
    /// use nalgebra::SVector;
    ///
    /// let first = Belief::new(SE23::identity(), Covariance::from_variances(&SVector::repeat(0.1)));
    /// let mut window = Window::<SE23, Left, 9>::new(&first, &WindowOptions::new(3));
    /// // One state, as it was given.
    /// assert_eq!((window.len(), window.newest()), (1, first));
    /// ```
    pub fn new(first: &Belief<G, Left, D>, options: &WindowOptions) -> Self {
        let options = WindowOptions {
            capacity: options.capacity.max(1),
            iterations: options.iterations.max(1),
            ..*options
        };
        let (knot, passage) = Self::beginning(first);
        let slots = options.capacity + 1;
        let mut window = Self {
            options,
            prior: Self::first_prior(first, &options),
            knots: Ring::new(&knot, slots),
            passages: Ring::new(&passage, slots),
            anisotropic: 0,
            gains_hold: false,
            solve: None,
            kept: None,
            ahead: None,
            cover: Cover::default(),
            gone: false,
            side: PhantomData,
        };
        window.restart(first);
        window
    }

    /// Forgets all states and begins again with `first`.
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
    /// window.restart(&first);
    /// assert_eq!((window.len(), window.newest()), (1, first));
    /// # Ok::<(), WindowError>(())
    /// ```
    pub fn restart(&mut self, first: &Belief<G, Left, D>) {
        self.prior = Self::first_prior(first, &self.options);
        self.knots.clear();
        self.passages.clear();
        (*self.knots.enter(), *self.passages.enter()) = Self::beginning(first);
        self.anisotropic = 0;
        self.solve = None;
        self.ahead = None;
        self.cover.forget();
        self.gone = false;
        self.gains_hold = self.is_constant();
    }

    /// The first state, with no motion before it.
    fn beginning(first: &Belief<G, Left, D>) -> (Knot<G, D>, Passage<G, D>) {
        let passage = Passage {
            motion: Preintegration::new(&first.mean),
            transition: SMatrix::identity(),
            inputs: InputJacobian::zeros(),
            predicted: first.covariance,
        };
        let track = Track::new(&passage.motion.motion().step);
        let knot = Knot::new(first.mean, track, &first.covariance);
        (knot, passage)
    }

    fn first_prior(first: &Belief<G, Left, D>, options: &WindowOptions) -> Prior<G, D> {
        Prior::new::<S>(options.first_prior, &first.mean, &first.covariance)
    }

    /// Adds the state at the end of `motion`. If the window is full its oldest state leaves first, and its last
    /// estimate, smoothed by all fixes since, is returned. An update that is under way is finished before.
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
    /// // There is room for three. The fourth makes the oldest leave, with its last estimate.
    /// assert!(window.push(&second_of_rest).is_none() && window.push(&second_of_rest).is_none());
    /// window.update(seen_at(0.3))?;
    /// let oldest = window.states().next().copied();
    /// assert_eq!(window.push(&second_of_rest), oldest);
    /// # Ok::<(), WindowError>(())
    /// ```
    pub fn push(&mut self, motion: &Preintegration<G, D>) -> Option<G> {
        self.finish();
        let passage = self.passages.enter();
        passage.motion = *motion;
        self.knots.enter();
        let (newest, knot) = self.knots.with_previous(self.knots.len() - 1);
        let track = passage.track(&newest.chi);
        let (noise, inputs) = (motion.noise(), &passage.inputs);
        track.carry_covariance(&newest.filtered, noise, inputs, &mut passage.predicted);
        let chi = track.apply(&newest.chi).normalized();
        knot.begin(chi, track, &passage.predicted);
        self.cover.forget();
        (self.knots.len() > self.options.capacity).then(|| {
            if !self.gone {
                self.marginalise();
                self.ahead = None;
            }
            self.pop()
        })
    }

    /// Forgets the oldest state, which has been marginalised. Gives its estimate.
    fn pop(&mut self) -> G {
        self.gone = false;
        if let Some(ahead) = &mut self.ahead {
            ahead.next -= 1;
        }
        let left = self.knots[0].chi;
        self.knots.leave();
        self.passages.leave();
        left
    }

    /// Marginalises the oldest of several states: what is known from it becomes the prior of the next one.
    fn marginalise(&mut self) {
        let (fresh, tracked) = (self.must_linearise(), self.is_tracked());
        let first = &mut self.knots[0];
        if fresh {
            let prior = self.prior.at::<S>(&first.chi);
            // It was positive definite at the last update, if there is a fix.
            first.filtered = prior.covariance;
            first.weigh();
            first.correct(&prior.mean);
        } else {
            let wanted = self.prior.mean_at::<S>(&first.chi);
            first.correct(&wanted);
        }
        self.anisotropic -= usize::from(first.fix.is_some_and(|fix| !fix.is_isotropic()));

        let (first, next) = self.knots.with_previous(1);
        let passage = &mut self.passages[1];
        let mean = if tracked {
            if !G::IS_GROUP_AFFINE {
                next.track = passage.track(&first.chi);
            }
            let Passage {
                motion,
                inputs,
                predicted,
                ..
            } = passage;
            if fresh {
                let (p, q) = (&first.filtered, motion.noise());
                next.track.carry_covariance(p, q, inputs, predicted);
            }
            next.track.carry(&first.correction, inputs) + next.offset::<S>(&first.chi)
        } else {
            let (offset, predicted) = passage.link::<S>(&first.chi, &next.chi, &first.filtered);
            passage.predicted = predicted;
            passage.transition * first.correction + offset
        };
        let form = self.options.prior;
        self.prior
            .replace::<S>(form, &next.chi, &mean, &passage.predicted);
    }

    /// Whether the Jacobians of the motions' residuals are left out: then the tracks have F.
    fn is_tracked(&self) -> bool {
        self.options.jacobians == Jacobians::Frozen
    }

    /// Whether the linearised motions are the same at all estimates, but for their offsets.
    fn is_affine(&self) -> bool {
        G::IS_GROUP_AFFINE && S::Residual::IS_LEFT && self.is_tracked()
    }

    /// Whether nothing that enters the covariances depends on the estimates.
    fn is_constant(&self) -> bool {
        self.is_affine() && self.anisotropic == 0 && self.prior.is_constant::<S>()
    }

    fn must_linearise(&self) -> bool {
        !(self.gains_hold && self.is_constant())
    }

    fn newest_knot(&self) -> &Knot<G, D> {
        &self.knots[self.knots.len() - 1]
    }

    /// The newest state, with the covariance of its left-invariant error given all fixes, as linearised at the
    /// last update.
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
    /// window.update(seen_at(0.3))?;
    /// // The fix is ten times as good as what was known.
    /// let newest = window.newest();
    /// assert!((newest.mean.position.x - 0.3 * 10.0 / 11.0).abs() < 1e-9);
    /// assert!((newest.covariance.matrix()[(6, 6)] - 0.1 / 11.0).abs() < 1e-9);
    /// # Ok::<(), WindowError>(())
    /// ```
    pub fn newest(&self) -> Belief<G, Left, D> {
        let newest = self.newest_knot();
        Belief::new(newest.chi, newest.filtered)
    }

    /// The estimates of all states, oldest first.
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
    /// // Oldest first: the fix of the second tells of the first, too.
    /// assert!(window.states().all(|chi| chi.position.x > 0.0));
    /// # Ok::<(), WindowError>(())
    /// ```
    pub fn states(&self) -> impl ExactSizeIterator<Item = &G> + DoubleEndedIterator {
        self.knots.iter().map(|knot| &knot.chi)
    }

    /// How many states the window holds.
    ///
    /// ```
    /// # use inekf::model::{Discretisation, ImuInput, ImuNoise};
    /// # use inekf::smoother::Preintegration;
    /// # use nalgebra::Vector3;
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
    /// let mut window = Window::<SE23, Left, 9>::new(&first, &WindowOptions::new(3));
    /// for _ in 0..10 {
    ///     window.push(&second_of_rest);
    /// }
    /// // As many as there is room for.
    /// assert_eq!(window.len(), 3);
    /// ```
    pub fn len(&self) -> usize {
        self.knots.len()
    }

    /// Whether the window holds no state: never.
    ///
    /// ```
    /// use inekf::filter::{Belief, Covariance, Left};
    /// use inekf::lie::{LieGroup, SE23};
    /// use inekf::smoother::{Window, WindowOptions};
    /// use nalgebra::SVector;
    ///
    /// let first = Belief::new(SE23::identity(), Covariance::from_variances(&SVector::repeat(0.1)));
    /// let mut window = Window::<SE23, Left, 9>::new(&first, &WindowOptions::new(3));
    /// assert!(!window.is_empty());
    /// ```
    pub fn is_empty(&self) -> bool {
        self.knots.len() == 0
    }

    /// Whether the next push makes the oldest state leave.
    ///
    /// ```
    /// # use inekf::model::{Discretisation, ImuInput, ImuNoise};
    /// # use inekf::smoother::Preintegration;
    /// # use nalgebra::Vector3;
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
    /// let mut window = Window::<SE23, Left, 9>::new(&first, &WindowOptions::new(3));
    /// assert!(!window.is_full());
    /// window.push(&second_of_rest);
    /// window.push(&second_of_rest);
    /// assert!(window.is_full());
    /// ```
    pub fn is_full(&self) -> bool {
        self.knots.len() >= self.options.capacity
    }
}
