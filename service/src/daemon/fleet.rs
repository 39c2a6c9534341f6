//! From a configuration to running vehicles: one or many, on one thread or several.
//!
//! Ports belong to the thread that made them, so each thread opens its own vehicles. Asleep between samples every
//! vehicle has a thread of its own; spinning, they are dealt onto as many threads as asked for.

use std::path::{Path, PathBuf};
use std::rc::Rc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Sender, channel};

use anyhow::Context;
use inekf_shared::clock::monotonic_ns;
use inekf_shared::message::EstimateMessage;
use inekf_shared::topic::Instance;
use inekf_shared::transport::{self, Node, TransportError, Watched};

use super::group::{Group, NODE};
use super::ports::Ports;
use super::realtime;
use super::run::{Ended, Work};
use super::vehicle::{Terms, Vehicle};
use crate::checkpoint::file::Identity;
use crate::checkpoint::{self, Keeper};
use crate::config::{Config, WaitMode, learned_in_words};
use crate::engine::resume::ResumeSettings;
use crate::engine::{self, Engine, History, Model, Use};

/// What stands for the name of the instance in the path of a checkpoint.
const INSTANCE_MARK: &str = "{instance}";

/// What is to be served.
///
/// ```
/// use std::sync::atomic::AtomicBool;
///
/// use inekf_service::config::Config;
/// use inekf_service::daemon::{Order, serve};
/// use inekf_shared::topic::Instance;
///
/// # let root = tempfile::tempdir_in("/tmp")?;
/// # let prefix = root.path().file_name().expect("a name");
/// # // SAFETY: this process has no other thread yet.
/// # unsafe {
/// #     std::env::set_var("INEKF_IPC_ROOT", root.path());
/// #     std::env::set_var("INEKF_IPC_PREFIX", prefix);
/// # }
/// let config_text = "model = 'imu'\n[noise]\ngyro_density = 3e-4\naccel_density = 2e-2\n";
/// let config = Config::from_toml_str(config_text, "example")?;
/// // Set by a signal's handler, or as here before it has begun.
/// let stop = AtomicBool::new(true);
/// let order = Order {
///     config: &config,
///     config_text,
///     instances: &[Instance::new("car")?, Instance::new("van")?],
///     stepped: false,
///     stop: &stop,
/// };
/// // Many vehicles, one configuration.
/// let mut ready = 0;
/// serve(&order, || {
///     ready += 1;
///     Ok(())
/// })?;
/// // Said once, when the ports of all are open.
/// assert_eq!(ready, 1);
/// # Ok::<(), anyhow::Error>(())
/// ```
#[derive(Clone, Copy, Debug)]
pub struct Order<'a> {
    /// The configuration, one for all.
    pub config: &'a Config,
    /// Its text.
    pub config_text: &'a str,
    /// The vehicles, at least one.
    pub instances: &'a [Instance],
    /// Whether inputs come in requests, one by one.
    pub stepped: bool,
    /// Set from outside to end it all.
    pub stop: &'a AtomicBool,
}

/// Serves every vehicle until `stop` is set; `ready` is called once all ports are open.
///
/// # Errors
/// A port cannot be opened or fails for good, or the configuration cannot be run. One thread's failure ends all.
///
/// ```
/// use std::sync::atomic::AtomicBool;
///
/// use inekf_service::config::Config;
/// use inekf_service::daemon::{Order, serve};
/// use inekf_shared::topic::Instance;
///
/// # let root = tempfile::tempdir_in("/tmp")?;
/// # let prefix = root.path().file_name().expect("a name");
/// # // SAFETY: this process has no other thread yet.
/// # unsafe {
/// #     std::env::set_var("INEKF_IPC_ROOT", root.path());
/// #     std::env::set_var("INEKF_IPC_PREFIX", prefix);
/// # }
/// let config_text = "model = 'imu'\n[noise]\ngyro_density = 3e-4\naccel_density = 2e-2\n";
/// let config = Config::from_toml_str(config_text, "example")?;
/// // Set by a signal's handler, or as here before it has begun.
/// let stop = AtomicBool::new(true);
/// let order = Order {
///     config: &config,
///     config_text,
///     instances: &[Instance::new("car")?],
///     stepped: false,
///     stop: &stop,
/// };
/// let mut is_ready = false;
/// serve(&order, || {
///     is_ready = true;
///     Ok(())
/// })?;
/// assert!(is_ready);
/// # Ok::<(), anyhow::Error>(())
/// ```
pub fn serve(order: &Order<'_>, ready: impl FnOnce() -> anyhow::Result<()>) -> anyhow::Result<()> {
    let threads = match order.config.runtime.wait {
        WaitMode::Event => order.instances.len(),
        WaitMode::Spin => order.config.fleet.threads.min(order.instances.len()),
    };
    let ready = || {
        // Better an error now than a SIGBUS at some later send.
        transport::reserve_shared_memory(&transport::config_from_env()?)?;
        ready()
    };
    if threads <= 1 {
        return thread(
            order,
            order.instances.iter(),
            0,
            transport::open_node,
            ready,
        );
    }
    // Once for all threads, before any of them meets what killed processes left.
    transport::sweep(&transport::config_from_env()?)?;
    std::thread::scope(|scope| {
        let (tell, open) = channel();
        let mut handles = Vec::with_capacity(threads);
        for index in 0..threads {
            let tell: Sender<()> = tell.clone();
            let work = move || {
                let own = order.instances.iter().skip(index).step_by(threads);
                let outcome = thread(order, own, index, transport::open_another_node, || {
                    // Whoever waits for it has gone only if another thread has failed.
                    let _ = tell.send(());
                    Ok(())
                });
                if outcome.is_err() {
                    order.stop.store(true, Ordering::Relaxed);
                }
                outcome
            };
            let spawned = std::thread::Builder::new()
                .name(format!("vehicles-{index}"))
                .spawn_scoped(scope, work)
                .context("starting a thread");
            match spawned {
                Ok(handle) => handles.push(handle),
                Err(error) => {
                    order.stop.store(true, Ordering::Relaxed);
                    return Err(error);
                }
            }
        }
        drop(tell);
        // Fewer messages than threads: one of them has failed, and says so below.
        let mut outcome = Ok(());
        if open.iter().take(threads).count() == threads {
            outcome = ready();
            if outcome.is_err() {
                order.stop.store(true, Ordering::Relaxed);
            }
        }
        for handle in handles {
            let ended = handle
                .join()
                .unwrap_or_else(|_| Err(anyhow::anyhow!("a thread of vehicles has panicked")));
            outcome = outcome.and(ended);
        }
        outcome
    })
}

