//! The common interface of both kinds of file.

pub(crate) use deepfusion_rosbag::hull;
use deepfusion_rosbag::{
    Connection, MessageIter, Selection, Serialization, SourceDamage, Time, TopicInfo,
};
use std::fmt;

/// The largest chunk or message that is read, in bytes. It limits the memory that a damaged or hostile file can claim.
pub(crate) const MOST_BYTES: u64 = 1 << 30;

/// The hint for damage that is typical of an incomplete copy.
pub(crate) const COPY_AGAIN: &str = "copy the file again; the readable part is read";

/// A file of a bag.
pub(crate) trait Storage: fmt::Debug + Send + Sync {
    /// Its topics, one connection per publisher.
    fn channels(&self) -> &[Channel];

    /// The times of the first and the last message.
    fn range(&self) -> Option<(Time, Time)>;

    /// The damage, if a part of the file cannot be read.
    fn damage(&self) -> Option<SourceDamage>;

    /// The messages of the channels that are `wanted`, by index, in time order.
    fn messages<'a>(&'a self, wanted: Vec<bool>, selection: &Selection) -> MessageIter<'a>;
}

/// A connection, the serialisation of its messages, and their times.
#[derive(Debug, Clone)]
pub(crate) struct Channel {
    pub connection: Connection,
    pub serialization: Serialization,
    /// The times of its first and last message.
    pub range: Option<(Time, Time)>,
}

impl Channel {
    /// A channel without messages yet.
    pub(crate) fn new(
        id: u32,
        topic: String,
        type_name: &str,
        encoding: &str,
        definition: String,
    ) -> Self {
        // `sensor_msgs/msg/Imu` is ROS 2's way to write `sensor_msgs/Imu`.
        let name = type_name.replacen("/msg/", "/", 1);
        let (serialization, type_name) = match encoding {
            "cdr" => (Serialization::Cdr, name),
            "ros1" => (Serialization::Ros1, name),
            // A type that no one requests: messages of other middleware are listed but not read.
            other => (Serialization::Cdr, format!("{name} ({other})")),
        };
        Self {
            connection: Connection {
                id,
                topic,
                type_name,
                md5: "*".to_owned(),
                definition,
                caller_id: None,
                latching: false,
                count: 0,
            },
            serialization,
            range: None,
        }
    }

    /// Counts a message.
    pub(crate) fn add(&mut self, time: Time) {
        self.connection.count += 1;
        self.range = hull(self.range, Some((time, time)));
    }
}

/// Channels grouped by topic, in order of names.
pub(crate) fn topics<'a>(channels: impl Iterator<Item = &'a Channel>) -> Vec<TopicInfo> {
    TopicInfo::gather(channels.map(|channel| (&channel.connection, channel.range)))
}
