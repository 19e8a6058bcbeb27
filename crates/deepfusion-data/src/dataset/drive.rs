use super::camera::Camera;
use super::ego::{Ego, Receiver};
use super::frame::{Frame, FrameImage};
use super::heading::Heading;
use super::inspection::{Mount, Stream};
use super::kind::DatasetKind;
use super::options::OpenOptions;
use super::recording::{CameraPath, Recording};
use super::seen_turn::{self, SeenTurn};
use super::selection::Selection;
use super::split::drive_name;
use super::warning::{DataWarning, IncompleteWarning, MotionWarning, MountWarning};
use crate::truth::{DynamicAgreement, GtKind, LidarMotion, MovingLabels, ScanTruth};
use crate::{Error, MotionModel, Result, VehicleTrack, image_size};
use deepfusion_geometry::{DepthMap, Intrinsics, Se3};
use image::RgbImage;
use rayon::prelude::*;
use std::path::Path;
use std::sync::Arc;

/// What every layout has: the parts of a [`Dataset`] that are plain values.
#[derive(Debug, Clone)]
pub struct DatasetParts {
    /// The drive's name.
    pub name: String,
    /// Its name in split files; KITTI raw's is `<date>/<drive>`.
    pub split_name: String,
    /// The camera whose images these are.
    pub camera: Camera,
    /// All frames, by number.
    pub frames: Vec<Frame>,
    /// Of the images as [`Recording::load_image`] gives them.
    pub intrinsics: Intrinsics,
    /// A point of the vehicle (x forward, y left, z up, where speed and yaw rate are measured) in the
    /// camera; `None` where the layout has to know it and does not.
    pub cam_from_vehicle: Option<Se3>,
    /// The car's speed and yaw rate, where the drive has them.
    pub track: Option<MotionModel>,
    /// Whether the track's yaw rates were measured. Where not, they are 0 and mean nothing.
    pub yaw_known: bool,
    /// Nanoseconds from which seconds are counted, on the vehicle's clock: since 1970 or whatever it starts at.
    pub origin_ns: Option<i64>,
    /// What was taken off the images' times, in seconds: how far the camera's clock is ahead of the vehicle's.
    pub camera_ahead_s: f64,
    /// The kind of drive, such as `garage`, for a row each in an evaluation.
    pub scenario: Option<String>,
}

impl DatasetParts {
    /// A drive of which no more is known than its frames, their times and speeds: its camera looks ahead, at the vehicle's own place, and nothing
    /// says how it turned.
    #[must_use]
    pub fn of_frames(name: &str, frames: Vec<Frame>, intrinsics: Intrinsics) -> Self {
        let samples = frames.iter();
        let samples = samples.filter_map(|frame| Some((frame.time_s?, frame.speed_mps?, 0.0)));
        let track = VehicleTrack::new(&samples.collect::<Vec<_>>());
        Self {
            name: name.to_owned(),
            split_name: name.to_owned(),
            camera: Camera::Left,
            frames,
            intrinsics,
            cam_from_vehicle: Some(looks_ahead()),
            track: Some(track.into()),
            yaw_known: false,
            origin_ns: None,
            camera_ahead_s: 0.0,
            scenario: None,
        }
    }
}

/// The vehicle's axes (x ahead, y to the left, z up) in a camera's (x to the right, y down, z ahead) at its origin.
fn looks_ahead() -> Se3 {
    Se3::from_quaternion([0.5, 0.5, -0.5, 0.5], Se3::identity().translation())
}

/// Everything a trainer or an evaluator needs from one camera's recording of one drive.
#[derive(Debug, Clone)]
pub struct Dataset {
    parts: DatasetParts,
    selected: Vec<usize>,
    /// Of each of these its place in the split.
    split_places: Vec<Option<usize>>,
    recording: Arc<dyn Recording>,
    receiver: Receiver,
    camera_assumed: bool,
    mount_assumed: bool,
    simulated: bool,
    /// The recording's, and what was noticed about its neighbours.
    warnings: Vec<DataWarning>,
}

/// Between the samples of a track whose turns are those of a course, in seconds.
const COURSE_STEP_S: f64 = 0.1;

