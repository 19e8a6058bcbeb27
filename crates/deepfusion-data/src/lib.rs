//! Recordings of vehicles as frames, snippets and ground-truth depth.
//!
//! [`Dataset::open`] opens a recording of any layout: KITTI raw, odometry and 360, nuScenes, a folder of images or a video with tables
//! beside it, a comma2k19 segment, an RGB-D folder, a ROS 1 bag. ROS 2 bags need the feature `ros2` (on by default) as MCAP, and
//! `ros2-sqlite` as SQLite. [`Dataset::snippets`] gives training samples with the camera's motion, [`Dataset::ground_truth`] the
//! measured depth. To add a layout, implement [`Recording`]. Nothing here depends on tensors.
//!
//! Inside, `formats` reads each layout with the help of `camera` (calibrations, lenses), `logs` (tables of times and speeds) and
//! `truth` (measured depth), and makes a `dataset` of it; `convert` writes data sets in other layouts.

mod camera;
mod convert;
mod dataset;
mod dataset_toml;
mod error;
mod formats;
mod logs;
mod names;
mod truth;

pub use camera::{CalibrationSource, CameraCalibration, Lens, calibration_near, camera_info_yaml};
pub use convert::{
    Converted, VELOCITY, convert_to_bag, convert_to_kitti, export_gt, ground_truth_names,
    write_overlays,
};
pub use dataset::{
    CalibrationPlace, Camera, CameraPath, CameraWarning, Cameras, ClockOffset, DataWarning,
    Dataset, DatasetKind, DatasetParts, DriveInspection, Ego, EgoMotion, Frame, FrameImage,
    Heading, IncompleteWarning, Inspection, IntrinsicsSummary, MotionWarning, Mount, MountWarning,
    NamedTopic, NoMotion, NoNamedTopic, NoSuchCamera, NotByFrames, OpenOptions, PLAUSIBLE_HEIGHT_M,
    Receiver, Recording, SeenTurn, Snippet, Source, SpeedRange, SpeedWarning, Split, SplitCoverage,
    SplitEntry, Stream, TimesWarning, TopicRole, Unreadable, grey_image, hold_out,
    road_camera_height, speed_unit_warning,
};
pub use dataset_toml::has_settings;
pub use deepfusion_fs::FileError;
pub use deepfusion_images::{
    Photo, RgbImage, decode_rgb, image_size, load_photo, load_rgb, read_depth_png, resize_rgb,
    save_png, to_chw, to_network_input, write_depth_png,
};
pub use deepfusion_motion::{MotionModel, VehicleMotion, VehicleTrack};
pub use error::{
    ArrayProblem, CalibrationFileProblem, CalibrationProblem, CameraInfoProblem, CameraProblem,
    CanProblem, ColumnsProblem, ConfigProblem, Error, ExpectedCell, ExpectedValue, FileKind,
    FoundInstead, FramesProblem, ImageProblem, JsonProblem, MissingPart, NoFramesReason, NoLens,
    NoTrackReason, OxtsField, OxtsProblem, PoseField, PoseFileProblem, PoseProblem, Quantity,
    Result, SegmentProblem, SplitProblem, TableProblem, TimeStampProblem, TopicProblem,
    TrackletPart, TrackletPlace, TrackletsProblem,
};
pub use formats::kitti;
pub use formats::{
    DopplerEgo, ego_velocity, ground_radial, inspect, inspect_with, write_bag_config,
};
pub use truth::{
    DynamicAgreement, GtKind, LidarMotion, MovingLabels, MovingPixels, MovingSource, NoSuchDepth,
    ScanTruth, overlay,
};
