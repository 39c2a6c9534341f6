//! Requests to a daemon: reset, set state, snapshot, barrier, smoothed window, pause, noise, configuration.

use std::time::{Duration, Instant};

use inekf_shared::clock::monotonic_ns;
use inekf_shared::message::{
    CONTROL_BARRIER, CONTROL_CONFIG, CONTROL_OK, CONTROL_PAUSE, CONTROL_RELOAD_NOISE,
    CONTROL_RESET, CONTROL_RESUME, CONTROL_SET_STATE, CONTROL_SMOOTHED, CONTROL_SNAPSHOT,
    ControlRequest, ControlResponse, ProcessNoise, StateVector, Zero, control_kind_name,
};
use inekf_shared::topic::Instance;
use inekf_shared::transport::{self, ControlClient, Node, TransportError, WakeNotifier};

use crate::attach::Attached;

/// A request was not granted.
///
/// ```
/// use inekf_client::control::ControlError;
///
/// let refused = ControlError::Refused { request: "smoothed", reason: "no smoother".to_owned() };
/// assert_eq!(refused.to_string(), "the daemon refused the request `smoothed`: no smoother");
/// ```
#[derive(Debug, thiserror::Error)]
pub enum ControlError {
    /// The daemon said no.
    #[error("the daemon refused the request `{request}`: {reason}")]
    Refused {
        /// What was asked.
        request: &'static str,
        /// Why not.
        reason: String,
    },
    /// No answer came.
    #[error("the daemon did not answer the request `{request}` within {seconds} s: is it running?")]
    Silent {
        /// What was asked.
        request: &'static str,
        /// How long was waited.
        seconds: f64,
    },
    /// The request could not be sent, or the answer not be received.
    #[error("the request `{request}` failed: {cause}")]
    Failed {
        /// What was asked.
        request: &'static str,
        /// iceoryx2's word for it.
        cause: String,
    },
}

/// Name of a controller's node, for people who list the nodes.
const NODE: &str = "inekf-control";

/// No configuration is longer, bytes.
const MAX_CONFIG_LEN: usize = 1 << 20;

/// Sends requests and waits for their answers.
///
/// If somebody removes the files in shared memory it attaches anew by itself at a later request.
///
/// ```no_run
/// use std::time::Duration;
///
/// use inekf_client::control::Controller;
/// use inekf_shared::topic::Instance;
///
/// // A daemon has to run.
/// let mut daemon = Controller::open(&Instance::new("car")?, Duration::from_secs(1))?;
/// println!("at {:?}", daemon.snapshot()?.p_w_m);
/// daemon.reset()?;
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// ```
/// use std::time::Duration;
///
/// use inekf_client::control::Controller;
/// use inekf_shared::message::{CONTROL_PAUSE, CONTROL_REFUSED, ControlResponse};
/// use inekf_shared::topic::Instance;
/// use inekf_shared::transport;
///
/// # let root = tempfile::tempdir_in("/tmp")?;
/// # let prefix = root.path().file_name().and_then(|name| name.to_str());
/// # let config = transport::config(root.path().to_str(), prefix)?;
/// # let node = || transport::open_node_with("doc", &config);
/// let instance = Instance::new("car")?;
/// let (ready, is_ready) = std::sync::mpsc::channel();
/// std::thread::scope(|scope| -> Result<(), Box<dyn std::error::Error>> {
///     // What a daemon does, twice:
///     scope.spawn(|| -> Result<(), Box<dyn std::error::Error + Send + Sync>> {
///         let node = node()?;
///         let server = transport::control(&node, &instance)?.server()?;
///         ready.send(())?;
///         loop {
///             let Some(request) = server.receive()? else { continue };
///             let mut answer = ControlResponse { request_id: request.request_id, ..Default::default() };
///             if request.kind == CONTROL_PAUSE {
///                 answer.status = CONTROL_REFUSED;
///                 answer.set_reason("it is busy");
///             }
///             request.send_copy(answer)?;
///             if request.kind == CONTROL_PAUSE {
///                 return Ok(());
///             }
///         }
///     });
///     is_ready.recv()?;
///     let mut controller = Controller::open_on(node()?, &instance, Duration::from_secs(20))?;
///     assert_eq!(controller.barrier()?.counters.lost, 0);
///     // A refused request says why.
///     let refused = controller.pause().expect_err("refused");
///     assert!(refused.to_string().ends_with("it is busy"));
///     Ok(())
/// })?;
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub struct Controller {
    ports: Attached<Ports>,
    next_id: u64,
    timeout: Duration,
}

