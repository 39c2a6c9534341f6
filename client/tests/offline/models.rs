//! The three models of the daemon: which rows each is fed, the state it starts from, and the rows of its estimate CSV.

use inekf_client::dataset::{
    Dataset, Event, HeadingRow, ImuRow, Initial, Meta, Odometry, Odometry2dRow, Odometry3dRow,
    PositionRow, VelocityRow,
};
use inekf_client::initial::state_vector;
use inekf_client::model::{Estimate, Model};
use inekf_client::rows::{RowBuilder, row, state, triangle};
use inekf_client::table::{EstimateState, EstimateWriter, read_estimates};
use inekf_shared::message::{
    ESTIMATE_PROPAGATED, ESTIMATE_REPLAYED, ESTIMATE_UPDATED, EstimateMessage, EstimateSe2,
    EstimateSe3, EstimateSe23, StateVector, Zero,
};

fn fix(stamp_ns: u64, source: u32, dimension: u32) -> PositionRow {
    PositionRow {
        stamp_ns,
        source,
        dimension,
        position_w_m: [1.0, 2.0, 0.0],
        sigma_m: [1.0; 3],
    }
}

/// A robot with an IMU and wheel odometry, as some recordings have both.
fn robot(odometry: Odometry) -> Dataset {
    let imu = |stamp_ns| ImuRow {
        stamp_ns,
        gyro_rps: [0.0; 3],
        accel_mps2: [0.0, 0.0, 9.8],
    };
    Dataset {
        imu: vec![imu(10), imu(20)],
        odometry,
        position: vec![fix(20, 0, 3), fix(20, 1, 3)],
        velocity: vec![VelocityRow {
            stamp_ns: 15,
            source: 0,
            velocity_w_mps: [0.0; 3],
            sigma_mps: [1.0; 3],
        }],
        heading: vec![HeadingRow {
            stamp_ns: 16,
            source: 0,
            heading_rad: 0.0,
            sigma_rad: 0.1,
        }],
        ..Dataset::default()
    }
}

fn planar() -> Odometry {
    let row = |stamp_ns| Odometry2dRow {
        stamp_ns,
        dtheta_rad: 0.1,
        translation_m: [1.0, 0.0],
    };
    Odometry::Planar(vec![row(12), row(22)])
}

fn spatial() -> Odometry {
    Odometry::Spatial(vec![Odometry3dRow {
        stamp_ns: 12,
        rotation_rad: [0.0; 3],
        translation_m: [1.0, 0.0, 0.0],
    }])
}

/// Kind and stamp of every row that a model is fed.
fn fed(dataset: &Dataset, model: Model) -> Vec<(&'static str, u64)> {
    let events = dataset.events_for(model).unwrap();
    let kind = |event: &Event| match event {
        Event::Position(_) => "position",
        Event::Velocity(_) => "velocity",
        Event::Heading(_) => "heading",
        Event::Imu(_) => "imu",
        Event::Odometry2d(_) => "planar",
        Event::Odometry3d(_) => "spatial",
    };
    let count = events.len();
    let fed: Vec<_> = events
        .map(|event| (kind(&event), event.stamp_ns()))
        .collect();
    assert_eq!(fed.len(), count);
    fed
}

#[test]
fn each_model_is_fed_with_what_moves_it_and_the_fixes_it_takes() {
    let both = robot(planar());
    assert_eq!(both.models(), [Model::Imu, Model::Odometry2d]);
    let of_imu = [
        ("imu", 10),
        ("velocity", 15),
        ("heading", 16),
        ("position", 20),
        ("position", 20),
        ("imu", 20),
    ];
    assert_eq!(fed(&both, Model::Imu), of_imu);
    let of_odometry = [
        ("planar", 12),
        ("position", 20),
        ("position", 20),
        ("planar", 22),
    ];
    assert_eq!(fed(&both, Model::Odometry2d), of_odometry);
    let of_spatial = [("spatial", 12), ("position", 20), ("position", 20)];
    assert_eq!(fed(&robot(spatial()), Model::Odometry3d), of_spatial);
}

