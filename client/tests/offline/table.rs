//! The estimate CSV: exact bytes, exact round trip, faults.

use inekf_client::table::{
    EstimateRow, EstimateState, EstimateTable, EstimateWriter, Layout, read_estimates,
};

fn write(table: &EstimateTable) -> Vec<u8> {
    let mut writer =
        EstimateWriter::new(Vec::new(), table.layout, table.covariance_dimension).unwrap();
    for row in &table.rows {
        writer
            .write(row.stamp_ns, &row.state, &row.covariance)
            .unwrap();
    }
    writer.finish().unwrap()
}

fn bits(values: &[f64]) -> Vec<u64> {
    values.iter().map(|value| value.to_bits()).collect()
}

#[test]
fn rows_are_the_shortest_decimals() {
    let table = EstimateTable {
        layout: Layout::Plane,
        covariance_dimension: Some(3),
        rows: vec![EstimateRow {
            stamp_ns: 18_446_744_073_709_551_615,
            state: EstimateState::Plane {
                theta_rad: 0.1 + 0.2,
                p_w_m: [-0.0, 1e300],
            },
            covariance: vec![1e-9, 0.25, -3.5, 5e-324, 0.0, 123456.789],
        }],
    };
    let expected = "t_ns,theta,x,y,p_0_0,p_0_1,p_0_2,p_1_1,p_1_2,p_2_2\n\
        18446744073709551615,0.30000000000000004,-0.0,1e300,1e-9,0.25,-3.5,5e-324,0.0,123456.789\n";
    assert_eq!(String::from_utf8(write(&table)).unwrap(), expected);
}

/// Numbers over all magnitudes, from a linear congruence on the bit pattern, and the awkward ones.
#[test]
fn every_double_reads_back_to_the_same_bits() {
    let mut seed = 0x9e37_79b9_7f4a_7c15_u64;
    let mut numbers = vec![
        -0.0,
        5e-324,
        f64::MIN_POSITIVE,
        f64::MAX,
        -f64::MAX,
        1.0 / 3.0,
    ];
    while numbers.len() < 9000 {
        seed = seed
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        let number = f64::from_bits(seed);
        if number.is_finite() {
            numbers.push(number);
        }
    }
    let rows: Vec<EstimateRow> = numbers
        .chunks_exact(132)
        .enumerate()
        .map(|(index, chunk)| EstimateRow {
            stamp_ns: index as u64,
            state: EstimateState::Navigation {
                q_wb: [0.5, -0.5, 0.5, 0.5],
                v_w_mps: [chunk[0], chunk[1], chunk[2]],
                p_w_m: [chunk[3], chunk[4], chunk[5]],
                gyro_bias_rps: [chunk[6], chunk[7], chunk[8]],
                accel_bias_mps2: [chunk[9], chunk[10], chunk[11]],
            },
            covariance: chunk[12..].to_vec(),
        })
        .collect();
    let table = EstimateTable {
        layout: Layout::Navigation,
        covariance_dimension: Some(15),
        rows,
    };
    let read = read_estimates("out.csv", write(&table).as_slice()).unwrap();
    assert_eq!(
        (read.layout, read.covariance_dimension),
        (Layout::Navigation, Some(15))
    );
    assert_eq!(read.rows.len(), 68);
    for (read, written) in read.rows.iter().zip(&table.rows) {
        assert_eq!(bits(&read.covariance), bits(&written.covariance));
        assert_eq!(format!("{:?}", read.state), format!("{:?}", written.state));
        assert_eq!(read.stamp_ns, written.stamp_ns);
    }
}

#[test]
fn layouts_are_told_apart_by_their_header() {
    let pose = EstimateState::Pose {
        q_wb: [0.0, 0.0, 0.0, 1.0],
        p_w_m: [1.0, 2.0, 3.0],
    };
    let plane = EstimateState::Plane {
        theta_rad: 1.0,
        p_w_m: [1.0, 2.0],
    };
    for state in [pose, plane] {
        let rows = vec![EstimateRow {
            stamp_ns: 4,
            state,
            covariance: Vec::new(),
        }];
        let table = EstimateTable {
            layout: state.layout(),
            covariance_dimension: None,
            rows,
        };
        assert_eq!(
            read_estimates("out.csv", write(&table).as_slice()).unwrap(),
            table
        );
    }
}

#[test]
fn a_row_that_does_not_fit_the_header_is_refused() {
    let mut writer = EstimateWriter::new(Vec::new(), Layout::Plane, Some(3)).unwrap();
    let plane = EstimateState::Plane {
        theta_rad: 0.0,
        p_w_m: [0.0; 2],
    };
    let pose = EstimateState::Pose {
        q_wb: [0.0, 0.0, 0.0, 1.0],
        p_w_m: [0.0; 3],
    };
    assert!(writer.write(1, &plane, &[0.0; 5]).is_err());
    assert!(writer.write(1, &pose, &[0.0; 6]).is_err());
    assert!(writer.write(1, &plane, &[0.0; 6]).is_ok());
    let text = String::from_utf8(writer.finish().unwrap()).unwrap();
    assert_eq!(text.lines().count(), 2, "refused rows leave nothing behind");
}

#[test]
fn faults_are_named() {
    for (text, wanted) in [
        ("", "out.csv: the file is empty"),
        ("t_ns,theta,x\n", "column y missing"),
        (
            "t_ns,theta,x,y\n1,NaN,0,0\n",
            "line 2 theta: `NaN` is not finite",
        ),
        (
            "t_ns,theta,x,y\n2,0,0,0\n1,0,0,0\n",
            "line 3 t_ns: stamp 1 is not after 2",
        ),
        ("t_ns,theta,x,y,p_0_0,p_0_1\n", "do not make a triangle"),
        (
            "t_ns,theta,x,y,p_0_0,p_0_1,p_0_2\n",
            "do not make a triangle",
        ),
    ] {
        let message = read_estimates("out.csv", text.as_bytes())
            .unwrap_err()
            .to_string();
        assert!(message.contains(wanted), "{message}");
    }
}
