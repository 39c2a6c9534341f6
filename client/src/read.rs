//! A reader: the receiving side of a user's own process.
//!
//! ```no_run
//! use inekf_client::read::EstimateReader;
//! use inekf_shared::topic::Instance;
//!
//! let mut reader = EstimateReader::open(&Instance::new("default")?)?;
//! while let Some(estimate) = reader.next_estimate()? {
//!     println!("{} {:?}", estimate.head.stamp_ns, estimate.p_w_m);
//! }
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

use inekf_shared::message::EstimateSe23;
use inekf_shared::topic::Instance;
use inekf_shared::transport::{self, LatestReader, Node, Subscriber, TransportError};

/// The estimates could not be received.
#[derive(Debug, thiserror::Error)]
#[error("receiving estimates: {cause}")]
pub struct ReadError {
    /// iceoryx2's word for it.
    pub cause: String,
}

/// Receives every estimate of one daemon, in order, and counts those it missed.
pub struct EstimateReader {
    estimates: Subscriber<EstimateSe23>,
    next_seq: Option<u64>,
    missed: u64,
    _node: Node,
}

impl EstimateReader {
    /// A reader of `instance`; it gets what is published from now on.
    ///
    /// # Errors
    /// [`TransportError`], naming the service and the remedy.
    pub fn open(instance: &Instance) -> Result<Self, TransportError> {
        Self::open_on(transport::open_node("inekf-reader")?, instance)
    }

    /// The same on a node of one's own.
    ///
    /// # Errors
    /// [`TransportError`], naming the service and the remedy.
    pub fn open_on(node: Node, instance: &Instance) -> Result<Self, TransportError> {
        let estimates = transport::estimate::<EstimateSe23>(&node, instance)?.subscriber()?;
        Ok(Self {
            estimates,
            next_seq: None,
            missed: 0,
            _node: node,
        })
    }

    /// The next estimate, or `None` if none waits. Never blocks.
    ///
    /// # Errors
    /// [`ReadError`].
    pub fn next_estimate(&mut self) -> Result<Option<EstimateSe23>, ReadError> {
        let received = self.estimates.receive().map_err(|error| ReadError {
            cause: error.to_string(),
        })?;
        Ok(received.map(|sample| {
            let seq = sample.head.estimate_seq;
            // A smaller number is a daemon that has started again.
            if let Some(expected) = self.next_seq
                && seq > expected
            {
                self.missed += seq - expected;
            }
            self.next_seq = Some(seq + 1);
            *sample
        }))
    }

    /// Estimates that were overwritten before they were read.
    pub fn missed(&self) -> u64 {
        self.missed
    }
}

/// Reads the newest estimate only, as a controller would.
pub struct LatestEstimate {
    latest: LatestReader<EstimateSe23>,
    _node: Node,
}

impl LatestEstimate {
    /// A reader of the newest estimate of `instance`, whose daemon must be running.
    ///
    /// # Errors
    /// [`TransportError`], naming the service and the remedy.
    pub fn open(instance: &Instance) -> Result<Self, TransportError> {
        Self::open_on(transport::open_node("inekf-latest")?, instance)
    }

    /// The same on a node of one's own.
    ///
    /// # Errors
    /// [`TransportError`], naming the service and the remedy.
    pub fn open_on(node: Node, instance: &Instance) -> Result<Self, TransportError> {
        let latest = transport::open_latest::<EstimateSe23>(&node, instance)?.reader()?;
        Ok(Self {
            latest,
            _node: node,
        })
    }

    /// The newest estimate; its `estimate_seq` is 0 before the first.
    pub fn read(&self) -> EstimateSe23 {
        self.latest.read()
    }
}