#[test]
fn a_dataset_without_what_moves_the_model_is_refused_with_file_model_and_remedy() {
    let mut no_imu = robot(planar());
    no_imu.imu.clear();
    for (dataset, model, words) in [
        (
            no_imu,
            Model::Imu,
            ["no imu.csv", "model imu", "model = 'odometry2d'"],
        ),
        (
            robot(Odometry::None),
            Model::Odometry2d,
            [
                "no odometry.csv with t_ns,dtheta,dx,dy",
                "model odometry2d",
                "model = 'imu'",
            ],
        ),
        (
            robot(planar()),
            Model::Odometry3d,
            [
                "no odometry.csv with t_ns,rx,ry,rz,dx,dy,dz",
                "model odometry3d",
                "model = 'imu' or model = 'odometry2d'",
            ],
        ),
        (
            robot(spatial()),
            Model::Odometry2d,
            ["t_ns,dtheta,dx,dy", "odometry2d", "model = 'odometry3d'"],
        ),
        (
            robot(Odometry::Planar(Vec::new())),
            Model::Odometry2d,
            ["no odometry.csv", "odometry2d", "add it"],
        ),
    ] {
        let sentence = dataset.events_for(model).unwrap_err().to_string();
        for word in words {
            assert!(sentence.contains(word), "{word:?} is not in {sentence:?}");
        }
    }
}

#[test]
fn a_planar_fix_is_refused_in_space_and_a_spatial_fix_sent_in_the_plane() {
    let mut dataset = robot(spatial());
    dataset.position[1] = fix(20, 7, 2);
    for model in [Model::Imu, Model::Odometry3d] {
        let sentence = dataset.events_for(model).unwrap_err().to_string();
        for word in ["source 7", "20 ns", "without z", model.name(), "odometry2d"] {
            assert!(sentence.contains(word), "{word:?} is not in {sentence:?}");
        }
    }
    dataset.odometry = planar();
    let dimensions: Vec<u32> = dataset
        .events_for(Model::Odometry2d)
        .unwrap()
        .filter_map(|event| match event {
            Event::Position(row) => Some(row.dimension),
            _ => None,
        })
        .collect();
    assert_eq!(dimensions, [3, 2]);
}

const THETA_RAD: f64 = 2.5;

fn planar_start() -> Initial {
    Initial::Planar {
        stamp_ns: 0,
        theta_rad: THETA_RAD,
        p_w_m: [-3.0, 4.0],
    }
}

fn spatial_start() -> Initial {
    Initial::Spatial {
        stamp_ns: 12,
        q_wb: [0.1, 0.5, -0.1, 0.8544],
        v_w_mps: [1.0, 2.0, 3.0],
        p_w_m: [4.0, 5.0, 6.0],
        gyro_bias_rps: [0.01, 0.02, 0.03],
        accel_bias_mps2: [0.1, 0.2, 0.3],
    }
}

/// A dataset's meta with this start and the variances 1, 2, 3 and so on.
fn meta(initial: Initial, variances: usize) -> Meta {
    let p0_diag = (variances > 0).then(|| (1..=variances).map(|i| i as f64).collect());
    Meta {
        initial: Some(initial),
        p0_diag,
        ..Meta::default()
    }
}

/// The diagonal of a request's covariance; everything else has to be zero.
fn diagonal(state: &StateVector) -> Vec<f64> {
    let dimension = state.dimension as usize;
    let mut entries = state.covariance.iter();
    let mut diagonal = Vec::new();
    for i in 0..dimension {
        diagonal.push(*entries.next().unwrap());
        for _ in i + 1..dimension {
            assert_eq!(*entries.next().unwrap(), 0.0);
        }
    }
    assert!(entries.all(|entry| *entry == 0.0));
    diagonal
}

#[test]
fn a_planar_start_becomes_a_turn_about_z_with_three_variances() {
    let state = state_vector(&meta(planar_start(), 3), Model::Odometry2d)
        .unwrap()
        .unwrap();
    assert_eq!(state.model, EstimateSe2::MODEL);
    assert_eq!(state.stamp_ns, 0);
    assert_eq!(state.p_w_m, [-3.0, 4.0, 0.0]);
    let [x, y, z, w] = state.q_wb;
    assert_eq!((x, y), (0.0, 0.0));
    assert!((z.hypot(w) - 1.0).abs() < 1e-15);
    assert!((2.0 * z.atan2(w) - THETA_RAD).abs() < 1e-15);
    assert_eq!(diagonal(&state), [1.0, 2.0, 3.0]);
}

