//! After construction a smoother allocates nothing, whatever it is fed.

use inekf_service::engine::Outbox;
use inekf_shared::message::EstimateSe23;

use crate::common::{Input, imu, position, stamp, state_on_circle, velocity};
use crate::counting::allocations;
use crate::{Fed, full, smoothing};

/// Keeps the last estimate, as a latest-value slot does.
struct Latest(EstimateSe23);

impl Outbox<EstimateSe23> for Latest {
    fn publish(&mut self, estimate: &mut EstimateSe23) {
        self.0 = *estimate;
    }
}

#[test]
fn nothing_is_allocated_after_construction() {
    let mut settings = smoothing("", 10, "");
    settings.fusion.recover_after = 3;
    settings.fusion.late_capacity = 40;
    let mut engine = full(settings);
    let mut outbox = Latest(EstimateSe23::default());
    let mut states = 0;
    let during = allocations(|| {
        for round in 0..2 {
            engine
                .set_state(&state_on_circle(stamp(1000 * round), 0.3))
                .unwrap();
            for k in 1000 * round..1000 * (round + 1) {
                let now_ns = stamp(k);
                engine.feed(&Input::Imu(imu(k)), &mut outbox);
                if k.is_multiple_of(3) {
                    engine.feed(
                        &Input::Velocity(velocity(now_ns - 3_333_333, k)),
                        &mut outbox,
                    );
                    engine.feed(&Input::Position(position(now_ns, k, 0)), &mut outbox);
                    engine.feed(&Input::Position(position(now_ns + 1, k, 1)), &mut outbox);
                    let mut far = position(now_ns, k, 1);
                    far.position_w_m[0] += 500.0;
                    engine.feed(&Input::Position(far), &mut outbox);
                }
                if k % 100 < 50 {
                    while engine.take_left().is_some() {
                        states += 1;
                    }
                }
                let _ = engine.smoothed(&mut |_| states += 1);
            }
            engine.reset();
        }
    });
    let counters = engine.tally().counters;
    assert!(
        counters.accepted > 1000 && counters.gated > 100,
        "{counters:?}"
    );
    assert!(counters.late > 0, "{counters:?}");
    assert!(states > 1000);
    assert_eq!(during, 0);
}
