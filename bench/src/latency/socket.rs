//! What one would use without shared memory: datagrams as long as an `ImuSample` there and an
//! `EstimateSe23` back, over a pair of Unix-domain sockets or UDP on the loopback interface; both
//! sides blocking, or both looking all the time.

use std::fs::File;
use std::io::{self, ErrorKind, Read, Write};
use std::net::{Ipv4Addr, UdpSocket};
use std::os::fd::{AsFd, OwnedFd};
use std::os::unix::net::UnixDatagram;
use std::time::Duration;

use anyhow::{Context, bail};
use inekf_shared::clock::monotonic_ns;
use inekf_shared::message::{EstimateSe23, ImuSample};

use super::mechanism::{Mechanism, Wait};
use super::partner::{Partner, RoundTrip, STOP, end_with_parent, still_patient};
use crate::pin;

/// How long one blocking receive may take; then it is looked whether there is still hope.
const RECEIVE_WITHIN: Duration = Duration::from_secs(1);

/// A connected pair of sockets, as files.
fn pair(mechanism: Mechanism, wait: Wait) -> io::Result<(File, OwnedFd)> {
    // Whether an end blocks belongs to the socket: what is set here holds in the partner too.
    let spins = wait == Wait::Spin;
    if mechanism == Mechanism::UnixSocket {
        let (near, far) = UnixDatagram::pair()?;
        near.set_nonblocking(spins)?;
        near.set_read_timeout(Some(RECEIVE_WITHIN))?;
        far.set_nonblocking(spins)?;
        return Ok((File::from(OwnedFd::from(near)), far.into()));
    }
    let near = UdpSocket::bind((Ipv4Addr::LOCALHOST, 0))?;
    let far = UdpSocket::bind((Ipv4Addr::LOCALHOST, 0))?;
    near.connect(far.local_addr()?)?;
    far.connect(near.local_addr()?)?;
    near.set_nonblocking(spins)?;
    near.set_read_timeout(Some(RECEIVE_WITHIN))?;
    far.set_nonblocking(spins)?;
    Ok((File::from(OwnedFd::from(near)), far.into()))
}

/// A datagram of `N` bytes with a number in front.
fn datagram<const N: usize>(seq: u64) -> [u8; N] {
    let mut bytes = [0; N];
    for (byte, digit) in bytes.iter_mut().zip(seq.to_le_bytes()) {
        *byte = digit;
    }
    bytes
}

/// Receives a datagram of `N` bytes; `None` if there is none yet.
fn receive<const N: usize>(socket: &mut File) -> io::Result<Option<u64>> {
    let mut bytes = [0; N];
    match socket.read(&mut bytes) {
        Ok(length) if length == N => {}
        Ok(length) => {
            let short = format!("a datagram of {length} bytes in place of {N}");
            return Err(io::Error::new(ErrorKind::InvalidData, short));
        }
        // The time-out of a blocking socket is a `WouldBlock`, too; a pause interrupts.
        Err(error) if matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::Interrupted) => {
            return Ok(None);
        }
        Err(error) => return Err(error),
    }
    let mut seq = [0; size_of::<u64>()];
    seq.copy_from_slice(&bytes[..size_of::<u64>()]);
    Ok(Some(u64::from_le_bytes(seq)))
}

const SAMPLE: usize = size_of::<ImuSample>();
const ESTIMATE: usize = size_of::<EstimateSe23>();

/// A process at the other end, and this end.
#[derive(Debug)]
pub struct Socket {
    near: File,
    next: u64,
    partner: Partner,
}

impl Socket {
    /// Starts the partner on processor `cpu`.
    ///
    /// # Errors
    /// There are no such sockets, or it cannot be started.
    pub fn start(mechanism: Mechanism, wait: Wait, cpu: usize) -> anyhow::Result<Self> {
        let (near, far) = pair(mechanism, wait).context("making a pair of sockets")?;
        // The partner finds its end where others have their standard input.
        let partner = Partner::start(mechanism, wait, "socket", cpu, far.into())?;
        Ok(Self {
            near,
            next: 0,
            partner,
        })
    }
}

impl RoundTrip for Socket {
    fn round(&mut self) -> anyhow::Result<u64> {
        self.next += 1;
        let sent_ns = monotonic_ns();
        self.near.write_all(&datagram::<SAMPLE>(self.next))?;
        while receive::<ESTIMATE>(&mut self.near)? != Some(self.next) {
            still_patient(sent_ns, "the process at the socket")?;
            std::hint::spin_loop();
        }
        Ok(monotonic_ns() - sent_ns)
    }

    fn process(&self) -> Option<u32> {
        Some(self.partner.id())
    }
}

impl Drop for Socket {
    fn drop(&mut self) {
        if self.near.write_all(&datagram::<SAMPLE>(STOP)).is_ok() {
            self.partner.await_end();
        }
    }
}

/// The process at the other end: answers every number with the same, until the last.
///
/// # Errors
/// The socket fails, or standard input is none.
pub fn serve(cpu: usize) -> anyhow::Result<()> {
    end_with_parent()?;
    pin::pin(None, cpu)?;
    let far = io::stdin().as_fd().try_clone_to_owned()?;
    let mut far = File::from(far);
    loop {
        match receive::<SAMPLE>(&mut far).context("standard input has to be a socket")? {
            None => std::hint::spin_loop(),
            Some(STOP) => return Ok(()),
            Some(seq) => {
                let answer = datagram::<ESTIMATE>(seq);
                if far.write(&answer)? != answer.len() {
                    bail!("the socket takes no {ESTIMATE} bytes at once");
                }
            }
        }
    }
}
