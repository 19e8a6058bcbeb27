//! ROS 1 bags (format 2.0): reader, writer, and the message types of a vehicle's recording.
//!
//! [`Bag::open`] reads a bag's index; [`Bag::messages`] yields the messages of a [`Selection`] in time order, raw or
//! decoded as one of [`msg`]'s types. [`BagSet`] reads several bags as one. [`BagWriter`] writes.
//!
//! The path of a message: `record` (a file's building block) → `index` (positions of the chunks; `scan` without an index)
//! → `chunk` and `content` (its bytes, decompressed `ahead`) → `entry` (positions of its messages) → [`Messages`] (in
//! time order) → [`Message`] → `msg`. The format: <http://wiki.ros.org/Bags/Format/2.0>.
//!
//! [`MessageSource`] is the common interface of recordings of any format; `deepfusion-ros2bag` reads those of ROS 2
//! into the same [`Message`] and the same types.

mod ahead;
mod bag;
mod bag_set;
mod buffer;
mod chunk;
mod compression;
mod connection;
mod content;
mod encode;
mod entry;
mod error;
mod index;
mod lz4_frame;
mod message;
mod message_source;
mod messages;
pub mod msg;
mod op;
mod problem;
mod record;
mod scan;
mod selection;
mod source;
mod source_damage;
mod time;
mod topic;
mod writer;

pub use bag::{Bag, BagOptions};
pub use bag_set::{BagSet, SetMessages};
pub use compression::Compression;
pub use connection::Connection;
pub use deepfusion_fs::FileError;
pub use error::{Error, Result};
pub use message::{Message, Serialization};
pub use message_source::{MessageIter, MessageSource};
pub use messages::Messages;
pub use msg::{LayoutProblem, MessageError, MessagePart, RosMessage};
pub use problem::{
    BagProblem, ChunkProblem, DecompressProblem, FramePart, IndexProblem, IndexRecord, RecordPart,
    RecordProblem,
};
pub use scan::{Damage, ScanReason};
pub use selection::Selection;
pub use source_damage::SourceDamage;
pub use time::Time;
pub use topic::{TopicInfo, hull};
pub use writer::{BagWriter, ConnectionId, WriterOptions};
