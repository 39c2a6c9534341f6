//! The harness of the whole-process tests.
//!
//! * [`programs`]: the real daemon and client, built once for a test run;
//! * [`memory`]: shared memory of one test's own, and what is left in it;
//! * [`process`]: running programs, with their output and a time limit; the daemon among them;
//! * [`link`]: one test's own ports to a daemon;
//! * [`faults`]: what is done to the processes, and what comes of it: the fault table;
//! * [`folder`]: dataset folders and configurations to be changed at will;
//! * [`drive`]: a short simulation and a configuration that fits it;
//! * [`mod@fuzz`]: bytes from outside into everything that takes them;
//! * [`in_process`]: the same engine without a process, fed in the daemon's order;
//! * [`replay`]: the real `inekf-client replay`;
//! * [`score`]: estimates against truth and fixes;
//! * [`tools`]: what may be missing on a machine;
//! * [`consistency`]: whether errors are as large as their covariance says.
//!
//! The harness panics where a test could not go on: it is part of the tests. SI units and radians, world ENU, body FLU.

pub mod consistency;
pub mod drive;
pub mod faults;
pub mod folder;
pub mod fuzz;
pub mod in_process;
pub mod link;
pub mod memory;
pub mod process;
pub mod programs;
pub mod replay;
pub mod score;
pub mod tools;
