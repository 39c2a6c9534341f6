//! Dataset folders: exact round trip, order of events, and faults said in plain words.

use std::fs;
use std::path::Path;

use inekf_client::dataset::{
    Dataset, DatasetError, Event, HeadingRow, ImuBias, ImuRow, LoadOptions, Odometry,
    Odometry2dRow, Odometry3dRow, PositionRow, Truth, Truth2dRow, TruthRow, VelocityRow,
};
use inekf_client::table::Fault;
use tempfile::TempDir;

/// Doubles that a careless writer or reader changes.
const AWKWARD: [f64; 6] = [
    0.1 + 0.2,
    -0.0,
    5e-324,
    2.225_073_858_507_201e-308,
    -1.797e308,
    1e-7,
];

fn vector(index: usize) -> [f64; 3] {
    [0, 1, 2].map(|axis| AWKWARD[(index + axis) % AWKWARD.len()])
}

fn full_dataset() -> Dataset {
    let stamps = [0, 7, 5_000_000_000, u64::MAX];
    let mut dataset = Dataset {
        odometry: Odometry::Spatial(Vec::new()),
        truth: Truth::Spatial(Vec::new()),
        ..Dataset::default()
    };
    dataset.meta.name = "full".to_owned();
    dataset.meta.gravity_mps2 = Some(0.1 + 0.2);
    let mut spatial = Vec::new();
    let mut truth = Vec::new();
    for (i, stamp_ns) in stamps.into_iter().enumerate() {
        dataset.imu.push(ImuRow {
            stamp_ns,
            gyro_rps: vector(i),
            accel_mps2: vector(i + 3),
        });
        spatial.push(Odometry3dRow {
            stamp_ns,
            rotation_rad: vector(i + 1),
            translation_m: vector(i),
        });
        let positive = vector(i).map(f64::abs);
        for source in [0, 3] {
            dataset.position.push(PositionRow {
                stamp_ns,
                source,
                dimension: 3,
                position_w_m: vector(i + 2),
                sigma_m: positive,
            });
        }
        let velocity_w_mps = vector(i);
        dataset.velocity.push(VelocityRow {
            stamp_ns,
            source: 1,
            velocity_w_mps,
            sigma_mps: positive,
        });
        let (heading_rad, sigma_rad) = (AWKWARD[i], positive[1]);
        dataset.heading.push(HeadingRow {
            stamp_ns,
            source: 0,
            heading_rad,
            sigma_rad,
        });
        truth.push(TruthRow {
            stamp_ns,
            q_wb: [0.6, -0.0, 0.0, 0.8],
            v_w_mps: vector(i),
            p_w_m: vector(i + 5),
            bias: Some(ImuBias {
                gyro_rps: vector(i + 4),
                accel_mps2: vector(i + 1),
            }),
        });
    }
    dataset.odometry = Odometry::Spatial(spatial);
    dataset.truth = Truth::Spatial(truth);
    dataset
}

/// Equality that tells -0.0 from 0.0: `Debug` prints the sign and enough digits.
fn assert_same_bits(left: &Dataset, right: &Dataset) {
    assert_eq!(format!("{left:?}"), format!("{right:?}"));
}

#[test]
fn spatial_dataset_comes_back_bit_for_bit() {
    let (dir, dataset) = (TempDir::new().unwrap(), full_dataset());
    dataset.save(dir.path()).unwrap();
    assert_same_bits(&Dataset::load(dir.path()).unwrap(), &dataset);
}

#[test]
fn planar_dataset_comes_back_bit_for_bit() {
    let dir = TempDir::new().unwrap();
    let p_w_m = [0.1 + 0.2, -0.0];
    let dataset = Dataset {
        odometry: Odometry::Planar(vec![Odometry2dRow {
            stamp_ns: 3,
            dtheta_rad: 5e-324,
            translation_m: p_w_m,
        }]),
        position: vec![PositionRow {
            stamp_ns: 2,
            source: 9,
            dimension: 2,
            position_w_m: [0.1, -1e300, 0.0],
            sigma_m: [0.3, 1e-9, 0.0],
        }],
        truth: Truth::Planar(vec![Truth2dRow {
            stamp_ns: 1,
            theta_rad: -0.0,
            p_w_m,
        }]),
        ..Dataset::default()
    };
    dataset.save(dir.path()).unwrap();
    assert_same_bits(&Dataset::load(dir.path()).unwrap(), &dataset);
}

