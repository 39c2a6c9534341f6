//! What is asked of an engine: its state, a pause, other noise, another state, or that of an earlier life.

use inekf_shared::message::{ProcessNoise, StateVector};

use super::super::history::History;
use super::super::model::Model;
use super::super::resume::{Earlier, ResumeSettings, Resumption};
use super::super::time_base::TimeBase;
use super::Engine;

impl<M: Model, H: History<M>> Engine<M, H> {
    /// The current state and covariance, if there is one.
    ///
    /// ```
    #[doc = include_str!("../example.txt")]
    /// assert!(engine.snapshot().is_none());
    /// engine.sample(&at_rest(10), 0, &mut estimates);
    /// let state = engine.snapshot().expect("it has started");
    /// assert_eq!((state.model, state.dimension, state.stamp_ns), (MODEL_IMU, 15, 10_000_000));
    /// ```
    pub fn snapshot(&self) -> Option<StateVector> {
        self.history
            .newest()
            .map(|(stamp_ns, state)| self.model.snapshot(stamp_ns, state))
    }

    /// Takes no sample and no fix until [`Engine::unpause`]; they are counted as refused.
    ///
    /// ```
    #[doc = include_str!("../example.txt")]
    /// engine.sample(&at_rest(10), 0, &mut estimates);
    /// engine.pause();
    /// engine.sample(&at_rest(20), 0, &mut estimates);
    /// assert_eq!(engine.last_sample_ns(), Some(10_000_000));
    /// assert_eq!((engine.state().0, engine.tally().counters.rejected), (STATE_PAUSED, 1));
    /// ```
    pub fn pause(&mut self) {
        self.paused = true;
    }

    /// Takes samples and fixes again. The time since the last sample is to the estimate what a silence is.
    ///
    /// ```
    #[doc = include_str!("../example.txt")]
    /// engine.sample(&at_rest(10), 0, &mut estimates);
    /// engine.pause();
    /// engine.unpause();
    /// engine.sample(&at_rest(20), 0, &mut estimates);
    /// assert_eq!(engine.last_sample_ns(), Some(20_000_000));
    /// ```
    pub fn unpause(&mut self) {
        self.paused = false;
    }

    /// Uses this process noise from the next sample on.
    ///
    /// # Errors
    /// A sentence that names the fault and the range; the noise is then as it was.
    ///
    /// ```
    #[doc = include_str!("../example.txt")]
    /// let noise = ProcessNoise {
    ///     form: NOISE_DENSITY,
    ///     rotation: 1e-3,
    ///     translation: 1e-2,
    ///     ..ProcessNoise::UNGIVEN
    /// };
    /// assert_eq!(engine.reload_noise(&noise), Ok(()));
    /// let refused = engine.reload_noise(&ProcessNoise { rotation: -1.0, ..noise });
    /// assert!(refused.is_err_and(|reason| reason.contains("0 to 10")));
    /// ```
    pub fn reload_noise(&mut self, noise: &ProcessNoise) -> Result<(), &'static str> {
        self.model.reload_noise(noise)
    }

    /// Forgets the state and initialises anew.
    ///
    /// ```
    #[doc = include_str!("../example.txt")]
    /// engine.sample(&at_rest(10), 0, &mut estimates);
    /// engine.reset();
    /// assert!(engine.snapshot().is_none());
    /// // The next sample starts it as configured.
    /// engine.sample(&at_rest(20), 0, &mut estimates);
    /// assert!(engine.snapshot().is_some());
    /// ```
    pub fn reset(&mut self) {
        self.time_base = TimeBase::new(self.model.restart_gap_ns());
        self.requested = None;
        self.give_up_earlier();
        self.last_input = None;
        self.missing = 0;
        self.forget();
    }

    /// Continues from `state`; a stamp of 0 means the stamp of the last sample, or where the first one
    /// begins if none has come yet.
    ///
    /// # Errors
    /// A sentence that names the fault and the remedy; the estimate is then unchanged.
    ///
    /// ```
    #[doc = include_str!("../example.txt")]
    /// engine.sample(&at_rest(10), 0, &mut estimates);
    /// let mut state = engine.snapshot().expect("it has started");
    /// state.p_w_m = [7.0, 0.0, 0.0];
    /// engine.set_state(&state)?;
    /// assert_eq!(engine.snapshot().map(|state| state.p_w_m), Some([7.0, 0.0, 0.0]));
    /// // What cannot be a state changes nothing, and the reason is said.
    /// state.q_wb = [0.0; 4];
    /// assert!(engine.set_state(&state).is_err_and(|reason| reason.contains("unit quaternion")));
    /// # Ok::<(), &'static str>(())
    /// ```
    pub fn set_state(&mut self, state: &StateVector) -> Result<(), &'static str> {
        let given_ns = (state.stamp_ns != 0).then_some(state.stamp_ns);
        let last_ns = self.last_sample_ns();
        if let (Some(given_ns), Some(last_ns)) = (given_ns, last_ns) {
            if given_ns < last_ns {
                return Err(
                    "the state is older than the last sample: send it with a stamp of 0 (now) or \
                     reset first",
                );
            }
            if given_ns - last_ns > self.model.restart_gap_ns() {
                return Err("the state lies too far ahead of the last sample: check its clock");
            }
        }
        let requested = self.model.requested(state)?;
        let Some(stamp_ns) = given_ns.or(last_ns) else {
            self.give_up_earlier();
            self.requested = Some(requested);
            return Ok(());
        };
        let input = self
            .last_input
            .and_then(|(input_ns, input)| (input_ns == stamp_ns).then_some(input));
        self.start(stamp_ns, input, requested);
        Ok(())
    }

    /// Continues from a state of an earlier life at the first sample, if that is not too late by `settings` and nothing
    /// else sets the state before. To be called before the first input.
    ///
    /// # Errors
    /// A sentence that names the fault; the estimate then starts as configured.
    ///
    /// ```
    #[doc = include_str!("../example.txt")]
    /// use inekf_service::engine::resume::{Doubt, ResumeSettings, Resumption};
    ///
    /// engine.sample(&at_rest(10), 0, &mut estimates);
    /// let state = engine.snapshot().expect("it has started");
    ///
    /// let doubt = Doubt { turn_sigma: 0.1, accel_sigma: 0.5, speed_sigma: 1.0 };
    /// let mut next_life = InertialEngine::<NavState, Left, 15>::new(settings("inekf"));
    /// next_life.resume_from(&state, ResumeSettings { max_age_ns: 1_000_000_000, doubt })?;
    /// next_life.sample(&at_rest(510), 0, &mut estimates);
    /// assert_eq!(next_life.resumption(), Resumption::Resumed { age_ns: 500_000_000 });
    /// # Ok::<(), &'static str>(())
    /// ```
    pub fn resume_from(
        &mut self,
        state: &StateVector,
        settings: ResumeSettings,
    ) -> Result<(), &'static str> {
        let stamp_ns = state.stamp_ns;
        let state = self.model.requested(state)?;
        self.earlier = Some(Earlier {
            stamp_ns,
            state,
            settings,
        });
        self.resumption = Resumption::Waiting;
        Ok(())
    }
}
