use crate::problem::Fault;
use crate::record::{Fields, Record};

/// A connection: a topic as published by one node.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Connection {
    /// The number its messages carry in the file; in a [`BagSet`](crate::BagSet) its index in the set's list.
    pub id: u32,
    /// The topic, with its leading slash as recorded.
    pub topic: String,
    /// The message type, such as `sensor_msgs/Imu`.
    pub type_name: String,
    /// The MD5 of the type's definition, 32 hexadecimal digits.
    pub md5: String,
    /// The definition: the type's fields, then those of every type it uses.
    pub definition: String,
    /// The publishing node, if it was recorded.
    pub caller_id: Option<String>,
    /// Whether the topic is latched: new subscribers receive the last message again.
    pub latching: bool,
    /// Number of its messages in the bag.
    pub count: u64,
}

impl Connection {
    /// Reads a connection record: number and topic are in its header, everything else is in its data, which is a header again.
    pub(crate) fn read(record: &Record<'_>) -> Result<Self, Fault> {
        let data = Record {
            fields: Fields(record.data),
            ..*record
        };
        let optional = |name| {
            data.fields
                .get(name)
                .map(|v| String::from_utf8_lossy(v).into_owned())
        };
        Ok(Self {
            id: record.u32("conn")?,
            topic: record.text("topic")?,
            type_name: data.text("type")?,
            md5: data.text("md5sum")?,
            // Comments in definitions are in whatever encoding their author used.
            definition: optional("message_definition").unwrap_or_default(),
            caller_id: optional("callerid"),
            latching: optional("latching").is_some_and(|v| v == "1"),
            count: 0,
        })
    }
}
