use crate::SharedFrames;
use std::path::PathBuf;

/// What can go wrong while learning.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// A setting that means nothing.
    #[error("setting `{field}`: expected {expected}, found {found}")]
    Config {
        /// The setting's name, as in the file.
        field: &'static str,
        /// What would do.
        expected: String,
        /// What was found.
        found: String,
    },
    /// A key that cannot be set so.
    #[error("{assignment}: {reason}")]
    Setting {
        /// What was asked for: KEY=VALUE.
        assignment: String,
        /// What is wrong with it.
        reason: String,
    },
    /// A configuration file that cannot be read as one.
    #[error("{path}: not a training configuration: {reason}")]
    ConfigFile {
        /// The file.
        path: PathBuf,
        /// What the parser says, with the line.
        reason: String,
    },
    /// A file that cannot be read or written.
    #[error("{path}: cannot {action}: {source}")]
    Io {
        /// The file.
        path: PathBuf,
        /// "read" or "write".
        action: &'static str,
        /// What the system says.
        source: std::io::Error,
    },
    /// A checkpoint that does not fit the program or the configuration.
    #[error("{path}: {reason}")]
    Checkpoint {
        /// The file.
        path: PathBuf,
        /// Why it cannot be used.
        reason: String,
        /// What to do about it.
        remedy: String,
    },
    /// A folder that already holds a run.
    #[error("{path}: there is a run here already")]
    RunExists {
        /// The folder.
        path: PathBuf,
    },
    /// Nothing to learn from.
    #[error("no training sample in {data}: {reason}")]
    NoSamples {
        /// The data that was given.
        data: String,
        /// Why nothing is left.
        reason: String,
    },
    /// A configuration that reads how the car turned, and a drive that does not say.
    #[error("{drive}: no yaw rate was recorded, and this configuration reads how the car turned")]
    NoYawRate {
        /// The drive.
        drive: String,
    },
    /// A recording to learn depth from that has none.
    #[error("{drive}: no frame has depth, and `learn` asks for it")]
    NoDepth {
        /// The drive.
        drive: String,
    },
    /// Validation frames that are learned from: their loss would say how well they are known by heart.
    #[error("validation frames are training frames: {}", told(shared))]
    SharedFrames {
        /// The drives with such frames.
        shared: Vec<SharedFrames>,
    },
    /// A loss that is not a number.
    #[error("step {step}: the loss term `{term}` is {value}; frames {frames}")]
    NotFinite {
        /// The step, counted from 1.
        step: usize,
        /// The term's name.
        term: &'static str,
        /// Its value.
        value: f64,
        /// The drives and frame numbers of the batch.
        frames: String,
    },
    /// Gradients that stay non-finite.
    #[error(
        "{count} steps in a row had a gradient that is not finite, the last at step {step}; frames {frames}"
    )]
    GradientsNotFinite {
        /// How many.
        count: usize,
        /// The last such step.
        step: usize,
        /// The drives and frame numbers of its batch.
        frames: String,
    },
    /// The loader's threads could not be started.
    #[error("no threads to load images with: {reason}")]
    Threads {
        /// What the system says.
        reason: String,
    },
    /// The loader's thread died.
    #[error("the loader of images stopped: {reason}")]
    Loader {
        /// The batch, counted from 0, and what it died of.
        reason: String,
    },
    /// Samples should be held out, and none are.
    #[error("no sample is held out to validate on")]
    NoValidation,
    /// Something that runs networks and cannot run this one.
    #[error("engine `{engine}`: {reason}")]
    Engine {
        /// Its name.
        engine: &'static str,
        /// What it says.
        reason: String,
    },
    /// The recording.
    #[error(transparent)]
    Data(#[from] deepfusion_data::Error),
    /// The simulator, of which views are learned from.
    #[error(transparent)]
    Simulator(#[from] deepfusion_sim::Error),
    /// The networks or their weights.
    #[error(transparent)]
    Network(#[from] deepfusion_nn::Error),
}

impl Error {
    /// What an engine said.
    pub fn engine(engine: &'static str, reason: &dyn std::fmt::Display) -> Self {
        Self::Engine {
            engine,
            reason: reason.to_string(),
        }
    }

    /// What to do about it, in a line.
    #[must_use]
    pub fn hint(&self) -> Option<String> {
        match self {
            Self::Config { field: "--data-set", .. } => {
                Some("give the name of the data set whose metres are meant: --data-set NAME".into())
            }
            Self::Config { field: "data" | "data.paths", .. } => Some(
                "give recordings with --data, or as data.paths or [[data.sets]] in the config file, one of the three".into(),
            ),
            Self::Config { field: "view_motion", .. } => Some(
                "without the speed loss nothing measured may enter: take --view-motion posenet, or keep the speed loss".into(),
            ),
            Self::Config { field, .. } => Some(format!(
                "set `{field}` so in the config file, or by its option; --help lists them"
            )),
            Self::Setting { .. } => Some(
                "`deepfusion config show` prints every key and what it means".into(),
            ),
            Self::ConfigFile { .. } => Some(
                "name a preset and the keys in which it differs; `deepfusion config show` prints them all".into(),
            ),
            Self::Io { source, action, .. } => match source.kind() {
                std::io::ErrorKind::StorageFull => {
                    Some("the disk is full; what was there before is untouched".into())
                }
                std::io::ErrorKind::PermissionDenied => {
                    Some(format!("no permission to {action} there"))
                }
                _ => None,
            },
            Self::Checkpoint { remedy, .. } => Some(remedy.clone()),
            Self::RunExists { .. } => Some(
                "continue it with --resume, or choose another folder with --out".into(),
            ),
            Self::NoSamples { .. } => Some(
                "training needs consecutive frames of a moving camera, with time stamps and speeds; \
                 `deepfusion data inspect` shows what is there"
                    .into(),
            ),
            Self::NoYawRate { .. } => Some(
                "train with view_motion posenet or distance and loss.rotation = 0, or give a yaw rate: \
                 yaw_rate_radps in speed.csv, or imu.csv"
                    .into(),
            ),
            Self::NoDepth { .. } => Some(
                "learn = \"self\" needs no depth but a speed; RGB-D folders, drives with LiDAR scans and simulated drives \
                 have depth"
                    .into(),
            ),
            Self::SharedFrames { .. } => Some(
                "validate on other drives (--val-data) or other frames (--val-split), or leave both out: the end of each drive \
                 is held out then"
                    .into(),
            ),
            Self::NotFinite { .. } | Self::GradientsNotFinite { .. } => Some(
                "the last good checkpoint is kept; look at the frames named above, or lower the \
                 learning rate, and continue with --resume"
                    .into(),
            ),
            Self::Engine { .. } => Some("`--engine burn` runs every network on every device".into()),
            Self::Threads { .. } => Some(
                "the system allows this user too few threads or too little memory; see `ulimit -u`"
                    .into(),
            ),
            Self::Loader { .. } => Some(
                "this is a fault of the program: please report it with the lines above; what was saved is whole, and \
                 --resume goes on from there"
                    .into(),
            ),
            Self::NoValidation => Some(
                "give longer drives or --val-data; `validation_share = 0` in a config file trains without validation \
                 and chooses no `best`"
                    .into(),
            ),
            Self::Data(error) => error.hint(),
            Self::Simulator(error) => error.hint(),
            Self::Network(error) => error.hint(),
        }
    }

    pub(crate) fn io(path: &std::path::Path, action: &'static str, source: std::io::Error) -> Self {
        Self::Io {
            path: path.to_owned(),
            action,
            source,
        }
    }
}

/// Each drive that has such frames, with their number.
fn told(shared: &[SharedFrames]) -> String {
    let drives = shared.iter().filter(|s| s.targets > 0);
    let drives = drives.map(|s| format!("{} of {}", s.targets, s.drive));
    drives.collect::<Vec<_>>().join(", ")
}
