//! The recording for layouts with frames in files or in a video: one camera, times, speeds, poses, measured depth.

use crate::dataset::selection::Selection;
use crate::logs::clock::{on_the_vehicles_clock, seconds};
use crate::logs::frame_times::TimedImage;
use crate::logs::speed_log::SpeedLog;
use crate::truth::measured::MeasuredDepth;
use crate::{
    CalibrationPlace, Camera, CameraCalibration, CameraPath, CameraWarning, DataWarning, Dataset,
    DatasetKind, DatasetParts, Error, Frame, FrameImage, GtKind, Lens, MotionWarning, MountWarning,
    NoTrackReason, OpenOptions, Receiver, Recording, Result, Stream, load_rgb,
};
use deepfusion_geometry::{DepthMap, Se3};
use deepfusion_video::VideoFrames;
use image::RgbImage;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Opens each of several recordings found at `path` as a data set, except those without a selected frame.
///
/// # Errors
/// The error of the first that cannot be opened; [`Error::SplitSelectsNothing`] if no frame of any is selected.
pub(crate) fn open_each<T>(
    path: &Path,
    found: impl IntoIterator<Item = T>,
    options: &OpenOptions,
    open: impl Fn(T) -> Result<Dataset>,
) -> Result<Vec<Dataset>> {
    let mut datasets = Vec::new();
    let mut any = false;
    for one in found {
        any = true;
        match open(one)?.select(path, options) {
            Ok(dataset) => datasets.push(dataset),
            Err(Error::SplitSelectsNothing { .. }) => {}
            Err(other) => return Err(other),
        }
    }
    match Selection::new(options).nothing_selected(path) {
        Some(error) if any && datasets.is_empty() => Err(error),
        _ => Ok(datasets),
    }
}

/// A recording of one camera, put together from what a layout found.
#[derive(Debug)]
pub(crate) struct PlainRecording {
    kind: DatasetKind,
    name: String,
    folder: PathBuf,
    calibration: CameraCalibration,
    lens: Lens,
    video: Option<VideoFrames>,
    truth: Option<MeasuredDepth>,
    world_from_cam: BTreeMap<u64, Se3>,
    streams: Vec<Stream>,
    warnings: Vec<DataWarning>,
    /// The reason reported if there is no ego-motion.
    no_motion: NoTrackReason,
}

/// The parts found by a layout, from which a [`Dataset`] is made.
pub(crate) struct PlainParts {
    pub(crate) kind: DatasetKind,
    pub(crate) folder: PathBuf,
    pub(crate) name: String,
    pub(crate) images: Vec<TimedImage>,
    pub(crate) video: Option<VideoFrames>,
    pub(crate) calibration: CameraCalibration,
    /// How far the camera's clock is ahead of the speeds' clock, in seconds.
    pub(crate) camera_ahead_s: f64,
    /// Width and height of the first image, in pixels.
    pub(crate) image_size: (u32, u32),
    pub(crate) speeds: Option<SpeedLog>,
    pub(crate) cam_from_vehicle: Se3,
    /// Whether the camera's mount is needed, but only assumed.
    pub(crate) mount_assumed: bool,
    /// Which of the vehicle's cameras it is.
    pub(crate) camera: Camera,
    pub(crate) truth: Option<MeasuredDepth>,
    pub(crate) world_from_cam: BTreeMap<u64, Se3>,
    /// Streams other than those of images, speeds, poses and measured depth.
    pub(crate) streams: Vec<Stream>,
    pub(crate) warnings: Vec<DataWarning>,
    /// Whether there are poses, but no times to compute speeds from them.
    pub(crate) untimed_poses: bool,
}

