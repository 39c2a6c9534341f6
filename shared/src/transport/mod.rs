//! Opens nodes, services and ports. Daemon and clients both come through here, so they agree on names, types and
//! limits without repeating them. What comes back are iceoryx2's own ports, with no layer on the hot path.
//!
//! A process makes one [`Node`] ([`open_node`]), opens services on it ([`inputs`], [`estimate`], [`latest`],
//! [`health`], [`smoothed`], [`journal`], [`control`], [`wake`]) and makes ports from those. Ports and services keep the node alive. None of
//! them can move to another thread: a thread that needs ports makes its own node.
//!
//! Where iceoryx2 keeps its files, from the environment:
//!
//! * `INEKF_IPC_ROOT`: absolute directory of the files that describe nodes and services. Default: iceoryx2's.
//! * `INEKF_IPC_PREFIX`: start of the names of all files, those in `/dev/shm` included. Default: iceoryx2's.
//!
//! Together they may have [`IPC_ROOT_AND_PREFIX_MAX_LEN`] bytes. Processes see each other only if both agree. Sets of processes are isolated from one another only if both differ.
//! No configuration file of iceoryx2 is read.
//!
//! The daemon's side, once around its loop:
//!
//! ```no_run
//! # use core::time::Duration;
//! # use inekf_shared::message::*;
//! # use inekf_shared::{clock::monotonic_ns, topic::Instance, transport};
//! # fn main() -> Result<(), Box<dyn core::error::Error>> {
//! let node = transport::open_node("inekf-service")?;
//! let instance = Instance::new("car")?;
//! // First, because a second daemon of the instance fails here, with the process id of the first.
//! let server = transport::control(&node, &instance)?.server()?;
//! let imu = transport::input::<ImuSample>(&node, &instance)?.subscriber()?;
//! let estimates = transport::estimate::<EstimateSe23>(&node, &instance)?.publisher()?;
//! let latest = transport::latest(&node, &instance, EstimateSe23::ZERO)?.writer()?;
//! let listener = transport::wake(&node, &instance)?.listener()?;
//! transport::reserve_shared_memory(node.config())?;
//!
//! // Loaning allocates in iceoryx2, so the outlet does it ahead, off the path from input to estimate.
//! let mut estimates = transport::Outlet::new(estimates, 1);
//! while let Some(sample) = imu.receive()? {
//!     let received_ns = monotonic_ns();
//!     let mut estimate = EstimateSe23::ZERO; // here the filter runs
//!     estimate.head.seq = sample.header.seq;
//!     estimate.head.received_ns = received_ns;
//!     estimates.send(&estimate)?;
//!     let _written = latest.write(estimate);
//!     estimates.restock();
//! }
//! while let Some(request) = server.receive()? {
//!     request.send_copy(ControlResponse {
//!         request_id: request.request_id,
//!         ..ControlResponse::default()
//!     })?;
//! }
//! listener.wait(Duration::from_millis(10))?;
//! # Ok(())
//! # }
//! ```
//!
//! A client's side:
//!
//! ```no_run
//! # use core::time::Duration;
//! # use inekf_shared::message::*;
//! # use inekf_shared::{clock::monotonic_ns, topic::Instance, transport};
//! # fn main() -> Result<(), Box<dyn core::error::Error>> {
//! let node = transport::open_node("my-robot")?;
//! let instance = Instance::new("car")?;
//! let imu = transport::input::<ImuSample>(&node, &instance)?.publisher()?;
//! let notifier = transport::wake(&node, &instance)?.notifier()?;
//! let estimates = transport::estimate::<EstimateSe23>(&node, &instance)?.subscriber()?;
//!
//! let mut sample = ImuSample::default();
//! sample.header.sent_ns = monotonic_ns();
//! let receivers = imu.loan_uninit()?.write_payload(sample).send()?;
//! assert_eq!(receivers, 1, "no daemon listens");
//! notifier.notify()?;
//! while let Some(estimate) = estimates.receive()? {
//!     println!("{:?}", estimate.p_w_m);
//! }
//!
//! let client = transport::control(&node, &instance)?.client()?;
//! let pending = client.send_copy(ControlRequest {
//!     kind: CONTROL_SNAPSHOT,
//!     request_id: 1,
//!     ..ControlRequest::default()
//! })?;
//! while pending.is_connected() {
//!     if let Some(response) = pending.receive()? {
//!         println!("{}", state_name(response.state_code));
//!         break;
//!     }
//!     std::thread::sleep(Duration::from_millis(1));
//! }
//!
//! let newest = transport::open_latest::<EstimateSe23>(&node, &instance)?.reader()?;
//! println!("{:?}", newest.read().p_w_m);
//! # Ok(())
//! # }
//! ```
//!
//! A port connects to a new counterpart when it next sends or receives. What a port sent is lost if it is dropped before
//! its counterpart has connected, although `send` counted a receiver; so a feeder stays until it was heard.

mod classify;
mod error;
mod folder;
pub mod inspect;
mod node;
mod open;
mod outlet;
mod reserve;
mod service;
mod stillborn;
mod sweep;
mod watched;

pub use error::TransportError;
pub use folder::Folder;
pub use iceoryx2::config::Config;
pub use node::{
    IPC_PREFIX_VARIABLE, IPC_ROOT_AND_PREFIX_MAX_LEN, IPC_ROOT_VARIABLE, Node, config,
    config_from_env, open_another_node, open_node, open_node_with, remove_node_counter,
};
pub use open::{
    InputMessage, Inputs, control, estimate, estimate_model, health, input, inputs, journal,
    latest, open_latest, smoothed, wake,
};
pub use outlet::Outlet;
pub use reserve::reserve_shared_memory;
pub use service::{
    Control, ControlClient, ControlServer, Latest, LatestReader, LatestWriter, PubSub, Publisher,
    Received, Subscriber, Wake, WakeListener, WakeNotifier,
};
pub use sweep::{Swept, process_of, sweep};
pub use watched::Watched;
