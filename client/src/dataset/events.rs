//! The rows of a dataset merged into one stream, in the order in which a daemon is to be fed.
//!
//! Order: by stamp; at one stamp position (by source), velocity, heading, IMU, odometry. Aiding
//! comes first so that the daemon already holds a fix when the sample that reaches its stamp
//! arrives. The order is a function of the dataset alone, so two replays feed the same sequence.

use super::{
    Dataset, HeadingRow, ImuRow, Odometry, Odometry2dRow, Odometry3dRow, PositionRow, VelocityRow,
};
use crate::model::Model;

/// One row of any kind.
///
/// ```
/// use inekf_client::dataset::{Event, HeadingRow, ImuRow};
///
/// let sample = Event::Imu(ImuRow { stamp_ns: 5, gyro_rps: [0.0; 3], accel_mps2: [0.0, 0.0, 9.81] });
/// let fix = Event::Heading(HeadingRow { stamp_ns: 5, source: 0, heading_rad: 0.1, sigma_rad: 0.02 });
/// // The sample moves the state, the fix corrects it, at the same time.
/// assert!(sample.is_motion() && !fix.is_motion());
/// assert_eq!(sample.stamp_ns(), fix.stamp_ns());
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Event {
    /// A position fix.
    Position(PositionRow),
    /// A velocity fix.
    Velocity(VelocityRow),
    /// A heading fix.
    Heading(HeadingRow),
    /// An IMU sample.
    Imu(ImuRow),
    /// A planar odometry increment.
    Odometry2d(Odometry2dRow),
    /// A spatial odometry increment.
    Odometry3d(Odometry3dRow),
}

impl Event {
    /// The row's stamp, ns.
    ///
    /// ```
    /// use inekf_client::dataset::{Event, HeadingRow};
    ///
    /// let fix = HeadingRow { stamp_ns: 5, source: 0, heading_rad: 0.3, sigma_rad: 0.1 };
    /// assert_eq!(Event::Heading(fix).stamp_ns(), 5);
    /// ```
    pub fn stamp_ns(&self) -> u64 {
        match self {
            Self::Position(row) => row.stamp_ns,
            Self::Velocity(row) => row.stamp_ns,
            Self::Heading(row) => row.stamp_ns,
            Self::Imu(row) => row.stamp_ns,
            Self::Odometry2d(row) => row.stamp_ns,
            Self::Odometry3d(row) => row.stamp_ns,
        }
    }

    /// Whether it moves the state (IMU, odometry) rather than corrects it.
    ///
    /// ```
    /// use inekf_client::dataset::{Event, Odometry2dRow};
    ///
    /// let row = Odometry2dRow { stamp_ns: 1, dtheta_rad: 0.0, translation_m: [0.1, 0.0] };
    /// assert!(Event::Odometry2d(row).is_motion());
    /// ```
    pub fn is_motion(&self) -> bool {
        matches!(
            self,
            Self::Imu(_) | Self::Odometry2d(_) | Self::Odometry3d(_)
        )
    }
}

/// Iterator over a dataset's rows in feeding order; made by [`Dataset::events`] and
/// [`Dataset::events_for`].
///
/// ```
/// use inekf_client::dataset::{Dataset, Event, ImuRow, PositionRow};
///
/// let sample = |stamp_ns| ImuRow { stamp_ns, gyro_rps: [0.0; 3], accel_mps2: [0.0, 0.0, 9.81] };
/// let drive = Dataset {
///     imu: vec![sample(10), sample(20)],
///     position: vec![PositionRow {
///         stamp_ns: 20,
///         source: 0,
///         dimension: 3,
///         position_w_m: [0.0; 3],
///         sigma_m: [1.0; 3],
///     }],
///     ..Dataset::default()
/// };
/// // It knows how many are left; the fix comes before the sample that reaches its stamp.
/// let mut events = drive.events();
/// assert_eq!(events.len(), 3);
/// assert_eq!(events.next().map(|event| event.stamp_ns()), Some(10));
/// assert!(matches!(events.next(), Some(Event::Position(_))));
/// assert!(matches!(events.next(), Some(Event::Imu(_))));
/// ```
#[derive(Clone, Debug)]
pub struct Events<'a> {
    position: &'a [PositionRow],
    velocity: &'a [VelocityRow],
    heading: &'a [HeadingRow],
    imu: &'a [ImuRow],
    odometry2d: &'a [Odometry2dRow],
    odometry3d: &'a [Odometry3dRow],
}

impl<'a> Events<'a> {
    pub(super) fn new(dataset: &'a Dataset) -> Self {
        let (odometry2d, odometry3d): (&[Odometry2dRow], &[Odometry3dRow]) = match &dataset.odometry
        {
            Odometry::None => (&[], &[]),
            Odometry::Planar(rows) => (rows, &[]),
            Odometry::Spatial(rows) => (&[], rows),
        };
        Self {
            position: &dataset.position,
            velocity: &dataset.velocity,
            heading: &dataset.heading,
            imu: &dataset.imu,
            odometry2d,
            odometry3d,
        }
    }

    /// The rows of the kinds that `model` takes.
    pub(super) fn of_model(dataset: &'a Dataset, model: Model) -> Self {
        let all = Self::new(dataset);
        match model {
            Model::Imu => Self {
                odometry2d: &[],
                odometry3d: &[],
                ..all
            },
            Model::Odometry3d | Model::Odometry2d => Self {
                imu: &[],
                velocity: &[],
                heading: &[],
                ..all
            },
        }
    }

    /// The next row of each stream, in the order that breaks ties.
    fn heads(&self) -> [Option<Event>; 6] {
        [
            self.position.first().copied().map(Event::Position),
            self.velocity.first().copied().map(Event::Velocity),
            self.heading.first().copied().map(Event::Heading),
            self.imu.first().copied().map(Event::Imu),
            self.odometry2d.first().copied().map(Event::Odometry2d),
            self.odometry3d.first().copied().map(Event::Odometry3d),
        ]
    }
}

impl Iterator for Events<'_> {
    type Item = Event;

    fn next(&mut self) -> Option<Event> {
        // `min_by_key` keeps the first of equal keys.
        let event = self
            .heads()
            .into_iter()
            .flatten()
            .min_by_key(Event::stamp_ns)?;
        match event {
            Event::Position(_) => self.position = &self.position[1..],
            Event::Velocity(_) => self.velocity = &self.velocity[1..],
            Event::Heading(_) => self.heading = &self.heading[1..],
            Event::Imu(_) => self.imu = &self.imu[1..],
            Event::Odometry2d(_) => self.odometry2d = &self.odometry2d[1..],
            Event::Odometry3d(_) => self.odometry3d = &self.odometry3d[1..],
        }
        Some(event)
    }

    fn size_hint(&self) -> (usize, Option<usize>) {
        let left = self.position.len()
            + self.velocity.len()
            + self.heading.len()
            + self.imu.len()
            + self.odometry2d.len()
            + self.odometry3d.len();
        (left, Some(left))
    }
}

impl ExactSizeIterator for Events<'_> {}
