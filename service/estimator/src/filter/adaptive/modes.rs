//! How mismatches may behave, and how one behaviour follows another.
//!
//! [`Mode`] is one hypothesis, [`Switching`] the Markov chain between them, [`standard_modes`] the one choice of
//! both that serves every pattern: absent, constant, drawn anew each step, bursts, jumps, drifts.

use nalgebra::{SMatrix, SVector};

use crate::model::Unknowns;

/// A hypothesis on how P mismatches behave. All sigmas are in the units of the mismatches, in the order of
/// [`Unknowns`].
///
/// ```
/// use inekf::filter::Mode;
/// use nalgebra::Vector1;
///
/// // A scale that drifts by 1 % in the root of a second, beginning anywhere within 5 %.
/// let drifting = Mode {
///     entry_sigma: Vector1::new(0.05),
///     walk_sigma: Vector1::new(0.01),
///     white_sigma: Vector1::new(0.0),
///     white_interval_s: 0.1,
/// };
/// // After nine seconds it has gone by 3 %.
/// assert!((drifting.walk_sigma[0] * 9_f64.sqrt() - 0.03).abs() < 1e-15);
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Mode<const P: usize> {
    /// Standard deviation of the mismatches when the mode is entered; zero where they are absent.
    pub entry_sigma: SVector<f64, P>,
    /// What the mismatches gain as a random walk, per square root of a second.
    pub walk_sigma: SVector<f64, P>,
    /// The part drawn anew at every measurement, and every `white_interval_s` along the motion.
    pub white_sigma: SVector<f64, P>,
    /// How long a draw of the white part lasts along the motion, s: the noise then does not depend on the
    /// rate of the odometry.
    pub white_interval_s: f64,
}

impl<const P: usize> Mode<P> {
    /// Covariance that the mode adds over a step of `dt_s` seconds with the transition `f`, D x D: the white part
    /// through the columns T of the mismatches, the walk on the mismatches themselves.
    pub(super) fn noise_of_motion<const D: usize>(
        &self,
        f: &SMatrix<f64, D, D>,
        dt_s: f64,
    ) -> SMatrix<f64, D, D> {
        let mut noise = SMatrix::<f64, D, D>::zeros();
        if dt_s <= 0.0 {
            return noise;
        }
        let first = D - P;
        for k in 0..P {
            let white = self.white_sigma[k] * self.white_sigma[k] * self.white_interval_s / dt_s;
            for column in 0..first {
                let across = white * f[(column, first + k)];
                for row in 0..first {
                    noise[(row, column)] += f[(row, first + k)] * across;
                }
            }
            noise[(first + k, first + k)] = self.walk_sigma[k] * self.walk_sigma[k] * dt_s;
        }
        noise
    }

    /// Covariance that the white part adds to a measurement with Jacobian `h`, M x M.
    pub(super) fn noise_of_measurement<const D: usize, const M: usize>(
        &self,
        h: &SMatrix<f64, M, D>,
    ) -> SMatrix<f64, M, M> {
        let mut noise = SMatrix::<f64, M, M>::zeros();
        for k in 0..P {
            let column = h.column(D - P + k) * self.white_sigma[k];
            noise += column * column.transpose();
        }
        noise
    }
}

/// How modes follow each other: a continuous-time Markov chain over S modes.
///
/// ```
/// use inekf::filter::Switching;
///
/// // Bursts that begin every 5 s and last 2 s.
/// let bursts = Switching { initial: [1.0, 0.0], rates_hz: [[0.0, 0.2], [0.5, 0.0]] };
/// // In the long run they are there for two sevenths of the time: what goes in comes out.
/// let share = 2.0 / 7.0;
/// assert!(((1.0 - share) * bursts.rates_hz[0][1] - share * bursts.rates_hz[1][0]).abs() < 1e-15);
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Switching<const S: usize> {
    /// Weights at the start; they add up to one.
    pub initial: [f64; S],
    /// `rates_hz[i][j]`: from mode i to mode j, per second; the diagonal is the rate of drawing the
    /// mismatches of mode i anew.
    pub rates_hz: [[f64; S]; S],
}

impl<const S: usize> Switching<S> {
    /// Probability of going from mode i to mode j (i == j: of staying with a redraw) within `dt_s`, to first
    /// order in how many switches happen, and never more than certain.
    pub(super) fn probability(&self, i: usize, j: usize, dt_s: f64) -> f64 {
        let total: f64 = self.rates_hz[i].iter().sum();
        if total <= 0.0 {
            return 0.0;
        }
        -(-total * dt_s).exp_m1() * self.rates_hz[i][j] / total
    }

    /// Probability of no switch within `dt_s`.
    pub(super) fn staying(&self, i: usize, dt_s: f64) -> f64 {
        (-self.rates_hz[i].iter().sum::<f64>() * dt_s).exp()
    }
}

/// What is expected of one mismatch.
///
/// ```
/// use inekf::filter::{Expected, STANDARD_MODES, standard_modes};
///
/// // A wheel that is off by 3 %, and slips by 20 % at times.
/// let wheel = Expected { sigma: 0.03, burst_sigma: 0.2, of_motion: true };
/// let (modes, switching) = standard_modes(&[wheel], 0.1);
/// assert_eq!(modes.len(), STANDARD_MODES);
/// assert!((switching.initial.iter().sum::<f64>() - 1.0).abs() < 1e-12);
/// // In the first it is absent.
/// assert_eq!(modes[0].entry_sigma[0], 0.0);
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Expected {
    /// How large it is when it lasts, 1 sigma.
    pub sigma: f64,
    /// How large it is in a burst, 1 sigma.
    pub burst_sigma: f64,
    /// Whether it is a [`ProcessMismatch`](crate::model::ProcessMismatch); else it is one of a measurement.
    pub of_motion: bool,
}

