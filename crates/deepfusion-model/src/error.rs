//! What can go wrong with a configuration, or with a run on disk.

use deepfusion_hint::{Hint, count_of, system_hint};
use std::path::PathBuf;

use crate::NetworkError;

mod expected;

pub use self::expected::{AskedBy, ExpectedDataSet, ExpectedSetting, FoundSetting};

/// The version of the checkpoint's layout; files of another version are refused.
pub const CHECKPOINT_VERSION: u32 = 1;

/// What can go wrong with a configuration, or with a run on disk.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// A setting that means nothing.
    #[error("setting `{field}`: expected {expected}, found {found}")]
    Config {
        /// The setting's name, as in the file.
        field: &'static str,
        /// What would do.
        expected: ExpectedSetting,
        /// What was found.
        found: FoundSetting,
    },
    /// A run of several data sets, and none of them named, or none of that name.
    #[error("data set: expected {expected}, found {found}")]
    DataSet {
        /// The names there are.
        expected: ExpectedDataSet,
        /// The name asked for, or "none".
        found: String,
    },
    /// A preset set as if it were one of its keys: its name alone would change.
    #[error("{assignment}: a preset is chosen as a whole, or in the file")]
    PresetAsKey {
        /// What was asked for: preset=NAME.
        assignment: String,
    },
    /// A key that cannot be set so.
    #[error("{assignment}: {reason}")]
    Setting {
        /// What was asked for: KEY=VALUE.
        assignment: String,
        /// What is wrong with it.
        reason: SettingProblem,
    },
    /// A configuration file that cannot be read as one.
    #[error("{path}: not a training configuration: {reason}")]
    ConfigFile {
        /// The file.
        path: PathBuf,
        /// What the parser says, with the line.
        #[source]
        reason: TomlProblem,
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
    /// What TOML cannot hold.
    #[error("{path}: cannot be written as TOML: {source}")]
    NotToml {
        /// The file that was to be written.
        path: PathBuf,
        /// Why not.
        source: toml::ser::Error,
    },
    /// A checkpoint of another version than [`CHECKPOINT_VERSION`].
    #[error(
        "{path}: checkpoint format {found}, this program reads {}",
        CHECKPOINT_VERSION
    )]
    Checkpoint {
        /// The file.
        path: PathBuf,
        /// Its version.
        found: usize,
    },
    /// No run where one should be.
    #[error("{path}: {reason}")]
    NotARun {
        /// The folder.
        path: PathBuf,
        /// What it lacks.
        reason: NoRun,
    },
    /// Weights that this program did not write.
    #[error("{path}: no checkpoint of this program: `{key}` is missing from its metadata")]
    Foreign {
        /// The file.
        path: PathBuf,
        /// What it lacks.
        key: String,
    },
    /// A run that ended before its first checkpoint.
    #[error("{path}: this run has no checkpoint yet: it ended before it saved its first")]
    NoCheckpoint {
        /// The run's folder.
        path: PathBuf,
    },
    /// A checkpoint that training cannot go on from; its weights are whole.
    #[error("{path}: {reason}")]
    NotResumable {
        /// The file.
        path: PathBuf,
        /// What it lacks.
        reason: CheckpointLacks,
    },
    /// A network that cannot be run: its encoder was imported, and the rest has learned nothing.
    #[error("{path}: only its encoder has weights: the rest was never trained")]
    EncodersOnly {
        /// The file.
        path: PathBuf,
    },
    /// A folder that already holds a run.
    #[error("{path}: there is a run here already")]
    RunExists {
        /// The folder.
        path: PathBuf,
    },
    /// The networks or their weights.
    #[error(transparent)]
    Network(#[from] NetworkError),
}

impl Error {
    /// A setting that means nothing, by its name in the file.
    #[must_use]
    pub fn config(
        field: &'static str,
        expected: impl Into<ExpectedSetting>,
        found: impl Into<FoundSetting>,
    ) -> Self {
        Self::Config {
            field,
            expected: expected.into(),
            found: found.into(),
        }
    }

    /// A file that cannot be read or written; `action` is "read" or "write".
    #[must_use]
    pub fn io(path: &std::path::Path, action: &'static str, source: std::io::Error) -> Self {
        Self::Io {
            path: path.to_owned(),
            action,
            source,
        }
    }
}

