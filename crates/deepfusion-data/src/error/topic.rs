//! Why a bag's topics are not what is needed.

use crate::{NamedTopic, TopicRole};
use deepfusion_rosbag::msg::Frame;
use deepfusion_rosbag::{MessageError, RosMessage};
use std::path::{Path, PathBuf};

/// Why a bag's topics are not what is needed.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum TopicProblem {
    /// A topic was named that is not there.
    #[error("has no topic {name}")]
    NoTopic {
        /// What it was named for.
        role: TopicRole,
        /// Its name.
        name: String,
        /// The topics that there are.
        there: Vec<String>,
        /// The file beside the bag, where that named it, and not the caller.
        config: Option<PathBuf>,
    },
    /// A topic was named whose messages are of another type.
    #[error("{name} holds {found}")]
    OtherType {
        /// What it was named for.
        role: TopicRole,
        /// Its name.
        name: String,
        /// Its type.
        found: String,
        /// The types that can be read for it.
        expected: Vec<String>,
        /// The file beside the bag, where that named it, and not the caller.
        config: Option<PathBuf>,
    },
    /// Several topics could be meant.
    #[error("{} topics could be the {role}: {}", topics.len(), topics.join(", "))]
    Several {
        /// What for.
        role: TopicRole,
        /// The topics.
        topics: Vec<String>,
        /// The file beside the bag.
        config: PathBuf,
    },
    /// A topic and a signal of CAN frames were named for one quantity.
    #[error("topics.{role} (\"{name}\") and can.{role} both say where the {role} is")]
    AndSignal {
        /// The quantity.
        role: TopicRole,
        /// The topic.
        name: String,
    },
    /// Signals of CAN frames were named, and there are no frames.
    #[error("has no topic of {}, which [can] reads", Frame::TYPE)]
    NoCan {
        /// The file beside the bag.
        config: PathBuf,
    },
    /// A cloud lacks a field.
    #[error("{topic}: {source}")]
    Column {
        /// Its topic.
        topic: String,
        /// Which.
        source: MessageError,
    },
    /// The points' own times are none of the cloud's.
    #[error("{topic}: the times in field {field} are more than a second from the message's")]
    PointTimes {
        /// The cloud's topic.
        topic: String,
        /// The field.
        field: String,
    },
    /// Points make no cloud.
    #[error("{0}")]
    Cloud(#[source] MessageError),
}

/// What a topic's name must be, in the file that says it, or as the caller does.
fn named_in(config: Option<&Path>, role: TopicRole, must: &str) -> String {
    match config {
        Some(config) => format!("topics.{role} {must} (in {})", config.display()),
        None => format!("{role} {must}"),
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
                named_in(config.as_deref(), *role, &format!("must be one of: {of}"))
            }
            Self::OtherType {
                role,
                expected,
                config,
                ..
            } => {
                let of = expected.join(" or ");
                named_in(config.as_deref(), *role, &format!("must be a topic of {of}"))
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
                    "delete [can], or record the bus (in {})",
                    config.display()
                )
            }
            Self::Column { .. } => {
                "lidar.velocity_field names the field of the radial velocity, lidar.time_field that of the points' times; x, y and z must be there".into()
            }
            Self::PointTimes { .. } => {
                "lidar.time_field names times in seconds or whole nanoseconds after the message's, or dates; without it all points count as measured then".into()
            }
            Self::Cloud(_) => "report this with the recording".into(),
        }
    }

    /// Of several topics the first, which could be named.
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
