//! Class 1 of \[LC\] III, the mean of the process, over the steps between two updates: the columns T.
//!
//! ```text
//! d <- F d + d_kappa / m        (LC (13)), zero again after an update
//! ```
//!
//! The same sum for every motion: odometry (`F = Ad_{kappa^-1}`), and an IMU on SE_2(3) with biases or without.
//! What differs is a [`Motion`]. Left-invariant, body axes at the end of the last step.

use core::ops::Range;

use nalgebra::{SMatrix, SVector};

use super::mismatch::{Declared, ProcessMismatch};
use super::odometry::OdometryStep;
use super::pose::{Pose, RigidPose};

/// Most process mismatches that are followed at a time: two scales, and a bias about each of three axes. Two points
/// of one body, whose distance is known, see no more than five dimensions either.
pub const MAX_PROCESS_MISMATCHES: usize = 5;

/// How many standard deviations of its own noise a travelled way, or a turn, must exceed to tell of a scale.
const GATE_SIGMAS: f64 = 5.0;

/// A lever below a micrometre (or a microsecond), squared, is rounding.
const NO_LEVER: f64 = 1e-12;

/// The part of the state that a mismatch of the mean acts on first.
///
/// ```
/// use inekf::model::{MeanMismatch, Part, ProcessMismatch};
///
/// // A wheel's scale acts on the way, a gyro's bias on the turn; the way follows from that later.
/// assert_eq!(ProcessMismatch::OdometryScale.part(), Part::Way);
/// assert_eq!(ProcessMismatch::OdometryRotationBias { axis: 0 }.part(), Part::Turn);
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Part {
    /// The rotation, rad.
    Turn,
    /// The velocity, m/s.
    Velocity,
    /// The position, m.
    Way,
}

impl Part {
    /// Its place in the tangent vector of G.
    fn rows<G: Pose<D, N>, const D: usize, const N: usize>(self) -> Range<usize> {
        match self {
            Self::Turn => 0..G::ROTATION_DIM,
            Self::Velocity => G::ROTATION_DIM..G::ROTATION_DIM + G::VELOCITY_DIM,
            Self::Way => G::POSITION..G::POSITION + N,
        }
    }

    fn norm_squared<G: Pose<D, N>, const D: usize, const N: usize>(
        self,
        column: &SVector<f64, D>,
    ) -> f64 {
        column.as_slice()[self.rows::<G, D, N>()]
            .iter()
            .map(|entry| entry * entry)
            .sum()
    }
}

/// A mismatch of class 1, of one parameter: how its column is judged.
///
/// ```
/// use inekf::model::{InertialScale, MeanMismatch, ProcessMismatch};
///
/// /// Whether its column is noise while nothing moves.
/// fn needs_motion(mismatch: impl MeanMismatch) -> bool {
///     mismatch.is_scale()
/// }
/// assert!(needs_motion(ProcessMismatch::OdometryScale) && needs_motion(InertialScale::Gyro));
/// assert!(!needs_motion(ProcessMismatch::OdometryRotationBias { axis: 0 }));
/// ```
pub trait MeanMismatch: Copy {
    /// What it acts on first.
    ///
    /// ```
    /// use inekf::model::{InertialMismatch, MeanMismatch, Part};
    /// use nalgebra::Vector3;
    ///
    /// // A force acts on the velocity first.
    /// let bias = InertialMismatch::AccelBias { axis_b: Vector3::x() };
    /// assert_eq!(bias.part(), Part::Velocity);
    /// ```
    fn part(&self) -> Part;

    /// Whether it multiplies that part: its column is noise then while the part is.
    ///
    /// ```
    /// use inekf::model::{MeanMismatch, ProcessMismatch};
    ///
    /// assert!(ProcessMismatch::OdometryTurnScale.is_scale());
    /// ```
    fn is_scale(&self) -> bool;

