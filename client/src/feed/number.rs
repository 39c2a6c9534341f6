//! Rows become messages: a header with stamp, number, time of sending and epoch.

use inekf_shared::message::{
    Header, HeadingFix, INPUT_HEADING, INPUT_IMU, INPUT_ODOMETRY_2D, INPUT_ODOMETRY_3D,
    INPUT_POSITION, INPUT_VELOCITY, INPUTS, ImuSample, Odometry2d, Odometry3d, PositionFix,
    VelocityFix, Zero,
};

use crate::dataset::{
    Event, HeadingRow, ImuRow, Odometry2dRow, Odometry3dRow, PositionRow, VelocityRow,
};

/// Any input message, numbered and ready to send.
///
/// ```
/// use inekf_client::dataset::{Event, HeadingRow};
/// use inekf_client::feed::{Input, Numbering};
///
/// let row = HeadingRow { stamp_ns: 5, source: 1, heading_rad: 0.3, sigma_rad: 0.1 };
/// let Input::Heading(fix) = Numbering::new(7).message(&Event::Heading(row), 9) else {
///     panic!("a heading stays one")
/// };
/// assert_eq!((fix.header.stamp_ns, fix.header.sent_ns, fix.header.epoch), (5, 9, 7));
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Input {
    /// An IMU sample.
    Imu(ImuSample),
    /// A planar odometry increment.
    Odometry2d(Odometry2d),
    /// A spatial odometry increment.
    Odometry3d(Odometry3d),
    /// A position fix.
    Position(PositionFix),
    /// A velocity fix.
    Velocity(VelocityFix),
    /// A heading fix.
    Heading(HeadingFix),
}

/// Numbers the messages of one sender, topic by topic, so that the daemon can count losses.
///
/// ```
/// use inekf_client::dataset::{HeadingRow, ImuRow};
/// use inekf_client::feed::Numbering;
///
/// let sample = ImuRow { stamp_ns: 5, gyro_rps: [0.0; 3], accel_mps2: [0.0, 0.0, 9.81] };
/// let fix = HeadingRow { stamp_ns: 5, source: 0, heading_rad: 0.3, sigma_rad: 0.1 };
/// let mut numbering = Numbering::new(1);
/// // Each topic counts for itself: a gap in one is a loss on that one.
/// assert_eq!(numbering.imu(&sample, 0).header.seq, 0);
/// assert_eq!(numbering.imu(&sample, 0).header.seq, 1);
/// assert_eq!(numbering.heading(&fix, 0).header.seq, 0);
/// ```
#[derive(Clone, Debug)]
pub struct Numbering {
    epoch: u64,
    next: [u64; INPUTS],
}

impl Numbering {
    /// A new life of a sender; `epoch` tells it from its earlier lives (its start time will do).
    ///
    /// ```
    /// use inekf_client::dataset::ImuRow;
    /// use inekf_client::feed::Numbering;
    ///
    /// // A sender that was started again counts from 0, in another life.
    /// let row = ImuRow { stamp_ns: 5, gyro_rps: [0.0; 3], accel_mps2: [0.0, 0.0, 9.81] };
    /// let sent = Numbering::new(7).imu(&row, 0);
    /// assert_eq!((sent.header.epoch, sent.header.seq), (7, 0));
    /// ```
    pub fn new(epoch: u64) -> Self {
        Self {
            epoch,
            next: [0; INPUTS],
        }
    }

    /// The message for `event`, sent at `sent_ns` (CLOCK_MONOTONIC).
    ///
    /// ```
    /// use inekf_client::dataset::{Event, ImuRow};
    /// use inekf_client::feed::{Input, Numbering};
    ///
    /// let row = ImuRow { stamp_ns: 5, gyro_rps: [0.1, 0.0, 0.0], accel_mps2: [0.0, 0.0, 9.81] };
    /// let Input::Imu(sample) = Numbering::new(1).message(&Event::Imu(row), 12) else { unreachable!() };
    /// assert_eq!((sample.gyro_rps, sample.header.sent_ns), (row.gyro_rps, 12));
    /// ```
    pub fn message(&mut self, event: &Event, sent_ns: u64) -> Input {
        match event {
            Event::Imu(row) => Input::Imu(self.imu(row, sent_ns)),
            Event::Odometry2d(row) => Input::Odometry2d(self.odometry2d(row, sent_ns)),
            Event::Odometry3d(row) => Input::Odometry3d(self.odometry3d(row, sent_ns)),
            Event::Position(row) => Input::Position(self.position(row, sent_ns)),
            Event::Velocity(row) => Input::Velocity(self.velocity(row, sent_ns)),
            Event::Heading(row) => Input::Heading(self.heading(row, sent_ns)),
        }
    }

    /// The message for an IMU sample.
    ///
    /// ```
    /// use inekf_client::dataset::ImuRow;
    /// use inekf_client::feed::Numbering;
    ///
    /// let row = ImuRow { stamp_ns: 5, gyro_rps: [0.1, 0.0, 0.0], accel_mps2: [0.0, 0.0, 9.81] };
    /// let sample = Numbering::new(1).imu(&row, 12);
    /// // When it was measured, and when it was sent: two clocks.
    /// assert_eq!((sample.header.stamp_ns, sample.header.sent_ns), (5, 12));
    /// assert_eq!(sample.accel_mps2, row.accel_mps2);
    /// ```
    pub fn imu(&mut self, row: &ImuRow, sent_ns: u64) -> ImuSample {
        ImuSample {
            header: self.header(INPUT_IMU, row.stamp_ns, sent_ns),
            gyro_rps: row.gyro_rps,
            accel_mps2: row.accel_mps2,
        }
    }

