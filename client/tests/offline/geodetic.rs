//! WGS 84 against its defining numbers, a published example, and closed forms.

use std::fs;

use inekf_client::dataset::Dataset;
use inekf_client::geodetic::{Geodetic, LocalFrame};
use tempfile::TempDir;

fn place(lat_deg: f64, lon_deg: f64, alt_m: f64) -> Geodetic {
    Geodetic {
        lat_deg,
        lon_deg,
        alt_m,
    }
}

fn assert_near(found: [f64; 3], expected: [f64; 3], tolerance: f64) {
    let near = found
        .iter()
        .zip(expected)
        .all(|(a, b)| (a - b).abs() < tolerance);
    assert!(near, "{found:?} {expected:?}");
}

#[test]
fn earth_centred_coordinates_are_those_of_the_ellipsoid() {
    // The axes of the ellipsoid, as NIMA TR 8350.2 lists them.
    let (a, b) = (6_378_137.0, 6_356_752.314_2);
    assert_near(place(0.0, 0.0, 0.0).ecef_m(), [a, 0.0, 0.0], 1e-6);
    assert_near(place(0.0, 90.0, 10.0).ecef_m(), [0.0, a + 10.0, 0.0], 1e-6);
    assert_near(place(90.0, 0.0, 0.0).ecef_m(), [0.0, 0.0, b], 1e-3);
    assert_near(place(-90.0, 0.0, 5.0).ecef_m(), [0.0, 0.0, -b - 5.0], 1e-3);
    // A worked example of a receiver's maker: 34 deg 0' 0.00174" N, 117 deg 20' 0.84965" W, 251.702 m.
    let example = place(
        34.0 + 0.00174 / 3600.0,
        -(117.0 + 20.0 / 60.0 + 0.84965 / 3600.0),
        251.702,
    );
    assert_near(
        example.ecef_m(),
        [-2_430_601.828, -4_702_442.703, 3_546_587.358],
        2e-3,
    );
}

#[test]
fn local_coordinates_are_those_of_closed_forms() {
    let a = 6_378_137.0;
    // Along the equator, which is a circle: east a sin, up a (cos - 1).
    let angle = 0.1_f64.to_radians();
    let enu = LocalFrame::new(place(0.0, 10.0, 0.0)).enu_m(place(0.0, 10.1, 0.0));
    assert_near(enu, [a * angle.sin(), 0.0, a * (angle.cos() - 1.0)], 1e-6);
    // A short step north is the meridian's radius of curvature, a (1 - e^2) / (1 - e^2 sin^2)^(3/2).
    let e2 = 0.006_694_379_990_14;
    let radius = a * (1.0 - e2) / (1.0 - e2 * 0.5_f64).powf(1.5);
    let enu = LocalFrame::new(place(45.0, 7.0, 0.0)).enu_m(place(45.0001, 7.0, 0.0));
    assert_near(enu, [0.0, radius * 1e-4_f64.to_radians(), 0.0], 1e-4);
    // Straight up is up anywhere.
    let enu = LocalFrame::new(place(-33.0, 151.0, 20.0)).enu_m(place(-33.0, 151.0, 120.0));
    assert_near(enu, [0.0, 0.0, 100.0], 1e-8);
}

#[test]
fn there_and_back_is_nothing() {
    for lat in [-90.0, -89.999, -45.0, -1e-9, 0.0, 12.3, 60.0, 89.999_999] {
        for lon in [-179.9, -90.0, 0.0, 13.4, 180.0] {
            let frame = LocalFrame::new(place(lat, lon, 100.0));
            for enu in [
                [0.0; 3],
                [1000.0, -2000.0, 50.0],
                [-80_000.0, 30_000.0, 9000.0],
            ] {
                assert_near(frame.enu_m(frame.geodetic(enu)), enu, 1e-6);
            }
        }
    }
}

#[test]
fn positions_by_latitude_and_longitude_are_read_into_the_world() {
    let folder = TempDir::new().unwrap();
    let write = |name: &str, text: &str| fs::write(folder.path().join(name), text).unwrap();
    write("imu.csv", "t_ns,gx,gy,gz,ax,ay,az\n1,0,0,0,0,0,9.8\n");
    write(
        "position.csv",
        "t_ns,lat,lon,alt,sx,sy,sz\n5,0,10,0,1,2,3\n6,0,10.1,0,1,2,3\n",
    );
    let angle = 0.1_f64.to_radians();
    let east = 6_378_137.0 * angle.sin();
    // Without an origin the first fix is it.
    let dataset = Dataset::load(folder.path()).unwrap();
    assert_near(dataset.position[0].position_w_m, [0.0; 3], 1e-9);
    assert!((dataset.position[1].position_w_m[0] - east).abs() < 1e-6);
    assert_eq!(dataset.position[1].sigma_m, [1.0, 2.0, 3.0]);
    assert_eq!(
        dataset.meta.other["origin_lat_lon_alt"].to_string(),
        "[0.0,10.0,0.0]"
    );
    // With one, it.
    write("meta.json", "{\"origin_lat_lon_alt\": [0, 10.1, 0]}");
    let dataset = Dataset::load(folder.path()).unwrap();
    assert!((dataset.position[0].position_w_m[0] + east).abs() < 1e-6);
    assert_near(dataset.position[1].position_w_m, [0.0; 3], 1e-9);

    write("meta.json", "{\"origin_lat_lon_alt\": [95, 10.1, 0]}");
    let error = Dataset::load(folder.path()).unwrap_err().to_string();
    assert!(error.contains("origin_lat_lon_alt"), "{error}");
    fs::remove_file(folder.path().join("meta.json")).unwrap();
    write(
        "position.csv",
        "t_ns,lat,lon,alt,sx,sy,sz\n5,95,10,0,1,2,3\n",
    );
    let error = Dataset::load(folder.path()).unwrap_err().to_string();
    assert!(error.contains("is no place"), "{error}");
}
