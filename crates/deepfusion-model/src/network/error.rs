use deepfusion_hint::{Hint, count_of};
use std::path::PathBuf;

use crate::weights::FormatProblem;

mod expected;

pub use self::expected::ExpectedNetworkSetting;

/// What can go wrong when a network is configured, or when weights are read, written or fitted
/// into a network.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum NetworkError {
    /// A configuration value outside what the network can be built with.
    #[error("network config: `{field}` is {found}, expected {expected}")]
    Config {
        /// The field's dotted name, such as `encoder.base_width`.
        field: &'static str,
        /// What would have been accepted.
        expected: ExpectedNetworkSetting,
        /// The value found.
        found: String,
    },

    /// An input size the encoder cannot halve five times.
    #[error(
        "network input of {width}×{height} pixels: width and height must be multiples of 32, at least 64"
    )]
    InputSize {
        /// Width in pixels.
        width: usize,
        /// Height in pixels.
        height: usize,
    },

    /// A file that could not be opened, read, written or renamed.
    #[error("{}: cannot {action}: {source}", path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// What was tried: `read`, `write`, …
        action: &'static str,
        /// The operating system's reason.
        source: std::io::Error,
    },

    /// A file that is not a weights file, or is damaged.
    #[error("{}: not a readable weights file: {reason}", path.display())]
    Format {
        /// The file.
        path: PathBuf,
        /// What the reader found.
        #[source]
        reason: FormatProblem,
    },

    /// A tensor the network has and the weights lack.
    #[error("{origin}: tensor `{name}` {expected:?} is missing{}", and_others(*others))]
    MissingTensor {
        /// Where the weights come from, usually a file.
        origin: String,
        /// The tensor's name.
        name: String,
        /// The shape the network expects.
        expected: Vec<usize>,
        /// How many further tensors are missing.
        others: usize,
    },

    /// A tensor the weights have and the network lacks.
    #[error("{origin}: tensor `{name}` {found:?} is not part of this network{}", and_others(*others))]
    UnexpectedTensor {
        /// Where the weights come from, usually a file.
        origin: String,
        /// The tensor's name.
        name: String,
        /// Its shape.
        found: Vec<usize>,
        /// How many further tensors are unexpected.
        others: usize,
    },

    /// A tensor of another shape than the network's.
    #[error("{origin}: tensor `{name}` has shape {found:?}, expected {expected:?}{}", and_others(*others))]
    TensorShape {
        /// Where the weights come from, usually a file.
        origin: String,
        /// The tensor's name.
        name: String,
        /// The shape the network expects.
        expected: Vec<usize>,
        /// The shape found.
        found: Vec<usize>,
        /// How many further tensors differ in shape.
        others: usize,
    },

    /// A network that cannot be written as a graph; its config and weights were accepted before.
    #[error(transparent)]
    Graph(#[from] deepfusion_infer::Error),

    /// A NaN or an infinity among the weights.
    #[error(
        "{origin}: tensor `{name}` holds {} that {} not finite",
        count_of(*count, "value"),
        if *count == 1 { "is" } else { "are" }
    )]
    NotFinite {
        /// Where the weights come from, usually a file.
        origin: String,
        /// The tensor's name.
        name: String,
        /// How many NaNs and infinities it holds.
        count: usize,
    },

    /// Weights whose tensors do not form any of the known encoders.
    #[error("{origin}: {reason}")]
    UnknownArchitecture {
        /// Where the weights come from, usually a file.
        origin: String,
        /// What was looked for and what was found.
        reason: ArchitectureProblem,
    },
}

/// Why weights are not those of a network that is known, or that is wanted.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum ArchitectureProblem {
    /// They lack a tensor that every network of a kind has.
    #[error("not {network}: there is no `{lacks}`; its first tensor is `{first}`")]
    NotOfKind {
        /// The kind.
        network: &'static str,
        /// The tensor.
        lacks: &'static str,
        /// The first tensor that there is; empty without any.
        first: String,
    },
    /// The same of a ResNet.
    #[error("no ResNet: there is no `{lacks}`; its first tensor is `{first}`")]
    NoResNet {
        /// The tensor.
        lacks: &'static str,
        /// The first tensor that there is; empty without any.
        first: String,
    },
    /// A ResNet of another depth than the known ones.
    #[error("a ResNet of {blocks:?} blocks, bottleneck: {bottleneck}, is not known")]
    ResNet {
        /// Blocks of each layer.
        blocks: [usize; 4],
        /// Whether its blocks are bottlenecks.
        bottleneck: bool,
    },
    /// A Lite-Mono of another size than the published ones.
    #[error("a Lite-Mono of {widths:?} channels and {blocks:?} dilated blocks is not known")]
    LiteMono {
        /// Channels of each stage.
        widths: [usize; 3],
        /// Dilated blocks of each stage.
        blocks: [usize; 3],
    },
    /// An R-MSFM of another encoder than the first half of a ResNet-18.
    #[error(
        "R-MSFM of a ResNet-18 reads 64 channels by `convX21.1.weight`, this one {}: R-MSFMX is not known",
        channels.map_or_else(|| "none".to_owned(), |channels| channels.to_string())
    )]
    RMsfm {
        /// The channels that this one reads.
        channels: Option<usize>,
    },
    /// Weights of a ResNet for a network without one.
    #[error("its weights are a ResNet's, and the network to start is {network}")]
    ResNetForOther {
        /// What the network is.
        network: &'static str,
    },
    /// A checkpoint of encoders alone, which are ResNets, for a depth network without one.
    #[error("it holds ResNets, and this configuration's depth network is {network}")]
    EncodersForOther {
        /// What the network is.
        network: &'static str,
    },
}

impl NetworkError {
    pub(crate) fn config(
        field: &'static str,
        expected: ExpectedNetworkSetting,
        found: impl std::fmt::Debug,
    ) -> Self {
        Self::Config {
            field,
            expected,
            found: format!("{found:?}"),
        }
    }
}

impl Hint for NetworkError {
    fn hint(&self) -> Option<String> {
        let hint = match self {
            Self::Config { .. } | Self::Graph(_) => return None,
            Self::InputSize { width, height } => {
                let nearest = |n: usize| (n.max(64) + 16) / 32 * 32;
                return Some(format!(
                    "the nearest is {}×{}",
                    nearest(*width),
                    nearest(*height)
                ));
            }
            Self::Io { action, .. } if *action == "write" => {
                "check the folder, its permissions and the free space"
            }
            Self::Io { .. } => "check the path",
            Self::Format { .. } => {
                "expected .safetensors, or a .pth / .pt state dictionary saved by torch.save; a partial download ends early"
            }
            Self::MissingTensor { .. }
            | Self::UnexpectedTensor { .. }
            | Self::TensorShape { .. } => {
                "the weights belong to another architecture: compare the encoder (`resnet18`…), the widths and the preset in both configs"
            }
            Self::NotFinite { .. } => {
                "the training that wrote this file had diverged; take an earlier checkpoint"
            }
            Self::UnknownArchitecture { .. } => {
                "known are torchvision's ResNet-18, 34, 50 and 101, and Monodepth2's encoder.pth, depth.pth, pose_encoder.pth, pose.pth"
            }
        };
        Some(hint.to_owned())
    }
}

fn and_others(others: usize) -> String {
    match others {
        0 => String::new(),
        n => format!(" (and {n} more)"),
    }
}
