//! The interface that a layout implements so that its recordings become a [`Dataset`].

use super::drive::Dataset;
use super::frame::Frame;
use super::inspection::{Mount, Stream};
use super::kind::DatasetKind;
use super::warning::DataWarning;
use crate::truth::{DynamicAgreement, GtKind, LidarMotion, MovingLabels, ScanTruth};
use crate::{CalibrationSource, Error, MissingPart, Result};
use deepfusion_geometry::{DepthMap, Se3};
use image::RgbImage;
use std::fmt;
use std::path::Path;

/// Source of a data set's images and labels; each layout has one implementation.
///
/// What all layouts have in common (frames, times, camera, speeds) is in [`crate::DatasetParts`]. This trait is the rest,
/// which is read on request. The default methods are for recordings without such data.
pub trait Recording: fmt::Debug + Send + Sync {
    /// The layout; by default [`DatasetKind::Other`].
    fn kind(&self) -> DatasetKind {
        DatasetKind::Other
    }

    /// Folder of the recording's files.
    fn folder(&self) -> &Path;

    /// A frame's image, corrected for lens distortion, at the size of the data set's intrinsics.
    ///
    /// # Errors
    /// If it cannot be read.
    fn load_image(&self, frame: &Frame) -> Result<RgbImage>;

    /// Whether [`Self::load_image`] corrects a lens distortion, so that its image differs from the file's.
    fn corrects_lens(&self) -> bool {
        false
    }

    /// Where the camera's intrinsics come from, for the error about an image of another size.
    fn calibration(&self) -> CalibrationPlace {
        CalibrationPlace {
            source: self.folder().into(),
            field: "the recording's camera",
        }
    }

    /// The recorded streams.
    ///
    /// # Errors
    /// If an existing stream cannot be read.
    fn streams(&self) -> Result<Vec<Stream>> {
        Ok(Vec::new())
    }

    /// The error about what is missing for the vehicle's motion, used if the data set lacks times, track or mount.
    fn no_motion(&self) -> Error {
        Error::Missing {
            path: self.folder().to_owned(),
            part: MissingPart::Motion,
        }
    }

    /// Assumptions, oddities and unreadable parts; use [`DataWarning::Other`] if no other variant fits.
    fn warnings(&self) -> &[DataWarning] {
        &[]
    }

    /// Those of [`Self::warnings`] about unreadable parts.
    fn damage(&self) -> &[DataWarning] {
        &[]
    }

    /// The sensors' mounts, if their sources are known.
    fn mounts(&self) -> &[Mount] {
        &[]
    }

    /// Whether a frame has [ground truth](Self::ground_truth).
    fn has_ground_truth(&self, _frame: &Frame, _kind: GtKind) -> bool {
        false
    }

    /// Depth of a frame in metres (camera z), at the size of its image, 0 = no depth.
    ///
    /// # Errors
    /// If it exists, but cannot be read.
    fn ground_truth(&self, _frame: &Frame, _kind: GtKind) -> Result<Option<DepthMap>> {
        Ok(None)
    }

    /// Whether a frame has [dense depth](Self::dense_depth).
    fn has_dense_depth(&self, _frame: &Frame) -> bool {
        false
    }

    /// Depth of every pixel, if the recording has it in addition to scans. See [`Dataset::dense_depth`].
    ///
    /// # Errors
    /// If it exists, but cannot be read.
    fn dense_depth(&self, _frame: &Frame) -> Result<Option<DepthMap>> {
        Ok(None)
    }

    /// [`Self::ground_truth`] with the measured velocities.
    ///
    /// # Errors
    /// Those of [`Self::ground_truth`].
    fn scan_truth(&self, frame: &Frame, kind: GtKind) -> Result<Option<ScanTruth>> {
        let depth = self.ground_truth(frame, kind)?;
        Ok(depth.map(|depth| ScanTruth {
            depth,
            velocity_mps: None,
        }))
    }

    /// Labels of dynamic and static pixels.
    ///
    /// # Errors
    /// If they exist, but cannot be read.
    fn moving_labels(&self, _dataset: &Dataset) -> Result<Option<MovingLabels>> {
        Ok(None)
    }

    /// The vehicle's velocity from a LiDAR that measures radial velocities, for at most `most` scans spread over
    /// the drive; empty if there is no such LiDAR.
    ///
    /// # Errors
    /// If a scan cannot be read.
    fn lidar_motion(&self, _most: usize) -> Result<Vec<LidarMotion>> {
        Ok(Vec::new())
    }

    /// Agreement of a topic of dynamic points with the radial velocities, in at most `most` scans spread over the
    /// drive; `None` unless the recording has both.
    ///
    /// # Errors
    /// If a scan cannot be read.
    fn dynamic_agreement(&self, _most: usize) -> Result<Option<DynamicAgreement>> {
        Ok(None)
    }

    /// The time of a frame number without an image, in seconds on the frames' clock.
    fn time_of(&self, _number: u64) -> Option<f64> {
        None
    }

    /// The camera's measured path.
    ///
    /// # Errors
    /// If it cannot be read; [`Error::NoPath`] if there is none.
    fn camera_paths(&self, dataset: &Dataset) -> Result<Vec<CameraPath>> {
        Err(Error::NoPath {
            drive: dataset.name().to_owned(),
            layout: self.kind().label(),
        })
    }
}

/// Where a calibration and its image size come from.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct CalibrationPlace {
    /// Where the calibration comes from.
    pub source: CalibrationSource,
    /// The field with the image size.
    pub field: &'static str,
}

/// A camera's path over consecutively numbered frames.
#[derive(Debug, Clone, PartialEq)]
pub struct CameraPath {
    /// Indices in [`Dataset::frames`].
    pub frames: Vec<usize>,
    /// Their times, in seconds from the drive's first time stamp; empty if they have no times.
    pub times_s: Vec<f64>,
    /// Camera poses in a fixed world frame, in metres. KITTI's has x east, y north, z up, and its origin at the
    /// unit's first position; an RGB-D folder's is the recording's own.
    pub world_from_cam: Vec<Se3>,
}
