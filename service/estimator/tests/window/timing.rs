//! What a new state and its fix cost, by size of the window: printed, not asserted.

use inekf::filter::{Belief, Left, propagate};
use inekf::lie::SE23;
use inekf::model::{
    Discretisation, ImuInput, ImuNoise, InertialState, NavState, PositionObservation,
};
use inekf::smoother::{Preintegration, Window, WindowOptions};
use nalgebra::{Matrix3, Vector3};
use std::hint::black_box;
use std::time::Instant;

use crate::common::{GRAVITY_W, NOISE, any_belief, normal, seeded};

/// The least mean time of a push and an update over so many blocks, s, in a window that is full.
fn cost_s<G: InertialState<D>, const D: usize>(
    capacity: usize,
    covariance_w: Matrix3<f64>,
    blocks: usize,
) -> f64 {
    let mut rng = seeded(1);
    let noise = ImuNoise { ..NOISE };
    let start = G::from_parts(
        SE23 {
            velocity: Vector3::new(10.0, 0.0, 0.0),
            ..inekf::lie::LieGroup::identity()
        },
        Vector3::zeros(),
        Vector3::zeros(),
    );
    let first: Belief<G, Left, D> = any_belief(start, 0.1, &mut rng);
    let mut window = Window::<G, Left, D>::new(&first, &WindowOptions::new(capacity));
    let input = ImuInput {
        omega_b: Vector3::new(0.0, 0.0, 0.1),
        force_b: Vector3::new(0.0, 1.0, -GRAVITY_W.z),
    };
    let zoh = Discretisation::ZeroOrderHold;
    let mut motion = Preintegration::new(&start);
    for _ in 0..100 {
        motion.push(&input, &GRAVITY_W, 0.01, zoh, &noise);
    }
    let mut truth = start;
    let mut block = |updates: usize| {
        let fixes: Vec<PositionObservation> = (0..updates)
            .map(|_| {
                truth = motion.transition(&truth).0;
                PositionObservation {
                    position_w: truth.pose().position + normal::<3, 1>(&mut rng),
                    covariance_w,
                    lever_arm_b: Vector3::new(0.1, 0.0, 1.0),
                }
            })
            .collect();
        let begin = Instant::now();
        for fix in &fixes {
            black_box(window.push(black_box(&motion)));
            black_box(window.update(*fix).expect("an update"));
        }
        begin.elapsed().as_secs_f64() / updates as f64
    };
    block(capacity);
    // Short blocks: some of them are not interrupted.
    let updates = 1_000 / capacity + 2;
    (0..blocks)
        .map(|_| block(updates))
        .fold(f64::INFINITY, f64::min)
}

/// The least mean time of a filter's step through one sample, s: to compare with.
fn filter_s<G: InertialState<D>, const D: usize>() -> f64 {
    let mut rng = seeded(1);
    let start = G::from_parts(
        inekf::lie::LieGroup::identity(),
        Vector3::zeros(),
        Vector3::zeros(),
    );
    let mut belief: Belief<G, Left, D> = any_belief(start, 0.1, &mut rng);
    let input = ImuInput {
        omega_b: Vector3::new(0.0, 0.0, 0.1),
        force_b: Vector3::new(0.0, 1.0, -GRAVITY_W.z),
    };
    let zoh = Discretisation::ZeroOrderHold;
    let mut block = || {
        let begin = Instant::now();
        for _ in 0..1000 {
            belief = propagate(&belief, black_box(&input), &GRAVITY_W, 1e-6, zoh, &NOISE);
        }
        begin.elapsed().as_secs_f64() / 1000.0
    };
    (0..300).map(|_| block()).fold(f64::INFINITY, f64::min)
}

#[test]
#[ignore = "prints times, asserts none: cargo test --release -p inekf --test window -- --ignored timing --nocapture"]
fn timing() {
    let isotropic = Matrix3::identity();
    let anisotropic = Matrix3::from_diagonal(&Vector3::new(1.0, 1.0, 2.25));
    let steps = [filter_s::<SE23, 9>(), filter_s::<NavState, 15>()].map(|step_s| 1e9 * step_s);
    println!(
        "a filter's step through one sample: {:.0} ns, with biases {:.0} ns",
        steps[0], steps[1]
    );
    println!(
        "states  constant gains  linearised anew  with biases   (us for a new state and its fix)"
    );
    for capacity in [1, 10, 50, 200, 1000] {
        let [constant, anew] =
            [isotropic, anisotropic].map(|noise| 1e6 * cost_s::<SE23, 9>(capacity, noise, 200));
        let biased = 1e6 * cost_s::<NavState, 15>(capacity, isotropic, 200);
        println!("{capacity:6}  {constant:14.2}  {anew:15.2}  {biased:11.2}");
    }
}

/// For an instrument that counts instructions, which do not depend on what else the machine does: what 20 blocks
/// count more than 10, by the updates in ten.
#[test]
#[ignore = "for valgrind: WINDOW=50 KIND=biased BLOCKS=10 valgrind --tool=none BINARY --ignored instructions"]
fn instructions() {
    let number = |name: &str| std::env::var(name).ok()?.parse::<usize>().ok();
    let (Some(capacity), Some(blocks)) = (number("WINDOW"), number("BLOCKS")) else {
        return;
    };
    let anisotropic = Matrix3::from_diagonal(&Vector3::new(1.0, 1.0, 2.25));
    let kind = std::env::var("KIND").unwrap_or_default();
    match kind.as_str() {
        "constant" => cost_s::<SE23, 9>(capacity, Matrix3::identity(), blocks),
        "anew" => cost_s::<SE23, 9>(capacity, anisotropic, blocks),
        _ => cost_s::<NavState, 15>(capacity, Matrix3::identity(), blocks),
    };
    println!("{} updates in a block", 1_000 / capacity + 2);
}