impl PlainParts {
    /// The recording as a data set of all its frames.
    ///
    /// # Errors
    /// [`Error::Clocks`] if the times of frames and speeds do not overlap, [`Error::CameraFile`],
    /// [`Error::FrameSize`], [`Error::Image`], [`Error::Motion`].
    pub(crate) fn into_dataset(mut self) -> Result<Dataset> {
        if self.mount_assumed {
            self.warnings.push(MountWarning::NotGiven.into());
        }
        for ns in self.images.iter_mut().filter_map(|i| i.ns.as_mut()) {
            *ns = on_the_vehicles_clock(*ns, self.camera_ahead_s);
        }
        let origin_ns = self.images.iter().find_map(|i| i.ns);
        let motion = match (&self.speeds, origin_ns) {
            (Some(log), Some(origin)) => Some(log.motion(origin)?),
            _ => None,
        };
        let receiver = match (&self.speeds, origin_ns) {
            (Some(log), Some(origin)) => log.receiver(origin),
            _ => Receiver::default(),
        };
        let yaw_known = motion.as_ref().is_some_and(|(_, known)| *known);
        let track = motion.map(|(track, _)| track);
        let no_motion = match (&self.speeds, origin_ns) {
            (None, _) if self.untimed_poses => NoTrackReason::UntimedPoses,
            (None, _) => NoTrackReason::NoSpeeds { layout: self.kind },
            _ => NoTrackReason::NoTimes,
        };
        self.check_size()?;
        let lens = self.calibration.lens()?;
        let mut frames = Vec::with_capacity(self.images.len());
        for (i, image) in self.images.iter().enumerate() {
            let time_s = image.ns.zip(origin_ns).map(|(ns, o)| seconds(ns, o));
            frames.push(Frame {
                drive: self.name.clone(),
                number: image.number,
                time_s,
                image: match &self.video {
                    Some(video) => FrameImage::Within {
                        file: video.file().to_owned(),
                        index: i as u64,
                    },
                    None => FrameImage::File(image.path.clone()),
                },
                speed_mps: time_s.and_then(|t| track.as_ref()?.speed_at(t)),
            });
        }
        self.check_clocks(&frames)?;
        self.describe_camera(&lens);
        let times: Vec<f64> = frames.iter().filter_map(|f| f.time_s).collect();
        let mut streams = vec![Stream::new("frames", "image", frames.len(), &times)];
        if let Some(log) = &self.speeds {
            streams.extend(log.streams.iter().cloned());
            self.warnings.extend(log.warnings.iter().cloned());
        }
        streams.extend(self.truth.as_ref().map(MeasuredDepth::stream));
        if !self.world_from_cam.is_empty() {
            streams.push(Stream::new("pose", "pose", self.world_from_cam.len(), &[]));
        }
        streams.append(&mut self.streams);
        let parts = DatasetParts {
            name: self.name.clone(),
            split_name: self.name.clone(),
            camera: self.camera,
            frames,
            intrinsics: lens.intrinsics(),
            cam_from_vehicle: Some(self.cam_from_vehicle),
            track,
            yaw_known,
            origin_ns,
            camera_ahead_s: self.camera_ahead_s,
            scenario: None,
        };
        let assumed = self.calibration.assumed;
        let dataset = Dataset::new(
            parts,
            Arc::new(PlainRecording {
                kind: self.kind,
                name: self.name,
                folder: self.folder,
                calibration: self.calibration,
                lens,
                video: self.video,
                truth: self.truth,
                world_from_cam: self.world_from_cam,
                streams,
                warnings: self.warnings,
                no_motion,
            }),
        )
        .with_receiver(receiver)
        .with_camera_assumed(assumed)
        .with_mount_assumed(self.mount_assumed);
        dataset.check_sizes()?;
        Ok(dataset)
    }

    /// Checks that the images have the size of the calibration, for which the lens correction was computed.
    fn check_size(&self) -> Result<()> {
        let k = &self.calibration.intrinsics;
        if self.image_size == (k.width, k.height) {
            return Ok(());
        }
        let first = self.images.first();
        let place = self.calibration.place();
        Err(Error::FrameSize {
            image: first.map_or_else(String::new, |i| i.path.display().to_string()),
            drive: self.name.clone(),
            frame: first.map_or(0, |i| i.number),
            found: self.image_size,
            expected: (k.width, k.height),
            field: place.field,
            calibration: place.source,
        })
    }

