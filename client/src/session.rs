//! One client's whole conversation with a daemon: feeding, reading and requesting.

use std::collections::VecDeque;
use std::time::Duration;

use anyhow::{Context, bail};
use inekf_shared::message::{
    ControlResponse, EstimateSe23, STATE_ALIGNING, STATE_WAITING, StateVector, reason_name,
    state_name, waiting_for_name,
};
use inekf_shared::topic::Instance;
use inekf_shared::transport;

use crate::control::Controller;
use crate::dataset::{Event, Meta};
use crate::feed::Feeder;
use crate::initial::state_vector;
use crate::model::{Estimate, Model};
use crate::read::{EstimateReader, model_of};

/// How long a daemon may take to answer.
const ANSWER_WITHIN: Duration = Duration::from_secs(5);
/// Inputs in flight at most when nothing may be lost: each may give two estimates, and the
/// reader's buffer holds 1024.
const IN_FLIGHT: usize = 256;
/// Estimates handed over for each row that is sent: as many as a row may give.
const HANDED_OVER_PER_ROW: usize = 2;
/// And at most this long a stretch of data: the daemon holds back a fix that is ahead of the
/// samples, but not one so far ahead that its clock seems wrong.
const IN_FLIGHT_NS: u64 = 10_000_000_000;

/// The model of the running daemon of `instance`.
///
/// ```no_run
/// use inekf_client::session::running_model;
/// use inekf_shared::topic::Instance;
///
/// println!("it estimates {}", running_model(&Instance::new("car")?)?);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// # Errors
/// No daemon answers, or it is of another version.
pub fn running_model(instance: &Instance) -> anyhow::Result<Model> {
    if let Some(model) = model_of(instance)? {
        return Ok(model);
    }
    require_answer(&mut Controller::open(instance, ANSWER_WITHIN)?, instance)?;
    if let Some(model) = model_of(instance)? {
        return Ok(model);
    }
    // A daemon answers, but its estimates are none of ours: opening them says what they are.
    transport::estimate::<EstimateSe23>(&transport::open_node("inekf-model")?, instance)?;
    bail!("the daemon of instance {instance} publishes no estimates: start it again")
}

/// Asks for a sign of life.
fn require_answer(controller: &mut Controller, instance: &Instance) -> anyhow::Result<()> {
    controller
        .barrier()
        .with_context(|| format!("no daemon of instance {instance} is running"))?;
    Ok(())
}

/// Ports of every kind to one daemon, whose model is that of the estimates `E`.
///
/// It is not run here, for it needs a daemon, another process:
///
/// ```no_run
/// use inekf_client::session::Session;
/// use inekf_client::simulate::{Scenario, SimulationOptions, simulate};
/// use inekf_shared::message::EstimateSe23;
/// use inekf_shared::topic::Instance;
///
/// let drive = simulate(Scenario::RoadCircuit, &SimulationOptions::default())?;
/// let mut session = Session::<EstimateSe23>::open(&Instance::new("car")?)?;
/// session.set_initial(&drive.meta)?;
/// let mut count = 0;
/// let mut take = |_| {
///     count += 1;
///     Ok(())
/// };
/// for event in drive.events() {
///     session.send_lossless(&event, &mut take)?;
/// }
/// let answer = session.settle(&mut take)?;
/// assert!(answer.counters.lost == 0 && count >= drive.imu.len());
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub struct Session<E: Estimate = EstimateSe23> {
    feeder: Feeder,
    reader: EstimateReader<E>,
    controller: Controller,
    in_flight: usize,
    settled_ns: u64,
    /// Estimates that have come and are not handed over yet.
    waiting: VecDeque<E>,
}

impl<E: Estimate> Session<E> {
    /// Opens all ports to `instance` and checks that its daemon answers.
    ///
    /// # Errors
    /// A port cannot be opened, the daemon has another model, or no daemon answers.
    ///
    /// It is not run here, for it needs a daemon, another process:
    ///
    /// ```no_run
    /// # use inekf_client::session::Session;
    /// # use inekf_shared::message::EstimateSe2;
    /// # use inekf_shared::topic::Instance;
    /// // A daemon that moves in the plane; one of another model is an error that says so.
    /// let session = Session::<EstimateSe2>::open(&Instance::new("cart")?)?;
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn open(instance: &Instance) -> anyhow::Result<Self> {
        let mut controller = Controller::open(instance, ANSWER_WITHIN)?;
        let reader = EstimateReader::open(instance)?;
        let feeder = Feeder::open(instance)?;
        require_answer(&mut controller, instance)?;
        Ok(Self {
            feeder,
            reader,
            controller,
            in_flight: 0,
            settled_ns: 0,
            waiting: VecDeque::with_capacity(HANDED_OVER_PER_ROW * IN_FLIGHT),
        })
    }

