//! What a drive's recording measured: depth, what is dynamic, paths.

use super::Dataset;
use crate::Result;
use crate::dataset::recording::CameraPath;
use crate::truth::{DynamicAgreement, GtKind, LidarMotion, MovingLabels, ScanTruth};
use deepfusion_geometry::DepthMap;

impl Dataset {
    /// Whether [`Self::ground_truth`] has something for a frame.
    ///
    /// # Panics
    /// If there is no frame of that index.
    #[must_use]
    pub fn has_ground_truth(&self, frame: usize, kind: GtKind) -> bool {
        self.recording.has_ground_truth(&self.frames()[frame], kind)
    }

    /// Depth of a frame from its scan or its depth image, at the image's full size, in metres, 0 = none;
    /// `None` where there is neither.
    ///
    /// # Errors
    /// [`crate::Error::Cloud`] where a scan cannot be read, [`crate::Error::Missing`] without the scanner's calibration,
    /// [`crate::Error::Image`] for a depth image that cannot be read, [`crate::Error::DepthKind`] where another
    /// kind is asked of one than it has.
    ///
    /// # Panics
    /// If there is no frame of that index.
    pub fn ground_truth(&self, frame: usize, kind: GtKind) -> Result<Option<DepthMap>> {
        self.recording.ground_truth(&self.frames()[frame], kind)
    }

    /// Whether [`Self::dense_depth`] has something for a frame.
    ///
    /// # Panics
    /// If there is no frame of that index.
    #[must_use]
    pub fn has_dense_depth(&self, frame: usize) -> bool {
        self.recording.has_dense_depth(&self.frames()[frame])
    }

    /// Exact depth of every pixel of a frame, where the recording has it beside its scans, as the simulator's drives do:
    /// H×W at the image's size, camera z in metres, infinite where nothing is within 255 m (the sky). `None` where there is
    /// no such depth; that of an RGB-D folder is its [`Self::ground_truth`].
    ///
    /// # Errors
    /// [`crate::Error::Image`] for a depth image that cannot be read, [`crate::Error::Size`] for one of another size than the images.
    ///
    /// # Panics
    /// If there is no frame of that index.
    pub fn dense_depth(&self, frame: usize) -> Result<Option<DepthMap>> {
        self.recording.dense_depth(&self.frames()[frame])
    }

    /// [`Self::ground_truth`] and, where a LiDAR measured them, the velocities of what is seen at each pixel with depth
    /// (H×W, m/s over ground along the LiDAR's ray, NaN where unknown).
    ///
    /// # Errors
    /// As [`Self::ground_truth`].
    ///
    /// # Panics
    /// If there is no frame of that index.
    pub fn scan_truth(&self, frame: usize, kind: GtKind) -> Result<Option<ScanTruth>> {
        self.recording.scan_truth(&self.frames()[frame], kind)
    }

    /// What tells this recording's dynamic pixels from its static ones: the simulator's masks, KITTI's
    /// tracklets together with the car's own motion, or a bag's LiDAR: its radial velocities, else its topic of dynamic
    /// points. `None` where none of these is there, or nothing says how
    /// the car itself moves.
    ///
    /// A tracklet is moving in a frame where its box's centre, seen from the ground, moves at 0.75 m/s
    /// or more from five frames before to five frames after (fewer at its ends). Traffic without a
    /// tracklet counts as static: KITTI labels what its annotators could follow in the scans.
    ///
    /// # Errors
    /// [`crate::Error::Tracklets`] for a tracklet file that cannot be read.
    pub fn moving_labels(&self) -> Result<Option<MovingLabels>> {
        self.recording.moving_labels(self)
    }

    /// The camera's path as the recording measured it, in stretches without gaps: KITTI's from OXTS
    /// attitude and integrated velocity, an RGB-D folder's from its poses.
    ///
    /// # Errors
    /// [`crate::Error::NoPath`] where the layout has none; [`crate::Error::Missing`] or [`crate::Error::Oxts`] where it should
    /// and cannot be read.
    pub fn camera_paths(&self) -> Result<Vec<CameraPath>> {
        self.recording.camera_paths(self)
    }

    /// The vehicle's velocity as a LiDAR that measures radial velocities saw it, in at most `most` scans spread over
    /// the drive, beside what speed and yaw rate say; none where there is no such LiDAR.
    ///
    /// # Errors
    /// Where a scan cannot be read.
    pub fn lidar_motion(&self, most: usize) -> Result<Vec<LidarMotion>> {
        self.recording.lidar_motion(most)
    }

    /// How far a topic of dynamic points agrees with the radial velocities of the LiDAR beside it, in at most `most` scans
    /// spread over the drive; `None` where the recording has not both.
    ///
    /// # Errors
    /// Where a scan cannot be read.
    pub fn dynamic_agreement(&self, most: usize) -> Result<Option<DynamicAgreement>> {
        self.recording.dynamic_agreement(most)
    }
}
