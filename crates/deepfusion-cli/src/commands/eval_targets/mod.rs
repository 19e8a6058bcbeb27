//! `deepfusion eval-targets`: 3D targets against labelled boxes.

mod labels;
mod lidar;
mod object_frames;
mod table;

use std::path::{Path, PathBuf};
use std::sync::Arc;

use deepfusion_data::{Dataset, OpenOptions, RgbImage, kitti::GtKind, read_depth_png, save_png};
use deepfusion_eval::IntervalFactors;
use deepfusion_geometry::{DepthMap, Intrinsics};
use deepfusion_perception::{
    Label, Perception, PerceptionConfig, Scorer, ScoringRules, Stamp, Target, TargetScore,
};
use deepfusion_render::box_overlay;
use deepfusion_runtime::DepthEstimator;
use deepfusion_runtime::ModelSource;
use serde::Serialize;

use self::labels::Labels;
use self::object_frames::ObjectFrame;
use super::perceive::read_config;
use super::remarks;
use super::scene::{MotionTracker, working_depth};
use super::uncertainty;
use crate::cli::{EvalTargetsArgs, TargetDepth};
use crate::error::CliError;
use crate::failure::Result;
use crate::model::ModelFacts;
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

/// Where the measured depth comes from.
enum Source {
    /// The simulator's exact depth.
    Truth,
    /// The scans.
    Lidar,
    /// A network, of every frame: targets need more than one to be confirmed.
    Network(Box<DepthEstimator>, IntervalFactors),
}

impl Source {
    fn of(args: &EvalTargetsArgs) -> Result<Self> {
        Ok(match (args.depth, &args.model) {
            (None, Some(model)) => {
                let model = ModelSource::named(model)?;
                let estimator = engine::load(&model, &args.engine)?;
                Self::Network(Box::new(estimator), model.interval_factors()?)
            }
            (Some(TargetDepth::Lidar), _) => Self::Lidar,
            // One of the two is asked for by the command line.
            (Some(TargetDepth::Truth), _) | (None, None) => Self::Truth,
        })
    }

    /// One word for the report.
    fn word(&self) -> &'static str {
        match self {
            Self::Truth => "truth",
            Self::Lidar => "lidar",
            Self::Network(..) => "predicted",
        }
    }

    fn settings(&self) -> PerceptionConfig {
        match self {
            Self::Truth | Self::Lidar => PerceptionConfig::default(),
            Self::Network(..) => PerceptionConfig::predicted(),
        }
    }

    /// What is seen of a recording's frame; `None` where it is not measured.
    fn of_frame(
        &mut self,
        dataset: &Dataset,
        index: usize,
        witness: Option<&Witness>,
    ) -> Result<Option<Measured>> {
        let camera = dataset.intrinsics(index);
        Ok(match self {
            Self::Truth => witness
                .filter(|witness| witness.dense)
                .map(|witness| Measured::exact(working_depth(&witness.depth, &camera))),
            Self::Lidar => dataset
                .ground_truth(index, GtKind::Z)?
                .map(|scan| Measured::exact(lidar::gathered(&scan, &camera))),
            Self::Network(estimator, intervals) => {
                let image = dataset.load_image(index)?;
                Some(predicted((estimator, intervals), &image, &camera)?)
            }
        })
    }

    /// What is seen of a labelled frame; it has no exact depth.
    fn of_object_frame(&mut self, frame: &ObjectFrame) -> Result<Option<Measured>> {
        Ok(match self {
            Self::Truth => None,
            Self::Lidar => Some(Measured::exact(lidar::gathered(&frame.scan, &frame.camera))),
            Self::Network(estimator, intervals) => {
                let image = deepfusion_data::load_rgb(&frame.image)?;
                Some(predicted((estimator, intervals), &image, &frame.camera)?)
            }
        })
    }
}

fn predicted(
    (estimator, intervals): (&mut DepthEstimator, &IntervalFactors),
    image: &RgbImage,
    camera: &Intrinsics,
) -> Result<Measured> {
    let prediction = estimator.predict(image, Some(camera), true, true)?;
    let whole = prediction.depth();
    let sigma = uncertainty::sigma(&prediction, &whole, intervals);
    let (depth, camera_of_depth) = working_depth(&whole, camera);
    Ok(Measured {
        depth,
        sigma: sigma.map(|sigma| working_depth(&sigma, camera).0),
        camera: camera_of_depth,
    })
}

