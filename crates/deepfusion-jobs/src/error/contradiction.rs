//! Settings that are asked for, and what a run that goes on has instead.

use std::fmt;
use std::path::PathBuf;

/// A setting that something asked for.
#[derive(Debug, Clone, PartialEq, Eq)]
#[non_exhaustive]
pub enum Setting {
    /// A configuration file.
    File(PathBuf),
    /// The preset.
    Preset,
    /// The size of the network's input.
    Size,
    /// Samples of a batch.
    Batch,
    /// The seed.
    Seed,
    /// What is learned from.
    Learn,
    /// Cameras.
    Camera,
    /// Whether the other camera's image is a view, too.
    Stereo,
    /// Whether the camera is learned.
    LearnedCamera,
    /// The pose used for warping.
    ViewMotion,
    /// Loss terms and parts of the network that are on.
    With,
    /// Those that are off.
    Without,
    /// Any key, as `batch=4` sets it.
    Assignment,
    /// What a run starts from.
    Init,
    /// How far the camera's clock is ahead.
    Clock,
    /// Topics of bags.
    Topic,
    /// The recordings that are learned from.
    Data,
    /// Those of the validation.
    Validation,
    /// The split of the first.
    Split,
    /// The split of the validation.
    ValidationSplit,
    /// A data set's own recordings and splits.
    DataSet,
}

impl fmt::Display for Setting {
    /// The key of a configuration, or the file.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::File(path) => return write!(f, "{}", path.display()),
            Self::Preset => "preset",
            Self::Size => "size",
            Self::Batch => "batch",
            Self::Seed => "seed",
            Self::Learn => "data.learn",
            Self::Camera => "data.camera",
            Self::Stereo => "stereo",
            Self::LearnedCamera => "assumed_camera.learn",
            Self::ViewMotion => "view_motion",
            Self::With | Self::Without => "loss",
            Self::Assignment => "config.toml",
            Self::Init => "init",
            Self::Clock => "data.camera_ahead_s",
            Self::Topic => "data.topics",
            Self::Data => "data.paths",
            Self::Validation => "data.validation",
            Self::Split => "data.split",
            Self::ValidationSplit => "data.validation_split",
            Self::DataSet => "data.sets",
        })
    }
}

/// Something that is asked of a run and is not what it has.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
#[error("{setting}: {asked} contradicts the run, which {run}")]
pub struct Contradiction {
    /// What was to be set.
    pub setting: Setting,
    /// To what.
    pub asked: RequestedValue,
    /// What the run has.
    pub run: RunHas,
}

impl Contradiction {
    /// What is asked of a run, and what it has.
    #[must_use]
    pub fn new(setting: Setting, asked: impl Into<RequestedValue>, run: RunHas) -> Self {
        Self {
            setting,
            asked: asked.into(),
            run,
        }
    }
}

/// The value that is asked for.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum RequestedValue {
    /// This.
    #[error("{0}")]
    Value(String),
    /// The other camera's view.
    #[error("on")]
    OtherCamera,
    /// That the camera is learned.
    #[error("to be learned")]
    Learned,
    /// That the clocks are compared.
    #[error("to be measured")]
    Measured,
}

impl From<String> for RequestedValue {
    fn from(value: String) -> Self {
        Self::Value(value)
    }
}

/// What a run has instead of what is asked for, in words that follow on "which".
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum RunHas {
    /// This.
    #[error("has {0}")]
    Value(String),
    /// Nothing of the kind.
    #[error("has none")]
    Nothing,
    /// It is switched off.
    #[error("has it off")]
    Off,
    /// The term is not among its own.
    #[error("is learned without it")]
    WithoutIt,
    /// The term is among its own.
    #[error("is learned with it")]
    WithIt,
    /// The key has another value.
    #[error("has another value in its config.toml")]
    AnotherValue,
    /// It names no topic.
    #[error("names none")]
    NoTopics,
    /// It is validated on frames of its own drives.
    #[error("is validated on the held-out end of each drive")]
    HeldOutEnd,
    /// Each of its data sets has its own.
    #[error("has the data.sets of its config.toml, each with its own")]
    OwnOfEachSet,
}
