//! Which topic of a bag is for what, where a caller says it.

use deepfusion_hint::Hint;
use std::fmt;
use std::str::FromStr;

/// What a topic of a bag is read for.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum TopicRole {
    /// The camera's images.
    Image,
    /// The camera's calibration.
    CameraInfo,
    /// The LiDAR's scans.
    Lidar,
    /// Those points of the scans that move.
    Dynamic,
    /// The inertial unit.
    Imu,
    /// The vehicle's speed, or the satellite positions that it is computed from.
    Speed,
    /// The steering angle.
    Steering,
    /// CAN frames.
    Can,
    /// The exact motion, for evaluation alone.
    Truth,
}

impl TopicRole {
    /// All of them.
    pub const ALL: [Self; 9] = [
        Self::Image,
        Self::CameraInfo,
        Self::Lidar,
        Self::Dynamic,
        Self::Imu,
        Self::Speed,
        Self::Steering,
        Self::Can,
        Self::Truth,
    ];

    /// Its name, which is its key in `[topics]` of the file beside a bag.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Image => "image",
            Self::CameraInfo => "camera_info",
            Self::Lidar => "lidar",
            Self::Dynamic => "dynamic",
            Self::Imu => "imu",
            Self::Speed => "speed",
            Self::Steering => "steering",
            Self::Can => "can",
            Self::Truth => "truth",
        }
    }

    /// Whether a bag is read without it, too: then [`NamedTopic::NONE`] may stand for its topic. There are no frames without images, and CAN
    /// frames are read only where signals of theirs are asked for.
    #[must_use]
    pub fn is_optional(self) -> bool {
        !matches!(self, Self::Image | Self::Can)
    }
}

impl fmt::Display for TopicRole {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(self.name())
    }
}

/// A topic and what it is read for, written `speed=/gps/fix`; `imu=none` where a bag has such topics, and none is to be read.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct NamedTopic {
    /// What for.
    pub role: TopicRole,
    /// The topic's whole name, or [`Self::NONE`].
    pub topic: String,
}

impl NamedTopic {
    /// In place of a topic's name: none is read for the role, which must be an [optional](TopicRole::is_optional) one.
    pub const NONE: &'static str = "none";
}

impl fmt::Display for NamedTopic {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}={}", self.role, self.topic)
    }
}

/// Why a text names no topic.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum NoNamedTopic {
    /// It is not written as one.
    #[error("expected ROLE=NAME, such as image=/camera/front/image_raw")]
    Shape,
    /// Nothing is read for such a role.
    #[error("`{text}` is no role: {} are", TopicRole::ALL.map(TopicRole::name).join(", "))]
    Role {
        /// What stands for the role.
        text: String,
    },
    /// The name is empty.
    #[error("no topic is named for {role}")]
    NoName {
        /// The role.
        role: TopicRole,
    },
}

impl Hint for NoNamedTopic {
    fn hint(&self) -> Option<String> {
        match self {
            // These messages say what is expected.
            Self::Shape | Self::Role { .. } => None,
            Self::NoName { role } => Some(format!(
                "write the topic's whole name after the equals sign, such as {role}=/a/b"
            )),
        }
    }
}

impl FromStr for NamedTopic {
    type Err = NoNamedTopic;

    fn from_str(text: &str) -> Result<Self, NoNamedTopic> {
        let (role, topic) = text.split_once('=').ok_or(NoNamedTopic::Shape)?;
        let known = TopicRole::ALL.into_iter().find(|r| r.name() == role.trim());
        let role = known.ok_or_else(|| NoNamedTopic::Role {
            text: role.to_owned(),
        })?;
        match topic.trim() {
            "" => Err(NoNamedTopic::NoName { role }),
            topic => Ok(Self {
                role,
                topic: topic.to_owned(),
            }),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_written_is_read_again() {
        for role in TopicRole::ALL {
            let text = format!("{role}=/a/b");
            let read: NamedTopic = text.parse().unwrap();
            assert_eq!((read.role, read.to_string()), (role, text));
        }
        for (text, why) in [
            ("/camera", "ROLE=NAME"),
            ("picture=/camera", "`picture` is no role: image,"),
            ("image= ", "no topic is named for image"),
        ] {
            let error = text.parse::<NamedTopic>().unwrap_err().to_string();
            assert!(error.contains(why), "{error}");
        }
    }
}
