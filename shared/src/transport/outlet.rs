//! A publisher with slots loaned ahead.
//!
//! Loaning a slot looks through what readers gave back and allocates inside iceoryx2. Done when a
//! message is ready it is part of that message's latency; done after the one before, it is not.

use core::mem::MaybeUninit;

use iceoryx2::port::SendError;
use iceoryx2::prelude::ipc;
use iceoryx2::sample_mut_uninit::SampleMutUninit;

use super::service::Publisher;
use crate::message::Message;
use crate::qos;

type Slot<M> = SampleMutUninit<ipc::Service, MaybeUninit<M>, ()>;

/// Sends the messages of one topic from slots loaned ahead.
///
/// ```
/// use inekf_shared::message::{EstimateSe2, Zero};
/// use inekf_shared::topic::Instance;
/// use inekf_shared::transport::{self, Outlet};
///
/// # let root = tempfile::tempdir_in("/tmp")?;
/// # let prefix = root.path().file_name().and_then(|name| name.to_str());
/// # let config = transport::config(root.path().to_str(), prefix)?;
/// # let node = transport::open_node_with("doc", &config)?;
/// let estimates = transport::estimate::<EstimateSe2>(&node, &Instance::new("cart")?)?;
/// let reader = estimates.subscriber()?;
/// let mut outlet = Outlet::new(estimates.publisher()?, 1);
/// for theta_rad in [0.1, 0.2] {
///     // From a slot that was loaned before the message was there ..
///     assert_eq!(outlet.send(&EstimateSe2 { theta_rad, ..EstimateSe2::ZERO })?, 1);
///     // .. and the next one, now that nothing waits.
///     outlet.restock();
/// }
/// assert_eq!(reader.receive()?.expect("sent").theta_rad, 0.1);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub struct Outlet<M: Message> {
    publisher: Publisher<M>,
    depth: usize,
    ahead: Vec<Slot<M>>,
}

impl<M: Message> Outlet<M> {
    /// An outlet that keeps `depth` slots ready, at most [`qos::MAX_LOANED`] less one; with 0 it loans when it sends.
    pub fn new(publisher: Publisher<M>, depth: usize) -> Self {
        let depth = depth.min(qos::MAX_LOANED - 1);
        let mut outlet = Self {
            publisher,
            depth,
            ahead: Vec::with_capacity(depth),
        };
        outlet.restock();
        outlet
    }

    /// Sends a copy of `message`, and says how many subscribers got it. Never waits for any of them, and does not
    /// allocate while a slot is ready.
    ///
    /// # Errors
    /// iceoryx2's: a full `/dev/shm`, or a connection that is broken.
    ///
    /// ```
    /// use inekf_shared::message::{ImuSample, Zero};
    /// use inekf_shared::topic::Instance;
    /// use inekf_shared::transport::{self, Outlet};
    ///
    /// # let root = tempfile::tempdir_in("/tmp")?;
    /// # let prefix = root.path().file_name().and_then(|name| name.to_str());
    /// # let config = transport::config(root.path().to_str(), prefix)?;
    /// # let node = transport::open_node_with("doc", &config)?;
    /// let imu = transport::input::<ImuSample>(&node, &Instance::new("car")?)?;
    /// // Without a slot ahead it loans one when it sends.
    /// let mut outlet = Outlet::new(imu.publisher()?, 0);
    /// assert_eq!(outlet.send(&ImuSample::ZERO)?, 0);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn send(&mut self, message: &M) -> Result<usize, SendError> {
        let slot = match self.ahead.pop() {
            Some(slot) => slot,
            None => self.publisher.loan_uninit()?,
        };
        slot.write_payload(*message).send()
    }

    /// Loans the slots for the messages to come. Call it when nothing waits for a message; what cannot be loaned now
    /// is loaned by [`Outlet::send`], which then says why not.
    pub fn restock(&mut self) {
        while self.ahead.len() < self.depth {
            match self.publisher.loan_uninit() {
                Ok(slot) => self.ahead.push(slot),
                Err(_) => break,
            }
        }
    }
}