    /// Whether it is left for later ([`ProcessColumns::hide_unseen`]) while an observation does not see it.
    ///
    /// ```
    /// use inekf::model::{MeanMismatch, ProcessMismatch};
    ///
    /// // A bias turns the body where it stands, which no position sees yet; a way is seen at once.
    /// assert!(ProcessMismatch::OdometryRotationBias { axis: 0 }.can_wait());
    /// assert!(!ProcessMismatch::OdometryScale.can_wait());
    /// ```
    fn can_wait(&self) -> bool;
}

/// Variances along one axis of what the noise of the steps adds.
///
/// ```
/// use inekf::lie::SE2;
/// use inekf::model::{Motion, OdometryStep, PathNoise};
/// use nalgebra::{Matrix3, Vector3};
///
/// let step = OdometryStep::<SE2>::new(&Vector3::new(0.0, 10.0, 0.0), 2.0);
/// let q = Matrix3::identity() * 0.01;
///
/// // Nothing yet; then the variances of one step after another, each along one axis.
/// let mut path = PathNoise::default();
/// step.lengthen(&mut path, &q);
/// step.lengthen(&mut path, &q);
/// assert_eq!((path.turn, path.way), (0.02, 0.02));
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct PathNoise {
    /// Rotation, rad^2.
    pub turn: f64,
    /// Velocity, m^2/s^2.
    pub velocity: f64,
    /// Velocity with position, m^2/s.
    pub velocity_way: f64,
    /// Position, m^2.
    pub way: f64,
}

impl PathNoise {
    fn of(&self, part: Part) -> f64 {
        match part {
            Part::Turn => self.turn,
            Part::Velocity => self.velocity,
            Part::Way => self.way,
        }
    }
}

/// One step of a motion whose mean may be wrong.
///
/// ```
/// use inekf::lie::SE2;
/// use inekf::model::{Motion, OdometryStep, ProcessMismatch};
/// use nalgebra::Vector3;
///
/// let step = OdometryStep::<SE2>::new(&Vector3::new(0.0, 10.0, 0.0), 2.0);
///
/// /// Where a unit of the mismatch leads over two steps.
/// fn twice<M: Motion<3, 2>>(step: &M, mismatch: &M::Mismatch) -> Vector3<f64> {
///     let carry = step.carry();
///     carry(&carry(&Vector3::zeros(), mismatch), mismatch)
/// }
/// // The scale of ten metres ahead, twice.
/// assert_eq!(twice(&step, &ProcessMismatch::OdometryScale), Vector3::new(0.0, 20.0, 0.0));
/// ```
pub trait Motion<const D: usize, const N: usize>: Sized {
    /// What it moves.
    type State: Pose<D, N>;
    /// What can be declared of it.
    type Mismatch: MeanMismatch;
    /// What is known of its noise.
    type Noise;

    /// `F column + d_kappa / m`, left-invariant, D.
    ///
    /// ```
    /// use inekf::lie::SE2;
    /// use inekf::model::{Motion, OdometryStep, ProcessMismatch};
    /// use nalgebra::Vector3;
    ///
    /// let step = OdometryStep::<SE2>::new(&Vector3::new(0.0, 10.0, 0.0), 2.0);
    ///
    /// // Turned by 0.1 rad before: ten metres ahead then lead a metre to the side, and the bias turns on for two seconds.
    /// let carried = step.carry()(&Vector3::new(0.1, 0.0, 0.0), &ProcessMismatch::OdometryRotationBias { axis: 0 });
    /// assert!((carried - Vector3::new(2.1, 0.0, 1.0)).norm() < 1e-12);
    /// ```
    fn carry(&self) -> impl Fn(&SVector<f64, D>, &Self::Mismatch) -> SVector<f64, D>;

