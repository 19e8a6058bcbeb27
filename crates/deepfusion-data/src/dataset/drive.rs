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

/// One camera's recording of one drive, with everything that training and evaluation need.
#[derive(Debug, Clone)]
pub struct Dataset {
    parts: DatasetParts,
    selected: Vec<usize>,
    /// Place in the split of each frame in `selected`.
    split_places: Vec<Option<usize>>,
    recording: Arc<dyn Recording>,
    receiver: Receiver,
    camera_assumed: bool,
    mount_assumed: bool,
    simulated: bool,
    /// The recording's warnings, and those about recordings beside it.
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

    /// The same data set, marked as simulated or not.
    #[must_use]
    pub fn with_simulated(mut self, simulated: bool) -> Self {
        self.simulated = simulated;
        self
    }

    /// Whether the recording is marked as simulated: by the key `simulated` of the file beside it, or by data that only a simulator can
    /// provide. [`crate::convert_to_kitti`] and [`crate::convert_to_bag`] keep the mark. An unmarked recording may be real or simulated.
    #[must_use]
    pub fn is_simulated(&self) -> bool {
        self.simulated
    }

    /// The same data set, with its camera marked as assumed or not.
    #[must_use]
    pub fn with_camera_assumed(mut self, assumed: bool) -> Self {
        self.camera_assumed = assumed;
        self
    }

    /// Whether there is no calibration, so that [`OpenOptions::assumed_camera`] is used.
    #[must_use]
    pub fn camera_assumed(&self) -> bool {
        self.camera_assumed
    }

    /// The same data set with only these frames selected, by index, each with its place in the split.
    pub(crate) fn with_selected(mut self, selected: Vec<(usize, Option<usize>)>) -> Self {
        (self.selected, self.split_places) = selected.into_iter().unzip();
        self
    }

    /// The same drive with only a range of its frames, by index, all selected.
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

    /// Applies the selection in the options, for layouts with one drive and one camera.
    ///
    /// # Errors
    /// [`Error::SplitSelectsNothing`]; [`Error::OneCamera`] if only the right camera is requested.
    pub(crate) fn select(self, path: &Path, options: &OpenOptions) -> Result<Self> {
        if !options.camera.cameras().contains(&self.camera()) {
            return Err(Error::OneCamera {
                path: path.to_owned(),
            });
        }
        let selection = Selection::new(options);
        let numbers = self.frames().iter().map(|f| f.number);
        let selected = selection.of(self.split_name(), self.scenario(), self.camera(), numbers);
        match selection.nothing_selected(path) {
            Some(error) if selected.is_empty() => Err(error),
            _ => Ok(self.with_selected(selected)),
        }
    }

    /// The drive's name.
    #[must_use]
    pub fn name(&self) -> &str {
        &self.parts.name
    }

    /// The drive's name in split files: `<date>/<drive>` for KITTI raw, otherwise the folder's name; a number has no leading zeros, as in
    /// the lists for KITTI odometry.
    #[must_use]
    pub fn split_name(&self) -> &str {
        &self.parts.split_name
    }

    /// The layout of the recording.
    #[must_use]
    pub fn kind(&self) -> DatasetKind {
        self.recording.kind()
    }

    /// The camera that took the images.
    #[must_use]
    pub fn camera(&self) -> Camera {
        self.parts.camera
    }

    /// Folder of the recording's files.
    #[must_use]
    pub fn folder(&self) -> &Path {
        self.recording.folder()
    }

    /// The file with all images (a video or a bag), otherwise [the folder](Self::folder). Recordings in the same folder may have file names
    /// that differ only in their extension.
    #[must_use]
    pub fn place(&self) -> &Path {
        match self.frames().first().map(|frame| &frame.image) {
            Some(FrameImage::Within { file, .. }) => file.as_path(),
            _ => self.folder(),
        }
    }

    /// The kind of drive, such as `garage`, if the recording states it.
    #[must_use]
    pub fn scenario(&self) -> Option<&str> {
        self.parts.scenario.as_deref()
    }

    /// All frames, ordered by number, selected or not.
    #[must_use]
    pub fn frames(&self) -> &[Frame] {
        &self.parts.frames
    }

    /// Indices of the frames that the split selects; all frames without a split. Never empty.
    #[must_use]
    pub fn selected(&self) -> &[usize] {
        &self.selected
    }

    /// For each [selected](Self::selected) frame, its place among the split's lines that name frames, from 0; `None` without a split,
    /// and for frames selected by a scenario. Data sets have their frames ordered by number, whereas published splits often have another
    /// order, which arrays without names follow.
    #[must_use]
    pub fn split_places(&self) -> &[Option<usize>] {
        &self.split_places
    }

