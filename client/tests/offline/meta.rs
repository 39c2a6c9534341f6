//! `meta.json`: every key that means something, in each of its forms.

use inekf_client::dataset::{ImuNoise, Initial, Meta};
use inekf_client::table::Faults;

fn parse(text: &str) -> Meta {
    let mut faults = Faults::new();
    let meta = Meta::parse(text, &mut faults);
    assert!(faults.is_empty(), "{faults}");
    meta
}

fn faults(text: &str) -> Vec<String> {
    let mut faults = Faults::new();
    Meta::parse(text, &mut faults);
    faults.list().iter().map(ToString::to_string).collect()
}

const SPATIAL: Initial = Initial::Spatial {
    stamp_ns: 12,
    q_wb: [0.1, 0.5, -0.1, 0.8544],
    v_w_mps: [1.0, 2.0, 3.0],
    p_w_m: [4.0, 5.0, 6.0],
    gyro_bias_rps: [0.01, 0.02, 0.03],
    accel_bias_mps2: [0.1, 0.2, 0.3],
};

#[test]
fn initial_state_in_space_from_single_keys_or_arrays() {
    let keys = r#"{"initial": {"t_ns": 12, "qw": 0.8544, "qx": 0.1, "qy": 0.5, "qz": -0.1,
        "vx": 1, "vy": 2, "vz": 3, "x": 4, "y": 5, "z": 6,
        "bgx": 0.01, "bgy": 0.02, "bgz": 0.03, "bax": 0.1, "bay": 0.2, "baz": 0.3}}"#;
    let arrays = r#"{"initial": {"t_ns": 12, "q_wb": [0.1, 0.5, -0.1, 0.8544], "v_w": [1, 2, 3],
        "p_w": [4, 5, 6], "gyro_bias": [0.01, 0.02, 0.03], "accel_bias": [0.1, 0.2, 0.3]}}"#;
    assert_eq!(parse(keys).initial, Some(SPATIAL));
    assert_eq!(parse(arrays).initial, Some(SPATIAL));
    let without = r#"{"initial": {"t_ns": 0, "qw": 1, "qx": 0, "qy": 0, "qz": 0,
        "x": 4, "y": 5, "z": 6}}"#;
    let Some(Initial::Spatial {
        v_w_mps,
        gyro_bias_rps,
        ..
    }) = parse(without).initial
    else {
        panic!("a state in space");
    };
    assert_eq!((v_w_mps, gyro_bias_rps), ([0.0; 3], [0.0; 3]));
}

#[test]
fn initial_state_in_the_plane() {
    let meta = parse(
        r#"{"initial": {"t_ns": 7, "theta": 0.5, "x": -1, "y": 2}, "P0_diag": [0.0009, 9, 9]}"#,
    );
    let expected = Initial::Planar {
        stamp_ns: 7,
        theta_rad: 0.5,
        p_w_m: [-1.0, 2.0],
    };
    assert_eq!(meta.initial, Some(expected));
    assert_eq!(meta.p0_diag.as_deref(), Some([0.0009, 9.0, 9.0].as_slice()));
}

#[test]
fn lever_arms_by_source_or_one_for_all() {
    let one = parse(r#"{"lever_arm_flu_m": [1, 2, 3]}"#);
    assert_eq!(
        (one.lever_arm_m(0), one.lever_arm_m(5)),
        ([1.0, 2.0, 3.0], [1.0, 2.0, 3.0])
    );
    let two = parse(r#"{"lever_arms": [[1, 2], [3, 4]]}"#);
    assert_eq!(
        (two.lever_arm_m(1), two.lever_arm_m(2)),
        ([3.0, 4.0, 0.0], [0.0; 3])
    );
    assert_eq!(parse("{}").lever_arm_m(0), [0.0; 3]);
}

#[test]
fn everything_comes_back_and_unknown_keys_are_kept() {
    let meta = Meta {
        name: "a \"name\"".to_owned(),
        kind: "imu".to_owned(),
        gravity_mps2: Some(9.806_650_000_000_001),
        lever_arms_m: vec![[0.1 + 0.2, -0.0, 5e-324], [1.0, 2.0, 3.0]],
        imu_noise: Some(ImuNoise {
            gyro_density: 1.1e-4,
            accel_density: 1.0 / 3.0,
            gyro_bias_walk: 1e-300,
            accel_bias_walk: 0.0,
        }),
        initial: Some(SPATIAL),
        p0_diag: Some((0..15).map(|i| f64::from(i) / 7.0).collect()),
        other: parse(r#"{"origin_lla": [42.375812, -71.14739466666667], "note": "x"}"#).other,
    };
    assert_eq!(meta.other.len(), 2);
    assert_eq!(parse(&meta.to_json()), meta);
    let remark = parse(r#"{"imu_noise": {"gyro_nd": 1, "source": "data sheet"}}"#);
    assert!(remark.to_json().contains("data sheet"));
    assert_eq!(parse(&remark.to_json()), remark);
}

#[test]
fn faults_name_the_key() {
    for (text, wanted) in [
        (r#"{"name": 5}"#, "meta.json name: 5 is not text"),
        (r#"{"gravity": -9.8}"#, "meta.json gravity: -9.8"),
        (
            r#"{"lever_arm_flu_m": [1]}"#,
            "meta.json lever_arm_flu_m: [1] does not fit",
        ),
        (
            r#"{"lever_arms": {}}"#,
            "meta.json lever_arms: {} is not a list",
        ),
        (
            r#"{"imu_noise": {"gyro_nd": "x"}}"#,
            "meta.json imu_noise.gyro_nd",
        ),
        (
            r#"{"P0_diag": [1, 2]}"#,
            "meta.json P0_diag: [1,2] does not fit",
        ),
        (r#"{"P0_diag": [1, 2, -3]}"#, "negative"),
        (
            r#"{"initial": {"theta": 1, "x": 0, "y": 0}}"#,
            "meta.json initial.t_ns",
        ),
        (
            r#"{"initial": {"t_ns": 1, "theta": 1, "x": 0}}"#,
            "meta.json initial.y",
        ),
        (
            r#"{"initial": {"t_ns": 1, "qw": 2, "qx": 0, "qy": 0, "qz": 0, "x": 0, "y": 0, "z": 0}}"#,
            "norm is 2.0",
        ),
    ] {
        let faults = faults(text);
        assert_eq!(faults.len(), 1, "{text}: {faults:?}");
        assert!(faults[0].contains(wanted), "{faults:?} lacks {wanted}");
    }
}
