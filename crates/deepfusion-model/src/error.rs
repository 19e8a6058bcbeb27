//! What can go wrong with a configuration, or with a run on disk.

use deepfusion_hint::{Hint, count_of, system_hint};
use std::io::ErrorKind;
use std::path::PathBuf;

use crate::NetworkError;

mod expected;

pub use self::expected::{AskedBy, ExpectedDataSet, ExpectedSetting, FoundSetting};

/// The version of the checkpoint's layout; files of another version are rejected.
pub const CHECKPOINT_VERSION: u32 = 1;

/// What can go wrong with a configuration, or with a run on disk.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// An invalid setting.
    #[error("setting `{field}`: expected {expected}, found {found}")]
    Config {
        /// The setting's name, as in the file.
        field: &'static str,
        /// What would be valid.
        expected: ExpectedSetting,
        /// What was found.
        found: FoundSetting,
    },
    /// A run that learned from several data sets, of which none or an unknown one was named.
    #[error("data set: expected {expected}, found {found}")]
    DataSet {
        /// The names to choose from.
        expected: ExpectedDataSet,
        /// The name asked for, or "none".
        found: String,
    },
    /// A preset set as if it were one of the keys: only the preset's name would change.
    #[error("{assignment}: a preset cannot be set as a key")]
    PresetAsKey {
        /// The assignment as given: preset=NAME.
        assignment: String,
    },
    /// An assignment that cannot be made.
    #[error("{assignment}: {reason}")]
    Setting {
        /// The assignment as given: KEY=VALUE.
        assignment: String,
        /// What is wrong with the assignment.
        reason: SettingProblem,
    },
    /// A file that is no training configuration.
    #[error("{path}: not a training configuration: {reason}")]
    ConfigFile {
        /// Path of the file.
        path: PathBuf,
        /// The parser's message, with the line.
        #[source]
        reason: TomlProblem,
    },
    /// A file to be read that does not exist.
    #[error("{path}: no such file or folder")]
    NoSuchFile {
        /// Path of the file.
        path: PathBuf,
    },
    /// A file that cannot be read or written.
    #[error("{path}: cannot {action}: {source}")]
    Io {
        /// Path of the file.
        path: PathBuf,
        /// "read" or "write".
        action: &'static str,
        /// The operating system's reason.
        source: std::io::Error,
    },
    /// A value that TOML has no form for.
    #[error("{path}: cannot be written as TOML: {source}")]
    NotToml {
        /// Path of the file to be written.
        path: PathBuf,
        /// The serialiser's message.
        source: toml::ser::Error,
    },
    /// A checkpoint of another version than [`CHECKPOINT_VERSION`].
    #[error("{path}: checkpoint format {found}, expected {}", CHECKPOINT_VERSION)]
    Checkpoint {
        /// Path of the file.
        path: PathBuf,
        /// The file's version.
        found: usize,
    },
    /// A path where no run is.
    #[error("{path}: {reason}")]
    NotARun {
        /// Path of the folder.
        path: PathBuf,
        /// What is wrong with the folder.
        reason: NoRun,
    },
    /// Weights that this program did not write.
    #[error("{path}: not a checkpoint of this program: metadata lacks `{key}`")]
    Foreign {
        /// Path of the file.
        path: PathBuf,
        /// The missing key.
        key: String,
    },
    /// A run without a checkpoint.
    #[error("{path}: this run has no checkpoint yet: it ended before writing its first")]
    NoCheckpoint {
        /// Path of the run's folder.
        path: PathBuf,
    },
    /// A checkpoint that training cannot continue from; its weights are complete.
    #[error("{path}: {reason}")]
    NotResumable {
        /// Path of the file.
        path: PathBuf,
        /// What the checkpoint lacks.
        reason: CheckpointLacks,
    },
    /// A network that cannot predict: its encoder was imported, and the rest was never trained.
    #[error("{path}: only the encoder has trained weights (imported)")]
    EncodersOnly {
        /// Path of the file.
        path: PathBuf,
    },
    /// A folder that already contains a run.
    #[error("{path}: this folder already contains a run")]
    RunExists {
        /// Path of the folder.
        path: PathBuf,
    },
    /// An error of the networks or their weights.
    #[error(transparent)]
    Network(#[from] NetworkError),
}

impl Error {
    /// An invalid setting, by its name in the file.
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
        let path = path.to_owned();
        if action == "read" && source.kind() == ErrorKind::NotFound {
            return Self::NoSuchFile { path };
        }
        Self::Io {
            path,
            action,
            source,
        }
    }
}

