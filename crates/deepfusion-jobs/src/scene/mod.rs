//! What is known of a frame besides its image: the camera's motion, and whether the scale has changed.

mod depth_watch;
mod motion;
mod scale_watch;

pub use depth_watch::DepthWatch;
pub use motion::{Motion, MotionTracker, StraightWay, motion_known, yaw_rate};
pub use scale_watch::{ScaleWatch, Unwatched, unwatched};