    /// Warns about frames without a speed. If no frame has one, the clocks differ, which is an error.
    fn check_clocks(&mut self, frames: &[Frame]) -> Result<()> {
        let Some(log) = &self.speeds else {
            return Ok(());
        };
        let timed = frames.iter().filter(|f| f.time_s.is_some()).count();
        let known = frames.iter().filter(|f| f.speed_mps.is_some()).count();
        let ns: Vec<i64> = self.images.iter().filter_map(|i| i.ns).collect();
        if let (Some(f0), Some(f1), Some(s0), Some(s1)) = (
            ns.iter().min(),
            ns.iter().max(),
            log.speeds_mps.ns.first(),
            log.speeds_mps.ns.last(),
        ) && (s1 < f0 || f1 < s0)
        {
            let s = |ns: &i64| seconds(*ns, 0);
            return Err(Error::Clocks {
                path: log.path.clone(),
                times_s: (s(s0), s(s1)),
                frames_s: (s(f0), s(f1)),
            });
        }
        if known < timed {
            let frames = timed - known;
            let unknown = MotionWarning::FramesWithoutSpeed { frames, of: timed };
            self.warnings.push(unknown.into());
        }
        Ok(())
    }

    fn describe_camera(&mut self, lens: &Lens) {
        // A layout with its own calibration has images of one size, and an assumed camera is learned in training.
        let known = self.calibration.size_in_file || self.calibration.assumed;
        if !known && !self.kind.has_own_calibration() {
            let k = &self.calibration.intrinsics;
            let unknown = CameraWarning::SizeUnknown {
                by: self.calibration.source.clone(),
                width: k.width,
                height: k.height,
            };
            self.warnings.push(unknown.into());
        }
        if lens.distorts() {
            self.warnings.push(CameraWarning::LensCorrected.into());
        }
    }
}

impl Recording for PlainRecording {
    fn kind(&self) -> DatasetKind {
        self.kind
    }

    fn folder(&self) -> &Path {
        &self.folder
    }

    fn corrects_lens(&self) -> bool {
        self.lens.distorts()
    }

    fn load_image(&self, frame: &Frame) -> Result<RgbImage> {
        let image = match (&self.video, &frame.image) {
            (Some(video), FrameImage::Within { index, .. }) => load_rgb(&video.frame(*index)?)?,
            _ => load_rgb(frame.image.path())?,
        };
        let k = self.lens.intrinsics();
        // The data set reports an image of another size, since it knows the frame.
        if image.dimensions() == (k.width, k.height) {
            self.lens.correct(image)
        } else {
            Ok(image)
        }
    }

    fn calibration(&self) -> CalibrationPlace {
        self.calibration.place()
    }

    fn streams(&self) -> Result<Vec<Stream>> {
        Ok(self.streams.clone())
    }

    fn no_motion(&self) -> Error {
        Error::NoTrack {
            drive: self.name.clone(),
            reason: self.no_motion.clone(),
        }
    }

    fn warnings(&self) -> &[DataWarning] {
        &self.warnings
    }

    fn has_ground_truth(&self, frame: &Frame, _kind: GtKind) -> bool {
        let truth = self.truth.as_ref();
        truth.is_some_and(|truth| truth.has(frame.number))
    }

    fn ground_truth(&self, frame: &Frame, kind: GtKind) -> Result<Option<DepthMap>> {
        let Some(truth) = &self.truth else {
            return Ok(None);
        };
        truth.of(frame.number, kind, &self.lens, &self.name)
    }

    fn camera_paths(&self, dataset: &Dataset) -> Result<Vec<CameraPath>> {
        if self.world_from_cam.is_empty() {
            return Err(Error::NoPath {
                drive: self.name.clone(),
                layout: self.kind.label(),
            });
        }
        let pose = |frame: &usize| {
            let frame = dataset.frames().get(*frame)?;
            self.world_from_cam.get(&frame.number).copied()
        };
        let mut paths = Vec::new();
        for stretch in dataset.stretches() {
            let has_pose = |a: &usize, b: &usize| pose(a).is_some() && pose(b).is_some();
            for piece in stretch.chunk_by(has_pose).filter(|p| p.len() > 1) {
                let times = piece.iter().map(|f| dataset.frames()[*f].time_s);
                paths.push(CameraPath {
                    frames: piece.to_vec(),
                    times_s: times.collect::<Option<Vec<_>>>().unwrap_or_default(),
                    world_from_cam: piece.iter().filter_map(pose).collect(),
                });
            }
        }
        Ok(paths)
    }
}