    /// Adds what the noise of this step adds to `path`.
    ///
    /// ```
    /// use inekf::model::{Discretisation, ImuIncrement, ImuInput, ImuNoise, Motion, PathNoise};
    /// use nalgebra::Vector3;
    ///
    /// let at_rest = ImuInput { omega_b: Vector3::zeros(), force_b: Vector3::new(0.0, 0.0, 9.80665) };
    /// let noise = ImuNoise { gyro_psd: 0.0, accel_psd: 0.03, gyro_bias_psd: 0.0, accel_bias_psd: 0.0 };
    /// let g_w = Vector3::new(0.0, 0.0, -9.80665);
    /// let interval = ImuIncrement::new(&at_rest, &g_w, 1.0, Discretisation::ZeroOrderHold);
    /// let mut path = PathNoise::default();
    /// Motion::<9, 3>::lengthen(&interval, &mut path, &noise);
    /// // White noise of a force: a walk of the velocity, and its integral with a third of that after a second.
    /// assert!((path.velocity - 0.03).abs() < 1e-15 && (path.way - 0.01).abs() < 1e-15);
    /// ```
    fn lengthen(&self, path: &mut PathNoise, noise: &Self::Noise);

    /// Two steps with no special direction: for a check at start-up.
    ///
    /// ```
    /// use inekf::lie::{LieGroup, SE2};
    /// use inekf::model::{Motion, OdometryStep};
    ///
    /// // No component vanishes.
    /// let [step, _] = <OdometryStep<SE2> as Motion<3, 2>>::in_general_position();
    /// assert!(step.kappa.log().iter().all(|component| component.abs() > 0.1));
    /// ```
    fn in_general_position() -> [Self; 2];
}

/// T, summed over the steps since the last update: `d <- F d + d_kappa / m`.
///
/// The columns are left-invariant, at the end of the last step. A scale's column is withheld while the way (or
/// the turn, or the velocity gained) is below five standard deviations of the noise of the steps: standing still, or
/// going straight on, its direction is noise. A bias turns the body where it stands, which no position tells until the
/// body has moved: then no gain meets `L H d = d`, and the column waits for an update that sees it
/// ([`hide_unseen`](Self::hide_unseen)).
///
/// ```
/// use inekf::lie::SE2;
/// use inekf::model::{Declared, OdometryStep, ProcessColumns, ProcessMismatch};
/// use nalgebra::{Matrix3, Vector3};
///
/// let step = OdometryStep::<SE2>::new(&Vector3::new(0.0, 10.0, 0.0), 2.0);
/// let q = Matrix3::identity() * 0.01;
/// let declared = [Declared::hard(ProcessMismatch::OdometryScale)];
/// let mut columns = ProcessColumns::new(&declared).expect("one of five");
/// // Two steps of ten metres, each known to 0.1 m.
/// columns.advance(&step, &q);
/// columns.advance(&step, &q);
/// let directions: Vec<_> = columns.active().map(|(_, direction)| direction).collect();
/// assert_eq!(directions, [Vector3::new(0.0, 20.0, 0.0)]);
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ProcessColumns<const D: usize, T = ProcessMismatch> {
    declared: [Option<Declared<T>>; MAX_PROCESS_MISMATCHES],
    columns: [SVector<f64, D>; MAX_PROCESS_MISMATCHES],
    above_noise: [bool; MAX_PROCESS_MISMATCHES],
    hidden: [bool; MAX_PROCESS_MISMATCHES],
    /// Of the steps that a column has gathered.
    noise: [PathNoise; MAX_PROCESS_MISMATCHES],
}

impl<const D: usize, T: MeanMismatch> ProcessColumns<D, T> {
    /// No motion yet. `None` if more than [`MAX_PROCESS_MISMATCHES`] are declared.
    ///
    /// ```
    /// use inekf::model::{Declared, ProcessColumns, ProcessMismatch};
    ///
    /// let scale = Declared::hard(ProcessMismatch::OdometryScale);
    /// assert!(ProcessColumns::<3>::new(&[scale; 5]).is_some());
    /// assert!(ProcessColumns::<3>::new(&[scale; 6]).is_none());
    /// ```
    pub fn new(declared: &[Declared<T>]) -> Option<Self> {
        if declared.len() > MAX_PROCESS_MISMATCHES {
            return None;
        }
        Some(Self {
            declared: core::array::from_fn(|i| declared.get(i).copied()),
            columns: [SVector::zeros(); MAX_PROCESS_MISMATCHES],
            above_noise: [true; MAX_PROCESS_MISMATCHES],
            hidden: [false; MAX_PROCESS_MISMATCHES],
            noise: [PathNoise::default(); MAX_PROCESS_MISMATCHES],
        })
    }