    /// Sets the daemon's state to the one the dataset starts from, if it names one.
    ///
    /// # Errors
    /// The state is not one of the daemon's model, or the daemon refuses it.
    ///
    /// It is not run here, for it needs a daemon, another process:
    ///
    /// ```no_run
    /// # use inekf_client::dataset::{Event, ImuRow, Meta};
    /// # use inekf_client::session::Session;
    /// # use inekf_shared::message::EstimateSe23;
    /// # use inekf_shared::topic::Instance;
    /// # let mut session = Session::<EstimateSe23>::open(&Instance::new("car")?)?;
    /// # let row = ImuRow { stamp_ns: 5, gyro_rps: [0.0; 3], accel_mps2: [0.0, 0.0, 9.81] };
    /// // As `initial` and `P0_diag` of a dataset say; without them the daemon begins as it is configured to.
    /// session.set_initial(&Meta::default())?;
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn set_initial(&mut self, meta: &Meta) -> anyhow::Result<()> {
        if let Some(state) = state_vector(meta, E::KIND)? {
            self.controller.set_state(state)?;
        }
        Ok(())
    }

    /// Sends one row. Never waits.
    ///
    /// # Errors
    /// It cannot be sent, or no daemon is there to get it.
    ///
    /// It is not run here, for it needs a daemon, another process:
    ///
    /// ```no_run
    /// # use inekf_client::dataset::{Event, ImuRow, Meta};
    /// # use inekf_client::session::Session;
    /// # use inekf_shared::message::EstimateSe23;
    /// # use inekf_shared::topic::Instance;
    /// # let mut session = Session::<EstimateSe23>::open(&Instance::new("car")?)?;
    /// # let row = ImuRow { stamp_ns: 5, gyro_rps: [0.0; 3], accel_mps2: [0.0, 0.0, 9.81] };
    /// session.send(&Event::Imu(row))?;
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn send(&mut self, event: &Event) -> anyhow::Result<()> {
        if self.feeder.send(event)? == 0 {
            bail!("the daemon has gone: it no longer listens");
        }
        Ok(())
    }

    /// Sends one row so that nothing is lost: after every so many rows it waits until the daemon
    /// has processed them, and hands the estimates that came to `take` while the daemon works on the next ones.
    ///
    /// # Errors
    /// As [`Session::send`], or the daemon does not answer, or an estimate was lost.
    ///
    /// It is not run here, for it needs a daemon, another process:
    ///
    /// ```no_run
    /// # use inekf_client::dataset::{Event, ImuRow, Meta};
    /// # use inekf_client::session::Session;
    /// # use inekf_shared::message::EstimateSe23;
    /// # use inekf_shared::topic::Instance;
    /// # let mut session = Session::<EstimateSe23>::open(&Instance::new("car")?)?;
    /// # let row = ImuRow { stamp_ns: 5, gyro_rps: [0.0; 3], accel_mps2: [0.0, 0.0, 9.81] };
    /// session.send_lossless(&Event::Imu(row), &mut |estimate| {
    ///     println!("{:?}", estimate.p_w_m);
    ///     Ok(())
    /// })?;
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn send_lossless(
        &mut self,
        event: &Event,
        take: &mut impl FnMut(E) -> anyhow::Result<()>,
    ) -> anyhow::Result<()> {
        let stamp_ns = event.stamp_ns();
        let stretch_ns = stamp_ns.saturating_sub(self.settled_ns);
        if self.in_flight >= IN_FLIGHT || (self.in_flight > 0 && stretch_ns > IN_FLIGHT_NS) {
            self.await_processed()?;
            self.collect()?;
        }
        if self.in_flight == 0 {
            self.settled_ns = stamp_ns;
        }
        self.send(event)?;
        self.in_flight += 1;
        let count = self.waiting.len().min(HANDED_OVER_PER_ROW);
        self.waiting.drain(..count).try_for_each(take)
    }

    /// Waits until everything sent has been processed.
    fn await_processed(&mut self) -> anyhow::Result<ControlResponse> {
        let response = self.controller.barrier()?;
        self.in_flight = 0;
        Ok(response)
    }

    /// Gets the estimates that have come. Never waits.
    fn collect(&mut self) -> anyhow::Result<()> {
        while let Some(estimate) = self.reader.next_estimate()? {
            self.waiting.push_back(estimate);
        }
        if self.reader.missed() > 0 {
            bail!(
                "{} estimates were lost: this process was held up for too long",
                self.reader.missed()
            );
        }
        Ok(())
    }

