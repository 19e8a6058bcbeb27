//! A drive's measurements: depth, dynamic objects, paths.

use super::Dataset;
use crate::Result;
use crate::dataset::recording::CameraPath;
use crate::truth::{DynamicAgreement, GtKind, LidarMotion, MovingLabels, ScanTruth};
use deepfusion_geometry::DepthMap;

impl Dataset {
    /// Whether a frame has [ground truth](Self::ground_truth).
    ///
    /// # Panics
    /// If there is no frame with that index.
    #[must_use]
    pub fn has_ground_truth(&self, frame: usize, kind: GtKind) -> bool {
        self.recording.has_ground_truth(&self.frames()[frame], kind)
    }

    /// Depth of a frame from its scan or its depth image, at the image's full size, in metres, 0 = no depth;
    /// `None` if there is neither.
    ///
    /// # Errors
    /// [`crate::Error::Cloud`] if a scan cannot be read, [`crate::Error::Missing`] without the scanner's calibration,
    /// [`crate::Error::Image`] if a depth image cannot be read, [`crate::Error::DepthKind`] if the recording does not
    /// have the requested kind.
    ///
    /// # Panics
    /// If there is no frame with that index.
    pub fn ground_truth(&self, frame: usize, kind: GtKind) -> Result<Option<DepthMap>> {
        self.recording.ground_truth(&self.frames()[frame], kind)
    }

    /// Whether a frame has [dense depth](Self::dense_depth).
    ///
    /// # Panics
    /// If there is no frame with that index.
    #[must_use]
    pub fn has_dense_depth(&self, frame: usize) -> bool {
        self.recording.has_dense_depth(&self.frames()[frame])
    }

    /// Exact depth of every pixel of a frame, for recordings that have it in addition to scans, such as simulated drives:
    /// H×W at the image's size, camera z in metres, infinite if nothing is within 255 m (the sky). `None` if there is
    /// no such depth; an RGB-D folder's depth is its [`Self::ground_truth`].
    ///
    /// # Errors
    /// [`crate::Error::Image`] if a depth image cannot be read, [`crate::Error::Size`] if its size differs from the images'.
    ///
    /// # Panics
    /// If there is no frame with that index.
    pub fn dense_depth(&self, frame: usize) -> Result<Option<DepthMap>> {
        self.recording.dense_depth(&self.frames()[frame])
    }

    /// [`Self::ground_truth`] and, if the LiDAR measured them, the velocities at each pixel with depth
    /// (H×W, m/s over ground along the LiDAR's ray, NaN if unknown).
    ///
    /// # Errors
    /// Those of [`Self::ground_truth`].
    ///
    /// # Panics
    /// If there is no frame with that index.
    pub fn scan_truth(&self, frame: usize, kind: GtKind) -> Result<Option<ScanTruth>> {
        self.recording.scan_truth(&self.frames()[frame], kind)
    }

    /// Labels of this recording's dynamic pixels: from the simulator's masks, from KITTI's tracklets with the vehicle's
    /// own motion, or from a bag's LiDAR (its radial velocities, otherwise its topic of dynamic points). `None` if
    /// there is none of these, or the vehicle's own motion is unknown.
    ///
    /// A tracklet is moving in a frame if its box's centre moves over ground at 0.75 m/s or more from five frames
    /// before to five frames after (fewer at its ends). Traffic without a tracklet counts as static: KITTI only has
    /// labels for what its annotators could follow in the scans.
    ///
    /// # Errors
    /// [`crate::Error::Tracklets`] if a tracklet file cannot be read.
    pub fn moving_labels(&self) -> Result<Option<MovingLabels>> {
        self.recording.moving_labels(self)
    }

    /// The camera's measured path, in segments without gaps: for KITTI from OXTS attitude and integrated velocity,
    /// for an RGB-D folder from its poses.
    ///
    /// # Errors
    /// [`crate::Error::NoPath`] if the layout has none; [`crate::Error::Missing`] or [`crate::Error::Oxts`] if it should have
    /// one that cannot be read.
    pub fn camera_paths(&self) -> Result<Vec<CameraPath>> {
        self.recording.camera_paths(self)
    }

    /// The vehicle's velocity from a LiDAR that measures radial velocities, together with that from speed and yaw rate, for at
    /// most `most` scans spread over the drive; empty if there is no such LiDAR.
    ///
    /// # Errors
    /// If a scan cannot be read.
    pub fn lidar_motion(&self, most: usize) -> Result<Vec<LidarMotion>> {
        self.recording.lidar_motion(most)
    }

    /// Agreement of a topic of dynamic points with the LiDAR's radial velocities, in at most `most` scans
    /// spread over the drive; `None` unless the recording has both.
    ///
    /// # Errors
    /// If a scan cannot be read.
    pub fn dynamic_agreement(&self, most: usize) -> Result<Option<DynamicAgreement>> {
        self.recording.dynamic_agreement(most)
    }
}
