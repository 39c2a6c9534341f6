//! Estimates as an MCAP file of ROS 2 messages, for Foxglove and rosbag2.
//!
//! | topic | message | frames |
//! |---|---|---|
//! | `/inekf/odometry` | `nav_msgs/msg/Odometry` | pose in `world`, twist in `base_link` ([`super::ros`]) |
//! | `/tf` | `tf2_msgs/msg/TFMessage` | `world` to `base_link` |
//!
//! Messages are in CDR; schemas are in the file. Not compressed, so that every reader can open it.

use std::io::{Seek, Write};

use mcap::records::MessageHeader;
use mcap::{WriteOptions, Writer};

use super::cdr::Cdr;
use super::ros::Odometry;
use super::{ExportError, require_sorted};
use crate::table::EstimateRow;

/// The frame that poses are in.
const WORLD: &str = "world";
/// The frame of the body.
const BODY: &str = "base_link";

/// Definitions of the messages, each followed by those it is made of.
const ODOMETRY: &str = "\
std_msgs/Header header
string child_frame_id
geometry_msgs/PoseWithCovariance pose
geometry_msgs/TwistWithCovariance twist
";
const POSE_WITH_COVARIANCE: &str = "geometry_msgs/Pose pose\nfloat64[36] covariance\n";
const TWIST_WITH_COVARIANCE: &str = "geometry_msgs/Twist twist\nfloat64[36] covariance\n";
const POSE: &str = "geometry_msgs/Point position\ngeometry_msgs/Quaternion orientation\n";
const TWIST: &str = "geometry_msgs/Vector3 linear\ngeometry_msgs/Vector3 angular\n";
const XYZ: &str = "float64 x\nfloat64 y\nfloat64 z\n";
const QUATERNION: &str = "float64 x\nfloat64 y\nfloat64 z\nfloat64 w\n";
const HEADER: &str = "builtin_interfaces/Time stamp\nstring frame_id\n";
const TIME: &str = "int32 sec\nuint32 nanosec\n";
const TF: &str = "geometry_msgs/TransformStamped[] transforms\n";
const TRANSFORM_STAMPED: &str =
    "std_msgs/Header header\nstring child_frame_id\ngeometry_msgs/Transform transform\n";
const TRANSFORM: &str = "geometry_msgs/Vector3 translation\ngeometry_msgs/Quaternion rotation\n";

/// Writes the file.
///
/// # Errors
/// [`ExportError`]; nothing is written if the stamps do not increase.
///
/// ```
/// use std::io::Cursor;
///
/// use inekf_client::exchange::mcap;
/// use inekf_client::table::read_estimates;
///
/// let table = read_estimates("estimate.csv", &b"t_ns,theta,x,y\n1500000000,0.0,1.0,2.0\n"[..])?;
/// let mut file = Cursor::new(Vec::new());
/// mcap::write(&table.rows, &mut file)?;
/// // The format's magic bytes, at both ends.
/// assert!(file.get_ref().starts_with(b"\x89MCAP0\r\n") && file.get_ref().ends_with(b"\x89MCAP0\r\n"));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn write(rows: &[EstimateRow], out: impl Write + Seek) -> Result<(), ExportError> {
    require_sorted(rows)?;
    let options = WriteOptions::new()
        .profile("ros2")
        .library(concat!("inekf-client ", env!("CARGO_PKG_VERSION")))
        .compression(None);
    let mut writer = Writer::with_options(out, options)?;
    let odometry = channel(
        &mut writer,
        "/inekf/odometry",
        "nav_msgs/msg/Odometry",
        &schema(
            ODOMETRY,
            &[
                ("std_msgs/Header", HEADER),
                ("builtin_interfaces/Time", TIME),
                ("geometry_msgs/PoseWithCovariance", POSE_WITH_COVARIANCE),
                ("geometry_msgs/Pose", POSE),
                ("geometry_msgs/Point", XYZ),
                ("geometry_msgs/Quaternion", QUATERNION),
                ("geometry_msgs/TwistWithCovariance", TWIST_WITH_COVARIANCE),
                ("geometry_msgs/Twist", TWIST),
                ("geometry_msgs/Vector3", XYZ),
            ],
        ),
    )?;
    let tf = channel(
        &mut writer,
        "/tf",
        "tf2_msgs/msg/TFMessage",
        &schema(
            TF,
            &[
                ("geometry_msgs/TransformStamped", TRANSFORM_STAMPED),
                ("std_msgs/Header", HEADER),
                ("builtin_interfaces/Time", TIME),
                ("geometry_msgs/Transform", TRANSFORM),
                ("geometry_msgs/Vector3", XYZ),
                ("geometry_msgs/Quaternion", QUATERNION),
            ],
        ),
    )?;
    for (sequence, row) in (0_u32..).zip(rows) {
        let message = Odometry::from_row(row);
        let stamp = Stamp::new(row.stamp_ns)?;
        for (channel_id, bytes) in [
            (odometry, odometry_message(&stamp, &message)),
            (tf, tf_message(&stamp, &message)),
        ] {
            let header = MessageHeader {
                channel_id,
                sequence,
                log_time: row.stamp_ns,
                publish_time: row.stamp_ns,
            };
            writer.write_to_known_channel(&header, &bytes)?;
        }
    }
    writer.finish()?;
    Ok(())
}