#[test]
fn saving_again_leaves_no_file_of_the_earlier_dataset() {
    let dir = TempDir::new().unwrap();
    full_dataset().save(dir.path()).unwrap();
    let imu_only = Dataset {
        imu: full_dataset().imu,
        ..Dataset::default()
    };
    imu_only.save(dir.path()).unwrap();
    assert_same_bits(&Dataset::load(dir.path()).unwrap(), &imu_only);
}

#[test]
fn columns_are_found_by_name_and_others_ignored() {
    let dir = folder(&[
        (
            "imu.csv",
            "\u{feff}az, ay ,ax,temperature,gz,gy,gx,t_ns\n6,5,4,x,3,2,1,10\n",
        ),
        ("position.csv", "t_ns,fix,y,x,sy,sx\n10,ok,2,1,0.2,0.1\n"),
    ]);
    let dataset = Dataset::load(dir.path()).unwrap();
    let expected = ImuRow {
        stamp_ns: 10,
        gyro_rps: [1.0, 2.0, 3.0],
        accel_mps2: [4.0, 5.0, 6.0],
    };
    assert_eq!(dataset.imu, [expected]);
    assert_eq!(dataset.position[0].position_w_m, [1.0, 2.0, 0.0]);
    assert_eq!(
        (dataset.position[0].dimension, dataset.position[0].source),
        (2, 0)
    );
    assert_eq!(
        dataset.meta.name,
        dir.path().file_name().unwrap().to_string_lossy()
    );
}

#[test]
fn events_come_by_stamp_with_aiding_before_motion() {
    let dir = folder(&[
        (
            "imu.csv",
            "t_ns,gx,gy,gz,ax,ay,az\n10,0,0,0,0,0,9\n20,0,0,0,0,0,9\n",
        ),
        ("odometry.csv", "t_ns,dtheta,dx,dy\n5,0,1,0\n20,0,1,0\n"),
        (
            "position.csv",
            "t_ns,source,x,y,z,sx,sy,sz\n20,1,0,0,,1,1,\n20,0,0,0,,1,1,\n",
        ),
        (
            "velocity.csv",
            "t_ns,vx,vy,vz,sx,sy,sz\n10,0,0,0,1,1,1\n20,0,0,0,1,1,1\n",
        ),
        ("heading.csv", "t_ns,heading,sigma\n20,0.5,0.1\n"),
    ]);
    let dataset = Dataset::load(dir.path()).unwrap();
    let names: Vec<String> = dataset
        .events()
        .map(|event| match event {
            Event::Position(row) => format!("position {} @{}", row.source, row.stamp_ns),
            Event::Velocity(row) => format!("velocity @{}", row.stamp_ns),
            Event::Heading(row) => format!("heading @{}", row.stamp_ns),
            Event::Imu(row) => format!("imu @{}", row.stamp_ns),
            Event::Odometry2d(row) => format!("odometry @{}", row.stamp_ns),
            Event::Odometry3d(row) => format!("spatial @{}", row.stamp_ns),
        })
        .collect();
    let expected = [
        "odometry @5",
        "velocity @10",
        "imu @10",
        "position 0 @20",
        "position 1 @20",
        "velocity @20",
        "heading @20",
        "imu @20",
        "odometry @20",
    ];
    assert_eq!(names, expected);
    assert_eq!(dataset.events().len(), expected.len());
}

const GOOD_IMU: &str = "t_ns,gx,gy,gz,ax,ay,az\n1,0,0,0,0,0,9.8\n";

fn folder(files: &[(&str, &str)]) -> TempDir {
    let dir = TempDir::new().unwrap();
    for (name, text) in files {
        fs::write(dir.path().join(name), text).unwrap();
    }
    dir
}

fn faults_of(dir: &Path) -> Vec<Fault> {
    match Dataset::load(dir) {
        Err(DatasetError::Faults { faults, .. }) => faults.list().to_vec(),
        other => panic!("expected faults, found {other:?}"),
    }
}