    /// Adds one step with its noise.
    ///
    /// ```
    /// use inekf::lie::SE2;
    /// use inekf::model::{Declared, OdometryStep, ProcessColumns, ProcessMismatch};
    /// use nalgebra::{Matrix3, Vector3};
    ///
    /// let step = OdometryStep::<SE2>::new(&Vector3::new(0.0, 10.0, 0.0), 2.0);
    /// let q = Matrix3::identity() * 0.01;
    /// let declared = [Declared::hard(ProcessMismatch::OdometryScale)];
    /// let mut columns = ProcessColumns::new(&declared).expect("one of five");
    /// // Twenty centimetres, known to ten: which way the wheels went is noise.
    /// let creeping = OdometryStep::<SE2>::new(&Vector3::new(0.0, 0.2, 0.0), 1.0);
    /// columns.advance(&creeping, &q);
    /// assert_eq!(columns.active().count(), 0);
    /// // Ten metres more are not.
    /// columns.advance(&step, &q);
    /// assert_eq!(columns.active().count(), 1);
    /// ```
    pub fn advance<M: Motion<D, N, Mismatch = T>, const N: usize>(
        &mut self,
        step: &M,
        noise: &M::Noise,
    ) {
        self.carry(step);
        for (i, declared) in self.declared.iter().enumerate() {
            let Some(Declared { mismatch, .. }) = declared else {
                continue;
            };
            step.lengthen(&mut self.noise[i], noise);
            let part = mismatch.part();
            let size = part.norm_squared::<M::State, D, N>(&self.columns[i]);
            let least = GATE_SIGMAS * GATE_SIGMAS * self.noise[i].of(part);
            self.above_noise[i] = !mismatch.is_scale() || size >= least;
        }
    }

    fn carry<M: Motion<D, N, Mismatch = T>, const N: usize>(&mut self, step: &M) {
        let carry = step.carry();
        for (column, declared) in self.columns.iter_mut().zip(&self.declared) {
            if let Some(Declared { mismatch, .. }) = declared {
                *column = carry(column, mismatch);
            }
        }
    }

    /// The columns after two steps of the motion M with no special direction: for a check at start-up
    /// ([`Constrained::check`](crate::filter::Constrained::check)). `None` as in [`new`](Self::new).
    ///
    /// ```
    /// use inekf::lie::SE2;
    /// use inekf::model::{Declared, OdometryStep, ProcessColumns, ProcessMismatch};
    ///
    /// let bias = Declared::hard(ProcessMismatch::OdometryRotationBias { axis: 0 });
    /// let columns =
    ///     ProcessColumns::<3>::in_general_motion::<OdometryStep<SE2>, 2>(&[bias]).expect("one of five");
    /// // After two steps it has led astray, too: every row says something.
    /// let (_, direction) = columns.active().next().expect("active");
    /// assert!(direction.iter().all(|row| row.abs() > 0.01));
    /// ```
    pub fn in_general_motion<M: Motion<D, N, Mismatch = T>, const N: usize>(
        declared: &[Declared<T>],
    ) -> Option<Self> {
        let mut columns = Self::new(declared)?;
        for step in M::in_general_position() {
            columns.carry(&step);
        }
        Some(columns)
    }