fn channel<W: Write + Seek>(
    writer: &mut Writer<W>,
    topic: &str,
    message: &str,
    definition: &str,
) -> Result<u16, ExportError> {
    let schema = writer.add_schema(message, "ros2msg", definition.as_bytes())?;
    Ok(writer.add_channel(schema, topic, "cdr", &Default::default())?)
}

/// A definition followed by those it needs, as rosbag2 concatenates them.
fn schema(definition: &str, parts: &[(&str, &str)]) -> String {
    let line = "=".repeat(80);
    let mut text = definition.to_owned();
    for (name, part) in parts {
        text += &format!("{line}\nMSG: {name}\n{part}");
    }
    text
}

/// ROS time: whole seconds in 32 bits with sign.
struct Stamp {
    seconds: u32,
    nanoseconds: u32,
}

impl Stamp {
    fn new(stamp_ns: u64) -> Result<Self, ExportError> {
        let seconds = i32::try_from(stamp_ns / 1_000_000_000)
            .map_err(|_| ExportError::TooLate { stamp_ns })?;
        Ok(Self {
            seconds: seconds.unsigned_abs(),
            // Less than 1e9.
            nanoseconds: (stamp_ns % 1_000_000_000) as u32,
        })
    }

    fn header(&self, cdr: &mut Cdr) {
        cdr.u32(self.seconds);
        cdr.u32(self.nanoseconds);
        cdr.string(WORLD);
        cdr.string(BODY);
    }
}

fn odometry_message(stamp: &Stamp, odometry: &Odometry) -> Vec<u8> {
    let mut cdr = Cdr::new();
    stamp.header(&mut cdr);
    cdr.f64s(odometry.pose.p_w_m.iter().copied());
    cdr.f64s(odometry.pose.q_wb.coords.iter().copied());
    // Symmetric: by rows or by columns is the same.
    cdr.f64s(odometry.pose_covariance.iter().copied());
    cdr.f64s(odometry.v_b_mps.iter().copied());
    cdr.f64s([0.0; 3]);
    cdr.f64s(odometry.twist_covariance.iter().copied());
    cdr.finish()
}

fn tf_message(stamp: &Stamp, odometry: &Odometry) -> Vec<u8> {
    let mut cdr = Cdr::new();
    cdr.u32(1);
    stamp.header(&mut cdr);
    cdr.f64s(odometry.pose.p_w_m.iter().copied());
    cdr.f64s(odometry.pose.q_wb.coords.iter().copied());
    cdr.finish()
}
