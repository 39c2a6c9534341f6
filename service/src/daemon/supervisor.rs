//! What systemd is told, if it started the daemon (`Type=notify`): ready, alive, stopping. Elsewhere nothing happens: the
//! environment variable `NOTIFY_SOCKET` is not set.
//!
//! Nothing here runs between a sample and its estimate: the sign of life goes out with the health message.

use sd_notify::NotifyState;
use tracing::warn;

/// The ports are open.
pub fn ready() {
    tell(&[NotifyState::Ready]);
}

/// The loop still turns; what it is at goes into `systemctl status`.
pub fn alive(state: &str) {
    tell(&[NotifyState::Watchdog, NotifyState::Status(state)]);
}

/// The loop has ended.
pub fn stopping() {
    tell(&[NotifyState::Stopping]);
}

fn tell(states: &[NotifyState<'_>]) {
    if let Err(error) = sd_notify::notify(states) {
        warn!(%error, "systemd could not be told");
    }
}
