//! `deepfusion eval-targets`: 3D targets against labelled boxes.

mod labels;
mod lidar;
mod object_frames;
mod table;

use std::path::{Path, PathBuf};
use std::sync::Arc;

use anyhow::Result;
use deepfusion_data::{Dataset, OpenOptions, kitti::GtKind, read_depth_png, save_png};
use deepfusion_geometry::{DepthMap, Intrinsics};
use deepfusion_perception::{
    Label, Perception, PerceptionConfig, Scorer, ScoringRules, TargetScore,
};
use deepfusion_render::box_overlay;
use deepfusion_train::Predictor;
use serde::Serialize;

use self::labels::Labels;
use super::perceive::read_config;
use super::perceive::scene::{MotionTracker, working_depth};
use crate::cli::{EvalTargetsArgs, TargetDepth};
use crate::error::CliError;
use crate::progress::Progress;
use crate::{engine, output};

/// Exact depth of simulated drives.
const EXACT_DEPTH: &str = "proj_depth/groundtruth/image_02";

/// The score, and of what.
#[derive(Debug, Serialize)]
struct Report {
    /// `truth`, `lidar` or `predicted`.
    depth: &'static str,
    /// What counted as found.
    rules: ScoringRules,
    #[serde(flatten)]
    score: TargetScore,
}

/// `deepfusion eval-targets`.
pub fn run(args: &EvalTargetsArgs) -> Result<()> {
    let (depth, base) = match args.depth {
        Some(TargetDepth::Truth) => ("truth", PerceptionConfig::default()),
        Some(TargetDepth::Lidar) => ("lidar", PerceptionConfig::default()),
        None => ("predicted", PerceptionConfig::predicted()),
    };
    let predictor = match &args.model {
        Some(model) => Some(engine::load(model, &args.engine)?),
        None => None,
    };
    let out = match &args.out {
        Some(out) => Some(output::run_folder(Some(out), "eval-targets")?),
        None => None,
    };
    let mut work = Work {
        out,
        depth: args.depth,
        predictor,
        perception: Perception::new(read_config(args.config.as_deref(), base)?),
        scorer: Scorer::new(ScoringRules::default()),
        progress: Progress::new("frames"),
    };
    for path in &args.data {
        if object_frames::is_folder_of(path) {
            work.object_frames(path)?;
            continue;
        }
        for dataset in Dataset::open(path, &OpenOptions::default())? {
            work.drive(&Arc::new(dataset))?;
        }
    }
    let report = Report {
        depth,
        rules: ScoringRules::default(),
        score: work.scorer.score(),
    };
    if args.json {
        output::print_json(&report)
    } else {
        output::print(&table::text(report.depth, &report.score))
    }
}

struct Work {
    out: Option<PathBuf>,
    depth: Option<TargetDepth>,
    predictor: Option<Predictor>,
    perception: Perception,
    scorer: Scorer,
    progress: Progress,
}

impl Work {
    fn drive(&mut self, dataset: &Arc<Dataset>) -> Result<()> {
        let labels = Labels::read(dataset)?;
        let mut motions = MotionTracker::default();
        self.scorer.begin_drive();
        let frames = dataset.selected();
        for (done, index) in frames.iter().enumerate() {
            self.progress.set(done, frames.len());
            let Some(witness) = witness(dataset, *index)? else {
                continue;
            };
            let camera = dataset.intrinsics(*index);
            let seen = match self.depth {
                Some(TargetDepth::Truth) if !witness.dense => None,
                Some(TargetDepth::Truth) => Some(working_depth(&witness.depth, &camera)),
                Some(TargetDepth::Lidar) => dataset
                    .ground_truth(*index, GtKind::Z)?
                    .map(|depth| lidar::gathered(&depth, &camera)),
                None => Some(self.predicted(&dataset.load_image(*index)?, &camera)?),
            };
            let Some((depth, k)) = seen else {
                continue;
            };
            let labels = labels.of(dataset, *index, &witness);
            let motion = motions.of(dataset, *index, &mut self.perception);
            let surroundings = self.perception.look(&depth, &k, motion.stamp)?;
            let time_s = motion.stamp.map_or(0.0, |stamp| stamp.time_s);
            self.scorer.add(time_s, &surroundings.targets, &labels);
            if let Some(out) = &self.out {
                let image = dataset.load_image(*index)?;
                let picture = box_overlay(&image, &camera, &surroundings.targets);
                let number = dataset.frames()[*index].number;
                save_png(
                    &picture,
                    &out.join(format!("{}-{number:010}.png", dataset.name())),
                )?;
            }
        }
        self.some_frames(dataset.folder())
    }

    fn object_frames(&mut self, folder: &Path) -> Result<()> {
        for frame in object_frames::read(folder)? {
            self.scorer.begin_drive();
            self.perception.forget();
            let (depth, k) = match self.depth {
                Some(_) => lidar::gathered(&frame.scan, &frame.camera),
                None => self.predicted(&deepfusion_data::load_rgb(&frame.image)?, &frame.camera)?,
            };
            let surroundings = self.perception.look(&depth, &k, None)?;
            self.scorer.add(0.0, &surroundings.targets, &frame.labels);
        }
        self.some_frames(folder)
    }

    fn some_frames(&self, path: &Path) -> Result<()> {
        match self.scorer.score().frames {
            0 => Err(CliError::NothingToMeasure {
                path: path.to_owned(),
            }
            .into()),
            _ => Ok(()),
        }
    }

    fn predicted(
        &self,
        image: &deepfusion_data::RgbImage,
        camera: &Intrinsics,
    ) -> Result<(DepthMap, Intrinsics)> {
        let predictor = self.predictor.as_ref().ok_or(CliError::NoCamera)?;
        let prediction = predictor.predict(image, Some(camera), true, true)?;
        Ok(working_depth(&prediction.depth(), camera))
    }
}

/// Depth that says how much of a box is seen.
pub struct Witness {
    /// At the image's size.
    pub depth: DepthMap,
    /// Every pixel, or a scan's points only.
    pub dense: bool,
}

/// The exact depth of a simulated frame, else its scan; `None` where there is neither.
fn witness(dataset: &Dataset, index: usize) -> Result<Option<Witness>> {
    let frame = &dataset.frames()[index];
    let exact = dataset
        .folder()
        .join(EXACT_DEPTH)
        .join(format!("{:010}.png", frame.number));
    if exact.is_file() {
        let depth = read_depth_png(&exact)?;
        return Ok(Some(Witness { depth, dense: true }));
    }
    let scan = dataset.ground_truth(index, GtKind::Z)?;
    Ok(scan.map(|depth| Witness {
        depth,
        dense: false,
    }))
}

/// Whether a label is to be found: a free-standing thing of a target's size of which enough is seen.
pub fn counts(label: &Label, class: &str, witnesses: usize, least: usize) -> bool {
    /// The simulator's things that are no targets, and KITTI's regions without labels.
    const NEITHER: [&str; 5] = ["Pole", "Tree", "Building", "Fence", "DontCare"];
    let [length, width, height] = label.size_m;
    !NEITHER.contains(&class)
        && (0.4..=4.5).contains(&height)
        && length <= 13.0
        && width <= 3.5
        && witnesses >= least
}
