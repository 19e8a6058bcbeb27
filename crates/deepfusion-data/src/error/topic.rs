//! Why a bag's topics cannot be used.

use crate::{NamedTopic, TopicRole};
use deepfusion_rosbag::msg::Frame;
use deepfusion_rosbag::{MessageError, RosMessage};
use std::path::{Path, PathBuf};

/// Why a bag's topics cannot be used.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum TopicProblem {
    /// The named topic does not exist.
    #[error("no topic {name}")]
    NoTopic {
        /// The role it was named for.
        role: TopicRole,
        /// Its name.
        name: String,
        /// Names of the bag's topics.
        there: Vec<String>,
        /// Path of the file beside the bag, if the topic was named there and not by the caller.
        config: Option<PathBuf>,
    },
    /// The named topic has messages of the wrong type.
    #[error("{name} has messages of the wrong type {found}")]
    OtherType {
        /// The role it was named for.
        role: TopicRole,
        /// Its name.
        name: String,
        /// Its type.
        found: String,
        /// The types that can be read for this role.
        expected: Vec<String>,
        /// Path of the file beside the bag, if the topic was named there and not by the caller.
        config: Option<PathBuf>,
    },
    /// Several topics are possible for a role.
    #[error("{} topics could be the {role}: {}", topics.len(), topics.join(", "))]
    Several {
        /// The role.
        role: TopicRole,
        /// Names of the topics.
        topics: Vec<String>,
        /// Path of the file beside the bag.
        config: PathBuf,
    },
    /// Both a topic and a CAN signal were named for one quantity.
    #[error("topics.{role} (\"{name}\") and can.{role} are both set")]
    AndSignal {
        /// The quantity.
        role: TopicRole,
        /// Name of the topic.
        name: String,
    },
    /// CAN signals were named, but the bag has no CAN frames.
    #[error("no topic of {}, which [can] reads", Frame::TYPE)]
    NoCan {
        /// Path of the file beside the bag.
        config: PathBuf,
    },
    /// A point cloud lacks a field.
    #[error("{topic}: {source}")]
    Column {
        /// Name of its topic.
        topic: String,
        /// Which field is missing.
        source: MessageError,
    },
    /// The points' own times are too far from the message's.
    #[error("{topic}: the times in field {field} differ from the message's by more than 1 s")]
    PointTimes {
        /// Name of the point cloud's topic.
        topic: String,
        /// Name of the field.
        field: String,
    },
    /// A point cloud message cannot be read.
    #[error("{0}")]
    Cloud(#[source] MessageError),
}

/// What to set a role's topic to, and where it is set: in the file beside the bag, or by the caller.
fn named_in(config: Option<&Path>, role: TopicRole, to: &str) -> String {
    match config {
        Some(config) => format!("set topics.{role} to {to} (in {})", config.display()),
        None => format!("set {role} to {to}"),
    }
}

impl TopicProblem {
    /// What to do about it.
    pub(super) fn hint(&self) -> String {
        match self {
            Self::NoTopic {
                role,
                there,
                config,
                ..
            } => {
                let of = there.join(", ");
                named_in(config.as_deref(), *role, &format!("one of: {of}"))
            }
            Self::OtherType {
                role,
                expected,
                config,
                ..
            } => {
                let of = expected.join(" or ");
                named_in(config.as_deref(), *role, &format!("a topic of {of}"))
            }
            Self::Several {
                role,
                topics,
                config,
            } => {
                let first = topics.first().map_or("", String::as_str);
                let none = if role.is_optional() {
                    format!(", or {role} = \"{}\" to read none", NamedTopic::NONE)
                } else {
                    String::new()
                };
                let config = config.display();
                format!("name it: [topics] {role} = \"{first}\"{none} (in {config})")
            }
            Self::AndSignal { role, .. } => {
                format!("keep one of them: delete topics.{role} or can.{role}")
            }
            Self::NoCan { config } => {
                format!(
                    "record the CAN bus, or delete [can] (in {})",
                    config.display()
                )
            }
            Self::Column { .. } => {
                "set lidar.velocity_field to the field of the radial velocity and lidar.time_field to that of the points' times; x, y and z are required".into()
            }
            Self::PointTimes { .. } => {
                "set lidar.time_field to a field with seconds or whole nanoseconds after the message's time, or dates; without it, all points get the message's time".into()
            }
            Self::Cloud(_) => "this is a bug: please report it, with the recording".into(),
        }
    }

    /// The first of several possible topics.
    pub(crate) fn choice(&self) -> Option<NamedTopic> {
        match self {
            Self::Several { role, topics, .. } => topics.first().map(|topic| NamedTopic {
                role: *role,
                topic: topic.clone(),
            }),
            _ => None,
        }
    }
}
