//! Recordings of vehicles as frames, snippets and ground-truth depth.
//!
//! [`Dataset::open`] takes a recording of any layout: KITTI raw, a folder of images or a video with tables
//! beside it, a comma2k19 segment, an RGB-D folder, a ROS 1 bag, with the feature `ros2` a ROS 2 bag. [`Dataset::snippets`] gives the training samples with
//! the camera's ego-motion, [`Dataset::ground_truth`] the measured depth. Another layout is another
//! [`Recording`]. Nothing here knows of tensors.

mod agreement;
mod bag;
mod calibration;
mod camera;
mod clock;
mod comma;
mod config;
mod convert;
mod dataset;
mod depth_images;
mod depth_png;
mod ego;
mod error;
mod export;
mod folder;
mod frame;
mod frame_times;
mod gps_log;
mod inspect;
mod inspect_text;
mod jpeg;
pub mod kitti;
mod layout;
mod lens;
mod moving;
mod overlay;
mod path;
mod photo;
mod picture;
mod plain;
mod recording;
mod resize;
mod rgbd;
mod selection;
mod snippet;
mod speed_check;
mod speed_log;
mod split;
mod table;
mod vehicle_log;
mod video;
mod write;

pub use agreement::DynamicAgreement;
pub use bag::{DopplerEgo, ego_velocity, ground_radial};
pub use calibration::CameraCalibration;
pub use camera::{Camera, CameraChoice};
pub use convert::{Converted, convert_to_bag, convert_to_kitti};
pub use dataset::{Dataset, DatasetParts, OpenOptions};
pub use deepfusion_motion::{MotionModel, VehicleMotion, VehicleTrack};
pub use depth_png::{read_depth_png, write_depth_png};
pub use ego::{Ego, EgoMotion, NoMotion};
pub use error::{Error, Result};
pub use export::{VELOCITY, export_gt, ground_truth_names};
pub use frame::{Frame, FrameImage};
pub use image::RgbImage;
pub use inspect::{
    ClockOffset, DriveInspection, Inspection, IntrinsicsSummary, SpeedRange, Stream, inspect,
    inspect_with,
};
pub use kitti::GtKind;
pub use lens::Lens;
pub use moving::{MovingLabels, MovingSource};
pub use overlay::overlay;
pub use path::CameraPath;
pub use photo::{Photo, load_photo};
pub use picture::{decode_rgb, image_size, load_rgb, save_png};
pub use recording::{CalibrationPlace, DatasetKind, LidarMotion, Recording, ScanTruth};
pub use resize::{resize_rgb, to_chw, to_network_input};
pub use snippet::{Snippet, Source, hold_out};
pub use speed_check::{
    PLAUSIBLE_HEIGHT_M, SpeedWarning, grey_image, road_camera_height, speed_unit_warning,
};
pub use split::{Split, SplitCoverage, SplitEntry};
pub use write::{write_atomically, write_unsynced};