/// What requests go through.
struct Ports {
    client: ControlClient,
    wake: WakeNotifier,
}

impl Ports {
    fn open(node: &Node, instance: &Instance) -> Result<Self, TransportError> {
        Ok(Self {
            client: transport::control(node, instance)?.client()?,
            wake: transport::wake(node, instance)?.notifier()?,
        })
    }
}

impl Controller {
    /// A controller of `instance` that waits up to `timeout` for each answer.
    ///
    /// # Errors
    /// [`TransportError`], naming the service and the remedy.
    ///
    /// ```
    /// use std::time::Duration;
    ///
    /// use inekf_client::control::Controller;
    /// use inekf_shared::topic::Instance;
    ///
    /// # let root = tempfile::tempdir_in("/tmp")?;
    /// # let prefix = root.path().file_name().expect("a name");
    /// # // SAFETY: this process has no other thread.
    /// # unsafe {
    /// #     std::env::set_var("INEKF_IPC_ROOT", root.path());
    /// #     std::env::set_var("INEKF_IPC_PREFIX", prefix);
    /// # }
    /// // Whether its daemon runs already or not; asked is it only then.
    /// let mut controller = Controller::open(&Instance::new("car")?, Duration::from_millis(1))?;
    /// let unanswered = controller.barrier().expect_err("nobody is there");
    /// assert!(!unanswered.to_string().is_empty());
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn open(instance: &Instance, timeout: Duration) -> Result<Self, TransportError> {
        Self::open_on(transport::open_node(NODE)?, instance, timeout)
    }

    /// The same on a node of one's own.
    ///
    /// # Errors
    /// [`TransportError`], naming the service and the remedy.
    ///
    /// ```
    /// use std::time::Duration;
    ///
    /// use inekf_client::control::Controller;
    /// use inekf_shared::topic::Instance;
    /// use inekf_shared::transport;
    ///
    /// # let root = tempfile::tempdir_in("/tmp")?;
    /// # let prefix = root.path().file_name().and_then(|name| name.to_str());
    /// # let config = transport::config(root.path().to_str(), prefix)?;
    /// # let node = || transport::open_node_with("doc", &config);
    /// let mut controller = Controller::open_on(node()?, &Instance::new("car")?, Duration::from_millis(1))?;
    /// assert!(controller.snapshot().is_err());
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn open_on(
        node: Node,
        instance: &Instance,
        timeout: Duration,
    ) -> Result<Self, TransportError> {
        Ok(Self {
            ports: Attached::open(node, NODE, instance, Ports::open)?,
            next_id: 1,
            timeout,
        })
    }

