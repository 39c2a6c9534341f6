//! What systemd is told, if it started the daemon (`Type=notify`): ready, alive, stopping. Elsewhere nothing happens: the
//! environment variable `NOTIFY_SOCKET` is not set.
//!
//! Nothing here runs between a sample and its estimate: the sign of life goes out with the health message.
//!
//! ```
//! use inekf_service::daemon::supervisor;
//!
//! supervisor::ready();
//! // Started by hand there is nobody to be told, and nothing happens.
//! assert!(std::env::var_os("NOTIFY_SOCKET").is_none());
//! ```

use sd_notify::NotifyState;
use tracing::warn;

/// The ports are open.
///
/// ```
/// use std::os::unix::net::UnixDatagram;
///
/// use inekf_service::daemon::supervisor;
///
/// let folder = tempfile::tempdir()?;
/// let systemd = UnixDatagram::bind(folder.path().join("notify"))?;
/// # // SAFETY: this process has no other thread.
/// # unsafe { std::env::set_var("NOTIFY_SOCKET", folder.path().join("notify")) };
/// supervisor::ready();
/// let mut note = [0; 64];
/// let length = systemd.recv(&mut note)?;
/// assert!(note[..length].starts_with(b"READY=1"));
/// # Ok::<(), std::io::Error>(())
/// ```
pub fn ready() {
    tell(&[NotifyState::Ready]);
}

/// The loop still turns; what it is at goes into `systemctl status`.
pub(super) fn alive(state: &str) {
    tell(&[NotifyState::Watchdog, NotifyState::Status(state)]);
}

/// The loop has ended.
///
/// ```
/// use std::os::unix::net::UnixDatagram;
///
/// use inekf_service::daemon::supervisor;
///
/// let folder = tempfile::tempdir()?;
/// let systemd = UnixDatagram::bind(folder.path().join("notify"))?;
/// # // SAFETY: this process has no other thread.
/// # unsafe { std::env::set_var("NOTIFY_SOCKET", folder.path().join("notify")) };
/// supervisor::stopping();
/// let mut note = [0; 64];
/// let length = systemd.recv(&mut note)?;
/// assert!(note[..length].starts_with(b"STOPPING=1"));
/// # Ok::<(), std::io::Error>(())
/// ```
pub fn stopping() {
    tell(&[NotifyState::Stopping]);
}

fn tell(states: &[NotifyState<'_>]) {
    if let Err(error) = sd_notify::notify(states) {
        warn!(%error, "systemd could not be told");
    }
}
