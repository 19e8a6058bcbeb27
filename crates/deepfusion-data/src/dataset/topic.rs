//! Topics of a bag named by a caller, with their roles.

use deepfusion_hint::Hint;
use std::fmt;
use std::str::FromStr;

/// The role for which a bag's topic is read.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum TopicRole {
    /// The camera's images.
    Image,
    /// The camera's calibration.
    CameraInfo,
    /// The LiDAR's scans.
    Lidar,
    /// The dynamic points of the scans.
    Dynamic,
    /// The inertial unit.
    Imu,
    /// The vehicle's speed, or the GPS positions from which it is computed.
    Speed,
    /// The steering angle.
    Steering,
    /// CAN frames.
    Can,
    /// The exact motion, only for evaluation.
    Truth,
}

impl TopicRole {
    /// All roles.
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

    /// The role's name, which is also its key in `[topics]` of the file beside a bag.
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

    /// Whether a bag can be read without a topic for this role, so that [`NamedTopic::NONE`] is allowed. Images are required, and CAN
    /// frames are only read if signals from them are named.
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

/// A topic and its role, written `speed=/gps/fix`, or `imu=none` to read no topic for a role.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct NamedTopic {
    /// The topic's role.
    pub role: TopicRole,
    /// The topic's full name, or [`Self::NONE`].
    pub topic: String,
}

impl NamedTopic {
    /// Instead of a topic's name: read none for the role, which must be [optional](TopicRole::is_optional).
    pub const NONE: &'static str = "none";
}

impl fmt::Display for NamedTopic {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}={}", self.role, self.topic)
    }
}

/// Why a text is not a topic with its role.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum NoNamedTopic {
    /// The text has the wrong form.
    #[error("expected ROLE=NAME, such as image=/camera/front/image_raw")]
    Shape,
    /// The role is unknown.
    #[error("unknown role `{text}`, expected one of {}", TopicRole::ALL.map(TopicRole::name).join(", "))]
    Role {
        /// The text in place of the role.
        text: String,
    },
    /// The topic's name is empty.
    #[error("no topic is named for {role}")]
    NoName {
        /// The role.
        role: TopicRole,
    },
}

impl Hint for NoNamedTopic {
    fn hint(&self) -> Option<String> {
        match self {
            // The messages already say what is expected.
            Self::Shape | Self::Role { .. } => None,
            Self::NoName { role } => Some(format!(
                "write the topic's full name after the equals sign, such as {role}=/a/b"
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
    fn the_written_form_is_read_back() {
        for role in TopicRole::ALL {
            let text = format!("{role}=/a/b");
            let read: NamedTopic = text.parse().unwrap();
            assert_eq!((read.role, read.to_string()), (role, text));
        }
        for (text, why) in [
            ("/camera", "ROLE=NAME"),
            (
                "picture=/camera",
                "unknown role `picture`, expected one of image,",
            ),
            ("image= ", "no topic is named for image"),
        ] {
            let error = text.parse::<NamedTopic>().unwrap_err().to_string();
            assert!(error.contains(why), "{error}");
        }
    }
}