    /// The message for a planar odometry increment.
    ///
    /// ```
    /// use inekf_client::dataset::Odometry2dRow;
    /// use inekf_client::feed::Numbering;
    ///
    /// let row = Odometry2dRow { stamp_ns: 5, dtheta_rad: 0.1, translation_m: [1.0, 0.0] };
    /// let increment = Numbering::new(1).odometry2d(&row, 0);
    /// assert_eq!((increment.dtheta_rad, increment.translation_m), (0.1, [1.0, 0.0]));
    /// ```
    pub fn odometry2d(&mut self, row: &Odometry2dRow, sent_ns: u64) -> Odometry2d {
        Odometry2d {
            header: self.header(INPUT_ODOMETRY_2D, row.stamp_ns, sent_ns),
            dtheta_rad: row.dtheta_rad,
            translation_m: row.translation_m,
        }
    }

    /// The message for a spatial odometry increment.
    ///
    /// ```
    /// use inekf_client::dataset::Odometry3dRow;
    /// use inekf_client::feed::Numbering;
    ///
    /// let row = Odometry3dRow { stamp_ns: 5, rotation_rad: [0.0, 0.0, 0.1], translation_m: [1.0, 0.0, 0.0] };
    /// let increment = Numbering::new(1).odometry3d(&row, 0);
    /// assert_eq!((increment.rotation_rad, increment.translation_m), (row.rotation_rad, row.translation_m));
    /// ```
    pub fn odometry3d(&mut self, row: &Odometry3dRow, sent_ns: u64) -> Odometry3d {
        Odometry3d {
            header: self.header(INPUT_ODOMETRY_3D, row.stamp_ns, sent_ns),
            rotation_rad: row.rotation_rad,
            translation_m: row.translation_m,
        }
    }

    /// The message for a position fix.
    ///
    /// ```
    /// use inekf_client::dataset::PositionRow;
    /// use inekf_client::feed::Numbering;
    ///
    /// let row = PositionRow { stamp_ns: 5, source: 1, dimension: 3, position_w_m: [1.0, 2.0, 3.0], sigma_m: [0.5, 0.5, 1.0] };
    /// // A row has standard deviations, a message the covariance, row by row.
    /// let fix = Numbering::new(1).position(&row, 0);
    /// assert_eq!(fix.covariance_w_m2, [0.25, 0.0, 0.0, 0.0, 0.25, 0.0, 0.0, 0.0, 1.0]);
    /// ```
    pub fn position(&mut self, row: &PositionRow, sent_ns: u64) -> PositionFix {
        PositionFix {
            header: self.header(INPUT_POSITION, row.stamp_ns, sent_ns),
            source: row.source,
            dimension: row.dimension,
            position_w_m: row.position_w_m,
            covariance_w_m2: diagonal(row.sigma_m),
        }
    }

    /// The message for a velocity fix.
    ///
    /// ```
    /// use inekf_client::dataset::VelocityRow;
    /// use inekf_client::feed::Numbering;
    ///
    /// let row = VelocityRow { stamp_ns: 5, source: 0, velocity_w_mps: [3.0, 0.0, 0.0], sigma_mps: [0.5; 3] };
    /// let fix = Numbering::new(1).velocity(&row, 0);
    /// assert_eq!((fix.velocity_w_mps, fix.covariance_w[0]), ([3.0, 0.0, 0.0], 0.25));
    /// ```
    pub fn velocity(&mut self, row: &VelocityRow, sent_ns: u64) -> VelocityFix {
        VelocityFix {
            header: self.header(INPUT_VELOCITY, row.stamp_ns, sent_ns),
            source: row.source,
            velocity_w_mps: row.velocity_w_mps,
            covariance_w: diagonal(row.sigma_mps),
            ..VelocityFix::ZERO
        }
    }

    /// The message for a heading fix.
    ///
    /// ```
    /// use inekf_client::dataset::HeadingRow;
    /// use inekf_client::feed::Numbering;
    ///
    /// let row = HeadingRow { stamp_ns: 5, source: 0, heading_rad: 0.3, sigma_rad: 0.1 };
    /// let fix = Numbering::new(1).heading(&row, 0);
    /// assert_eq!((fix.heading_rad, fix.sigma_rad), (0.3, 0.1));
    /// ```
    pub fn heading(&mut self, row: &HeadingRow, sent_ns: u64) -> HeadingFix {
        HeadingFix {
            header: self.header(INPUT_HEADING, row.stamp_ns, sent_ns),
            source: row.source,
            heading_rad: row.heading_rad,
            sigma_rad: row.sigma_rad,
            ..HeadingFix::ZERO
        }
    }

    fn header(&mut self, input: usize, stamp_ns: u64, sent_ns: u64) -> Header {
        let seq = self.next[input];
        self.next[input] += 1;
        Header {
            stamp_ns,
            seq,
            sent_ns,
            epoch: self.epoch,
        }
    }
}

/// The row-major covariance of independent axes.
fn diagonal(sigma: [f64; 3]) -> [f64; 9] {
    let [x, y, z] = sigma.map(|s| s * s);
    [x, 0.0, 0.0, 0.0, y, 0.0, 0.0, 0.0, z]
}
