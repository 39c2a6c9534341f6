//! The wire contract of the invariant estimation service: what the daemon and its clients say to each other through
//! shared memory, under which names and with which guarantees. No mathematics.
//!
//! * [`message`]: the fixed-layout messages;
//! * [`topic`]: instances and the names of their topics;
//! * [`qos`]: buffer sizes and limits of every topic, in one place;
//! * [`transport`]: opens nodes, services and ports, so that both sides agree on names, types and limits;
//! * [`clock`]: the clock of the latency stamps;
//! * [`codec`]: frames for what is stored or sent off the hot path.

pub mod clock;
pub mod codec;
pub mod message;
pub mod qos;
pub mod topic;
pub mod transport;
