//! What the estimation thread allocates: nothing but what iceoryx2 needs for the slot of an estimate to come, which is
//! loaned after the one before has left.

use std::rc::Rc;
use std::sync::atomic::{AtomicBool, Ordering};

use inekf_service::config::Config;
use inekf_service::daemon::{Guard, Ports, Terms, Vehicle, run};
use inekf_service::engine::{self, Engine, History, Model, Use};
use inekf_shared::message::{EstimateSe23, Zero};
use inekf_shared::transport::{self, Watched};
use inekf_tests::link::instance;
use inekf_tests::memory::Memory;

use super::counting::{allocations, watch_this_thread, watched_allocations};
use super::{CONFIG, INSTANCE, WARM_UP, feed, warm_link};

const STEPS: u64 = 2000;

/// The daemon's loop on this thread, watched.
struct Serve<'a> {
    config: &'a Config,
    memory: &'a Memory,
    is_ready: &'a AtomicBool,
    stop: &'a AtomicBool,
}

impl Use for Serve<'_> {
    type Output = ();

    fn with<M: Model + 'static, H: History<M> + 'static>(self, engine: Engine<M, H>) {
        let node = Rc::new(self.memory.node());
        let ports = Ports::open_on(Rc::clone(&node), &instance(INSTANCE), self.config, false);
        let terms = Terms {
            config: self.config,
            config_text: CONFIG,
            stepped: false,
            unused_checkpoint: false,
        };
        let vehicle = Vehicle::new(engine, ports.expect("ports"), terms, None);
        let guard = Guard::of(Watched::of(&node).expect("the files"));
        let runtime = &self.config.runtime;
        watch_this_thread();
        self.is_ready.store(true, Ordering::Release);
        run(&mut [Box::new(vehicle)], runtime, &guard, self.stop).expect("it runs");
    }
}

/// Allocations and frees that iceoryx2 makes for one message from the loan of its slot to its end.
fn of_one_loan(memory: &Memory) -> u64 {
    let node = memory.node();
    let topic = transport::estimate::<EstimateSe23>(&node, &instance("loan")).expect("a topic");
    let publisher = topic.publisher().expect("a publisher");
    let send = || {
        let slot = publisher.loan_uninit().expect("a slot");
        slot.write_payload(EstimateSe23::ZERO).send().expect("sent");
    };
    send();
    allocations(send)
}

#[test]
fn the_loop_allocates_nothing_but_the_loans_of_slots_ahead() {
    let memory = Memory::new();
    let config = Config::from_toml_str(CONFIG, "the test's").expect("a configuration");
    let (is_ready, stop) = (AtomicBool::new(false), AtomicBool::new(false));
    let (estimates, counted) = std::thread::scope(|scope| {
        let daemon = Serve {
            config: &config,
            memory: &memory,
            is_ready: &is_ready,
            stop: &stop,
        };
        let thread = scope.spawn(|| engine::build(&config, daemon).expect("an engine"));
        // A failure ends the scope only if it ends the loop.
        let _stops = StopAtEnd(&stop);
        while !is_ready.load(Ordering::Acquire) {
            assert!(!thread.is_finished(), "the loop has ended");
            std::thread::yield_now();
        }
        let mut link = warm_link(&memory);
        let before = watched_allocations();
        let estimates = feed(&mut link, WARM_UP + 1..=WARM_UP + STEPS);
        (estimates, watched_allocations() - before)
    });
    let of_one_loan = of_one_loan(&memory);
    assert!(of_one_loan > 0, "then this test may ask for nothing at all");
    // At either end the loan of one slot may fall on this side of the count or on that.
    let expected = estimates * of_one_loan;
    assert!(
        counted.abs_diff(expected) <= 2 * of_one_loan,
        "{counted} allocations and frees for {estimates} estimates; {of_one_loan} for a loan"
    );
}

/// Stops the loop when it goes out of scope.
struct StopAtEnd<'a>(&'a AtomicBool);

impl Drop for StopAtEnd<'_> {
    fn drop(&mut self) {
        self.0.store(true, Ordering::Relaxed);
    }
}
