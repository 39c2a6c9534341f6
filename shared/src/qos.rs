//! Quality of service of every topic, in one place. iceoryx2's own defaults are small (a buffer of two), and the side
//! that creates a service decides for both, so every opener asks for all of these.
//!
//! Every publish-subscribe topic overflows safely: a full buffer drops its oldest message. So no sender ever waits
//! for a reader, and a reader sees its losses as gaps in `seq` or `estimate_seq`.

use crate::topic::Topic;

/// Processes (nodes) that may open one service at a time.
pub const MAX_NODES: usize = 32;

/// Messages that a publisher may have loaned and not yet sent: one loaned ahead and one on its way, and some slack.
pub const MAX_LOANED: usize = 4;

/// Messages that a subscriber may hold at a time.
pub const MAX_BORROWED: usize = 8;

/// Limits of a publish-subscribe topic.
///
/// ```
/// use inekf_shared::qos::{ESTIMATE, HEALTH};
///
/// // A reader of estimates may be away for a second at 1 kHz; a late one of health gets the last at once.
/// assert!(ESTIMATE.buffer >= 1000 && ESTIMATE.history == 0);
/// assert_eq!(HEALTH.history, 1);
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PubSubQos {
    /// Messages that wait for a subscriber; one more drops the oldest.
    pub buffer: usize,
    /// Publishers at a time.
    pub publishers: usize,
    /// Subscribers at a time.
    pub subscribers: usize,
    /// Messages that a late subscriber still gets.
    pub history: usize,
}

/// IMU and odometry: more than four seconds at 1 kHz.
pub const PROPAGATION: PubSubQos = PubSubQos {
    buffer: 4096,
    publishers: 8,
    subscribers: 4,
    history: 0,
};

/// Position, velocity and heading.
pub const AIDING: PubSubQos = PubSubQos {
    buffer: 1024,
    publishers: 8,
    subscribers: 4,
    history: 0,
};

/// Estimates. The second publisher is for a daemon that starts while a killed one's place is still to be cleaned up.
pub const ESTIMATE: PubSubQos = PubSubQos {
    buffer: 1024,
    publishers: 2,
    subscribers: 8,
    history: 0,
};

/// Smoothed states: a whole window on request, of 1000 states at most, on top of what has left it.
pub const SMOOTHED: PubSubQos = PubSubQos {
    buffer: 2048,
    publishers: 2,
    subscribers: 8,
    history: 0,
};

/// Health: a late subscriber gets the last one at once.
pub const HEALTH: PubSubQos = PubSubQos {
    buffer: 8,
    publishers: 2,
    subscribers: 8,
    history: 1,
};

/// The journal: as long as the inputs' own buffers, for the one or two that record it.
pub const JOURNAL: PubSubQos = PubSubQos {
    buffer: 4096,
    publishers: 2,
    subscribers: 2,
    history: 0,
};

/// Limits of the publish-subscribe topic `topic`; `None` for a topic of another kind.
///
/// ```
/// use inekf_shared::qos::{PROPAGATION, pub_sub};
/// use inekf_shared::topic::Topic;
///
/// assert_eq!(pub_sub(Topic::Imu), Some(PROPAGATION));
/// // The newest estimate is a blackboard and no queue.
/// assert_eq!(pub_sub(Topic::Latest), None);
/// ```
#[must_use]
pub const fn pub_sub(topic: Topic) -> Option<PubSubQos> {
    match topic {
        Topic::Imu | Topic::Odometry2d | Topic::Odometry3d => Some(PROPAGATION),
        Topic::Position | Topic::Velocity | Topic::Heading => Some(AIDING),
        Topic::Estimate => Some(ESTIMATE),
        Topic::Smoothed => Some(SMOOTHED),
        Topic::Health => Some(HEALTH),
        Topic::Journal => Some(JOURNAL),
        Topic::Latest | Topic::Control | Topic::Wake => None,
    }
}

/// Servers of the control topic: one, so that a second daemon of an instance is found out.
pub const CONTROL_SERVERS: usize = 1;
/// Clients of the control topic at a time.
pub const CONTROL_CLIENTS: usize = 8;
/// Requests of one client that may be unanswered at a time.
pub const CONTROL_PENDING: usize = 4;

/// Readers of the newest estimate at a time. There is one writer.
pub const LATEST_READERS: usize = 16;
/// Key of the newest estimate on its blackboard.
pub const LATEST_KEY: u32 = 0;

/// Notifiers of the wake topic at a time.
pub const WAKE_NOTIFIERS: usize = 32;
/// Listeners of the wake topic at a time.
pub const WAKE_LISTENERS: usize = 2;
/// Largest event id of the wake topic. Only id 0 is used.
pub const WAKE_MAX_EVENT: usize = 0;
