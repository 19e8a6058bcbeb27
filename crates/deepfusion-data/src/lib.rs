//! Recordings of vehicles as frames, snippets and ground-truth depth.
//!
//! [`Dataset::open`] takes a KITTI raw drive, a date folder or a whole root; [`Dataset::snippets`] gives
//! the training samples with the camera's ego-motion, [`Dataset::ground_truth`] the velodyne's depth.
//! Nothing here knows of tensors.

mod dataset;
mod depth_png;
mod error;
mod export;
mod inspect;
mod jpeg;
pub mod kitti;
mod moving;
mod overlay;
mod path;
mod picture;
mod resize;
mod snippet;
mod speed_check;
mod split;
mod write;

pub use dataset::{Camera, CameraChoice, Dataset, DatasetKind, Frame, OpenOptions};
pub use deepfusion_motion::{VehicleMotion, VehicleTrack};
pub use depth_png::{read_depth_png, write_depth_png};
pub use error::{Error, Result};
pub use export::{export_gt, ground_truth_names};
pub use image::RgbImage;
pub use inspect::{DriveInspection, Inspection, IntrinsicsSummary, SpeedRange, Stream, inspect};
pub use kitti::GtKind;
pub use moving::{MovingLabels, MovingSource};
pub use overlay::overlay;
pub use path::CameraPath;
pub use picture::{decode_rgb, image_size, load_rgb, save_png};
pub use resize::{resize_rgb, to_chw, to_network_input};
pub use snippet::{EgoMotion, Snippet, Source, hold_out};
pub use speed_check::{
    GreyImage, GroundPair, SpeedWarning, implied_camera_height, speed_unit_warning,
};
pub use split::{Split, SplitEntry};
pub use write::write_atomically;
