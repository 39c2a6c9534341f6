//! Faults of the odometry models: keys of the other model, combinations of estimators and mismatches, stacking.

use inekf_service::config::{Config, Motion, OdometryNoise, RowSigmas};

use super::{NOISE, TOP, assert_single, faults_of, keys, text};

/// The noise of a sound text of odometry.
const ROWS: &str = "[noise]\nrotation_density = 3e-3\ntranslation_density = 1e-2\n";

/// The same for odometry: model and `top` before the first table, then the noise, then `tables`.
fn odometry(model: &str, top: &str, tables: &str) -> String {
    format!("model = \"{model}\"\n{top}\n{ROWS}{tables}\n")
}

/// Of odometry in the plane, with the setting `mismatch` and the table `[[mismatched]]` of `keys`.
fn mismatched(mismatch: &str, keys: &str) -> String {
    let estimator = match mismatch {
        "hard" | "soft" => "lc-inekf",
        _ => "inekf",
    };
    let top = format!("estimator = \"{estimator}\"\nmismatch = \"{mismatch}\"");
    odometry("odometry2d", &top, &format!("[[mismatched]]\n{keys}"))
}

/// 0.5 rad and 8 m in 0.25 s, worked out by hand.
#[test]
fn the_noise_of_a_row_grows_with_its_time_its_way_and_its_turn() {
    let read = |keys: &str| -> OdometryNoise {
        let text = format!("model = 'odometry2d'\n[noise]\n{keys}\n");
        match Config::from_toml_str(&text, "noise").unwrap().motion {
            Motion::Odometry(odometry) => odometry.noise,
            Motion::Inertial(_) => panic!("{text}"),
        }
    };
    let density = "rotation_density = 4\ntranslation_density = 6\nlateral_density = 8\n";
    let white = RowSigmas {
        rotation: 2.0,
        translation: 3.0,
        lateral: 4.0,
    };
    assert_eq!(read(density).row_sigmas(0.25, 8.0, 0.5), white);
    let per_row =
        "rotation_sigma_per_row = 2\ntranslation_sigma_per_row = 3\nlateral_sigma_per_row = 4\n";
    assert_eq!(read(per_row).row_sigmas(0.25, 8.0, 0.5), white);

    let slip =
        "rotation_per_sqrt_m = 0.5\nrotation_per_sqrt_rad = 2\ntranslation_per_sqrt_m = 0.25\n";
    let expected = RowSigmas {
        rotation: f64::sqrt(4.0 + 0.25 * 8.0 + 4.0 * 0.5),
        translation: f64::sqrt(9.0 + 0.0625 * 8.0),
        lateral: f64::sqrt(16.0 + 0.0625 * 8.0),
    };
    let noise = read(&format!("{per_row}{slip}"));
    assert_eq!(noise.row_sigmas(0.25, 8.0, 0.5), expected);
}

