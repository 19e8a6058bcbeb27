//! A recording of any layout as a [`Dataset`] of [`Frame`]s, with [`Snippet`]s to train on.
//!
//! `recording` and `parts` are what a layout provides, and `drive` is the data set made from it. `ego` computes the camera's motion,
//! `split` and `selection` select frames, `inspection` reports the contents, and `warning` what is uncertain.

mod camera;
mod coverage;
mod drive;
mod ego;
mod frame;
mod heading;
mod inspection;
mod inspection_text;
mod kind;
mod options;
mod parts;
mod recording;
mod seen_turn;
pub(crate) mod selection;
mod snippet;
mod speed_check;
mod split;
mod topic;
mod warning;

pub use camera::{Camera, Cameras, NoSuchCamera};
pub use coverage::SplitCoverage;
pub use drive::Dataset;
pub use ego::{Ego, EgoMotion, NoMotion, Receiver};
pub use frame::{Frame, FrameImage};
pub use heading::Heading;
pub use inspection::{
    ClockOffset, DriveInspection, Inspection, IntrinsicsSummary, Mount, SpeedRange, Stream,
    Unreadable,
};
pub use kind::DatasetKind;
pub use options::OpenOptions;
pub(crate) use options::numbers_of_hfov;
pub use parts::DatasetParts;
pub use recording::{CalibrationPlace, CameraPath, Recording};
pub use seen_turn::SeenTurn;
pub use snippet::{Snippet, Source, hold_out};
pub use speed_check::{
    PLAUSIBLE_HEIGHT_M, SpeedWarning, grey_image, road_camera_height, speed_unit_warning,
};
pub use split::{Split, SplitEntry};
pub use topic::{NamedTopic, NoNamedTopic, TopicRole};
pub use warning::{
    CameraWarning, DataWarning, IncompleteWarning, MotionWarning, MountWarning, NotByFrames,
    TimesWarning,
};
