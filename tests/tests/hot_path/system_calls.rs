//! What the estimation thread of a real daemon asks of the system while it spins: nothing.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::channel;

use inekf_tests::memory::Memory;
use inekf_tests::process::Daemon;
use rustix::process::Signal;

use super::tracer::trace;
use super::{CONFIG, FIX_EVERY, INSTANCE, WARM_UP, feed, warm_link};

const STEPS: u64 = 2000;

#[test]
fn from_samples_to_estimates_a_spinning_daemon_makes_no_system_call() {
    let memory = Memory::new();
    let counts = AtomicBool::new(false);
    let seen = std::thread::scope(|scope| {
        // In here, so that a failure ends it, and with it the tracer.
        let daemon = Daemon::start(&memory, INSTANCE, CONFIG);
        let (tell, ready) = channel();
        let (id, counts) = (daemon.id(), &counts);
        let tracer = scope.spawn(move || trace(id, counts, &tell));
        if let Err(error) = ready.recv().expect("the tracer speaks") {
            println!("SKIPPED: this system does not let one trace a child: {error}");
            return None;
        }
        let mut link = warm_link(&memory);
        counts.store(true, Ordering::SeqCst);
        let estimates = feed(&mut link, WARM_UP + 1..=WARM_UP + STEPS);
        counts.store(false, Ordering::SeqCst);
        assert_eq!(estimates, STEPS + STEPS / FIX_EVERY);
        // The tracer first: who waits for a traced process may be given the stop that the tracer waits for, and then
        // both wait for ever.
        daemon.signal(Signal::TERM);
        let seen = tracer.join().expect("the tracer ends");
        daemon.stop();
        Some(seen)
    });
    let Some(seen) = seen else { return };
    assert!(
        !seen.beside.is_empty(),
        "the daemon maps what a new feeder brings: the tracer is blind"
    );
    assert!(
        seen.counted.is_empty(),
        "system calls by number: {:?}",
        seen.counted
    );
}
