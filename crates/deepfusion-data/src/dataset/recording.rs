//! What a layout has to offer for its recordings to be a [`Dataset`].

use crate::kitti::GtKind;
use crate::{CameraPath, Dataset, DynamicAgreement, Error, Frame, MovingLabels, Result, Stream};
use deepfusion_geometry::DepthMap;
use image::RgbImage;
use nalgebra::Vector3;
use serde::{Deserialize, Serialize};
use std::fmt;
use std::path::{Path, PathBuf};

/// The layout a recording came in.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum DatasetKind {
    /// KITTI raw.
    KittiRaw,
    /// A folder of images with tables beside it.
    Folder,
    /// A video file with tables beside it.
    Video,
    /// A comma2k19 segment.
    Comma2k19,
    /// A folder of colour, depth and pose files, as 7-Scenes has.
    RgbD,
    /// A ROS bag.
    Bag,
    /// A layout of somebody else's: a [`Recording`] from outside this crate.
    Other,
}

impl DatasetKind {
    /// Its name in text.
    #[must_use]
    pub fn label(self) -> &'static str {
        match self {
            Self::KittiRaw => "KITTI raw",
            Self::Folder => "image folder",
            Self::Video => "video",
            Self::Comma2k19 => "comma2k19 segment",
            Self::RgbD => "RGB-D folder",
            Self::Bag => "ROS bag",
            Self::Other => "recording",
        }
    }
}

/// Where a data set's images and labels come from; one implementation a layout.
///
/// What all layouts share (frames, times, camera, speeds) is in [`crate::DatasetParts`]; this is the rest,
/// read when it is asked for. The provided methods are those of a recording that has no such thing.
pub trait Recording: fmt::Debug + Send + Sync {
    /// The layout.
    fn kind(&self) -> DatasetKind;

    /// The folder its files are in.
    fn folder(&self) -> &Path;

    /// A frame's image, freed of its lens' distortion, at the size of the data set's intrinsics.
    ///
    /// # Errors
    /// Where it cannot be read.
    fn load_image(&self, frame: &Frame) -> Result<RgbImage>;

    /// Where the camera's numbers are from, for the error on an image of another size.
    fn calibration(&self) -> CalibrationPlace;

    /// What was recorded.
    ///
    /// # Errors
    /// Where a stream is there and cannot be read.
    fn streams(&self) -> Result<Vec<Stream>>;

    /// What is missing for the car's motion, asked where the data set lacks times, track or mount.
    fn no_motion(&self) -> Error;

    /// What was taken for granted or looks odd, in sentences for the inspection.
    fn remarks(&self) -> &[String] {
        &[]
    }

    /// Whether [`Self::ground_truth`] will have something for a frame.
    fn has_ground_truth(&self, _frame: &Frame) -> bool {
        false
    }

    /// Depth of a frame in metres (camera z), at the size of its image, 0 = none.
    ///
    /// # Errors
    /// Where it is there and cannot be read.
    fn ground_truth(&self, _frame: &Frame, _kind: GtKind) -> Result<Option<DepthMap>> {
        Ok(None)
    }

    /// Depth of every pixel, where the recording knows it beside its scans: [`Dataset::dense_depth`].
    ///
    /// # Errors
    /// Where it is there and cannot be read.
    fn dense_depth(&self, _frame: &Frame) -> Result<Option<DepthMap>> {
        Ok(None)
    }

    /// [`Self::ground_truth`] with the velocities that were measured beside it.
    ///
    /// # Errors
    /// As [`Self::ground_truth`].
    fn scan_truth(&self, frame: &Frame, kind: GtKind) -> Result<Option<ScanTruth>> {
        let depth = self.ground_truth(frame, kind)?;
        Ok(depth.map(|depth| ScanTruth {
            depth,
            velocity_mps: None,
        }))
    }

    /// What tells moving pixels from static ones.
    ///
    /// # Errors
    /// Where it is there and cannot be read.
    fn moving_labels(&self, _dataset: &Dataset) -> Result<Option<MovingLabels>> {
        Ok(None)
    }

    /// The vehicle's velocity as a LiDAR that measures radial velocities saw it, in at most `most` scans spread over
    /// the drive; none where there is no such LiDAR.
    ///
    /// # Errors
    /// Where a scan cannot be read.
    fn lidar_motion(&self, _most: usize) -> Result<Vec<LidarMotion>> {
        Ok(Vec::new())
    }

    /// How far a topic of dynamic points agrees with the radial velocities, in at most `most` scans spread over the
    /// drive; `None` where the recording has not both.
    ///
    /// # Errors
    /// Where a scan cannot be read.
    fn dynamic_agreement(&self, _most: usize) -> Result<Option<DynamicAgreement>> {
        Ok(None)
    }

    /// The time of a number without an image, in seconds on the frames' clock.
    fn time_of(&self, _number: u64) -> Option<f64> {
        None
    }

    /// The camera's measured path.
    ///
    /// # Errors
    /// Where it cannot be read; [`Error::NoPath`] where there is none.
    fn camera_paths(&self, dataset: &Dataset) -> Result<Vec<CameraPath>> {
        Err(Error::NoPath {
            drive: dataset.name().to_owned(),
            layout: self.kind().label(),
        })
    }
}

/// Depth of a frame by its scan, and how fast what is seen there moves.
#[derive(Debug, Clone, PartialEq)]
pub struct ScanTruth {
    /// H×W camera z in metres, 0 = none; as [`Dataset::ground_truth`].
    pub depth: DepthMap,
    /// Velocity over ground along the LiDAR's ray, m/s, receding is positive, row by row, of the point that the depth is
    /// of: about 0 for what stands still, NaN where there is no depth or no velocity. `None` where the scan has no
    /// radial velocities.
    pub velocity_mps: Option<Vec<f32>>,
}

/// The velocity of a LiDAR over ground, by its scan and by the vehicle.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LidarMotion {
    /// When, in seconds on the frames' clock.
    pub time_s: f64,
    /// By the scan's static points, in the vehicle's axes (x forward, y left, z up), m/s.
    pub by_scan_mps: Vector3<f64>,
    /// By speed and yaw rate, same axes, m/s.
    pub by_vehicle_mps: Vector3<f64>,
}

/// The place in a file that says what the camera is.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct CalibrationPlace {
    /// The file.
    pub file: PathBuf,
    /// The field that holds the image's size.
    pub field: &'static str,
}