#[test]
fn each_fault_of_a_file_of_odometry() {
    let plane = "odometry2d";
    let space = "odometry3d";
    let cases: [(&str, &str, &str, &str, &[&str]); 36] = [
        (
            plane,
            "biases = false",
            "",
            "biases",
            &["only for model \"imu\""],
        ),
        (plane, "hold = \"forward\"", "", "hold", &["only for model"]),
        (
            space,
            "gravity_mps2 = 9.8",
            "",
            "gravity_mps2",
            &["only for model"],
        ),
        (
            space,
            "discretisation = \"zoh\"",
            "",
            "discretisation",
            &["only for"],
        ),
        (
            plane,
            "",
            "[imu]\nmax_gap_s = 1",
            "imu",
            &["only for model \"imu\""],
        ),
        (
            plane,
            "velocity_source = []",
            "",
            "velocity_source",
            &["only for model"],
        ),
        (
            plane,
            "",
            "[[heading_source]]\nid = 1",
            "heading_source",
            &["only for model"],
        ),
        (
            plane,
            "",
            "[odometry]\nmax_gap_s = 0",
            "odometry.max_gap_s",
            &["above 0, at most 60 s"],
        ),
        (
            plane,
            "",
            "[odometry]\nmax_rotation_rad = 3.2",
            "odometry.max_rotation_rad",
            &["at most 3.1 rad"],
        ),
        (
            plane,
            "",
            "[odometry]\nmax_translation_m = 0",
            "odometry.max_translation_m",
            &["at most 1000 m"],
        ),
        (
            plane,
            "",
            "[odometry]\nfirst_period_s = 61",
            "odometry.first_period_s",
            &["at most 60 s"],
        ),
        (
            plane,
            "",
            "[odometry]\non_gap = \"skip\"",
            "odometry.on_gap",
            &["\"inflate\""],
        ),
        (
            plane,
            "",
            "[initial]\nlevel = \"given\"",
            "initial.level",
            &["no tilt in the plane"],
        ),
        (
            plane,
            "",
            "[initial]\nroll_deg = 0",
            "initial.roll_deg",
            &["no tilt in the plane"],
        ),
        (
            space,
            "",
            "[initial]\nlevel = \"accelerometer\"",
            "initial.level",
            &["no accelerometer", "\"given\""],
        ),
        (
            space,
            "",
            "[initial]\nlevel_window_s = 1",
            "initial.level_window_s",
            &["only for model"],
        ),
        (
            space,
            "",
            "[initial]\nvelocity_mps = [0, 0, 0]",
            "initial.velocity_mps",
            &["only for model"],
        ),
        (
            plane,
            "",
            "[imu]\nmax_gap_s = 0\nmax_gap = 1",
            "imu",
            &["only for model"],
        ),
        (
            plane,
            "",
            "[[velocity_source]]\nid = 9",
            "velocity_source",
            &["only for model"],
        ),
        (
            plane,
            "",
            "[initial]\ngyro_bias_sigma_rps = 1",
            "initial.gyro_bias_sigma_rps",
            &["only for model"],
        ),
        (
            plane,
            "",
            "[initial]\nposition_m = [1, 2, 0]",
            "initial.position_m",
            &["must have 2 numbers, has 3"],
        ),
        (
            space,
            "",
            "[initial]\nposition_m = [1, 2]",
            "initial.position_m",
            &["must have 3 numbers, has 2"],
        ),
        (
            plane,
            "",
            "[[position_source]]\nlever_arm_m = [1]",
            "position_source[0].lever_arm_m",
            &["2 or 3 numbers, has 1"],
        ),
        (
            space,
            "",
            "[[position_source]]\nlever_arm_m = [1, 2]",
            "position_source[0].lever_arm_m",
            &["3 numbers, has 2"],
        ),
        (
            plane,
            "",
            "[[position_source]]\nscale_error = -1",
            "position_source[0].scale_error",
            &["-0.9 to 10"],
        ),
        (
            plane,
            "estimator = \"ekf\"\ninvariance = \"left\"",
            "",
            "invariance",
            &["is additive: remove"],
        ),
        (
            plane,
            "estimator = \"ekf\"\nmismatch = \"soft\"",
            "",
            "mismatch",
            &["cannot do that, but \"none\""],
        ),
        (
            plane,
            "mismatch = \"hard\"",
            "",
            "mismatch",
            &[
                "\"inekf\" cannot",
                "\"none\", \"consider\", \"augmented\", \"adaptive\"",
            ],
        ),
        (
            plane,
            "estimator = \"lc-ekf\"\nmismatch = \"none\"",
            "",
            "mismatch",
            &["\"hard\", \"soft\""],
        ),
        (
            plane,
            "mismatch = \"adaptive\"\ninvariance = \"right\"",
            "[[mismatched]]\nwhat = \"odometry_scale\"\nsigma = 1",
            "mismatch",
            &["needs invariance = \"left\""],
        ),
        (
            plane,
            "estimator = \"invariant-hinf\"\ninvariance = \"right\"",
            "[hinf]\ngamma = 0",
            "invariance",
            &["\"left\" only"],
        ),
        (
            plane,
            "estimator = \"invariant-hinf\"",
            "",
            "hinf",
            &["[hinf] is required"],
        ),
        (
            plane,
            "estimator = \"invariant-hinf\"",
            "[hinf]\ngain = \"kalman\"",
            "hinf.gamma",
            &["required, but missing"],
        ),
        (
            plane,
            "estimator = \"invariant-hinf\"",
            "[hinf]\ngamma = -1",
            "hinf.gamma",
            &["0 to 1000000"],
        ),
        (
            plane,
            "",
            "[hinf]",
            "hinf",
            &["needs estimator = \"invariant-hinf\""],
        ),
        (
            plane,
            "estimator = \"smoother\"",
            "",
            "estimator",
            &["built for model \"imu\" only"],
        ),
    ];
    for (model, top, tables, key, words) in cases {
        assert_single(&odometry(model, top, tables), key, words);
    }
}

