//! `position.csv` by latitude and longitude: `t_ns,lat,lon,alt,sx,sy,sz[,source]`, degrees and metres above the WGS 84
//! ellipsoid; the standard deviations are in metres east, north, up.
//!
//! The world's origin is the key `origin_lat_lon_alt` of `meta.json`, else the first fix; it is noted in the metadata of
//! the dataset, so that a folder saved from it says where it was.

use std::collections::BTreeMap;

use serde_json::json;

use super::load::{Table, fix_stamp, read_rows};
use super::{Meta, PositionRow};
use crate::geodetic::{Geodetic, LocalFrame};
use crate::table::{Fault, Faults};

/// Key of the origin.
const ORIGIN: &str = "origin_lat_lon_alt";
/// The columns.
const POSITION: &str = "t_ns,lat,lon,alt,sx,sy,sz";

/// The frame that the metadata name; a fault if what they name is no place.
pub fn frame_of(meta: &Meta, faults: &mut Faults) -> Option<LocalFrame> {
    let value = meta.other.get(ORIGIN)?;
    let numbers: Option<Vec<f64>> = value
        .as_array()
        .and_then(|entries| entries.iter().map(serde_json::Value::as_f64).collect());
    let place = match numbers.as_deref() {
        Some([lat_deg, lon_deg, alt_m]) => Some(Geodetic {
            lat_deg: *lat_deg,
            lon_deg: *lon_deg,
            alt_m: *alt_m,
        }),
        _ => None,
    };
    let place = place.filter(Geodetic::is_valid);
    if place.is_none() {
        let remedy = "write [latitude, longitude, height], in degrees and metres";
        let fault = Fault::in_file("meta.json", format!("{value} is no place"), remedy);
        faults.push(fault.at_column(ORIGIN));
    }
    place.map(LocalFrame::new)
}

/// Notes the origin.
pub fn note_frame(meta: &mut Meta, frame: &LocalFrame) {
    let origin = frame.origin();
    meta.other.insert(
        ORIGIN.to_owned(),
        json!([origin.lat_deg, origin.lon_deg, origin.alt_m]),
    );
}

/// Reads the fixes; the first one makes the frame if there is none.
pub fn read_position(
    table: Table,
    frame: &mut Option<LocalFrame>,
    faults: &mut Faults,
) -> Vec<PositionRow> {
    let mut last = BTreeMap::new();
    read_rows(table, POSITION, faults, |row| {
        let stamp = fix_stamp(row, &mut last);
        let place = row.numbers(["lat", "lon", "alt"]);
        let sigma = row.sigmas(["sx", "sy", "sz"]);
        let [lat_deg, lon_deg, alt_m] = place?;
        let place = Geodetic {
            lat_deg,
            lon_deg,
            alt_m,
        };
        if !place.is_valid() {
            let problem = format!("latitude {lat_deg}, longitude {lon_deg} is no place");
            row.fault("lat", problem, "give degrees, latitude first");
            return None;
        }
        let (stamp_ns, source) = stamp?;
        Some(PositionRow {
            stamp_ns,
            source,
            dimension: 3,
            position_w_m: frame.get_or_insert(LocalFrame::new(place)).enu_m(place),
            sigma_m: sigma?,
        })
    })
}