#[test]
fn a_spatial_start_keeps_for_each_model_what_it_has() {
    let of = |model, variances| {
        state_vector(&meta(spatial_start(), variances), model)
            .unwrap()
            .unwrap()
    };
    let pose = of(Model::Odometry3d, 6);
    assert_eq!(pose.model, EstimateSe3::MODEL);
    assert_eq!(diagonal(&pose), [1.0, 2.0, 3.0, 4.0, 5.0, 6.0]);
    assert_eq!(
        (pose.v_w_mps, pose.gyro_bias_rps, pose.accel_bias_mps2),
        ([0.0; 3], [0.0; 3], [0.0; 3])
    );
    for variances in [9, 15] {
        let navigation = of(Model::Imu, variances);
        assert_eq!(navigation.model, EstimateSe23::MODEL);
        assert_eq!(diagonal(&navigation).len(), variances);
        assert_eq!(navigation.v_w_mps, [1.0, 2.0, 3.0]);
        assert_eq!(navigation.gyro_bias_rps, [0.01, 0.02, 0.03]);
        assert_eq!(navigation.accel_bias_mps2, [0.1, 0.2, 0.3]);
        assert_eq!(
            (navigation.stamp_ns, navigation.q_wb, navigation.p_w_m),
            (pose.stamp_ns, pose.q_wb, pose.p_w_m)
        );
    }
    assert_eq!(pose.stamp_ns, 12);
    assert_eq!(pose.q_wb, [0.1, 0.5, -0.1, 0.8544]);
    assert_eq!(pose.p_w_m, [4.0, 5.0, 6.0]);
}

#[test]
fn without_variances_the_dimension_is_zero_and_without_a_start_there_is_no_request() {
    for (initial, model) in [
        (planar_start(), Model::Odometry2d),
        (spatial_start(), Model::Odometry3d),
        (spatial_start(), Model::Imu),
    ] {
        let state = state_vector(&meta(initial, 0), model).unwrap().unwrap();
        assert_eq!(state.dimension, 0);
        assert_eq!(diagonal(&state), [0.0; 0]);
        assert_eq!(state_vector(&Meta::default(), model), Ok(None));
    }
}

#[test]
fn a_start_that_is_not_the_models_is_refused_in_a_sentence() {
    for (initial, variances, model, words) in [
        (planar_start(), 3, Model::Imu, ["planar", "model imu"]),
        (
            planar_start(),
            3,
            Model::Odometry3d,
            ["planar", "odometry3d"],
        ),
        (
            spatial_start(),
            0,
            Model::Odometry2d,
            ["spatial", "odometry2d"],
        ),
        (
            planar_start(),
            6,
            Model::Odometry2d,
            ["6 entries", "takes 3"],
        ),
        (
            spatial_start(),
            15,
            Model::Odometry3d,
            ["15 entries", "takes 6"],
        ),
        (spatial_start(), 6, Model::Imu, ["6 entries", "9"]),
        (spatial_start(), 200, Model::Imu, ["200 entries", "15"]),
    ] {
        let sentence = state_vector(&meta(initial, variances), model)
            .unwrap_err()
            .to_string();
        for word in ["meta.json"].iter().chain(&words) {
            assert!(sentence.contains(word), "{word:?} is not in {sentence:?}");
        }
    }
}

/// An estimate whose numbers tell it from others.
trait Numbered: Estimate {
    const DIMENSION: u32;

    fn numbered(number: f64) -> Self;
}

impl Numbered for EstimateSe23 {
    const DIMENSION: u32 = 9;

    fn numbered(number: f64) -> Self {
        let mut estimate = Self {
            q_wb: [0.0, 0.0, 0.0, 1.0],
            p_w_m: [number; 3],
            ..Self::ZERO
        };
        estimate.covariance[..45].fill(number);
        estimate
    }
}

impl Numbered for EstimateSe3 {
    const DIMENSION: u32 = 6;

    fn numbered(number: f64) -> Self {
        Self {
            q_wb: [0.0, 0.0, 0.0, 1.0],
            p_w_m: [number; 3],
            covariance: [number; 21],
            ..Self::ZERO
        }
    }
}

impl Numbered for EstimateSe2 {
    const DIMENSION: u32 = 3;

    fn numbered(number: f64) -> Self {
        Self {
            theta_rad: 0.5,
            p_w_m: [number; 2],
            covariance: [number; 6],
            ..Self::ZERO
        }
    }
}

fn at<E: Numbered>(stamp_ns: u64, flags: u32, number: f64) -> E {
    let mut estimate = E::numbered(number);
    let head = estimate.head_mut();
    head.stamp_ns = stamp_ns;
    head.flags = flags;
    head.dimension = E::DIMENSION;
    estimate
}