    /// Hides the hard constraints that [can wait](MeanMismatch::can_wait) and of which an observation with the Jacobian
    /// `h` (M x D, left-invariant) sees too little: of a rotation, the lever `|H d| / |rotation of d|`, m, is below five
    /// standard deviations of the noise of the way that it has gathered; of a velocity, `|H d| / |velocity of d|`, s, is rounding. They
    /// are hidden from one update, and what they have gathered outlasts the [`reset`](Self::reset) after it: a gain
    /// leaves an error as it is that the observation does not see, `(I - L H) d = d`.
    ///
    /// ```
    /// use inekf::lie::SE2;
    /// use inekf::model::{Declared, OdometryStep, ProcessColumns, ProcessMismatch};
    /// use nalgebra::{Matrix2x3, Matrix3, Vector3};
    ///
    /// let step = OdometryStep::<SE2>::new(&Vector3::new(0.0, 10.0, 0.0), 2.0);
    /// let q = Matrix3::identity() * 0.01;
    /// let bias = [Declared::hard(ProcessMismatch::OdometryRotationBias { axis: 0 })];
    /// let mut columns = ProcessColumns::new(&bias).expect("one of five");
    /// let position = Matrix2x3::new(0.0, 1.0, 0.0, 0.0, 0.0, 1.0);
    /// // Standing, a bias turns the vehicle where it is: no position tells, and the bias waits.
    /// columns.advance(&OdometryStep::<SE2>::new(&Vector3::zeros(), 2.0), &q);
    /// columns.hide_unseen::<SE2, 2, 2>(&position);
    /// assert_eq!(columns.active().count(), 0);
    /// // Once it has gone on, it shows, with all that was gathered.
    /// columns.reset();
    /// columns.advance(&step, &q);
    /// columns.hide_unseen::<SE2, 2, 2>(&position);
    /// assert_eq!(columns.active().next().map(|(_, direction)| direction.x), Some(4.0));
    /// ```
    pub fn hide_unseen<G: Pose<D, N>, const N: usize, const M: usize>(
        &mut self,
        h: &SMatrix<f64, M, D>,
    ) {
        for (i, declared) in self.declared.iter().enumerate() {
            let Some(Declared { mismatch, sigma }) = declared else {
                continue;
            };
            let column = &self.columns[i];
            let lever = match mismatch.part() {
                Part::Turn => (GATE_SIGMAS * GATE_SIGMAS * self.noise[i].way).max(NO_LEVER),
                Part::Velocity | Part::Way => NO_LEVER,
            };
            let part = mismatch.part().norm_squared::<G, D, N>(column);
            let unseen = (h * column).norm_squared() <= lever * part;
            self.hidden[i] = mismatch.can_wait() && sigma.is_infinite() && part > 0.0 && unseen;
        }
    }

    /// Forgets the way: after an update. What was hidden from it goes on.
    ///
    /// ```
    /// use inekf::lie::SE2;
    /// use inekf::model::{Declared, OdometryStep, ProcessColumns, ProcessMismatch};
    /// use nalgebra::{Matrix3, Vector3};
    ///
    /// let step = OdometryStep::<SE2>::new(&Vector3::new(0.0, 10.0, 0.0), 2.0);
    /// let q = Matrix3::identity() * 0.01;
    /// let declared = [Declared::hard(ProcessMismatch::OdometryScale)];
    /// let mut columns = ProcessColumns::new(&declared).expect("one of five");
    /// columns.advance(&step, &q);
    /// columns.reset();
    /// assert_eq!(columns, ProcessColumns::new(&declared).expect("one of five"));
    /// ```
    pub fn reset(&mut self) {
        for i in 0..MAX_PROCESS_MISMATCHES {
            if !self.hidden[i] {
                self.columns[i] = SVector::zeros();
                self.noise[i] = PathNoise::default();
            }
        }
        self.hidden = [false; MAX_PROCESS_MISMATCHES];
        self.above_noise = [true; MAX_PROCESS_MISMATCHES];
    }