    /// Forgets the state and initialises anew.
    ///
    /// # Errors
    /// [`ControlError`].
    ///
    /// It is not run here, for it needs a daemon, another process:
    ///
    /// ```no_run
    /// # use std::time::Duration;
    /// # use inekf_client::control::Controller;
    /// # use inekf_shared::topic::Instance;
    /// # let mut controller = Controller::open(&Instance::new("car")?, Duration::from_secs(1))?;
    /// use inekf_shared::message::STATE_RUNNING;
    ///
    /// let answer = controller.reset()?;
    /// // It begins anew: what it waits for now is in the answer.
    /// assert_ne!(answer.state_code, STATE_RUNNING);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn reset(&mut self) -> Result<ControlResponse, ControlError> {
        self.request(CONTROL_RESET, StateVector::ZERO)
    }

    /// Continues from `state`.
    ///
    /// # Errors
    /// [`ControlError`].
    ///
    /// It is not run here, for it needs a daemon, another process:
    ///
    /// ```no_run
    /// # use std::time::Duration;
    /// # use inekf_client::control::Controller;
    /// # use inekf_shared::topic::Instance;
    /// # let mut controller = Controller::open(&Instance::new("car")?, Duration::from_secs(1))?;
    /// use inekf_shared::message::{MODEL_IMU, StateVector, Zero};
    ///
    /// controller.set_state(StateVector {
    ///     model: MODEL_IMU,
    ///     dimension: 0, // the covariance of the configuration
    ///     q_wb: [0.0, 0.0, 0.0, 1.0],
    ///     p_w_m: [12.0, 7.0, 0.0],
    ///     ..StateVector::ZERO
    /// })?;
    /// assert_eq!(controller.snapshot()?.p_w_m, [12.0, 7.0, 0.0]);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn set_state(&mut self, state: StateVector) -> Result<ControlResponse, ControlError> {
        self.request(CONTROL_SET_STATE, state)
    }

    /// The current state with its covariance.
    ///
    /// # Errors
    /// [`ControlError`].
    ///
    /// It is not run here, for it needs a daemon, another process:
    ///
    /// ```no_run
    /// # use std::time::Duration;
    /// # use inekf_client::control::Controller;
    /// # use inekf_shared::topic::Instance;
    /// # let mut controller = Controller::open(&Instance::new("car")?, Duration::from_secs(1))?;
    /// let state = controller.snapshot()?;
    /// // Its first entry is the variance of the roll, rad^2.
    /// println!("roll is known to {:.3} rad", state.covariance[0].sqrt());
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn snapshot(&mut self) -> Result<StateVector, ControlError> {
        Ok(self.request(CONTROL_SNAPSHOT, StateVector::ZERO)?.state)
    }

    /// Returns when everything sent before has been processed; the answer has the counters.
    ///
    /// # Errors
    /// [`ControlError`].
    ///
    /// It is not run here, for it needs a daemon, another process:
    ///
    /// ```no_run
    /// # use std::time::Duration;
    /// # use inekf_client::control::Controller;
    /// # use inekf_shared::topic::Instance;
    /// # let mut controller = Controller::open(&Instance::new("car")?, Duration::from_secs(1))?;
    /// let before = controller.barrier()?.counters;
    /// // .. feed a fix ..
    /// let after = controller.barrier()?.counters;
    /// assert!(after.accepted + after.gated > before.accepted + before.gated);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn barrier(&mut self) -> Result<ControlResponse, ControlError> {
        self.request(CONTROL_BARRIER, StateVector::ZERO)
    }

    /// Has the states in the window of the smoother published, for a [`SmoothedReader`](crate::read::SmoothedReader);
    /// the answer says how many they are, and under which request.
    ///
    /// # Errors
    /// [`ControlError`]; refused if the daemon has no smoother, or no state yet.
    ///
    /// ```
    /// use std::time::Duration;
    ///
    /// use inekf_client::control::Controller;
    /// use inekf_shared::message::{CONTROL_SMOOTHED, ControlResponse};
    /// use inekf_shared::topic::Instance;
    /// use inekf_shared::transport;
    ///
    /// # let root = tempfile::tempdir_in("/tmp")?;
    /// # let prefix = root.path().file_name().and_then(|name| name.to_str());
    /// # let config = transport::config(root.path().to_str(), prefix)?;
    /// # let node = || transport::open_node_with("doc", &config);
    /// let instance = Instance::new("car")?;
    /// let (ready, is_ready) = std::sync::mpsc::channel();
    /// std::thread::scope(|scope| -> Result<(), Box<dyn std::error::Error>> {
    ///     // What a daemon does, once:
    ///     scope.spawn(|| -> Result<(), Box<dyn std::error::Error + Send + Sync>> {
    ///         let node = node()?;
    ///         let server = transport::control(&node, &instance)?.server()?;
    ///         ready.send(())?;
    ///         loop {
    ///             let Some(request) = server.receive()? else { continue };
    ///             assert_eq!(request.kind, CONTROL_SMOOTHED);
    ///             let request_id = request.request_id;
    ///             request.send_copy(ControlResponse { request_id, smoothed: 10, ..Default::default() })?;
    ///             return Ok(());
    ///         }
    ///     });
    ///     is_ready.recv()?;
    ///     let mut controller = Controller::open_on(node()?, &instance, Duration::from_secs(20))?;
    ///     // Ten states of the window, to be read under the id of this request.
    ///     let answer = controller.smoothed()?;
    ///     assert_eq!((answer.smoothed, answer.request_id), (10, 1));
    ///     Ok(())
    /// })?;
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn smoothed(&mut self) -> Result<ControlResponse, ControlError> {
        self.request(CONTROL_SMOOTHED, StateVector::ZERO)
    }

    /// Has the daemon take no sample and no fix until [`Controller::unpause`].
    ///
    /// # Errors
    /// [`ControlError`].
    ///
    /// It is not run here, for it needs a daemon, another process:
    ///
    /// ```no_run
    /// # use std::time::Duration;
    /// # use inekf_client::control::Controller;
    /// # use inekf_shared::topic::Instance;
    /// # let mut controller = Controller::open(&Instance::new("car")?, Duration::from_secs(1))?;
    /// use inekf_shared::message::STATE_PAUSED;
    ///
    /// assert_eq!(controller.pause()?.state_code, STATE_PAUSED);
    /// controller.unpause()?;
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn pause(&mut self) -> Result<ControlResponse, ControlError> {
        self.request(CONTROL_PAUSE, StateVector::ZERO)
    }

    /// Ends a pause.
    ///
    /// # Errors
    /// [`ControlError`].
    ///
    /// It is not run here, for it needs a daemon, another process:
    ///
    /// ```no_run
    /// # use std::time::Duration;
    /// # use inekf_client::control::Controller;
    /// # use inekf_shared::topic::Instance;
    /// # let mut controller = Controller::open(&Instance::new("car")?, Duration::from_secs(1))?;
    /// use inekf_shared::message::STATE_PAUSED;
    ///
    /// assert_ne!(controller.unpause()?.state_code, STATE_PAUSED);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn unpause(&mut self) -> Result<ControlResponse, ControlError> {
        self.request(CONTROL_RESUME, StateVector::ZERO)
    }

    /// Uses this process noise from the next sample on.
    ///
    /// # Errors
    /// [`ControlError`]; refused if a number is out of its range.
    ///
    /// It is not run here, for it needs a daemon, another process:
    ///
    /// ```no_run
    /// # use std::time::Duration;
    /// # use inekf_client::control::Controller;
    /// # use inekf_shared::topic::Instance;
    /// # let mut controller = Controller::open(&Instance::new("car")?, Duration::from_secs(1))?;
    /// let noise = inekf_client::noise::parse("[noise]\ngyro_density = 3e-4\naccel_density = 2e-2\n")?;
    /// controller.reload_noise(noise)?;
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn reload_noise(&mut self, noise: ProcessNoise) -> Result<ControlResponse, ControlError> {
        self.send(ControlRequest {
            kind: CONTROL_RELOAD_NOISE,
            noise,
            ..ControlRequest::ZERO
        })
    }

    /// The text of the daemon's configuration, page by page.
    ///
    /// # Errors
    /// [`ControlError`]; failed if it is no text, or longer than any configuration.
    ///
    /// ```
    /// use std::time::Duration;
    ///
    /// use inekf_client::control::Controller;
    /// use inekf_shared::message::{ControlResponse};
    /// use inekf_shared::topic::Instance;
    /// use inekf_shared::transport;
    ///
    /// # let root = tempfile::tempdir_in("/tmp")?;
    /// # let prefix = root.path().file_name().and_then(|name| name.to_str());
    /// # let config = transport::config(root.path().to_str(), prefix)?;
    /// # let node = || transport::open_node_with("doc", &config);
    /// let instance = Instance::new("car")?;
    /// let (ready, is_ready) = std::sync::mpsc::channel();
    /// std::thread::scope(|scope| -> Result<(), Box<dyn std::error::Error>> {
    ///     // What a daemon does, until it has given the whole text:
    ///     scope.spawn(|| -> Result<(), Box<dyn std::error::Error + Send + Sync>> {
    ///         let node = node()?;
    ///         let server = transport::control(&node, &instance)?.server()?;
    ///         ready.send(())?;
    ///         loop {
    ///             let Some(request) = server.receive()? else { continue };
    ///             let text = "model = 'imu'\n".repeat(50);
    ///             let mut answer = ControlResponse { request_id: request.request_id, ..Default::default() };
    ///             answer.set_page(&text, request.argument as usize);
    ///             let is_last = request.argument as usize + answer.page().len() == text.len();
    ///             request.send_copy(answer)?;
    ///             if is_last {
    ///                 return Ok(());
    ///             }
    ///         }
    ///     });
    ///     is_ready.recv()?;
    ///     // Longer than one answer holds; it comes whole.
    ///     let mut controller = Controller::open_on(node()?, &instance, Duration::from_secs(20))?;
    ///     assert_eq!(controller.config()?, "model = 'imu'\n".repeat(50));
    ///     Ok(())
    /// })?;
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn config(&mut self) -> Result<String, ControlError> {
        let failed = |cause: &str| ControlError::Failed {
            request: control_kind_name(CONTROL_CONFIG),
            cause: cause.to_owned(),
        };
        let mut text = Vec::new();
        loop {
            let response = self.send(ControlRequest {
                kind: CONTROL_CONFIG,
                argument: text.len() as u32,
                ..ControlRequest::ZERO
            })?;
            text.extend_from_slice(response.page());
            if text.len() as u64 >= response.config_len || response.page().is_empty() {
                break;
            }
            if text.len() > MAX_CONFIG_LEN {
                return Err(failed("the text does not end"));
            }
        }
        String::from_utf8(text).map_err(|_| failed("the configuration is no text"))
    }

    fn request(&mut self, kind: u32, state: StateVector) -> Result<ControlResponse, ControlError> {
        self.send(ControlRequest {
            kind,
            state,
            ..ControlRequest::ZERO
        })
    }

    /// Sends a request under the next id, and waits for its answer.
    ///
    /// # Errors
    /// [`ControlError`].
    ///
    /// ```
    /// use std::time::Duration;
    ///
    /// use inekf_client::control::{ControlError, Controller};
    /// use inekf_shared::message::{CONTROL_SNAPSHOT, ControlRequest};
    /// # use inekf_shared::topic::Instance;
    /// # use inekf_shared::transport;
    ///
    /// # let root = tempfile::tempdir_in("/tmp")?;
    /// # let prefix = root.path().file_name().and_then(|name| name.to_str());
    /// # let config = transport::config(root.path().to_str(), prefix)?;
    /// # let node = || transport::open_node_with("doc", &config);
    /// // Nobody answers: it waits for as long as it may, and says so.
    /// let mut controller = Controller::open_on(node()?, &Instance::new("car")?, Duration::from_millis(1))?;
    /// let request = ControlRequest { kind: CONTROL_SNAPSHOT, ..ControlRequest::default() };
    /// assert!(matches!(controller.send(request), Err(ControlError::Silent { request: "snapshot", .. })));
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn send(&mut self, mut asked: ControlRequest) -> Result<ControlResponse, ControlError> {
        let request = control_kind_name(asked.kind);
        let failed = |cause: String| ControlError::Failed { request, cause };
        asked.request_id = self.next_id;
        self.next_id += 1;
        self.ports.look(monotonic_ns());
        let Some(ports) = self.ports.ports() else {
            return Err(failed(
                "its files in shared memory were removed, and cannot be opened again yet"
                    .to_owned(),
            ));
        };
        let pending = ports
            .client
            .send_copy(asked)
            .map_err(|error| failed(error.to_string()))?;
        let _ = ports.wake.notify();
        let started = Instant::now();
        loop {
            if let Some(response) = pending
                .receive()
                .map_err(|error| failed(error.to_string()))?
            {
                let answer = if response.status == CONTROL_OK {
                    Ok(*response)
                } else {
                    Err(ControlError::Refused {
                        request,
                        reason: response.reason().to_owned(),
                    })
                };
                self.ports.heard();
                return answer;
            }
            let waited = started.elapsed();
            if waited > self.timeout {
                return Err(ControlError::Silent {
                    request,
                    seconds: self.timeout.as_secs_f64(),
                });
            }
            // Spin for what a running daemon needs, then leave the processor to others.
            if waited > Duration::from_micros(200) {
                std::thread::sleep(Duration::from_micros(100));
            } else {
                std::hint::spin_loop();
            }
        }
    }
}