impl Hint for Error {
    fn hint(&self) -> Option<String> {
        match self {
            Self::DataSet { .. } => Some("give the name of the data set whose metres are meant".into()),
            Self::Config { field: "data" | "data.paths", .. } => Some(
                "give recordings as data.paths or as [[data.sets]], one of the two".into(),
            ),
            Self::Config { field: "view_motion", .. } => Some(
                "without the speed loss nothing measured may enter: take view_motion = \"posenet\", or keep the speed loss".into(),
            ),
            Self::Config { field, .. } => Some(format!("set `{field}` so in the configuration")),
            Self::Setting { .. } | Self::PresetAsKey { .. } => Some(
                concat!(
                    "every key and what it means is in ",
                    env!("CARGO_PKG_REPOSITORY"),
                    "/blob/main/docs/reference/configuration.md"
                )
                .into(),
            ),
            Self::ConfigFile { .. } => Some(
                concat!(
                    "name a preset and the keys in which it differs; all are in ",
                    env!("CARGO_PKG_REPOSITORY"),
                    "/blob/main/docs/reference/configuration.md"
                )
                .into(),
            ),
            Self::Io { source, action, .. } => match source.kind() {
                std::io::ErrorKind::StorageFull => {
                    Some("the disk is full; what was there before is untouched".into())
                }
                std::io::ErrorKind::PermissionDenied => {
                    Some(format!("no permission to {action} there"))
                }
                kind => Some(system_hint(kind).into()),
            },
            Self::NotToml { .. } => None,
            Self::Checkpoint { .. } => Some("use the version of the program that wrote it".into()),
            Self::NotARun { .. } => Some("give the folder of a run".into()),
            Self::Foreign { .. } => {
                Some("weights of other programs are imported: deepfusion-nn".into())
            }
            Self::EncodersOnly { .. } => Some("train from it first".into()),
            Self::NoCheckpoint { .. } => {
                Some("begin it anew in another folder, or empty this one first".into())
            }
            Self::NotResumable { .. } => Some("start a new run from these weights".into()),
            Self::RunExists { .. } => Some("resume it, or choose another folder".into()),
            Self::Network(error) => error.hint(),
        }
    }
}

/// What the parser of TOML says of a text or a table, without the line break that ends it.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
#[error("{}", .0.to_string().trim_end())]
pub struct TomlProblem(pub Box<toml::de::Error>);

impl From<toml::de::Error> for TomlProblem {
    fn from(error: toml::de::Error) -> Self {
        Self(Box::new(error))
    }
}

/// Why a key cannot be set so.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum SettingProblem {
    /// There is no `=`.
    #[error("expected KEY=VALUE")]
    NoValue,
    /// A key under one that is no table.
    #[error("`{key}` is a value and no table")]
    NoTable {
        /// What is no table.
        key: String,
    },
    /// A place in what is no list.
    #[error("`{key}` is no list")]
    NoList {
        /// What is no list.
        key: String,
    },
    /// A place that a list does not have.
    #[error("there is no `{key}[{place}]`: the list has {}, counted from 0", count_of(*length, "element"))]
    BeyondList {
        /// The list.
        key: String,
        /// The place.
        place: usize,
        /// How many elements the list has.
        length: usize,
    },
    /// A name in a list, whose elements have places.
    #[error("`{key}` is a list of {}: say which, such as {key}[0]", count_of(*length, "element"))]
    NameInList {
        /// The list.
        key: String,
        /// How many elements it has.
        length: usize,
    },
    /// A name in a list that has no elements.
    #[error("`{key}` is a list without elements: it is set as a whole first")]
    NameInEmptyList {
        /// The list.
        key: String,
    },
    /// A text that cannot be a place in a list.
    #[error("`{part}`: a place in a list is a number in brackets, such as [0]")]
    NoPlace {
        /// The part of the key between two dots.
        part: String,
    },
    /// An element of a list that is to be taken away.
    #[error("`{key}` is an element of a list, which can only be set anew without it")]
    ElementOfList {
        /// The element.
        key: String,
    },
    /// Nothing has this name.
    #[error("there is no key `{key}`{}", did_you_mean(nearest))]
    NoSuchKey {
        /// The name.
        key: String,
        /// Those that may have been meant.
        nearest: Vec<String>,
    },
    /// The key cannot have this value: what the parser says.
    #[error("{}", .0.to_string().trim().replace('\n', " "))]
    Value(Box<toml::de::Error>),
    /// Something else decides it; what, in its caller's words.
    #[error("{0}")]
    DecidedElsewhere(&'static str),
}

fn did_you_mean(keys: &[String]) -> String {
    let quoted: Vec<String> = keys.iter().map(|key| format!("`{key}`")).collect();
    if quoted.is_empty() {
        String::new()
    } else {
        format!(": did you mean {}?", quoted.join(" or "))
    }
}

/// Why a folder is no run's.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum NoRun {
    /// There is no such folder.
    #[error("no such run")]
    Missing,
    /// It has no configuration.
    #[error("this is no run: it has no config.toml")]
    NoConfig,
}

/// What a checkpoint lacks that training needs to go on.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum CheckpointLacks {
    /// The optimiser's averages.
    #[error("it has no optimiser state to go on with")]
    OptimiserState,
    /// The decoder of the flow.
    #[error("it has no flow decoder, and this configuration trains one")]
    FlowDecoder,
    /// PoseNet.
    #[error("it has no PoseNet, and this configuration has one")]
    PoseNet,
}
