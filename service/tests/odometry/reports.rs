//! What estimates say of the mismatches.

use inekf_shared::message::NO_MODE;

use super::harness::{
    CHOICES, Estimate, Input, PERIOD, SIGMAS, START, fix, named, planar_state, plane, run,
};

/// Rows of `way` m, and a pair of fixes at each fifth.
fn straight(way: f64, rows: u64) -> Vec<Input> {
    let mut inputs = vec![Input::Set(planar_state(START, [0.02, 1.0, 2.0]))];
    for k in 1..=rows {
        inputs.push(plane(START + k * PERIOD, k, [0.0, way, 0.0]));
        if k % 5 == 0 {
            let x = 4.0 + way * k as f64;
            inputs.extend([0, 1].map(|source| fix(START + k * PERIOD, k, source, &[x, -3.0])));
        }
    }
    inputs
}

fn after(name: &str, inputs: &[Input]) -> Estimate {
    run(&named(name).text(2, ""), inputs).last().clone()
}

#[test]
fn the_bits_are_those_of_the_last_update() {
    for choice in CHOICES {
        let bits = |inputs: &[Input]| after(choice.name, inputs).head.active_mismatches;
        let declared = if choice.mismatched.is_some() {
            0b111
        } else {
            0
        };
        assert_eq!(bits(&straight(0.5, 4)), 0, "{}: no update yet", choice.name);
        assert_eq!(bits(&straight(0.5, 10)), declared, "{}", choice.name);
        let constrained = choice.name.starts_with("hard") || choice.name.starts_with("soft");
        // Standing still the way's direction is noise; the sources' mismatches stay.
        let at_rest = if constrained { 0b110 } else { declared };
        assert_eq!(bits(&straight(0.0, 10)), at_rest, "{}", choice.name);
    }
}

#[test]
fn the_odometrys_mismatches_come_first_whatever_the_order_of_the_tables() {
    let scale = "[[mismatched]]\nwhat = \"odometry_scale\"\nsigma = 0.08\n";
    let text = named("augmented").text(2, "");
    let turned = text
        .replace(scale, "")
        .replace("[stacking]", &format!("{scale}[stacking]"));
    assert_ne!(text, turned);
    let inputs = straight(0.5, 30);
    assert_eq!(
        run(&text, &inputs).last().bits(),
        run(&turned, &inputs).last().bits()
    );
}

#[test]
fn parameters_are_reported_where_they_are_estimated_and_are_nan_elsewhere() {
    for choice in CHOICES {
        let last = after(choice.name, &straight(0.5, 30));
        let learns = matches!(choice.name, "consider" | "augmented" | "adaptive");
        let estimated = if learns { 3 } else { 0 };
        for k in 0..last.mismatch.len() {
            assert_eq!(
                last.mismatch[k].is_finite(),
                k < estimated,
                "{} {k}",
                choice.name
            );
            assert_eq!(
                last.sigma[k].is_finite(),
                k < estimated,
                "{} {k}",
                choice.name
            );
            assert_eq!(last.mismatch[k].is_nan(), k >= estimated);
        }
        let is_bank = choice.name == "adaptive";
        assert_eq!(last.head.mode != NO_MODE, is_bank, "{}", choice.name);
        assert!(!is_bank || last.head.mode < 9);
        if choice.name == "consider" {
            assert_eq!(last.mismatch[..3], [0.0; 3]);
            for (ours, sigma) in last.sigma.iter().zip(SIGMAS) {
                assert!((ours - sigma).abs() < 1e-12);
            }
        }
    }
}

#[test]
fn an_augmented_filter_learns_the_scale_of_the_odometry() {
    // The wheels say 0.55 m where the body goes 0.5 m: the scale is 0.5 / 0.55 - 1.
    let mut inputs = straight(0.5, 400);
    for input in &mut inputs {
        if let Input::Plane(row) = input {
            row.translation_m[0] = 0.55;
        }
    }
    let text = "model = \"odometry2d\"\nestimator = \"inekf\"\nmismatch = \"augmented\"\n[noise]\n\
                rotation_density = 0.01\ntranslation_density = 0.02\n[[position_source]]\nid = 0\n\
                [[position_source]]\nid = 1\n[[mismatched]]\nwhat = \"odometry_scale\"\nsigma = 0.1\n";
    let last = run(text, &inputs).last().clone();
    let expected = 0.5 / 0.55 - 1.0;
    assert!(
        (last.mismatch[0] - expected).abs() < 3.0 * last.sigma[0],
        "{last:?}"
    );
    assert!(last.sigma[0] < 0.01, "{last:?}");
}

#[test]
fn a_bias_in_the_plane_is_learned_about_its_one_axis() {
    let text = "model = \"odometry2d\"\nestimator = \"inekf\"\nmismatch = \"augmented\"\n[noise]\n\
                rotation_density = 0.001\ntranslation_density = 0.02\n[[position_source]]\nid = 0\n\
                [[position_source]]\nid = 1\n[[mismatched]]\nwhat = \"odometry_rotation_bias\"\nsigma = 0.05\n";
    let mut inputs = straight(0.5, 600);
    for input in &mut inputs {
        if let Input::Plane(row) = input {
            row.dtheta_rad = 0.002;
        }
    }
    if let Input::Set(state) = &mut inputs[0] {
        state.q_wb = [0.0, 0.0, 0.0, 1.0];
    }
    let last = run(text, &inputs).last().clone();
    // The rows turn by 0.02 rad/s where the body does not.
    assert!((last.mismatch[0] + 0.02).abs() < 0.002, "{last:?}");
}
