//! After construction no filter allocates, whatever it is fed.

use inekf_service::engine::{Engine, History, Model, Outbox, Use, build};

use super::counting::allocations;
use super::harness::{
    CHOICES, Input, PERIOD, START, feed, fix, parse, planar_state, plane, space, spatial_state,
};

/// Counts estimates and keeps none.
struct Sink(u64);

impl<E> Outbox<E> for Sink {
    fn publish(&mut self, _estimate: &mut E) {
        self.0 += 1;
    }
}

struct Allocations<'a>(&'a [Input]);

impl Use for Allocations<'_> {
    type Output = (u64, u64);

    fn with<M: Model + 'static, H: History<M> + 'static>(
        self,
        mut engine: Engine<M, H>,
    ) -> (u64, u64) {
        let mut sink = Sink(0);
        let allocated = allocations(|| {
            for input in self.0 {
                let _ = feed(&mut engine, input, &mut sink);
                let _ = std::hint::black_box((engine.state(), engine.snapshot()));
            }
        });
        (allocated, sink.0)
    }
}

/// Rows; pairs on time, late, alone, far off; requests and restarts.
fn everything(dimension: usize) -> Vec<Input> {
    let state = |stamp| {
        Input::Set(if dimension == 2 {
            planar_state(stamp, [0.02, 1.0, 2.0])
        } else {
            spatial_state(stamp, [0.02, 0.02, 0.02, 1.0, 2.0, 2.0])
        })
    };
    let mut inputs = vec![state(0)];
    for k in 1..600_u64 {
        let now = START + k * PERIOD;
        let at = |back: u64, seq: u64, source: u32, x: f64| {
            fix(now - back, seq, source, &[x, -3.0, 1.0][..dimension])
        };
        match k % 7 {
            0 => inputs.extend([at(1000, k, 0, 5.0), at(0, k, 1, 5.0)]),
            2 => inputs.extend([at(3 * PERIOD, k, 0, 5.0), at(3 * PERIOD, k, 1, 5.0)]),
            4 => inputs.push(at(0, k, 0, 5.0)),
            5 => inputs.push(at(0, k, 1, 1e6)),
            _ => {}
        }
        let way = if k % 50 < 10 {
            f64::NAN
        } else {
            0.1 * (k % 3) as f64
        };
        inputs.push(if dimension == 2 {
            plane(now, k, [0.02, way, 0.0])
        } else {
            space(now, k, [0.0, 0.01, 0.02, way, 0.0, 0.0])
        });
        if k % 97 == 0 {
            inputs.push(state(now));
        }
        if k % 211 == 0 {
            inputs.extend([Input::Reset, state(0), at(0, k, 0, 5.0)]);
        }
    }
    inputs
}

#[test]
fn no_filter_allocates() {
    let counted = allocations(|| drop(std::hint::black_box(vec![1_u8; 100])));
    assert!(counted >= 2, "the counter counts");
    for dimension in [2, 3] {
        let inputs = everything(dimension);
        for choice in CHOICES {
            let config = parse(&choice.text(dimension, "[update]\ngate_probability = 0.999\n"));
            let (allocated, published) = build(&config, Allocations(&inputs)).unwrap();
            assert_eq!(allocated, 0, "{}", choice.name);
            assert!(published > 500, "{} {published}", choice.name);
        }
    }
}
