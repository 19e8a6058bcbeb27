//! A bag as a [`Recording`].

use super::image;
use super::index::MessageRef;
use super::scans::{BagScans, MovingPoints};
use super::topics::Topics;
use super::video::BagVideo;
use crate::{
    CalibrationPlace, CameraPath, DataWarning, Dataset, DatasetKind, DynamicAgreement, Error,
    Frame, FrameImage, GtKind, ImageProblem, Lens, LidarMotion, Mount, MovingLabels, MovingSource,
    NoTrackReason, Recording, Result, ScanTruth, Stream, TopicRole,
};
use ::image::RgbImage;
use deepfusion_geometry::{DepthMap, Se3, Trajectory};
use deepfusion_rosbag::MessageSource;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Longest gap between exact poses that is interpolated, in seconds.
const POSE_GAP_S: f64 = 0.5;

/// A bag with a camera.
#[derive(Debug)]
pub(super) struct BagRecording {
    pub(super) folder: PathBuf,
    pub(super) bag: Arc<dyn MessageSource>,
    pub(super) topics: Topics,
    pub(super) images: Vec<MessageRef>,
    /// The video stream, if the images are packets of one.
    pub(super) video: Option<BagVideo>,
    pub(super) lens: Lens,
    pub(super) streams: Vec<Stream>,
    pub(super) mounts: Vec<Mount>,
    pub(super) damage: Vec<DataWarning>,
    /// All warnings, including those in `damage`.
    pub(super) warnings: Vec<DataWarning>,
    /// The vehicle's exact poses, on the vehicle's clock.
    pub(super) truth: Trajectory,
    pub(super) cam_from_vehicle: Se3,
    pub(super) scans: Option<Arc<BagScans>>,
    pub(super) calibration: CalibrationPlace,
}

impl Recording for BagRecording {
    fn kind(&self) -> DatasetKind {
        DatasetKind::Bag
    }

    fn folder(&self) -> &Path {
        &self.folder
    }

    fn corrects_lens(&self) -> bool {
        self.lens.distorts()
    }

    fn load_image(&self, frame: &Frame) -> Result<RgbImage> {
        let missing = || Error::Image {
            path: self.bag.path().to_owned(),
            problem: ImageProblem::NoImage(frame.number),
        };
        let FrameImage::Within { index, .. } = frame.image else {
            return Err(missing());
        };
        if let Some(video) = &self.video {
            let image = video.load(self.bag.as_ref(), index)?;
            return self.lens.correct(image.ok_or_else(missing)?);
        }
        let topic = self.topics.of(TopicRole::Image).unwrap_or_default();
        let place = usize::try_from(index).ok();
        let place = place.and_then(|index| self.images.get(index));
        let place = place.ok_or_else(missing)?;
        let message = image::message(self.bag.as_ref(), topic, place)?;
        self.lens
            .correct(image::decode(self.bag.as_ref(), &message)?)
    }

    fn calibration(&self) -> CalibrationPlace {
        self.calibration.clone()
    }

    fn streams(&self) -> Result<Vec<Stream>> {
        Ok(self.streams.clone())
    }

    fn no_motion(&self) -> Error {
        Error::NoTrack {
            drive: self.bag.path().display().to_string(),
            reason: NoTrackReason::NoSpeedTopic,
        }
    }

    fn warnings(&self) -> &[DataWarning] {
        &self.warnings
    }

    fn damage(&self) -> &[DataWarning] {
        &self.damage
    }

    fn mounts(&self) -> &[Mount] {
        &self.mounts
    }

    fn has_ground_truth(&self, frame: &Frame, _kind: GtKind) -> bool {
        let scans = self.scans.as_ref();
        scans.is_some_and(|scans| frame.time_s.is_some_and(|t| scans.has(t)))
    }

    fn ground_truth(&self, frame: &Frame, kind: GtKind) -> Result<Option<DepthMap>> {
        if kind != GtKind::Z {
            return Err(Error::DepthKind {
                drive: frame.drive.clone(),
                kind,
            });
        }
        let (Some(scans), Some(time_s)) = (&self.scans, frame.time_s) else {
            return Ok(None);
        };
        scans.depth(time_s)
    }

    fn scan_truth(&self, frame: &Frame, kind: GtKind) -> Result<Option<ScanTruth>> {
        if kind != GtKind::Z {
            return Err(Error::DepthKind {
                drive: frame.drive.clone(),
                kind,
            });
        }
        match (&self.scans, frame.time_s) {
            (Some(scans), Some(time_s)) => scans.truth(time_s),
            _ => Ok(None),
        }
    }

    fn lidar_motion(&self, most: usize) -> Result<Vec<LidarMotion>> {
        self.scans
            .as_ref()
            .map_or(Ok(Vec::new()), |scans| scans.motion(most))
    }

    fn dynamic_agreement(&self, most: usize) -> Result<Option<DynamicAgreement>> {
        let scans = self.scans.as_ref();
        let scans = scans.filter(|scans| scans.dynamic.is_some());
        scans.map_or(Ok(None), |scans| scans.agreement(most))
    }

    fn moving_labels(&self, dataset: &Dataset) -> Result<Option<MovingLabels>> {
        let Some(scans) = &self.scans else {
            return Ok(None);
        };
        let source = match (scans.has_velocities()?, &scans.dynamic) {
            (true, _) => MovingSource::RadialVelocity,
            (false, Some(_)) => MovingSource::DynamicPoints,
            (false, None) => return Ok(None),
        };
        let times = dataset
            .frames()
            .iter()
            .filter_map(|f| Some((f.number, f.time_s?)));
        let moving = MovingPoints {
            scans: Arc::clone(scans),
            times_s: times.collect(),
        };
        Ok(Some(MovingLabels::new(source, moving)))
    }

    fn camera_paths(&self, dataset: &Dataset) -> Result<Vec<CameraPath>> {
        // An assumed viewing direction may have been corrected from the images since.
        let cam_from_vehicle = dataset.cam_from_vehicle().unwrap_or(self.cam_from_vehicle);
        let vehicle_from_cam = cam_from_vehicle.inverse();
        let mut paths = Vec::new();
        let pose = |frame: &usize| {
            let time_s = dataset.frames()[*frame].time_s?;
            let world_from_vehicle = self.truth.at(time_s, POSE_GAP_S)?;
            Some((time_s, world_from_vehicle * vehicle_from_cam))
        };
        for stretch in dataset.stretches() {
            let have_poses = |a: &usize, b: &usize| pose(a).is_some() && pose(b).is_some();
            for piece in stretch.chunk_by(have_poses).filter(|p| p.len() > 1) {
                let (times_s, world_from_cam) = piece.iter().filter_map(pose).unzip();
                paths.push(CameraPath {
                    frames: piece.to_vec(),
                    times_s,
                    world_from_cam,
                });
            }
        }
        if paths.is_empty() {
            Err(Error::NoPath {
                drive: dataset.name().to_owned(),
                layout: self.kind().label(),
            })
        } else {
            Ok(paths)
        }
    }
}
