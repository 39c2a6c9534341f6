//! The vehicles of one thread, which share a node, and who looks after its files: if files that others need in order to
//! attach are removed, all ports are opened anew, and the vehicles keep their states.

use std::rc::Rc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use inekf_shared::topic::Instance;
use inekf_shared::transport::{Node, TransportError, Watched, open_node, reserve_shared_memory};
use tracing::warn;

use super::guard::Guard;
use super::run::{Closed, Ended, Work, run};
use crate::config::Runtime;

/// Which files of a node are looked after: [`Watched::of`] or [`Watched::services_of`].
pub type Watch = fn(&Node) -> Result<Watched, TransportError>;

/// The vehicles of one thread on one node (a node of its own for each would have to look at those of all others), and
/// who looks after its files.
pub struct Group<'a> {
    vehicles: Vec<Box<dyn Work<'a> + 'a>>,
    guard: Guard,
    // After the vehicles, which have ports on it.
    node: Rc<Node>,
}

/// Between two tries to open ports anew.
const BETWEEN_TRIES: Duration = Duration::from_millis(100);

/// The name of the daemon's nodes, for people who list the nodes.
pub const NODE: &str = "inekf-service";

impl<'a> Group<'a> {
    /// Opens these vehicles on a node, each by `open`.
    ///
    /// # Errors
    /// A port cannot be opened, or the folders with the files cannot be read.
    pub fn open(
        node: Node,
        instances: &[&Instance],
        watch: Watch,
        mut open: impl FnMut(Rc<Node>, &Instance) -> anyhow::Result<Box<dyn Work<'a> + 'a>>,
    ) -> anyhow::Result<Self> {
        let node = Rc::new(node);
        let mut vehicles = Vec::with_capacity(instances.len());
        for instance in instances {
            vehicles.push(open(Rc::clone(&node), instance)?);
        }
        Ok(Self {
            vehicles,
            // Once nothing is open any more that is closed again.
            guard: Guard::of(watch(&node)?),
            node,
        })
    }

    /// Works until `stop` is set, or ports have to be opened anew.
    ///
    /// # Errors
    /// As [`run`].
    pub fn run(&mut self, runtime: &Runtime, stop: &AtomicBool) -> anyhow::Result<Ended> {
        run(&mut self.vehicles, runtime, &self.guard, stop)
    }

    /// Ends them all; the first failure is the one that is said.
    ///
    /// # Errors
    /// As [`Work::finish`].
    pub fn finish(self) -> anyhow::Result<()> {
        let mut outcome = Ok(());
        for vehicle in self.vehicles {
            outcome = outcome.and(vehicle.finish());
        }
        outcome
    }

    /// The same with all ports opened anew, on another node whose making sweeps what is left of the old one: tries until
    /// it can, or until `stop` is set; then there is none.
    pub fn reopened(
        self,
        instances: &[&Instance],
        watch: Watch,
        stop: &AtomicBool,
    ) -> Option<Self> {
        let Self {
            vehicles,
            guard,
            node,
        } = self;
        // Their places first, or the new ones would take them for another daemon's.
        let mut closed: Vec<_> = guard.end().sparing_others(|| {
            let closed = vehicles.into_iter().map(|vehicle| vehicle.close());
            let closed = closed.collect();
            drop(node);
            closed
        });
        let mut is_said = false;
        loop {
            match Self::reopen(closed, instances, watch) {
                Ok(again) => return Some(again),
                Err((still, error)) => {
                    closed = still;
                    if !core::mem::replace(&mut is_said, true) {
                        warn!(
                            "not yet, and tried again: do feeders or readers hold the removed files? {error:#}"
                        );
                    }
                }
            }
            if stop.load(Ordering::Relaxed) {
                for vehicle in closed {
                    vehicle.finish();
                }
                return None;
            }
            std::thread::sleep(BETWEEN_TRIES);
        }
    }

    /// Opens all of them on a new node, or none.
    fn reopen(
        closed: Vec<Box<dyn Closed<'a> + 'a>>,
        instances: &[&Instance],
        watch: Watch,
    ) -> Result<Self, (Vec<Box<dyn Closed<'a> + 'a>>, anyhow::Error)> {
        let node = match open_node(NODE) {
            Ok(node) => Rc::new(node),
            Err(error) => return Err((closed, error.into())),
        };
        let mut vehicles: Vec<Box<dyn Work<'a> + 'a>> = Vec::with_capacity(closed.len());
        let mut waiting = closed.into_iter().zip(instances);
        while let Some((vehicle, instance)) = waiting.next() {
            match vehicle.open(Rc::clone(&node), instance) {
                Ok(vehicle) => vehicles.push(vehicle),
                Err((vehicle, error)) => {
                    let opened = vehicles.into_iter().map(|vehicle| vehicle.close());
                    let rest = waiting.map(|(vehicle, _)| vehicle);
                    return Err((opened.chain([vehicle]).chain(rest).collect(), error));
                }
            }
        }
        let guard = reserve_shared_memory(node.config())
            .and_then(|_| watch(&node))
            .map(Guard::of);
        match guard {
            Ok(guard) => Ok(Self {
                vehicles,
                guard,
                node,
            }),
            Err(error) => {
                let closed = vehicles.into_iter().map(|vehicle| vehicle.close());
                Err((closed.collect(), error.into()))
            }
        }
    }
}
