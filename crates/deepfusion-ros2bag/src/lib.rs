//! Reads ROS 2 bags into the messages of `deepfusion-rosbag`.
//!
//! [`Ros2Bag::open`] takes a recording's folder (`metadata.yaml` and its files) or one of its files: MCAP or SQLite. It is
//! a [`MessageSource`](deepfusion_rosbag::MessageSource): messages by topic and time, in time order, decoded as
//! `deepfusion_rosbag::msg`'s types by name. ROS 2 has no MD5 of a type; a different definition is detected by the
//! message's length.
//!
//! The path of a message: `metadata` (which files) → `storage` (what MCAP and SQLite have in common): `mcap` (`record`
//! → `index`, or `scan` if there is none → `chunk` → `messages`) or `sqlite` → `bag` (all files in time order) →
//! [`Message`](deepfusion_rosbag::Message), whose bytes are CDR.
//!
//! A separate crate, because it brings C code (Zstandard, and with the feature `ros2-sqlite` SQLite) that a reader of ROS 1 does not
//! need. Without that feature a `.db3` is an [`Error::Feature`](deepfusion_rosbag::Error::Feature).

mod bag;
mod mcap;
mod metadata;
mod packed;
mod problem;
#[cfg(feature = "ros2-sqlite")]
mod sqlite;
mod storage;

pub use bag::{BagDamage, FileDamage, Ros2Bag, is_ros2_bag};
pub use mcap::{ChunkProblem, McapDamage, McapProblem, RecordProblem};
pub use packed::PackedProblem;
pub use problem::StorageProblem;
#[cfg(feature = "ros2-sqlite")]
pub use sqlite::DatabaseDamage;