impl Expected {
    /// What is expected of each of the P parameters of `unknowns`: these standard deviations, zero for a parameter
    /// that means nothing.
    ///
    /// ```
    /// use inekf::filter::Expected;
    /// use inekf::model::{OutputMismatch, ProcessMismatch, Unknowns};
    /// use nalgebra::Vector2;
    ///
    /// let source = OutputMismatch::MeasurementScale { source: 0 };
    /// let unknowns = Unknowns::new::<2, 2>(&[ProcessMismatch::OdometryScale], &[source]).expect("two");
    /// let [wheel, source] = Expected::of(&unknowns, &Vector2::new(0.03, 0.01), &Vector2::new(0.2, 0.1));
    /// assert!(wheel.of_motion && !source.of_motion);
    /// assert_eq!((wheel.sigma, source.burst_sigma), (0.03, 0.1));
    /// ```
    pub fn of<const P: usize>(
        unknowns: &Unknowns,
        sigmas: &SVector<f64, P>,
        burst_sigmas: &SVector<f64, P>,
    ) -> [Self; P] {
        core::array::from_fn(|k| Self {
            sigma: sigmas[k],
            burst_sigma: burst_sigmas[k],
            of_motion: unknowns.is_of_motion(k),
        })
    }
}

/// How many modes the [`standard_modes`] bank has.
pub const STANDARD_MODES: usize = 9;

/// The modes that one configuration for any mismatch needs, and how they follow each other.
///
/// | mode | mismatches | white part | regime |
/// |---|---|---|---|
/// | 0 | absent | | absent |
/// | 1 | constant | | constant |
/// | 2 | constant | all | noisy |
/// | 3 | constant | motion only | noisy motion |
/// | 4 | absent | | bursts, between two |
/// | 5 | all, constant | | bursts |
/// | 6 | motion only, constant | | bursts |
/// | 7 | drifting | | drifting |
/// | 8 | constant | measurements only | noisy measurements |
///
/// Regimes follow each other once in a quarter of an hour; bursts begin every 5 s and last 2 s; what is
/// constant jumps or begins to drift every 100 s. `white_interval_s` is that of [`Mode`].
///
/// ```
/// use inekf::filter::{Expected, standard_modes};
///
/// let source = Expected { sigma: 0.05, burst_sigma: 0.3, of_motion: false };
/// let (modes, _) = standard_modes(&[source], 0.1);
/// // Mode 3 is noise on the motion only: a source has none of it. Mode 8 is noise of measurements.
/// assert_eq!(modes[3].white_sigma[0], 0.0);
/// assert!(modes[8].white_sigma[0] > 0.0);
/// ```
pub fn standard_modes<const P: usize>(
    expected: &[Expected; P],
    white_interval_s: f64,
) -> ([Mode<P>; STANDARD_MODES], Switching<STANDARD_MODES>) {
    /// A walk reaches the expected size in 30 s: sigma / sqrt(30 s).
    const WALK_SHARE: f64 = 0.18;
    const REGIME_HZ: f64 = 1e-3;
    const ONSET_HZ: f64 = 0.1;
    const END_HZ: f64 = 0.35;
    const REDRAW_HZ: f64 = 0.15;
    const JUMP_HZ: f64 = 0.005;

    let zero = SVector::<f64, P>::zeros();
    let lasting = SVector::from_fn(|k, _| expected[k].sigma);
    let burst = SVector::from_fn(|k, _| expected[k].burst_sigma);
    let of_motion = SVector::from_fn(|k, _| if expected[k].of_motion { 1.0 } else { 0.0 });
    let mode = |entry_sigma, walk_sigma, white_sigma| Mode {
        entry_sigma,
        walk_sigma,
        white_sigma,
        white_interval_s,
    };
    let absent = mode(zero, zero, zero);
    let modes = [
        absent,
        mode(lasting, zero, zero),
        mode(lasting, zero, lasting),
        mode(lasting, zero, lasting.component_mul(&of_motion)),
        absent,
        mode(burst, zero, zero),
        mode(burst.component_mul(&of_motion), zero, zero),
        mode(lasting, lasting * WALK_SHARE, zero),
        mode(lasting, zero, lasting - lasting.component_mul(&of_motion)),
    ];

    // "No mismatch at all" needs little credit at the start: it predicts sharply, and wins where it is true.
    let initial = [0.02, 0.4, 0.1, 0.1, 0.01, 0.1, 0.07, 0.1, 0.1];
    let regime = [0, 1, 2, 3, 4, 4, 4, 5, 6];
    let mut rates_hz = [[0.0; STANDARD_MODES]; STANDARD_MODES];
    for i in 0..STANDARD_MODES {
        for j in 0..STANDARD_MODES {
            if regime[i] != regime[j] {
                rates_hz[i][j] = REGIME_HZ * initial[j];
            }
        }
    }
    for burst in [5, 6] {
        rates_hz[4][burst] = ONSET_HZ;
        rates_hz[burst][4] = END_HZ;
        rates_hz[burst][burst] = REDRAW_HZ;
    }
    rates_hz[1][5] += JUMP_HZ;
    rates_hz[1][7] += JUMP_HZ;
    (modes, Switching { initial, rates_hz })
}
