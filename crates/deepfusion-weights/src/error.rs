use deepfusion_hint::Hint;
use std::path::PathBuf;

/// What can go wrong with packed networks.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// A name that no embedded network has.
    #[error(
        "no embedded network is named `{name}`: this build has {}",
        listed(known)
    )]
    NotEmbedded {
        /// The name asked for.
        name: String,
        /// The names of the embedded networks.
        known: Vec<String>,
    },
    /// A text that is not a card.
    #[error("{origin}: not a card of a packed network: {reason}")]
    Card {
        /// Path of the file, or name of the network.
        origin: String,
        /// Why it is not a card.
        #[source]
        reason: CardProblem,
    },
    /// A card of another version.
    #[error("{origin}: format version {found}, expected {}", crate::FORMAT_VERSION)]
    Version {
        /// Path of the file, or name of the network.
        origin: String,
        /// The card's version.
        found: i64,
    },
    /// Weights that do not belong to the card beside them.
    #[error("{}: SHA-256 is {found}, expected {expected} according to the card", path.display())]
    OtherWeights {
        /// Path of the weights' file.
        path: PathBuf,
        /// SHA-256 of the file.
        found: String,
        /// SHA-256 according to the card.
        expected: String,
    },
    /// An invalid name.
    #[error(
        "`{name}`: expected a name of letters a to z, digits and dashes that starts with a letter and is not `none`"
    )]
    Name {
        /// The name.
        name: String,
    },
    /// A value that cannot be packed.
    #[error("tensor `{tensor}`: {value} is not finite, or too large for bf16")]
    Value {
        /// The tensor's name.
        tensor: String,
        /// The value.
        value: f32,
    },
    /// Tensors that cannot be written as a file.
    #[error("cannot write the tensors: {source}")]
    Tensors {
        /// The safetensors library's message.
        source: safetensors::SafeTensorError,
    },
    /// A file that already exists.
    #[error("{}: already exists", path.display())]
    Exists {
        /// Path of the file.
        path: PathBuf,
    },
    /// A file that cannot be read or written.
    #[error("{}: cannot {action}: {source}", path.display())]
    Io {
        /// Path of the file.
        path: PathBuf,
        /// "read" or "write".
        action: &'static str,
        /// The operating system's reason.
        source: std::io::Error,
    },
}

/// Why a text is not a card, or a card cannot be written.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum CardProblem {
    /// The text cannot be parsed: the parser's message, without the line break that ends it.
    #[error("{}", .0.to_string().trim_end())]
    NotOne(Box<toml::de::Error>),
    /// A value has no TOML form: the serialiser's message.
    #[error("{0}")]
    Unwritten(#[source] Box<toml::ser::Error>),
    /// The card describes another network than the one beside it.
    #[error("it is the card of `{name}`")]
    OfAnother {
        /// Name of the network that it describes.
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
            Self::NotEmbedded { known, .. } if known.is_empty() => {
                "train a network and give its folder"
            }
            Self::NotEmbedded { known, .. } => {
                return Some(format!(
                    "give {}, or the folder of a run",
                    known.join(" or ")
                ));
            }
            Self::Card { .. } => "pack the network again: this writes its card beside the weights",
            Self::Version { .. } => {
                "use the version of the program that packed the network, or pack its run again"
            }
            Self::OtherWeights { .. } => {
                "copy weights and card again from one place, or pack the run again"
            }
            Self::Name { .. } => "choose a name such as street or street-2",
            Self::Value { .. } => {
                "take an earlier checkpoint: the training diverged before this one was written"
            }
            Self::Tensors { .. } => return None,
            Self::Exists { .. } => "choose another folder or name, or allow replacing the files",
            Self::Io {
                action: "write", ..
            } => "check the folder, its permissions and the free space",
            Self::Io { .. } => "check the path: NAME.safetensors needs NAME.toml beside it",
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