    /// Lets `remainder`, D x D of the left-invariant error, act on the columns: what an update without constraints
    /// leaves of them, `I - K H`.
    ///
    /// ```
    /// use inekf::lie::SE2;
    /// use inekf::model::{Declared, OdometryStep, ProcessColumns, ProcessMismatch};
    /// use nalgebra::{Matrix3, Vector3};
    ///
    /// let step = OdometryStep::<SE2>::new(&Vector3::new(0.0, 10.0, 0.0), 2.0);
    /// let q = Matrix3::identity() * 0.01;
    /// let declared = [Declared::hard(ProcessMismatch::OdometryScale)];
    /// let mut columns = ProcessColumns::new(&declared).expect("one of five");
    /// columns.advance(&step, &q);
    /// // An update that takes back half of every error.
    /// columns.transform(&(Matrix3::identity() * 0.5));
    /// assert_eq!(columns.active().next().map(|(_, direction)| direction.y), Some(5.0));
    /// ```
    pub fn transform(&mut self, remainder: &SMatrix<f64, D, D>) {
        for column in &mut self.columns {
            *column = remainder * *column;
        }
    }

    fn is_active(&self, index: usize) -> bool {
        self.above_noise[index] && !self.hidden[index]
    }

    /// Bit i is set where the column of mismatch i stands above its noise and is not hidden.
    ///
    /// ```
    /// use inekf::lie::SE2;
    /// use inekf::model::{Declared, OdometryStep, ProcessColumns, ProcessMismatch};
    /// use nalgebra::{Matrix3, Vector3};
    ///
    /// let step = OdometryStep::<SE2>::new(&Vector3::new(0.0, 10.0, 0.0), 2.0);
    /// let q = Matrix3::identity() * 0.01;
    /// let bias = Declared::hard(ProcessMismatch::OdometryRotationBias { axis: 0 });
    /// let scale = Declared::hard(ProcessMismatch::OdometryTurnScale);
    /// let mut columns = ProcessColumns::new(&[scale, bias]).expect("two of five");
    /// // Straight on: of a turn there is no scale to be seen.
    /// columns.advance(&step, &q);
    /// assert_eq!(columns.active_bits(), 0b10);
    /// ```
    pub fn active_bits(&self) -> u32 {
        let declared = self.declared.iter().enumerate();
        declared
            .filter(|(i, declared)| declared.is_some() && self.is_active(*i))
            .fold(0, |bits, (i, _)| bits | 1 << i)
    }

    /// The columns that stand above their noise and are not hidden, each with what was declared.
    ///
    /// ```
    /// use inekf::lie::SE2;
    /// use inekf::model::{Declared, OdometryStep, ProcessColumns, ProcessMismatch};
    /// use nalgebra::{Matrix3, Vector3};
    ///
    /// let step = OdometryStep::<SE2>::new(&Vector3::new(0.0, 10.0, 0.0), 2.0);
    /// let q = Matrix3::identity() * 0.01;
    /// let scale = Declared::soft(ProcessMismatch::OdometryScale, 0.05);
    /// let mut columns = ProcessColumns::new(&[scale]).expect("one of five");
    /// columns.advance(&step, &q);
    /// // Each with what was declared: half a metre of doubt, after ten metres.
    /// let (declared, direction) = columns.active().next().expect("active");
    /// assert!((declared.sigma * direction.norm() - 0.5).abs() < 1e-12);
    /// ```
    pub fn active(&self) -> impl Iterator<Item = (Declared<T>, SVector<f64, D>)> + '_ {
        let columns = self.declared.iter().zip(&self.columns).enumerate();
        columns
            .filter(|(i, _)| self.is_active(*i))
            .filter_map(|(_, (declared, column))| declared.map(|declared| (declared, *column)))
    }
}

impl<const D: usize> ProcessColumns<D> {
    /// [`in_general_motion`](Self::in_general_motion) of odometry on G.
    ///
    /// ```
    /// use inekf::lie::SE2;
    /// use inekf::model::{Declared, ProcessColumns, ProcessMismatch};
    ///
    /// let scale = Declared::hard(ProcessMismatch::OdometryScale);
    /// let columns = ProcessColumns::in_general_position::<SE2, 2>(&[scale]).expect("one of five");
    /// assert_eq!(columns.active_bits(), 1);
    /// ```
    pub fn in_general_position<G: RigidPose<D, N>, const N: usize>(
        declared: &[Declared<ProcessMismatch>],
    ) -> Option<Self> {
        Self::in_general_motion::<OdometryStep<G>, N>(declared)
    }
}