    /// Waits until everything sent has been processed, and hands over the estimates.
    ///
    /// # Errors
    /// As [`Session::send_lossless`].
    ///
    /// It is not run here, for it needs a daemon, another process:
    ///
    /// ```no_run
    /// # use inekf_client::dataset::{Event, ImuRow, Meta};
    /// # use inekf_client::session::Session;
    /// # use inekf_shared::message::EstimateSe23;
    /// # use inekf_shared::topic::Instance;
    /// # let mut session = Session::<EstimateSe23>::open(&Instance::new("car")?)?;
    /// # let row = ImuRow { stamp_ns: 5, gyro_rps: [0.0; 3], accel_mps2: [0.0, 0.0, 9.81] };
    /// session.send(&Event::Imu(row))?;
    /// let mut came = Vec::new();
    /// session.settle(&mut |estimate| {
    ///     came.push(estimate.head.stamp_ns);
    ///     Ok(())
    /// })?;
    /// assert_eq!(came.last(), Some(&5));
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn settle(
        &mut self,
        take: &mut impl FnMut(E) -> anyhow::Result<()>,
    ) -> anyhow::Result<ControlResponse> {
        let response = self.await_processed()?;
        self.take_estimates(take)?;
        Ok(response)
    }

    /// Hands over the estimates that have come. Never waits.
    ///
    /// # Errors
    /// An estimate was lost, or what `take` returns.
    ///
    /// It is not run here, for it needs a daemon, another process:
    ///
    /// ```no_run
    /// # use inekf_client::dataset::{Event, ImuRow, Meta};
    /// # use inekf_client::session::Session;
    /// # use inekf_shared::message::EstimateSe23;
    /// # use inekf_shared::topic::Instance;
    /// # let mut session = Session::<EstimateSe23>::open(&Instance::new("car")?)?;
    /// # let row = ImuRow { stamp_ns: 5, gyro_rps: [0.0; 3], accel_mps2: [0.0, 0.0, 9.81] };
    /// session.take_estimates(&mut |estimate| {
    ///     println!("{:?}", estimate.p_w_m);
    ///     Ok(())
    /// })?;
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn take_estimates(
        &mut self,
        take: &mut impl FnMut(E) -> anyhow::Result<()>,
    ) -> anyhow::Result<()> {
        self.collect()?;
        self.waiting.drain(..).try_for_each(take)
    }

    /// The requests, for what a session does not ask itself.
    ///
    /// It is not run here, for it needs a daemon, another process:
    ///
    /// ```no_run
    /// # use inekf_client::session::Session;
    /// # use inekf_shared::message::EstimateSe23;
    /// # use inekf_shared::topic::Instance;
    /// # let mut session = Session::<EstimateSe23>::open(&Instance::new("car")?)?;
    /// session.controller().reset()?;
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn controller(&mut self) -> &mut Controller {
        &mut self.controller
    }

    /// The daemon's state and covariance now.
    ///
    /// # Errors
    /// It has none yet, or does not answer.
    ///
    /// It is not run here, for it needs a daemon, another process:
    ///
    /// ```no_run
    /// # use inekf_client::dataset::{Event, ImuRow, Meta};
    /// # use inekf_client::session::Session;
    /// # use inekf_shared::message::EstimateSe23;
    /// # use inekf_shared::topic::Instance;
    /// # let mut session = Session::<EstimateSe23>::open(&Instance::new("car")?)?;
    /// # let row = ImuRow { stamp_ns: 5, gyro_rps: [0.0; 3], accel_mps2: [0.0, 0.0, 9.81] };
    /// // The covariance belongs to the left-invariant error, rotation first.
    /// println!("{:?}", &session.snapshot()?.covariance[..3]);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn snapshot(&mut self) -> anyhow::Result<StateVector> {
        Ok(self.controller.snapshot()?)
    }
}

/// Why there is no estimate, in words.
///
/// ```
/// use inekf_client::session::why_no_estimate;
/// use inekf_shared::message::{
///     ControlResponse, REASON_NOT_READY, STATE_WAITING, WAITING_FOR_POSITION, Zero,
/// };
///
/// let mut response = ControlResponse {
///     state_code: STATE_WAITING,
///     waiting_for: WAITING_FOR_POSITION,
///     ..ControlResponse::ZERO
/// };
/// response.rejected_by_reason[REASON_NOT_READY as usize] = 3;
/// assert_eq!(
///     why_no_estimate(&response),
///     "the daemon is waiting, waiting for: position; rejected 3 (not ready)"
/// );
/// ```
pub fn why_no_estimate(response: &ControlResponse) -> String {
    let mut text = format!("the daemon is {}", state_name(response.state_code));
    if matches!(response.state_code, STATE_WAITING | STATE_ALIGNING) {
        text += &format!(", waiting for: {}", waiting_for_name(response.waiting_for));
    }
    for (code, count) in response.rejected_by_reason.iter().enumerate() {
        if *count > 0 {
            let reason = reason_name(u32::try_from(code).unwrap_or(u32::MAX));
            text += &format!("; rejected {count} ({reason})");
        }
    }
    text
}