#[test]
fn each_fault_of_odometry_in_a_file_of_an_imu() {
    let cases: [(&str, &str, &[&str]); 4] = [
        (
            "[odometry]\nmax_gap_s = 1",
            "odometry",
            &["\"odometry3d\" and \"odometry2d\""],
        ),
        (
            "[stacking]\nsources = [0, 1]\n[[position_source]]\n[[position_source]]\nid = 1",
            "stacking",
            &["only for models"],
        ),
        (
            "[[position_source]]\nscale_error = 0",
            "position_source[0].scale_error",
            &["only for models"],
        ),
        (
            "[[mismatched]]\nwhat = \"odometry_scale\"\nsigma = 1",
            "mismatched",
            &["does nothing about it"],
        ),
    ];
    for (tables, key, words) in cases {
        assert_single(&text("", tables), key, words);
    }
    let right = "invariance = \"right\"";
    assert_eq!(
        faults_of(&text(right, "")),
        [],
        "the right-invariant error is built"
    );
}

#[test]
fn each_fault_of_the_noise_of_odometry() {
    let noise = |keys: &str| format!("model = \"odometry2d\"\n[noise]\n{keys}\n");
    let densities = "rotation_density = 1\ntranslation_density = 1\n";
    let sigmas = "rotation_sigma_per_row = 1\ntranslation_sigma_per_row = 1\n";
    assert_eq!(
        keys(&faults_of(&noise(""))),
        ["noise.rotation_density", "noise.translation_density"]
    );
    let cases: [(&str, &str, &[&str]); 7] = [
        (
            "rotation_density = 1",
            "noise.translation_density",
            &["beside the other density", "m/sqrt(s)"],
        ),
        (
            "translation_sigma_per_row = 1",
            "noise.rotation_sigma_per_row",
            &["beside the other sigma per row"],
        ),
        (
            &format!("{densities}rotation_sigma_per_row = 1"),
            "noise.rotation_sigma_per_row",
            &["not both"],
        ),
        (
            &format!("{densities}lateral_sigma_per_row = 1"),
            "noise.lateral_sigma_per_row",
            &["not both"],
        ),
        (
            &format!("{sigmas}lateral_density = 1"),
            "noise.lateral_density",
            &["not both"],
        ),
        (
            &format!("{sigmas}gyro_bias_walk = 0"),
            "noise.gyro_bias_walk",
            &["only for model \"imu\""],
        ),
        (
            &format!("{sigmas}translation_per_sqrt_m = -1"),
            "noise.translation_per_sqrt_m",
            &["0 to 100 m/sqrt(m)"],
        ),
    ];
    for (given, key, words) in cases {
        assert_single(&noise(given), key, words);
    }
    assert_single(
        &format!("{TOP}{NOISE}rotation_per_sqrt_m = 0"),
        "noise.rotation_per_sqrt_m",
        &["only for models"],
    );
}