/// How a thread gets its node.
type OpenNode = fn(&str) -> Result<Node, TransportError>;

/// Opens and runs the vehicles of one thread, the one with this `index`.
fn thread<'a>(
    order: &Order<'a>,
    instances: impl Iterator<Item = &'a Instance>,
    index: usize,
    open_node: OpenNode,
    ready: impl FnOnce() -> anyhow::Result<()>,
) -> anyhow::Result<()> {
    let instances: Vec<&Instance> = instances.collect();
    // Files of the process can be told to be this thread's only if there is no other.
    let watch = match instances.len() == order.instances.len() {
        true => Watched::of,
        false => Watched::services_of,
    };
    let mut group = Group::open(open_node(NODE)?, &instances, watch, |node, instance| {
        let open = Open {
            node,
            order,
            instance,
        };
        engine::build(order.config, open)?
    })?;
    realtime::apply(&order.config.runtime, index);
    ready()?;
    let outcome = loop {
        match group.run(&order.config.runtime, order.stop) {
            Ok(Ended::FilesGone) => {}
            ended => break ended.map(drop),
        }
        let which = match instances[..] {
            [instance] => instance.to_string(),
            _ => format!("{} of them", instances.len()),
        };
        tracing::warn!(
            instance = which,
            "files in shared memory were removed while they were in use; opening them anew. Feeders and readers of \
             this project's library attach again by themselves"
        );
        match group.reopened(&instances, watch, order.stop) {
            Some(again) => group = again,
            None => return Ok(()),
        }
        tracing::info!(instance = which, "the ports are open again");
    };
    let finished = group.finish();
    outcome.and(finished)
}

struct Open<'o, 'a> {
    node: Rc<Node>,
    order: &'o Order<'a>,
    instance: &'o Instance,
}

impl<'a> Use for Open<'_, 'a> {
    type Output = anyhow::Result<Box<dyn Work<'a> + 'a>>;

    fn with<M: Model + 'static, H: History<M> + 'static>(
        self,
        mut engine: Engine<M, H>,
    ) -> Self::Output {
        let Order {
            config,
            config_text,
            stepped,
            ..
        } = *self.order;
        let mut ports = Ports::open_on(self.node, self.instance, config, stepped)?;
        let mut terms = Terms {
            config,
            config_text,
            stepped,
            unused_checkpoint: false,
        };
        // After the ports: a second daemon of the instance must not touch the first one's file.
        let mut keeper = None;
        if let Some(path) = config.checkpoint.path.as_ref().filter(|_| !stepped) {
            let identity = Identity {
                instance: self.instance.to_string(),
                estimator: config.estimator.to_string(),
                model: M::Estimate::MODEL,
                dimension: config.error_states() as u32,
                mismatches: learned_in_words(config.mismatch, &config.mismatched),
            };
            let path = PathBuf::from(path.replace(INSTANCE_MARK, self.instance.as_str()));
            terms.unused_checkpoint = !resume(&mut engine, &mut ports, config, &path, &identity);
            let period_ns = config.checkpoint.period_ns();
            keeper = Some(Keeper::start(path, identity, period_ns, monotonic_ns())?);
        }
        Ok(Box::new(Vehicle::new(engine, ports, terms, keeper)))
    }
}

/// Has the engine continue from the checkpoint, if there is one. False if it is of no use; the log then says why.
fn resume<M: Model, H: History<M>>(
    engine: &mut Engine<M, H>,
    ports: &mut Ports<M>,
    config: &Config,
    path: &Path,
    identity: &Identity,
) -> bool {
    let state = match checkpoint::last_state(path, identity) {
        Ok(Some(state)) => state,
        Ok(None) => return true,
        Err(checkpoint::Unused) => return false,
    };
    match engine.resume_from(&state, ResumeSettings::new(&config.checkpoint)) {
        Ok(()) => {
            ports.journal.resumed(&state);
            true
        }
        Err(reason) => {
            tracing::warn!("checkpoint not used, starting as configured: {reason}");
            false
        }
    }
}