/// Each faulty file with what its one message has to say.
#[test]
fn every_fault_names_file_line_column_value_and_remedy() {
    let cases: &[(&str, &str, &[&str])] = &[
        ("imu.csv", "", &["imu.csv", "empty", "t_ns,gx,gy,gz"]),
        (
            "imu.csv",
            "t_ns,gx,gy,gz,ax,ay,az\n",
            &["imu.csv", "no rows"],
        ),
        (
            "imu.csv",
            "t_ns,gx,gy,gz,acc_x,ay,az\n1,0,0,0,0,0,9\n",
            &[
                "line 1",
                "column ax missing",
                "t_ns,gx,gy,gz,acc_x,ay,az",
                "has to name",
            ],
        ),
        (
            "imu.csv",
            "t_ns,gx,gx,gy,gz,ax,ay,az\n1,0,0,0,0,0,0,9\n",
            &["line 1 gx", "occurs twice"],
        ),
        (
            "imu.csv",
            "t_ns,gx,gy,gz,ax,ay,az\n1,0,0,0,0,0,9\n2,0,0,one,0,0,9\n",
            &["line 3 gz", "`one` is not a number"],
        ),
        (
            "imu.csv",
            "t_ns,gx,gy,gz,ax,ay,az\n1,0,NaN,0,0,0,9\n",
            &["line 2 gy", "`NaN` is not finite", "leave"],
        ),
        (
            "imu.csv",
            "t_ns,gx,gy,gz,ax,ay,az\n1,0,0,0,0,-inf,9\n",
            &["line 2 ay", "`-inf` is not finite"],
        ),
        (
            "imu.csv",
            "t_ns,gx,gy,gz,ax,ay,az\n1,0,0,0,0,,9\n",
            &["line 2 ay", "empty"],
        ),
        (
            "imu.csv",
            "t_ns,gx,gy,gz,ax,ay,az\n1,0,0,0,0,9\n",
            &["line 2", "6 fields", "header has 7"],
        ),
        (
            "imu.csv",
            "t_ns,gx,gy,gz,ax,ay,az\n1.5,0,0,0,0,0,9\n",
            &[
                "line 2 t_ns",
                "`1.5` is not a whole number of nanoseconds",
                "integer",
            ],
        ),
        (
            "imu.csv",
            "t_ns,gx,gy,gz,ax,ay,az\n-1,0,0,0,0,0,9\n",
            &[
                "line 2 t_ns",
                "`-1` is not a whole number of nanoseconds from 0 up",
            ],
        ),
        (
            "imu.csv",
            "t_ns,gx,gy,gz,ax,ay,az\n9,0,0,0,0,0,9\n9,0,0,0,0,0,9\n",
            &["line 3 t_ns", "9 is not after 9", "sort"],
        ),
        (
            "position.csv",
            "t_ns,x,y,z,sx,sy,sz\n1,0,0,0,1,-0.5,1\n",
            &["position.csv line 2 sy", "-0.5 is negative", "positive"],
        ),
        (
            "position.csv",
            "t_ns,x,y,z,sx,sy,sz\n1,0,0,5,1,1,\n",
            &["position.csv line 2 sz", "empty"],
        ),
        (
            "position.csv",
            "t_ns,source,x,y,z,sx,sy,sz\n1,gps,0,0,0,1,1,1\n",
            &["line 2 source", "`gps` is not a source number", "0, 1, 2"],
        ),
        (
            "position.csv",
            "t_ns,source,x,y,z,sx,sy,sz\n4,1,0,0,0,1,1,1\n5,0,0,0,0,1,1,1\n3,1,0,0,0,1,1,1\n",
            &["line 4 t_ns", "3 is not after 4"],
        ),
        (
            "velocity.csv",
            "t_ns,vx,vy,sx,sy,sz\n1,0,0,1,1,1\n",
            &["velocity.csv", "column vz missing"],
        ),
        (
            "heading.csv",
            "t_ns,heading,sigma\n1,0,-0.1\n",
            &["heading.csv line 2 sigma", "negative"],
        ),
        (
            "odometry.csv",
            "t_ns,dt,v,w\n1,0,0,0\n",
            &[
                "odometry.csv",
                "columns dtheta, dx, dy missing",
                "t_ns,dt,v,w",
            ],
        ),
        (
            "truth.csv",
            "t_ns,qw,qx,qy,qz,vx,vy,vz,x,y,z\n1,1,1,0,0,0,0,0,0,0,0\n",
            &["truth.csv line 2", "norm is 1.414", "unit"],
        ),
        (
            "meta.json",
            "{\n\"name\": \n",
            &["meta.json line", "not JSON", "delete"],
        ),
        ("meta.json", "[1, 2]", &["meta.json", "no object"]),
    ];
    for (file, text, wanted) in cases {
        let mut files = vec![(*file, *text)];
        if *file != "imu.csv" {
            files.push(("imu.csv", GOOD_IMU));
        }
        let faults = faults_of(folder(&files).path());
        assert_eq!(faults.len(), 1, "{file} {text:?}: {faults:?}");
        let message = faults[0].to_string();
        assert!(!faults[0].remedy.is_empty());
        for part in *wanted {
            assert!(message.contains(part), "{message:?} lacks {part:?}");
        }
        assert!(!message.contains('\n'), "{message:?} is one line");
    }
}