/// Depth of a frame, and what it is worth where its source says so.
struct Measured {
    depth: DepthMap,
    sigma: Option<DepthMap>,
    camera: Intrinsics,
}

impl Measured {
    fn exact((depth, camera): (DepthMap, Intrinsics)) -> Self {
        Self {
            depth,
            sigma: None,
            camera,
        }
    }

    /// What stands there.
    fn targets(&self, perception: &mut Perception, stamp: Option<Stamp>) -> Result<Vec<Target>> {
        let sigma = self.sigma.as_ref();
        let seen = perception.detect_with_sigma(&self.depth, sigma, &self.camera, stamp, &[])?;
        Ok(seen.targets)
    }
}

/// `deepfusion eval-targets`.
pub fn run(args: &EvalTargetsArgs) -> Result<()> {
    let source = Source::of(args)?;
    let config = read_config(args.config.as_deref(), source.settings())?;
    let out = match &args.out {
        Some(out) => Some(output::run_folder(Some(out), "eval-targets")?),
        None => None,
    };
    let mut work = Work {
        out,
        source,
        perception: Perception::new(config),
        scorer: Scorer::new(ScoringRules::default()),
        progress: Progress::new("frames"),
    };
    for path in &args.data {
        if object_frames::is_folder_of(path) {
            work.object_frames(path)?;
            continue;
        }
        let datasets = Dataset::open(path, &OpenOptions::default())?;
        remarks::tell(&datasets);
        for dataset in datasets {
            work.drive(&Arc::new(dataset))?;
        }
    }
    let report = Report {
        depth: work.source.word(),
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
    source: Source,
    perception: Perception,
    scorer: Scorer,
    progress: Progress,
}

impl Work {
    fn drive(&mut self, dataset: &Arc<Dataset>) -> Result<()> {
        let labels = Labels::read(dataset)?;
        let mut motions = MotionTracker::default();
        let before = self.scorer.score().frames;
        self.scorer.begin_drive();
        let frames = dataset.selected();
        for (done, index) in frames.iter().enumerate() {
            self.progress.set(done, frames.len());
            let witness = witness(dataset, *index)?;
            let seen = self.source.of_frame(dataset, *index, witness.as_ref())?;
            let Some(measured) = seen else {
                continue;
            };
            let motion = motions.of(dataset, *index);
            if !motion.goes_on {
                self.perception.reset();
            }
            let targets = measured.targets(&mut self.perception, motion.stamp)?;
            // Without a witness nothing says which boxes are seen: such a frame is followed, but not scored.
            if let Some(witness) = &witness {
                let labels = labels.of(dataset, *index, witness);
                let time_s = motion.stamp.map_or(0.0, |stamp| stamp.time_s);
                self.scorer.add(time_s, &targets, &labels);
            }
            let number = dataset.frames()[*index].number;
            let name = format!("{}-{number:010}.png", dataset.name());
            self.save(&name, &targets, &dataset.intrinsics(*index), || {
                dataset.load_image(*index)
            })?;
        }
        self.some_frames_since(before, dataset.folder())
    }

    fn object_frames(&mut self, folder: &Path) -> Result<()> {
        let before = self.scorer.score().frames;
        for frame in object_frames::read(folder)? {
            self.scorer.begin_drive();
            self.perception.reset();
            let Some(measured) = self.source.of_object_frame(&frame)? else {
                continue;
            };
            let targets = measured.targets(&mut self.perception, None)?;
            self.scorer.add(0.0, &targets, &frame.labels);
            let name = frame.image.with_extension("png");
            let name = name.file_name().unwrap_or_default().to_string_lossy();
            self.save(&name, &targets, &frame.camera, || {
                deepfusion_data::load_rgb(&frame.image)
            })?;
        }
        self.some_frames_since(before, folder)
    }

    /// Writes the image with the targets on it, where it was asked for.
    fn save(
        &self,
        name: &str,
        targets: &[Target],
        camera: &Intrinsics,
        image: impl FnOnce() -> deepfusion_data::Result<RgbImage>,
    ) -> Result<()> {
        if let Some(out) = &self.out {
            let picture = box_overlay(&image()?, camera, targets);
            save_png(&picture, &out.join(name))?;
        }
        Ok(())
    }

    fn some_frames_since(&self, before: usize, path: &Path) -> Result<()> {
        if self.scorer.score().frames > before {
            return Ok(());
        }
        Err(CliError::NothingToMeasure {
            path: path.to_owned(),
        }
        .into())
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