impl Hint for Error {
    fn hint(&self) -> Option<String> {
        match self {
            Self::DataSet { .. } => Some("name the data set whose metres the predictions should have".into()),
            Self::Config { field: "data" | "data.paths", .. } => Some(
                "give recordings either as data.paths or as [[data.sets]]".into(),
            ),
            Self::Config { field: "view_motion", .. } => Some(
                "set view_motion = \"posenet\", or keep the speed loss: without it, a run uses no measured motion".into(),
            ),
            Self::Config { field, .. } => Some(format!("correct `{field}` in the configuration")),
            Self::Setting { .. } | Self::PresetAsKey { .. } => Some(
                concat!(
                    "see all keys in ",
                    env!("CARGO_PKG_REPOSITORY"),
                    "/blob/main/docs/reference/configuration.md"
                )
                .into(),
            ),
            Self::ConfigFile { .. } => Some(
                concat!(
                    "name a preset and the keys that differ from it; see ",
                    env!("CARGO_PKG_REPOSITORY"),
                    "/blob/main/docs/reference/configuration.md"
                )
                .into(),
            ),
            Self::NoSuchFile { .. } => Some(system_hint(ErrorKind::NotFound).into()),
            Self::Io { source, action, .. } => match source.kind() {
                ErrorKind::StorageFull => {
                    Some("free some disk space; an existing file is unchanged".into())
                }
                ErrorKind::PermissionDenied => {
                    Some(format!("check that you have permission to {action} there"))
                }
                kind => Some(system_hint(kind).into()),
            },
            Self::NotToml { .. } => None,
            Self::Checkpoint { .. } => Some("use the version of the program that wrote the file".into()),
            Self::NotARun { .. } => Some("give the folder of a run".into()),
            Self::Foreign { .. } => {
                Some("import weights of other programs with deepfusion-nn".into())
            }
            Self::EncodersOnly { .. } => Some("train a network from it first".into()),
            Self::NoCheckpoint { .. } => {
                Some("train again in another folder, or empty this one first".into())
            }
            Self::NotResumable { .. } => Some("start a new run from these weights".into()),
            Self::RunExists { .. } => Some("resume that run, or choose another folder".into()),
            Self::Network(error) => error.hint(),
        }
    }
}

/// The TOML parser's message about a text or a table, without its final line break.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
#[error("{}", .0.to_string().trim_end())]
pub struct TomlProblem(pub Box<toml::de::Error>);

impl From<toml::de::Error> for TomlProblem {
    fn from(error: toml::de::Error) -> Self {
        Self(Box::new(error))
    }
}

/// Why an assignment KEY=VALUE cannot be made.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum SettingProblem {
    /// The `=` is missing.
    #[error("expected KEY=VALUE")]
    NoValue,
    /// A key below one that is not a table.
    #[error("`{key}` is a value, not a table")]
    NoTable {
        /// The key that is not a table.
        key: String,
    },
    /// An index into something that is not a list.
    #[error("`{key}` is not a list")]
    NoList {
        /// The key that is not a list.
        key: String,
    },
    /// An index beyond the end of a list.
    #[error("there is no `{key}[{place}]`: the list has {}, numbered from 0", count_of(*length, "element"))]
    BeyondList {
        /// The list's key.
        key: String,
        /// The index, from 0.
        place: usize,
        /// How many elements the list has.
        length: usize,
    },
    /// A key below a list, without the index of an element.
    #[error("`{key}` is a list of {}: name one, such as {key}[0]", count_of(*length, "element"))]
    NameInList {
        /// The list's key.
        key: String,
        /// How many elements it has.
        length: usize,
    },
    /// A key below a list that is empty.
    #[error("`{key}` is an empty list: set the whole list first")]
    NameInEmptyList {
        /// The list's key.
        key: String,
    },
    /// An index that cannot be parsed.
    #[error("`{part}`: an element of a list is named by a number in brackets, such as [0]")]
    NoPlace {
        /// The part of the key between two dots.
        part: String,
    },
    /// An element to be removed from a list.
    #[error("`{key}` is one element of a list: set the whole list instead")]
    ElementOfList {
        /// The element's key.
        key: String,
    },
    /// A key that does not exist.
    #[error("unknown key `{key}`{}", did_you_mean(nearest))]
    NoSuchKey {
        /// The key.
        key: String,
        /// Keys that may have been meant.
        nearest: Vec<String>,
    },
    /// A value that the key cannot have: the parser's message.
    #[error("{}", of_value(.0))]
    Value(Box<toml::de::Error>),
    /// A key that the caller sets itself; its reason.
    #[error("{0}")]
    DecidedElsewhere(&'static str),
}

/// The parser's message in one line, without Rust's names of types.
fn of_value(error: &toml::de::Error) -> String {
    let mut text = error.to_string().trim().replace('\n', " ");
    for (rust, plain) in [
        ("f64", "a number"),
        ("usize", "a whole number"),
        ("u64", "a whole number"),
        ("u32", "a whole number"),
        ("i32", "a whole number"),
    ] {
        text = text.replace(&format!("expected {rust}"), &format!("expected {plain}"));
    }
    text
}

fn did_you_mean(keys: &[String]) -> String {
    let quoted: Vec<String> = keys.iter().map(|key| format!("`{key}`")).collect();
    if quoted.is_empty() {
        String::new()
    } else {
        format!(": did you mean {}?", quoted.join(" or "))
    }
}

/// Why a folder is not a run.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum NoRun {
    /// The folder does not exist.
    #[error("no such run")]
    Missing,
    /// The folder lacks a configuration.
    #[error("not a run: config.toml is missing")]
    NoConfig,
}

/// What a checkpoint lacks that training needs to continue.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum CheckpointLacks {
    /// The optimiser's moving averages.
    #[error("the checkpoint has no optimiser state")]
    OptimiserState,
    /// The flow decoder.
    #[error("the checkpoint has no flow decoder, but the configuration trains one")]
    FlowDecoder,
    /// PoseNet.
    #[error("the checkpoint has no PoseNet, but the configuration has one")]
    PoseNet,
}
