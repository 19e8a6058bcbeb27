use deepfusion_hint::{Hint, count_of, system_hint};
use std::io::ErrorKind;
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
    #[error("network configuration: `{field}` is {found}, expected {expected}")]
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
        "network input of {width}x{height} pixels: width and height must be multiples of 32, at least 64"
    )]
    InputSize {
        /// Width in pixels.
        width: usize,
        /// Height in pixels.
        height: usize,
    },

    /// A file to be opened that does not exist.
    #[error("{}: no such file or folder", path.display())]
    NoSuchFile {
        /// Path of the file.
        path: PathBuf,
    },

    /// A file that could not be opened, read, written or renamed.
    #[error("{}: cannot {action}: {source}", path.display())]
    Io {
        /// Path of the file.
        path: PathBuf,
        /// What was tried: `read`, `write`, …
        action: &'static str,
        /// The operating system's reason.
        source: std::io::Error,
    },

    /// A file that is not a weights file, or is damaged.
    #[error("{}: not a readable weights file: {reason}", path.display())]
    Format {
        /// Path of the file.
        path: PathBuf,
        /// Why it cannot be read.
        #[source]
        reason: FormatProblem,
    },

    /// A tensor that the network has and the weights lack.
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

    /// A tensor that the weights have and the network lacks.
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

    /// A tensor whose shape is not the network's.
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

    /// A network that cannot be written as a graph, although its configuration and weights were accepted before.
    #[error(transparent)]
    Graph(#[from] deepfusion_infer::Error),

    /// NaNs or infinities among the weights.
    #[error(
        "{origin}: tensor `{name}` has {} that {} not finite",
        count_of(*count, "value"),
        if *count == 1 { "is" } else { "are" }
    )]
    NotFinite {
        /// Where the weights come from, usually a file.
        origin: String,
        /// The tensor's name.
        name: String,
        /// Number of NaNs and infinities.
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

/// Why weights do not belong to a known network, or not to the expected one.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum ArchitectureProblem {
    /// A tensor is missing that every network of this kind has.
    #[error("not {network}: `{lacks}` is missing; the first tensor is `{first}`")]
    NotOfKind {
        /// The kind of network.
        network: &'static str,
        /// The missing tensor.
        lacks: &'static str,
        /// The first tensor of the weights; empty if there is none.
        first: String,
    },
    /// A tensor is missing that every ResNet has.
    #[error("not a ResNet: `{lacks}` is missing; the first tensor is `{first}`")]
    NoResNet {
        /// The missing tensor.
        lacks: &'static str,
        /// The first tensor of the weights; empty if there is none.
        first: String,
    },
    /// A ResNet of unknown depth.
    #[error("unknown ResNet: {blocks:?} blocks, bottleneck: {bottleneck}")]
    ResNet {
        /// Number of blocks of each layer.
        blocks: [usize; 4],
        /// Whether its blocks are bottlenecks.
        bottleneck: bool,
    },
    /// A Lite-Mono of unknown size.
    #[error("unknown Lite-Mono: {widths:?} channels, {blocks:?} dilated blocks")]
    LiteMono {
        /// Channels of each stage.
        widths: [usize; 3],
        /// Number of dilated blocks of each stage.
        blocks: [usize; 3],
    },
    /// An R-MSFM whose encoder is not the first half of a ResNet-18.
    #[error(
        "`convX21.1.weight`: expected 64 input channels (R-MSFM with ResNet-18), found {}: R-MSFMX is not known",
        channels.map_or_else(|| "none".to_owned(), |channels| channels.to_string())
    )]
    RMsfm {
        /// Input channels of `convX21.1.weight`.
        channels: Option<usize>,
    },
    /// Weights of a ResNet for a network that has none.
    #[error("the weights are a ResNet's, but the network to be trained is {network}")]
    ResNetForOther {
        /// The network to be trained.
        network: &'static str,
    },
    /// A checkpoint of encoders (ResNets) alone, for a depth network without a ResNet.
    #[error("the checkpoint has ResNets, but the configuration's depth network is {network}")]
    EncodersForOther {
        /// The configuration's depth network.
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
                    "the nearest valid size is {}x{}",
                    nearest(*width),
                    nearest(*height)
                ));
            }
            Self::Io { action, .. } if *action == "write" => {
                "check the folder, its permissions and the free space"
            }
            Self::NoSuchFile { .. } => system_hint(ErrorKind::NotFound),
            Self::Io { source, .. } => system_hint(source.kind()),
            Self::Format { .. } => {
                "give a complete .safetensors file, or a state dictionary (.pth, .pt) saved by torch.save"
            }
            Self::MissingTensor { .. }
            | Self::UnexpectedTensor { .. }
            | Self::TensorShape { .. } => {
                "use weights of the same architecture: compare the encoder (`resnet18`…), the widths and the preset of both configurations"
            }
            Self::NotFinite { .. } => {
                "take an earlier checkpoint: the training diverged before this one was written"
            }
            Self::UnknownArchitecture { .. } => {
                "give torchvision's ResNet-18, 34, 50 or 101, or Monodepth2's encoder.pth, depth.pth, pose_encoder.pth or pose.pth"
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
