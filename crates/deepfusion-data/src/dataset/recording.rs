//! What a layout has to offer for its recordings to be a [`Dataset`].

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

/// Where a data set's images and labels come from; one implementation a layout.
///
/// What all layouts share (frames, times, camera, speeds) is in [`crate::DatasetParts`]; this is the rest,
/// read when it is asked for. The provided methods are those of a recording that has no such thing.
pub trait Recording: fmt::Debug + Send + Sync {
    /// The layout; another than those of this library where nothing is said.
    fn kind(&self) -> DatasetKind {
        DatasetKind::Other
    }

    /// The folder its files are in.
    fn folder(&self) -> &Path;

    /// A frame's image, freed of its lens' distortion, at the size of the data set's intrinsics.
    ///
    /// # Errors
    /// Where it cannot be read.
    fn load_image(&self, frame: &Frame) -> Result<RgbImage>;

    /// Whether [`Self::load_image`] undoes a distortion, so that the picture is not that of the frame's file.
    fn corrects_lens(&self) -> bool {
        false
    }

    /// Where the camera's numbers are from, for the error on an image of another size.
    fn calibration(&self) -> CalibrationPlace {
        CalibrationPlace {
            source: self.folder().into(),
            field: "the recording's camera",
        }
    }

    /// What was recorded beside the frames.
    ///
    /// # Errors
    /// Where a stream is there and cannot be read.
    fn streams(&self) -> Result<Vec<Stream>> {
        Ok(Vec::new())
    }

    /// What is missing for the car's motion, asked where the data set lacks times, track or mount.
    fn no_motion(&self) -> Error {
        Error::Missing {
            path: self.folder().to_owned(),
            part: MissingPart::Motion,
        }
    }

    /// What was taken for granted, looks odd or cannot be read; what no other variant says is a [`DataWarning::Other`].
    fn warnings(&self) -> &[DataWarning] {
        &[]
    }

    /// Those of [`Self::warnings`] that say what cannot be read.
    fn damage(&self) -> &[DataWarning] {
        &[]
    }

    /// Where its sensors are, where the recording can tell who says so.
    fn mounts(&self) -> &[Mount] {
        &[]
    }

    /// Whether [`Self::ground_truth`] will have something for a frame.
    fn has_ground_truth(&self, _frame: &Frame, _kind: GtKind) -> bool {
        false
    }

    /// Depth of a frame in metres (camera z), at the size of its image, 0 = none.
    ///
    /// # Errors
    /// Where it is there and cannot be read.
    fn ground_truth(&self, _frame: &Frame, _kind: GtKind) -> Result<Option<DepthMap>> {
        Ok(None)
    }

    /// Whether [`Self::dense_depth`] will have something for a frame.
    fn has_dense_depth(&self, _frame: &Frame) -> bool {
        false
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

    /// What tells dynamic pixels from static ones.
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

/// What says what the camera is, and where.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct CalibrationPlace {
    /// The file, or who else says it.
    pub source: CalibrationSource,
    /// The field that holds the image's size.
    pub field: &'static str,
}

/// A camera's path over consecutively numbered frames.
#[derive(Debug, Clone, PartialEq)]
pub struct CameraPath {
    /// Indices in [`Dataset::frames`].
    pub frames: Vec<usize>,
    /// Their times, in seconds from the drive's first time stamp; empty where there are none.
    pub times_s: Vec<f64>,
    /// The camera in a world that does not move. KITTI's has x east, y north, z up, and its origin at the
    /// unit's first place; an RGB-D folder's is the recording's own.
    pub world_from_cam: Vec<Se3>,
}
