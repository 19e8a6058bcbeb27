//! One camera's recording of one drive.

mod measured;
mod motion;

use super::camera::Camera;
use super::ego::Receiver;
use super::frame::{Frame, FrameImage};
use super::inspection::{Mount, Stream};
use super::kind::DatasetKind;
use super::options::OpenOptions;
use super::parts::DatasetParts;
use super::recording::Recording;
use super::selection::Selection;
use super::split::drive_name;
use super::warning::{DataWarning, IncompleteWarning};
use crate::{Error, MotionModel, Result, image_size};
use deepfusion_geometry::{Intrinsics, Se3};
use image::RgbImage;
use rayon::prelude::*;
use std::ops::Range;
use std::path::Path;
use std::sync::Arc;

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

    /// With only these frames selected, by index, each with its place in the split.
    pub(crate) fn with_selected(mut self, selected: Vec<(usize, Option<usize>)>) -> Self {
        (self.selected, self.split_places) = selected.into_iter().unzip();
        self
    }

    /// The same drive with some of its frames alone, by index, all of them selected.
    ///
    /// # Panics
    /// If the range ends beyond the frames.
    #[must_use]
    pub fn with_frames(&self, range: Range<usize>) -> Self {
        let mut part = self.clone();
        part.parts.frames = self.frames()[range].to_vec();
        part.selected = (0..part.frames().len()).collect();
        part.split_places = vec![None; part.frames().len()];
        part
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

    /// That a frame's image can be read, where it is a file of its own; as [`deepfusion_images::check_whole`], which hardly takes longer than to open
    /// the file.
    ///
    /// # Errors
    /// As [`crate::load_rgb`].
    ///
    /// # Panics
    /// If there is no frame of that index.
    pub fn check_image(&self, frame: usize) -> Result<()> {
        match self.frames()[frame].image.file() {
            Some(file) => Ok(deepfusion_images::check_whole(file)?),
            None => Ok(()),
        }
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
}