impl Dataset {
    /// A data set of all its frames.
    #[must_use]
    pub fn new(mut parts: DatasetParts, recording: Arc<dyn Recording>) -> Self {
        parts.split_name = drive_name(&parts.split_name);
        Self {
            selected: (0..parts.frames.len()).collect(),
            split_places: vec![None; parts.frames.len()],
            parts,
            warnings: recording.warnings().to_vec(),
            recording,
            receiver: Receiver::default(),
            camera_assumed: false,
            mount_assumed: false,
            simulated: false,
        }
    }

    /// With the mark of a simulator, or without it.
    #[must_use]
    pub fn with_simulated(mut self, simulated: bool) -> Self {
        self.simulated = simulated;
        self
    }

    /// Whether the recording says that nobody drove it: by the key `simulated` of the file beside it, else by what only a simulator can write
    /// beside the images. [`crate::convert_to_kitti`] and [`crate::convert_to_bag`] hand it on. Without the mark it may be either.
    #[must_use]
    pub fn is_simulated(&self) -> bool {
        self.simulated
    }

    /// With a camera that nothing says, or that something does.
    #[must_use]
    pub fn with_camera_assumed(mut self, assumed: bool) -> Self {
        self.camera_assumed = assumed;
        self
    }

    /// Whether nothing says what the camera is, and [`OpenOptions::assumed_camera`] stands in.
    #[must_use]
    pub fn camera_assumed(&self) -> bool {
        self.camera_assumed
    }

    /// With a mount that nothing says, so that the camera is taken to look straight ahead, or one that something does.
    #[must_use]
    pub fn with_mount_assumed(mut self, assumed: bool) -> Self {
        self.mount_assumed = assumed;
        self
    }

    /// Whether nothing says where the camera looks from the vehicle, nor has it been [aimed](Self::aim).
    #[must_use]
    pub fn mount_assumed(&self) -> bool {
        self.mount_assumed
    }

    /// Turns the camera on its vehicle to where its images show that it looks: motions between frames then have that direction.
    /// Nothing happens where the mount is not [assumed](Self::mount_assumed). A bag's scans are still brought to the frames' times by the
    /// motion of the mount that was assumed: over milliseconds these differ by millimetres.
    pub fn aim(&mut self, heading: &Heading) {
        if let Some(cam_from_vehicle) = self.parts.cam_from_vehicle {
            self.aim_beside(heading, &cam_from_vehicle);
        }
    }

    /// As [`Self::aim`], by what the images of another camera on the vehicle show, whose mount was `cam_from_vehicle` before that one was aimed:
    /// where the two cameras are to each other stays as it is.
    pub fn aim_beside(&mut self, heading: &Heading, cam_from_vehicle: &Se3) {
        if !self.mount_assumed {
            return;
        }
        let mount = self.parts.cam_from_vehicle.as_mut();
        if let Some(own_from_vehicle) = mount {
            let own_from_cam = *own_from_vehicle * cam_from_vehicle.inverse();
            *own_from_vehicle = own_from_cam * heading.turn() * *cam_from_vehicle;
            self.mount_assumed = false;
            self.warnings.retain(|warning| {
                !matches!(
                    warning,
                    DataWarning::Mount(MountWarning::NotGiven | MountWarning::CameraUnknown)
                )
            });
            self.warnings.push(MountWarning::Aimed(*heading).into());
        }
    }

    /// Whether nothing says how the vehicle rolls and pitches, though its speed is known.
    #[must_use]
    pub fn tilt_unknown(&self) -> bool {
        let track = self.parts.track.as_ref();
        track.is_some_and(MotionModel::lacks_tilt)
    }

    /// With the vehicle's turns as its images show them, in the order of time: roll and pitch, and where no yaw rate was recorded the turns
    /// to the side as well. Nothing happens where [they are known](Self::tilt_unknown), where none are given, and without a yaw rate where
    /// those of a tenth of the pairs that moved are missing: a drive with holes in it is no better known.
    pub fn take_turns(&mut self, turns: &[SeenTurn]) {
        let yaw_known = self.parts.yaw_known;
        let enough = yaw_known || self.shows_enough(turns);
        if !self.tilt_unknown() || turns.is_empty() || !enough {
            return;
        }
        let track = self.parts.track.take();
        self.parts.track = track.map(|track| seen_turn::put_into(track, turns, yaw_known));
        self.parts.yaw_known = true;
        self.warnings.retain(|warning| {
            !matches!(
                warning,
                DataWarning::Motion(
                    MotionWarning::NoYawRate { .. } | MotionWarning::YawNotMeasured
                )
            )
        });
        let images = self.frames().len();
        let taken = seen_turn::warning(turns, images, yaw_known);
        self.warnings.push(taken.into());
    }

