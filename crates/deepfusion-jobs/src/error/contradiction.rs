//! Requested settings that contradict a resumed run.

use std::fmt;
use std::path::PathBuf;

/// A setting that can be requested.
#[derive(Debug, Clone, PartialEq, Eq)]
#[non_exhaustive]
pub enum Setting {
    /// A configuration file.
    File(PathBuf),
    /// The preset.
    Preset,
    /// The size of the network's input.
    Size,
    /// Number of samples in a batch.
    Batch,
    /// The seed.
    Seed,
    /// What the network learns from.
    Learn,
    /// The camera.
    Camera,
    /// Whether the other camera's image is used as a view, too.
    Stereo,
    /// Whether the camera's intrinsics are learned.
    LearnedCamera,
    /// The pose used for warping.
    ViewMotion,
    /// Loss terms and parts of the network that are switched on.
    With,
    /// Loss terms and parts of the network that are switched off.
    Without,
    /// Any key, set as in `batch=4`.
    Assignment,
    /// The network that a run starts from.
    Init,
    /// How far the camera's clock is ahead.
    Clock,
    /// The topics of bags.
    Topic,
    /// The training recordings.
    Data,
    /// The validation recordings.
    Validation,
    /// The split of the training recordings.
    Split,
    /// The split of the validation recordings.
    ValidationSplit,
    /// A data set's own recordings and splits.
    DataSet,
}

impl fmt::Display for Setting {
    /// The key in the configuration, or the file.
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

/// A requested setting that contradicts a resumed run.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
#[error("{setting}: {asked} contradicts the run, which {run}")]
pub struct Contradiction {
    /// The setting.
    pub setting: Setting,
    /// The requested value.
    pub asked: RequestedValue,
    /// The run's value.
    pub run: RunHas,
}

impl Contradiction {
    /// A contradiction of `setting`: `asked` is the requested value, `run` the run's.
    #[must_use]
    pub fn new(setting: Setting, asked: impl Into<RequestedValue>, run: RunHas) -> Self {
        Self {
            setting,
            asked: asked.into(),
            run,
        }
    }
}

/// The requested value.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum RequestedValue {
    /// A value, as text.
    #[error("{0}")]
    Value(String),
    /// Using the other camera's view.
    #[error("on")]
    OtherCamera,
    /// Learning the camera.
    #[error("learning it")]
    Learned,
    /// Measuring the clocks' offset.
    #[error("measuring it")]
    Measured,
}

impl From<String> for RequestedValue {
    fn from(value: String) -> Self {
        Self::Value(value)
    }
}

/// What the run has instead. The text follows "which".
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum RunHas {
    /// A value, as text.
    #[error("has {0}")]
    Value(String),
    /// The setting is not set.
    #[error("has none")]
    Nothing,
    /// The setting is switched off.
    #[error("has it off")]
    Off,
    /// The loss term is not used.
    #[error("is trained without it")]
    WithoutIt,
    /// The loss term is used.
    #[error("is trained with it")]
    WithIt,
    /// The key has another value.
    #[error("has another value in its config.toml")]
    AnotherValue,
    /// No topics are named.
    #[error("names none")]
    NoTopics,
    /// It is validated on frames of its own drives.
    #[error("is validated on the held-out end of each drive")]
    HeldOutEnd,
    /// Each of its data sets has its own value.
    #[error("has the data.sets of its config.toml, each with its own")]
    OwnOfEachSet,
}
