//! The clock of the latency stamps: CLOCK_MONOTONIC, nanoseconds, one for all processes of a host.

use rustix::time::{ClockId, clock_gettime};

/// Now, CLOCK_MONOTONIC, nanoseconds since an arbitrary start (the host's boot).
///
/// ```
/// use inekf_shared::clock::monotonic_ns;
///
/// // It never runs backwards, whatever happens to the time of day.
/// let sent_ns = monotonic_ns();
/// assert!(monotonic_ns() >= sent_ns);
/// ```
#[must_use]
pub fn monotonic_ns() -> u64 {
    let now = clock_gettime(ClockId::Monotonic);
    // Neither part is ever negative: the clock starts at zero and runs forward.
    now.tv_sec as u64 * 1_000_000_000 + now.tv_nsec as u64
}

#[cfg(test)]
mod tests {
    use super::monotonic_ns;

    #[test]
    fn runs_forward_and_agrees_with_the_standard_library() {
        // std's Instant reads the same clock, so a span measured by it encloses one measured inside it.
        let outer = std::time::Instant::now();
        let before = monotonic_ns();
        std::thread::sleep(std::time::Duration::from_millis(2));
        let after = monotonic_ns();
        let outer_ns = outer.elapsed().as_nanos();
        assert!(after - before >= 2_000_000);
        assert!(u128::from(after - before) <= outer_ns);
    }
}