    /// Whether these are the turns of nine tenths of the neighbours between which the vehicle moved.
    fn shows_enough(&self, turns: &[SeenTurn]) -> bool {
        /// Slower than this it stands, m/s.
        const STANDING: f64 = 0.5;
        let Ok(ego) = self.ego() else { return false };
        let moves = |(from_s, to_s): (f64, f64)| {
            let motion = ego.vehicle_motion(from_s, to_s);
            motion.is_some_and(|motion| motion.distance_m.abs() > STANDING * (to_s - from_s))
        };
        let pairs = self.frames().windows(2);
        let pairs = pairs.filter_map(|pair| pair[0].time_s.zip(pair[1].time_s));
        let moving = pairs.filter(|pair| moves(*pair)).count();
        let seen = turns.iter().filter(|turn| moves((turn.from_s, turn.to_s)));
        10 * seen.count() >= 9 * moving
    }

    /// With what a satellite receiver says beside the speeds.
    #[must_use]
    pub fn with_receiver(mut self, receiver: Receiver) -> Self {
        self.receiver = receiver;
        self
    }

    /// The same with the turns of its receiver's course for a yaw rate, where it has no other: to compare clocks by, not to train
    /// on, since a course is spread over a second or so. `None` where it has a yaw rate, or no course.
    #[must_use]
    pub fn turning_as_its_course(&self) -> Option<Self> {
        let track = self.parts.track.as_ref().filter(|_| !self.yaw_known())?;
        let course = self.receiver.course_rate_radps.as_ref()?;
        let times = course.times_s();
        let (first, last) = (*times.first()?, *times.last()?);
        let steps = ((last - first) / COURSE_STEP_S).floor().max(0.0) as usize;
        let sample = |step: usize| {
            let time_s = first + step as f64 * COURSE_STEP_S;
            Some((time_s, track.speed_at(time_s)?, course.at(time_s)?))
        };
        let samples: Vec<_> = (0..=steps).filter_map(sample).collect();
        let mut turning = self.clone();
        turning.parts.track = Some(VehicleTrack::new(&samples).into());
        turning.parts.yaw_known = true;
        Some(turning)
    }

    /// What a satellite receiver says beside the speeds; nothing where there is none.
    #[must_use]
    pub fn receiver(&self) -> &Receiver {
        &self.receiver
    }

    /// With only these frames selected, by index, each with its place in the split.
    pub(crate) fn with_selected(mut self, selected: Vec<(usize, Option<usize>)>) -> Self {
        (self.selected, self.split_places) = selected.into_iter().unzip();
        self
    }

    /// With what the options select; for layouts of one drive and one camera.
    ///
    /// # Errors
    /// [`Error::SplitSelectsNothing`]; [`Error::OneCamera`] where only the right camera is asked for.
    pub(crate) fn select(self, path: &Path, options: &OpenOptions) -> Result<Self> {
        if !options.camera.cameras().contains(&self.camera()) {
            return Err(Error::OneCamera {
                path: path.to_owned(),
            });
        }
        let selection = Selection::new(options);
        let numbers = self.frames().iter().map(|f| f.number);
        let selected = selection.of(self.split_name(), self.scenario(), self.camera(), numbers);
        match selection.nothing(path) {
            Some(error) if selected.is_empty() => Err(error),
            _ => Ok(self.with_selected(selected)),
        }
    }

    /// The drive's name.
    #[must_use]
    pub fn name(&self) -> &str {
        &self.parts.name
    }

    /// Its name in split files: KITTI raw's is `<date>/<drive>`, others' the folder's name; a number has no leading zeros, as in
    /// the odometry task's lists.
    #[must_use]
    pub fn split_name(&self) -> &str {
        &self.parts.split_name
    }

    /// The layout it came in.
    #[must_use]
    pub fn kind(&self) -> DatasetKind {
        self.recording.kind()
    }

    /// The camera whose images these are.
    #[must_use]
    pub fn camera(&self) -> Camera {
        self.parts.camera
    }

    /// The folder its files are in.
    #[must_use]
    pub fn folder(&self) -> &Path {
        self.recording.folder()
    }

