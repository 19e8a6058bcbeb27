//! Compares 3D targets with labelled boxes: in drives with tracklets, and in KITTI's object frames.

mod lidar;
mod object_frames;
mod report;
mod source;
mod tracklets;
mod visibility;

use std::path::Path;
use std::sync::Arc;

use deepfusion_data::{Dataset, RgbImage};
use deepfusion_geometry::Intrinsics;
use deepfusion_perception::{
    Perception, PerceptionConfig, Scorer, ScoringRules, Target, TargetScore,
};

use self::object_frames::{ObjectFrame, labels_of};
pub use self::object_frames::{ObjectFrameProblem, is_folder_of};
pub use self::report::TargetReport;
pub use self::source::{DepthSource, PredictedDepth};
use self::tracklets::Labels;
use self::visibility::visibility;
use crate::files::UniqueNames;
use crate::scene::MotionTracker;
use crate::{Error, Result};

/// Finds targets in labelled frames, and scores them.
pub struct TargetEvaluation {
    source: DepthSource,
    perception: Perception,
    scorer: Scorer,
    /// Names for drives, and for frames that belong to none.
    names: UniqueNames,
}

/// A frame that was evaluated.
pub struct EvaluatedFrame<'a> {
    /// Name of a picture of it.
    pub name: String,
    /// The targets found.
    pub targets: &'a [Target],
    /// The image's camera.
    pub camera: Intrinsics,
    /// Loads the image.
    pub image: &'a dyn Fn() -> deepfusion_data::Result<RgbImage>,
    /// Number of the recording's frames evaluated before it, and of all.
    pub progress: (usize, usize),
}

impl TargetEvaluation {
    /// An evaluation without frames yet.
    #[must_use]
    pub fn new(source: DepthSource, config: PerceptionConfig) -> Self {
        Self {
            source,
            perception: Perception::new(config),
            scorer: Scorer::new(ScoringRules::default()),
            names: UniqueNames::default(),
        }
    }

    /// The source of depth.
    #[must_use]
    pub fn source(&self) -> &DepthSource {
        &self.source
    }

    /// The score so far.
    #[must_use]
    pub fn score(&self) -> TargetScore {
        self.scorer.score()
    }

    /// Evaluates a labelled drive; `each` is called for every measured frame.
    ///
    /// # Errors
    /// [`Error::NothingToMeasure`]; files that cannot be read; images that cannot be predicted; an error of `each`.
    pub fn drive<E: From<Error>>(
        &mut self,
        dataset: &Arc<Dataset>,
        each: &mut dyn FnMut(EvaluatedFrame) -> Result<(), E>,
    ) -> Result<(), E> {
        let labels = Labels::read(dataset)?;
        let mut motions = MotionTracker::default();
        let before = self.score().frames;
        self.scorer.begin_drive();
        let name = self.names.take(dataset.name());
        let frames = dataset.selected();
        for (done, index) in frames.iter().enumerate() {
            let visibility = visibility(dataset, *index)?;
            let seen = self.source.of_frame(dataset, *index, visibility.as_ref())?;
            let Some(measured) = seen else {
                continue;
            };
            let motion = motions.of(dataset, *index);
            if !motion.continues {
                self.perception.reset();
            }
            if motion.stamp.is_none() {
                // No track continues here: a new id is not a switch.
                self.scorer.begin_drive();
            }
            let targets = measured.targets(&mut self.perception, motion.stamp)?;
            // Without this depth it is unknown which boxes are visible: the frame is tracked, but not scored.
            if let Some(visibility) = &visibility {
                let labels = labels.of(dataset, *index, visibility);
                let time_s = motion.stamp.map_or(0.0, |stamp| stamp.time_s);
                self.scorer.add(time_s, &targets, &labels);
            }
            let number = dataset.frames()[*index].number;
            each(EvaluatedFrame {
                name: format!("{name}-{number:010}.png"),
                targets: &targets,
                camera: dataset.intrinsics(*index),
                image: &|| dataset.load_image(*index),
                progress: (done, frames.len()),
            })?;
        }
        Ok(self.some_frames_since(before, dataset.folder())?)
    }

    /// Evaluates the labelled frames of a folder ([`is_folder_of`]), each on its own; `each` is called for every frame.
    ///
    /// # Errors
    /// As [`Self::drive`].
    pub fn object_frames<E: From<Error>>(
        &mut self,
        folder: &Path,
        each: &mut dyn FnMut(EvaluatedFrame) -> Result<(), E>,
    ) -> Result<(), E> {
        let before = self.score().frames;
        let labels = labels_of(folder)?;
        let total = labels.len();
        for (done, labels) in labels.iter().enumerate() {
            let frame = ObjectFrame::read(folder, labels)?;
            self.scorer.begin_drive();
            self.perception.reset();
            let Some(measured) = self.source.of_object_frame(&frame)? else {
                continue;
            };
            let targets = measured.targets(&mut self.perception, None)?;
            self.scorer
                .add_but(0.0, &targets, &frame.labels, &|target| {
                    frame.is_unlabelled(target)
                });
            let name = frame.image.file_stem().unwrap_or_default();
            let name = self.names.take(&name.to_string_lossy());
            each(EvaluatedFrame {
                name: format!("{name}.png"),
                targets: &targets,
                camera: frame.camera,
                image: &|| Ok(deepfusion_data::load_rgb(&frame.image)?),
                progress: (done, total),
            })?;
        }
        Ok(self.some_frames_since(before, folder)?)
    }

    fn some_frames_since(&self, before: usize, path: &Path) -> Result<()> {
        if self.score().frames > before {
            return Ok(());
        }
        Err(Error::NothingToMeasure {
            path: path.to_owned(),
        })
    }
}