#[test]
fn all_faults_of_all_files_are_collected() {
    let dir = folder(&[
        (
            "imu.csv",
            "t_ns,gx,gy,gz,ax,ay,az\n1,a,0,0,b,0,9\n1,0,0,0,0,0,9\n1,0,0,0,0,0,9\n",
        ),
        ("position.csv", "t_ns,x,y,z,sx,sy,sz\n2,0,0,0,1,1,nan\n"),
        ("meta.json", "{\"gravity\": \"big\"}"),
    ]);
    let faults = faults_of(dir.path());
    let places: Vec<_> = faults
        .iter()
        .map(|fault| (fault.file.as_str(), fault.line, fault.column.as_deref()))
        .collect();
    let expected = [
        ("meta.json", None, Some("gravity")),
        ("imu.csv", Some(2), Some("gx")),
        ("imu.csv", Some(2), Some("ax")),
        ("imu.csv", Some(3), Some("t_ns")),
        ("imu.csv", Some(4), Some("t_ns")),
        ("position.csv", Some(2), Some("sz")),
    ];
    assert_eq!(places, expected);
    let message = Dataset::load(dir.path()).unwrap_err().to_string();
    assert!(
        message.contains("(and 5 more)") && !message.contains('\n'),
        "{message}"
    );
}

#[test]
fn a_file_with_faults_on_every_line_is_given_up() {
    let rows: String = (0..1000).map(|i| format!("{i};0;0;0;0;0;9\n")).collect();
    let dir = folder(&[("imu.csv", &format!("t_ns,gx,gy,gz,ax,ay,az\n{rows}"))]);
    let faults = faults_of(dir.path());
    assert_eq!(faults.len(), 11);
    assert!(faults[10].problem.contains("stopped after 10"));
}

#[test]
fn missing_files_and_folders_are_named() {
    let faults = faults_of(folder(&[]).path());
    assert!(
        faults[0]
            .to_string()
            .contains("neither imu.csv nor odometry.csv"),
        "{faults:?}"
    );

    let dir = folder(&[("imu.csv", GOOD_IMU)]);
    let absent = dir.path().join("absent");
    let message = Dataset::load(&absent).unwrap_err().to_string();
    assert!(
        message.contains("absent") && message.contains("name a folder"),
        "{message}"
    );

    let position_file = "position_noisy.csv".to_owned();
    let options = LoadOptions {
        position_file,
        ..LoadOptions::default()
    };
    let message = Dataset::load_with(dir.path(), &options)
        .unwrap_err()
        .to_string();
    assert!(
        message.contains("position_noisy.csv: the file is not there"),
        "{message}"
    );
}

#[test]
fn another_position_file_can_be_chosen() {
    let dir = folder(&[
        ("imu.csv", GOOD_IMU),
        ("position.csv", "t_ns,x,y,z,sx,sy,sz\n1,1,1,1,1,1,1\n"),
        ("rough.csv", "t_ns,x,y,z,sx,sy,sz\n1,2,2,2,3,3,3\n"),
    ]);
    let options = LoadOptions {
        position_file: "rough.csv".to_owned(),
        ..LoadOptions::default()
    };
    let dataset = Dataset::load_with(dir.path(), &options).unwrap();
    assert_eq!(dataset.position[0].sigma_m, [3.0; 3]);
}
