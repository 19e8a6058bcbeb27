//! Selects one of a vehicle's cameras.

use deepfusion_hint::Hint;
use serde::{Deserialize, Serialize};

/// One of the vehicle's two colour cameras. A recording's only camera counts as the left one.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Camera {
    /// KITTI's camera 2.
    Left,
    /// KITTI's camera 3.
    Right,
}

impl Camera {
    /// The camera's number in KITTI: 2 or 3.
    #[must_use]
    pub fn number(self) -> u8 {
        match self {
            Self::Left => 2,
            Self::Right => 3,
        }
    }
}

/// Which cameras to open.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
pub enum Cameras {
    /// Camera 2, the left one.
    #[default]
    #[serde(rename = "2")]
    Left,
    /// Camera 3, the right one.
    #[serde(rename = "3")]
    Right,
    /// Both, each as a data set.
    #[serde(rename = "both")]
    Both,
}

impl Cameras {
    /// The selected cameras.
    #[must_use]
    pub fn cameras(self) -> &'static [Camera] {
        match self {
            Self::Left => &[Camera::Left],
            Self::Right => &[Camera::Right],
            Self::Both => &[Camera::Left, Camera::Right],
        }
    }
}

/// The error for a text that does not name a camera.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
#[error("unknown camera '{text}', expected 2, 3 or both")]
pub struct NoSuchCamera {
    /// The text given.
    pub text: String,
}

impl Hint for NoSuchCamera {
    /// No hint: the message already lists the choices.
    fn hint(&self) -> Option<String> {
        None
    }
}

impl std::str::FromStr for Cameras {
    type Err = NoSuchCamera;

    fn from_str(text: &str) -> Result<Self, NoSuchCamera> {
        match text {
            "2" => Ok(Self::Left),
            "3" => Ok(Self::Right),
            "both" => Ok(Self::Both),
            _ => Err(NoSuchCamera {
                text: text.to_owned(),
            }),
        }
    }
}
