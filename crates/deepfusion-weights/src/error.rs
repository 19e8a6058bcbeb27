use deepfusion_hint::Hint;
use std::path::PathBuf;

/// What can go wrong with packed networks.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// A name that no embedded network has.
    #[error(
        "no network `{name}` is embedded in this build, which has {}",
        listed(known)
    )]
    NotEmbedded {
        /// What was asked for.
        name: String,
        /// What there is.
        known: Vec<String>,
    },
    /// A text that is no card.
    #[error("{origin}: not a card of a packed network: {reason}")]
    Card {
        /// The file, or the network's name.
        origin: String,
        /// Why.
        #[source]
        reason: CardProblem,
    },
    /// A card of another version.
    #[error(
        "{origin}: format version {found}, this program reads {}",
        crate::FORMAT_VERSION
    )]
    Version {
        /// The file, or the network's name.
        origin: String,
        /// Its version.
        found: i64,
    },
    /// Weights that are not those of the card beside them.
    #[error("{}: its SHA-256 is {found}, the card beside it says {expected}", path.display())]
    OtherWeights {
        /// The weights' file.
        path: PathBuf,
        /// As it is.
        found: String,
        /// As the card has it.
        expected: String,
    },
    /// A name that none can have.
    #[error(
        "`{name}`: a network's name is letters a to z, digits and dashes, a letter first, and not `none`"
    )]
    Name {
        /// The name.
        name: String,
    },
    /// A value that cannot be kept.
    #[error("tensor `{tensor}`: {value} is not a number, or too large for bf16")]
    Value {
        /// The tensor's name.
        tensor: String,
        /// The value.
        value: f32,
    },
    /// Tensors that do not make a file.
    #[error("the tensors cannot be written: {source}")]
    Tensors {
        /// What the format's library says.
        source: safetensors::SafeTensorError,
    },
    /// A file that is in the way.
    #[error("{}: already exists", path.display())]
    Exists {
        /// The file.
        path: PathBuf,
    },
    /// A file that cannot be read or written.
    #[error("{}: cannot {action}: {source}", path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// "read" or "write".
        action: &'static str,
        /// What the system says.
        source: std::io::Error,
    },
}

/// Why a text is no card, or a card has no text.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum CardProblem {
    /// Its text cannot be read as one. What the parser says, without the line break that ends it.
    #[error("{}", .0.to_string().trim_end())]
    NotOne(Box<toml::de::Error>),
    /// It has a value that TOML cannot hold.
    #[error("{0}")]
    Unwritten(#[source] Box<toml::ser::Error>),
    /// It describes another network than the one it lies beside.
    #[error("it is the card of `{name}`")]
    OfAnother {
        /// That network's name.
        name: String,
    },
}

impl Error {
    pub(crate) fn io(
        path: &std::path::Path,
        action: &'static str,
    ) -> impl Fn(std::io::Error) -> Self {
        let path = path.to_owned();
        move |source| Self::Io {
            path: path.clone(),
            action,
            source,
        }
    }
}

impl Hint for Error {
    fn hint(&self) -> Option<String> {
        let hint = match self {
            Self::NotEmbedded { known, .. } if known.is_empty() => "train one and give its folder",
            Self::NotEmbedded { known, .. } => {
                return Some(format!(
                    "give {}, or the folder of a run",
                    known.join(" or ")
                ));
            }
            Self::Card { .. } => {
                "packing a network writes a card beside the weights; take both from there"
            }
            Self::Version { .. } => {
                "use the version of the program that packed it, or pack its run again"
            }
            Self::OtherWeights { .. } => {
                "one of the two files was changed, or belongs to another network: copy both again, or pack the run again"
            }
            Self::Name { .. } => "choose a name such as street or street-2",
            Self::Value { .. } => {
                "the training that made it had diverged; take an earlier checkpoint"
            }
            Self::Tensors { .. } => return None,
            Self::Exists { .. } => "choose another folder or name, or allow it to be replaced",
            Self::Io {
                action: "write", ..
            } => "check the folder, its permissions and the free space",
            Self::Io { .. } => "check the path; NAME.safetensors and NAME.toml belong together",
        };
        Some(hint.to_owned())
    }
}

fn listed(known: &[String]) -> String {
    match known {
        [] => "none".into(),
        known => known.join(", "),
    }
}