    /// The file that all its images are in, as a video's or a bag's are; else [its folder](Self::folder). Recordings side by side share a folder,
    /// and their files may differ in the endings of their names alone.
    #[must_use]
    pub fn place(&self) -> &Path {
        match self.frames().first().map(|frame| &frame.image) {
            Some(FrameImage::Within { file, .. }) => file.as_path(),
            _ => self.folder(),
        }
    }

    /// The kind of drive, such as `garage`, where the recording says it.
    #[must_use]
    pub fn scenario(&self) -> Option<&str> {
        self.parts.scenario.as_deref()
    }

    /// All frames, by number. Not all need be selected.
    #[must_use]
    pub fn frames(&self) -> &[Frame] {
        &self.parts.frames
    }

    /// Indices of the frames that the split selects, all without one. Never empty.
    #[must_use]
    pub fn selected(&self) -> &[usize] {
        &self.selected
    }

    /// Of each [selected](Self::selected) frame its place among the lines of the split that name frames, from 0; `None` without a split,
    /// and for what a scenario selects. Recordings are opened in an order of their own, with their frames by number: the lists of the field
    /// often have another, and what comes without names is in theirs.
    #[must_use]
    pub fn split_places(&self) -> &[Option<usize>] {
        &self.split_places
    }

    /// A point of the vehicle (x forward, y left, z up) in the camera, in metres; `None` where unknown.
    #[must_use]
    pub fn cam_from_vehicle(&self) -> Option<Se3> {
        self.parts.cam_from_vehicle
    }

    /// The car's speed and yaw rate, where the drive has them. See [`Self::yaw_known`].
    #[must_use]
    pub fn track(&self) -> Option<&MotionModel> {
        self.parts.track.as_ref()
    }

    /// Whether the track knows how the vehicle turned: measured, or [taken](Self::take_turns) from the images. Where not, only its speeds
    /// and distances mean anything.
    #[must_use]
    pub fn yaw_known(&self) -> bool {
        self.parts.yaw_known
    }

    /// Nanoseconds from which its seconds are counted (since 1970 where the recording's clock says so), on the
    /// vehicle's clock, where it has time stamps.
    #[must_use]
    pub fn origin_ns(&self) -> Option<i64> {
        self.parts.origin_ns
    }

    /// How far the camera's clock was said to be ahead of the vehicle's, in seconds: by the recording's file or by
    /// [`OpenOptions::camera_ahead_s`]. It is off the frames' times already.
    #[must_use]
    pub fn camera_ahead_s(&self) -> f64 {
        self.parts.camera_ahead_s
    }

    /// The time of a frame number, whether or not there is an image of it, in seconds from the drive's
    /// first time stamp.
    #[must_use]
    pub fn time_of(&self, number: u64) -> Option<f64> {
        let frames = self.frames();
        match frames.binary_search_by_key(&number, |f| f.number) {
            Ok(index) => frames[index].time_s,
            Err(_) => self.recording.time_of(number),
        }
    }

    /// The camera of a frame's image as [`Self::load_image`] gives it.
    #[must_use]
    pub fn intrinsics(&self, _frame: usize) -> Intrinsics {
        self.parts.intrinsics
    }

    /// A frame's image at full size, freed of its lens' distortion.
    ///
    /// # Errors
    /// As [`crate::load_rgb`], [`Error::FrameSize`], and [`Error::Video`] where a video cannot be
    /// decoded.
    ///
    /// # Panics
    /// If there is no frame of that index.
    pub fn load_image(&self, frame: usize) -> Result<RgbImage> {
        let frame = &self.frames()[frame];
        let image = self.recording.load_image(frame)?;
        self.check_size(frame, image.dimensions())?;
        Ok(image)
    }

    /// Whether [`Self::load_image`] undoes a distortion, so that its picture is not that of the frame's file.
    #[must_use]
    pub fn corrects_lens(&self) -> bool {
        self.recording.corrects_lens()
    }

    /// Reads the header of every image that is a file: that takes some microseconds each, and a wrong
    /// size found now is not found at night.
    ///
    /// # Errors
    /// [`Error::FrameSize`], [`Error::Image`].
    pub(crate) fn check_sizes(&self) -> Result<()> {
        self.frames().par_iter().try_for_each(|frame| {
            let Some(file) = frame.image.file() else {
                return Ok(());
            };
            self.check_size(frame, image_size(file)?)
        })
    }

