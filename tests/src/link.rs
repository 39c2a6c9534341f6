//! One test's own ports to a daemon: what it would hold in a user's process, of the client's library.

use inekf_client::control::Controller;
use inekf_client::dataset::{Dataset, Event};
use inekf_client::feed::Feeder;
use inekf_client::model::Estimate;
use inekf_client::read::{EstimateReader, LatestEstimate};
use inekf_shared::message::{ControlResponse, EstimateSe23, Health};
use inekf_shared::topic::Instance;
use inekf_shared::transport::{self, InputMessage, Node, Publisher, Subscriber};

use crate::memory::Memory;
use crate::process::{PATIENCE, eventually};

/// Rows in flight at most: each may give two estimates, and a reader's buffer holds 1024.
const IN_FLIGHT: usize = 200;

/// A feeder, a reader and a controller of a daemon whose model is that of the estimates `E`.
pub struct Link<E: Estimate = EstimateSe23> {
    /// Sends.
    pub feeder: Feeder,
    /// Receives.
    pub reader: EstimateReader<E>,
    /// Asks.
    pub controller: Controller,
}

impl Link {
    /// Opens them on a daemon of the model `imu` that is ready.
    pub fn open(memory: &Memory, instance: &str) -> Self {
        Self::open_model(memory, instance)
    }
}

impl<E: Estimate> Link<E> {
    /// Opens them on a daemon that is ready, whatever its model.
    pub fn open_model(memory: &Memory, instance: &str) -> Self {
        let instance = self::instance(instance);
        let mut link = Self {
            feeder: Feeder::open_on(memory.node(), &instance).expect("a feeder"),
            reader: EstimateReader::open_on(memory.node(), &instance).expect("a reader"),
            controller: Controller::open_on(memory.node(), &instance, PATIENCE)
                .expect("a controller"),
        };
        link.controller.barrier().expect("the daemon answers");
        link
    }

    /// Feeds rows so that none is lost, and returns every estimate that came of them.
    pub fn feed(&mut self, events: impl IntoIterator<Item = Event>) -> Vec<E> {
        let mut estimates = Vec::new();
        for (sent, event) in events.into_iter().enumerate() {
            if sent % IN_FLIGHT == IN_FLIGHT - 1 {
                self.settle(&mut estimates);
            }
            let receivers = self.feeder.send(&event).expect("it can be sent");
            assert_eq!(receivers, 1, "one daemon listens");
        }
        self.settle(&mut estimates);
        estimates
    }

    /// Feeds a dataset from its first row to its last, as [`Link::feed`] does.
    pub fn feed_all(&mut self, dataset: &Dataset) -> Vec<E> {
        self.feed(dataset.events())
    }

    /// Waits until everything sent has been processed and takes the estimates; returns the answer.
    pub fn settle(&mut self, estimates: &mut Vec<E>) -> ControlResponse {
        let answer = self.controller.barrier().expect("the daemon answers");
        while let Some(estimate) = self.reader.next_estimate().expect("it can be received") {
            estimates.push(estimate);
        }
        assert_eq!(self.reader.missed(), 0);
        answer
    }
}

/// A reader of the newest estimate only.
pub fn latest(memory: &Memory, instance: &str) -> LatestEstimate {
    LatestEstimate::open_on(memory.node(), &self::instance(instance)).expect("a reader")
}

/// Hears how the daemon is.
pub struct HealthReader {
    subscriber: Subscriber<Health>,
    _node: Node,
}

impl HealthReader {
    /// Listens to the daemon of an instance.
    pub fn open(memory: &Memory, instance: &str) -> Self {
        let node = memory.node();
        let topic = transport::health(&node, &self::instance(instance)).expect("the topic");
        Self {
            subscriber: topic.subscriber().expect("a subscriber"),
            _node: node,
        }
    }

    /// Waits for a message that is as `wanted`.
    pub fn wait_until(&self, what: &str, wanted: impl Fn(&Health) -> bool) -> Health {
        eventually(what, || {
            let mut found = None;
            while let Some(health) = self.subscriber.receive().expect("it can be received") {
                found = found.or(Some(*health).filter(|health| wanted(health)));
            }
            found
        })
    }
}

/// Sends messages as they are, good or bad.
pub struct RawFeeder<M: InputMessage> {
    publisher: Publisher<M>,
    _node: Node,
}

impl<M: InputMessage> RawFeeder<M> {
    /// A feeder of one input of an instance.
    pub fn open(memory: &Memory, instance: &str) -> Self {
        let node = memory.node();
        let topic = transport::input::<M>(&node, &self::instance(instance)).expect("the topic");
        Self {
            publisher: topic.publisher().expect("a publisher"),
            _node: node,
        }
    }

    /// Sends a message to the daemon, which must be there.
    pub fn send(&self, message: M) {
        let receivers = self.publisher.send_copy(message).expect("it can be sent");
        assert_eq!(receivers, 1, "one daemon listens");
    }
}

/// The instance of this name.
pub fn instance(name: &str) -> Instance {
    Instance::new(name).expect("a name of an instance")
}