    /// Transforms points from the vehicle (x forward, y left, z up) to the camera, in metres; `None` if unknown.
    #[must_use]
    pub fn cam_from_vehicle(&self) -> Option<Se3> {
        self.parts.cam_from_vehicle
    }

    /// The vehicle's speed and yaw rate, if the drive has them. See [`Self::yaw_known`].
    #[must_use]
    pub fn track(&self) -> Option<&MotionModel> {
        self.parts.track.as_ref()
    }

    /// Whether the track's turns are known: measured, or [estimated](Self::take_turns) from the images. If not, only its speeds
    /// and distances are valid.
    #[must_use]
    pub fn yaw_known(&self) -> bool {
        self.parts.yaw_known
    }

    /// Origin of the drive's times on the vehicle's clock, in nanoseconds (since 1970 if that clock counts from then); `None` without
    /// time stamps.
    #[must_use]
    pub fn origin_ns(&self) -> Option<i64> {
        self.parts.origin_ns
    }

    /// How far the camera's clock is ahead of the vehicle's, in seconds, according to the recording's file or
    /// [`OpenOptions::camera_ahead_s`]. Already subtracted from the frames' times.
    #[must_use]
    pub fn camera_ahead_s(&self) -> f64 {
        self.parts.camera_ahead_s
    }

    /// The time of a frame number, in seconds from the drive's first time stamp, also for numbers without an
    /// image.
    #[must_use]
    pub fn time_of(&self, number: u64) -> Option<f64> {
        let frames = self.frames();
        match frames.binary_search_by_key(&number, |f| f.number) {
            Ok(index) => frames[index].time_s,
            Err(_) => self.recording.time_of(number),
        }
    }

    /// Intrinsics of the images returned by [`Self::load_image`], in pixels.
    #[must_use]
    pub fn intrinsics(&self, _frame: usize) -> Intrinsics {
        self.parts.intrinsics
    }

    /// A frame's image at full size, corrected for lens distortion.
    ///
    /// # Errors
    /// Those of [`crate::load_rgb`], [`Error::FrameSize`], and [`Error::Video`] if a video cannot be decoded.
    ///
    /// # Panics
    /// If there is no frame with that index.
    pub fn load_image(&self, frame: usize) -> Result<RgbImage> {
        let frame = &self.frames()[frame];
        let image = self.recording.load_image(frame)?;
        self.check_size(frame, image.dimensions())?;
        Ok(image)
    }

    /// Checks that a frame's image can be read, if it is a file of its own. Uses [`deepfusion_images::check_complete`], which takes hardly
    /// longer than opening the file.
    ///
    /// # Errors
    /// Those of [`crate::load_rgb`].
    ///
    /// # Panics
    /// If there is no frame with that index.
    pub fn check_image(&self, frame: usize) -> Result<()> {
        match self.frames()[frame].image.file() {
            Some(file) => Ok(deepfusion_images::check_complete(file)?),
            None => Ok(()),
        }
    }

    /// Whether [`Self::load_image`] corrects a lens distortion, so that its image differs from the file's.
    #[must_use]
    pub fn corrects_lens(&self) -> bool {
        self.recording.corrects_lens()
    }

    /// Checks the size of every image file. Reading a header takes only microseconds, and a wrong size should be
    /// found now, not in the middle of a long training.
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

    /// The recorded streams.
    ///
    /// # Errors
    /// If an existing stream cannot be read.
    pub fn streams(&self) -> Result<Vec<Stream>> {
        self.recording.streams()
    }

    /// A bag's sensor mounts, with their sources.
    #[must_use]
    pub fn mounts(&self) -> &[Mount] {
        self.recording.mounts()
    }

    /// Assumptions, oddities and unreadable parts.
    #[must_use]
    pub fn warnings(&self) -> &[DataWarning] {
        &self.warnings
    }

    /// Those of [`Self::warnings`] about unreadable parts of the recording.
    #[must_use]
    pub fn damage(&self) -> &[DataWarning] {
        self.recording.damage()
    }

    /// The one of [`Self::warnings`] about other recordings in the [opened](Self::open) folder that were not read. It concerns
    /// the folder, so only the first data set of a folder has it.
    #[must_use]
    pub fn passed_over(&self) -> Option<&DataWarning> {
        self.warnings.iter().find(|warning| {
            matches!(
                warning,
                DataWarning::Incomplete(IncompleteWarning::PassedOver { .. })
            )
        })
    }

    /// Adds a warning about the recording's surroundings.
    pub(crate) fn warn(&mut self, warning: impl Into<DataWarning>) {
        self.warnings.push(warning.into());
    }

    /// Sequences of at least two frames with consecutive numbers, as indices.
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