    fn check_size(&self, frame: &Frame, found: (u32, u32)) -> Result<()> {
        let k = &self.parts.intrinsics;
        if found == (k.width, k.height) {
            return Ok(());
        }
        let place = self.recording.calibration();
        Err(Error::FrameSize {
            image: frame.image.to_string(),
            drive: frame.drive.clone(),
            frame: frame.number,
            found,
            expected: (k.width, k.height),
            field: place.field,
            calibration: place.source,
        })
    }

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
    /// [`Error::Cloud`] where a scan cannot be read, [`Error::Missing`] without the scanner's calibration,
    /// [`Error::Image`] for a depth image that cannot be read, [`Error::DepthKind`] where another
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
    /// [`Error::Image`] for a depth image that cannot be read, [`Error::Size`] for one of another size than the images.
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
    /// [`Error::Tracklets`] for a tracklet file that cannot be read.
    pub fn moving_labels(&self) -> Result<Option<MovingLabels>> {
        self.recording.moving_labels(self)
    }

    /// The camera's path as the recording measured it, in stretches without gaps: KITTI's from OXTS
    /// attitude and integrated velocity, an RGB-D folder's from its poses.
    ///
    /// # Errors
    /// [`Error::NoPath`] where the layout has none; [`Error::Missing`] or [`Error::Oxts`] where it should
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

    /// What was recorded, stream by stream.
    ///
    /// # Errors
    /// Where a stream is there and cannot be read.
    pub fn streams(&self) -> Result<Vec<Stream>> {
        self.recording.streams()
    }

    /// Where its sensors are, and by whom; of a bag.
    #[must_use]
    pub fn mounts(&self) -> &[Mount] {
        self.recording.mounts()
    }

    /// What was taken for granted, looks odd or cannot be read.
    #[must_use]
    pub fn warnings(&self) -> &[DataWarning] {
        &self.warnings
    }

    /// Those of [`Self::warnings`] that say what of the recording cannot be read.
    #[must_use]
    pub fn damage(&self) -> &[DataWarning] {
        self.recording.damage()
    }

    /// That of [`Self::warnings`] which says what else in the folder that was [opened](Self::open) looks like a recording and is not read. It
    /// names the folder, and is about no single recording in it: the first of them has it.
    #[must_use]
    pub fn passed_over(&self) -> Option<&DataWarning> {
        self.warnings.iter().find(|warning| {
            matches!(
                warning,
                DataWarning::Incomplete(IncompleteWarning::PassedOver { .. })
            )
        })
    }

    /// Adds what was noticed beside it.
    pub(crate) fn warn(&mut self, warning: impl Into<DataWarning>) {
        self.warnings.push(warning.into());
    }

    /// Stretches of at least two frames whose numbers follow each other, by index.
    #[must_use]
    pub fn stretches(&self) -> Vec<Vec<usize>> {
        let frames = self.frames();
        let indices: Vec<usize> = (0..frames.len()).collect();
        indices
            .chunk_by(|a, b| frames[*a].number + 1 == frames[*b].number)
            .filter(|stretch| stretch.len() > 1)
            .map(<[usize]>::to_vec)
            .collect()
    }

    /// The camera of frame `to` in the camera of frame `from` (`from_from_to`, metres), from the vehicle's speed and yaw
    /// rate; `None` where either was not recorded, or the frames have no times.
    ///
    /// # Panics
    /// If there is no frame of such an index.
    #[must_use]
    pub fn camera_motion(&self, from: usize, to: usize) -> Option<Se3> {
        let motion = self.ego().ok()?.between(self.frames(), to, from).ok()?;
        motion.source_from_target
    }

    /// What the camera's motion is made from.
    ///
    /// # Errors
    /// What is missing for it: [`Error::Missing`] or [`Error::NoTrack`].
    pub fn ego(&self) -> Result<Ego<'_>> {
        let timed = self.frames().iter().any(|f| f.time_s.is_some());
        match (&self.parts.track, self.parts.cam_from_vehicle) {
            (Some(track), Some(cam_from_vehicle)) if timed => Ok(Ego {
                track,
                yaw_known: self.parts.yaw_known,
                cam_from_vehicle,
                speed_sigma_mps: self.receiver.speed_sigma_mps.as_ref(),
                rolls_and_pitches: true,
            }),
            _ => Err(self.recording.no_motion()),
        }
    }
}
