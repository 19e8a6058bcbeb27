//! What is known of a frame beside its image: how the camera moved, and whether its metres hold.

mod depth_watch;
mod motion;
mod scale_watch;

pub use depth_watch::DepthWatch;
pub use motion::{Motion, MotionTracker, StraightWay, motion_known, yaw_rate};
pub use scale_watch::{ScaleWatch, Unwatched, unwatched};