/// The stamps and numbers of the rows that come of these stamps and flags; estimate k has the number k.
fn rows_of<E: Numbered>(stamps_and_flags: &[(u64, u32)]) -> Vec<(u64, f64)> {
    let mut builder = RowBuilder::<E>::default();
    let mut rows = Vec::new();
    for (number, (stamp_ns, flags)) in stamps_and_flags.iter().enumerate() {
        rows.extend(builder.push(at(*stamp_ns, *flags, number as f64)));
    }
    rows.extend(builder.finish());
    rows.iter()
        .map(|estimate| (estimate.head().stamp_ns, triangle(estimate)[0]))
        .collect()
}

fn assert_one_row_a_sample<E: Numbered>() {
    const BOTH: u32 = ESTIMATE_PROPAGATED | ESTIMATE_UPDATED;
    let rows = rows_of::<E>(&[
        // An update before the first sample has no row.
        (5, ESTIMATE_UPDATED),
        (10, ESTIMATE_PROPAGATED),
        // Two sources at the sample's stamp, one of them held back.
        (10, ESTIMATE_UPDATED),
        (10, ESTIMATE_UPDATED),
        // Between two samples: no row of its own.
        (15, ESTIMATE_UPDATED),
        (20, ESTIMATE_PROPAGATED),
        (20, ESTIMATE_UPDATED | ESTIMATE_REPLAYED),
        // A stamp is one row, whatever the flags.
        (30, ESTIMATE_PROPAGATED),
        (30, BOTH),
        (40, ESTIMATE_PROPAGATED),
    ]);
    assert_eq!(rows, [(10, 3.0), (20, 6.0), (30, 8.0), (40, 9.0)]);
    assert_eq!(rows_of::<E>(&[]), []);
}

#[test]
fn the_last_estimate_of_a_stamp_is_its_row_in_every_model() {
    assert_one_row_a_sample::<EstimateSe23>();
    assert_one_row_a_sample::<EstimateSe3>();
    assert_one_row_a_sample::<EstimateSe2>();
}

/// Writes estimates of one model, reads them back, and returns the header.
fn written_and_read<E: Numbered>() -> String {
    assert_eq!(E::KIND.code(), E::MODEL);
    assert_eq!(Model::from_code(E::MODEL), Some(E::KIND));
    let dimension = E::DIMENSION as usize;
    let mut writer = EstimateWriter::new(Vec::new(), E::LAYOUT, Some(dimension)).unwrap();
    let estimates = [10, 20].map(|stamp_ns| at::<E>(stamp_ns, 0, 0.1 * stamp_ns as f64));
    for estimate in &estimates {
        writer
            .write(
                estimate.head().stamp_ns,
                &state(estimate),
                triangle(estimate),
            )
            .unwrap();
    }
    let bytes = writer.finish().unwrap();
    let table = read_estimates("out.csv", bytes.as_slice()).unwrap();
    assert_eq!(table.layout, E::LAYOUT);
    assert_eq!(table.covariance_dimension, Some(dimension));
    assert_eq!(table.rows, estimates.map(|estimate| row(&estimate)));
    let text = String::from_utf8(bytes).unwrap();
    text.lines().next().unwrap().to_owned()
}

#[test]
fn each_model_has_its_columns() {
    assert_eq!(
        written_and_read::<EstimateSe2>(),
        "t_ns,theta,x,y,p_0_0,p_0_1,p_0_2,p_1_1,p_1_2,p_2_2"
    );
    let pose = written_and_read::<EstimateSe3>();
    assert!(pose.starts_with("t_ns,qx,qy,qz,qw,x,y,z,p_0_0,p_0_1,") && pose.ends_with(",p_5_5"));
    let navigation = written_and_read::<EstimateSe23>();
    assert!(navigation.starts_with("t_ns,qx,qy,qz,qw,vx,vy,vz,x,y,z,bgx,"));
    assert!(navigation.ends_with(",p_8_8"));
    assert_eq!(Model::from_code(0), None);
}

#[test]
fn a_mean_keeps_its_numbers() {
    let plane = EstimateSe2 {
        theta_rad: 0.25,
        p_w_m: [1.0, -2.0],
        ..EstimateSe2::ZERO
    };
    let expected = EstimateState::Plane {
        theta_rad: 0.25,
        p_w_m: [1.0, -2.0],
    };
    assert_eq!(state(&plane), expected);
    let pose = EstimateSe3 {
        q_wb: [0.6, 0.0, 0.0, 0.8],
        p_w_m: [1.0, -2.0, 3.0],
        ..EstimateSe3::ZERO
    };
    let expected = EstimateState::Pose {
        q_wb: [0.6, 0.0, 0.0, 0.8],
        p_w_m: [1.0, -2.0, 3.0],
    };
    assert_eq!(state(&pose), expected);
}