#[test]
fn each_fault_of_a_mismatch() {
    let scale = "what = \"odometry_scale\"\n";
    let cases: [(&str, &str, &str, &[&str]); 17] = [
        (
            "soft",
            "sigma = 1",
            "mismatched[0].what",
            &["required, but missing", "\"odometry_scale\""],
        ),
        (
            "soft",
            "what = \"odometry_scal\"\nsigma = 1",
            "mismatched[0].what",
            &["did you mean \"odometry_scale\"?"],
        ),
        (
            "soft",
            scale,
            "mismatched[0].sigma",
            &["required with mismatch = \"soft\""],
        ),
        (
            "augmented",
            scale,
            "mismatched[0].sigma",
            &["above 0, at most 10"],
        ),
        (
            "hard",
            "what = \"odometry_scale\"\nsigma = 0.1",
            "mismatched[0].sigma",
            &["any size"],
        ),
        (
            "soft",
            "what = \"odometry_scale\"\nsigma = 0",
            "mismatched[0].sigma",
            &["out of range"],
        ),
        (
            "soft",
            "what = \"odometry_scale\"\nsigma = 1\nburst_sigma = 1",
            "mismatched[0].burst_sigma",
            &["\"adaptive\""],
        ),
        (
            "adaptive",
            "what = \"odometry_scale\"\nsigma = 1\nwalk = 0",
            "mismatched[0].walk",
            &["\"augmented\""],
        ),
        (
            "hard",
            "what = \"odometry_scale\"\nsource = 0",
            "mismatched[0].source",
            &["about the odometry"],
        ),
        (
            "hard",
            "what = \"measurement_scale\"",
            "mismatched[0].source",
            &["required with \"measurement_scale\""],
        ),
        (
            "hard",
            "what = \"measurement_scale\"\nsource = 1",
            "mismatched[0].source",
            &["no [[position_source]] with id 1"],
        ),
        (
            "hard",
            "what = \"measurement_scale\"\nsource = 8",
            "mismatched[0].source",
            &["0 to 7"],
        ),
        (
            "hard",
            "what = \"odometry_scale\"\naxis = \"z\"",
            "mismatched[0].axis",
            &["has no axis"],
        ),
        (
            "hard",
            "what = \"odometry_rotation_bias\"\naxis = \"z\"",
            "mismatched[0].axis",
            &["in the plane it is z"],
        ),
        (
            "hard",
            "what = \"odometry_scale\"\n[[mismatched]]\nwhat = \"odometry_scale\"",
            "mismatched[1].what",
            &["a table above declares"],
        ),
        (
            "hard",
            "what = \"odometry_scale\"\n[[mismatched]]\nwhat = \"odometry_turn_scale\"\n\
             [[mismatched]]\nwhat = \"odometry_rotation_bias\"",
            "mismatched",
            &[
                "3 hard constraints",
                "2 outputs of position source 0",
                "\"soft\"",
            ],
        ),
        ("none", scale, "mismatched", &["does nothing about it"]),
    ];
    for (mismatch, given, key, words) in cases {
        assert_single(&mismatched(mismatch, given), key, words);
    }
    let in_space = "what = \"odometry_rotation_bias\"\naxis = \"w\"";
    assert_single(
        &mismatched("hard", in_space).replace("odometry2d", "odometry3d"),
        "mismatched[0].axis",
        &["\"x\", \"y\", \"z\""],
    );
    for empty in ["", "mismatched = []"] {
        let top = format!("mismatch = \"adaptive\"\n{empty}");
        assert_single(
            &odometry("odometry2d", &top, ""),
            "mismatched",
            &["at least one"],
        );
    }
}

#[test]
fn six_parameters_of_mismatches_are_the_most() {
    let top = "mismatch = \"augmented\"";
    let sources = "[[position_source]]\n[[position_source]]\nid = 1\n";
    let one =
        |what: &str, rest: &str| format!("[[mismatched]]\nwhat = \"{what}\"\nsigma = 1\n{rest}\n");
    let turned = |source: u32| one("measurement_rotation", &format!("source = {source}"));
    let six = [sources, &turned(0), &turned(1)].concat();
    assert_eq!(faults_of(&odometry("odometry3d", top, &six)), []);
    let seven = six.clone() + &one("odometry_scale", "");
    assert_single(
        &odometry("odometry3d", top, &seven),
        "mismatched",
        &["7 parameters", "at most 6"],
    );
    assert_eq!(
        faults_of(&odometry("odometry2d", top, &seven)),
        [],
        "in the plane a rotation has one"
    );
    let overlapping = six + &one("measurement_rotation", "source = 1\naxis = \"x\"");
    assert_single(
        &odometry("odometry3d", top, &overlapping).replace(
            "[[mismatched]]\nwhat = \"measurement_rotation\"\nsigma = 1\nsource = 0\n",
            "",
        ),
        "mismatched[1].what",
        &["a table above declares"],
    );
    let seventh = (0..7)
        .map(|_| one("odometry_scale", ""))
        .collect::<String>();
    let faults = faults_of(&odometry("odometry2d", top, &seventh));
    assert_eq!(keys(&faults).last(), Some(&"mismatched[6]"));
}

#[test]
fn stacking_makes_hard_constraints_solvable() {
    let top = "estimator = \"lc-inekf\"";
    let tables = "[[position_source]]\n[[position_source]]\nid = 1\n[[mismatched]]\nwhat = \"odometry_scale\"\n\
                  [[mismatched]]\nwhat = \"measurement_rotation\"\nsource = 0\n\
                  [[mismatched]]\nwhat = \"measurement_scale\"\nsource = 0\n";
    assert_single(
        &odometry("odometry2d", top, tables),
        "mismatched",
        &["3 hard constraints", "2 outputs of position source 0:"],
    );
    let stacked = |keys: &str| odometry("odometry2d", top, &format!("{tables}[stacking]\n{keys}"));
    assert_eq!(faults_of(&stacked("sources = [1, 0]")), []);
    assert_eq!(
        faults_of(&odometry(
            "odometry3d",
            "estimator = \"lc-inekf\"\nmismatch = \"soft\"",
            &tables.replace("what", "sigma = 1\nwhat")
        )),
        [],
        "soft constraints always have a solution"
    );
    assert_single(
        &odometry("odometry3d", top, tables),
        "mismatched",
        &["4 hard constraints", "3 outputs"],
    );

    let cases: [(&str, &str, &[&str]); 9] = [
        ("", "stacking.sources", &["required, but missing"]),
        (
            "sources = 1",
            "stacking.sources",
            &["an array of 2 whole numbers"],
        ),
        (
            "sources = [1]",
            "stacking.sources",
            &["must have 2 numbers, has 1"],
        ),
        ("sources = [1, 1]", "stacking.sources", &["two different"]),
        (
            "sources = [0, 2]",
            "stacking.sources",
            &["no [[position_source]] with id 2"],
        ),
        ("sources = [0, 8]", "stacking.sources[1]", &["0 to 7"]),
        (
            "sources = [0, 1]\ntolerance_s = 11",
            "stacking.tolerance_s",
            &["0 to 10 s"],
        ),
        (
            "sources = [0, 1]\nwait_s = -1",
            "stacking.wait_s",
            &["0 to 60 s"],
        ),
        (
            "sources = [0, 1]\nmissing = \"drop\"",
            "stacking.missing",
            &["\"unconstrained\", \"skip\""],
        ),
    ];
    for (given, key, words) in cases {
        assert_single(&stacked(given), key, words);
    }
}

#[test]
fn a_faulty_model_or_estimator_draws_no_other_fault() {
    assert_single(
        &odometry(
            "odometry2",
            "",
            "[odometry]\nmax_gap_s = 2\n[initial]\nposition_m = [0, 0]",
        ),
        "model",
        &["did you mean \"odometry2d\"?"],
    );
    assert_single(
        &odometry(
            "odometry2d",
            "estimator = \"invariant-hin\"",
            "[hinf]\ngamma = 0.1",
        ),
        "estimator",
        &["did you mean \"invariant-hinf\"?"],
    );
    assert_single(
        &odometry(
            "odometry2d",
            "estimator = \"lc-inek\"\nmismatch = \"hard\"",
            "[[mismatched]]\nwhat = \"odometry_scale\"",
        ),
        "estimator",
        &["did you mean \"lc-inekf\"?"],
    );
    let two = "[[position_source]]\nid = 9\n[[mismatched]]\nwhat = \"measurement_scale\"\nsource = 1\nsigma = 1";
    assert_single(
        &odometry("odometry2d", "mismatch = \"consider\"", two),
        "position_source[0].id",
        &["0 to 7"],
    );
}
