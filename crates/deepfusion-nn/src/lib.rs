//! The depth, pose and flow networks, and the differentiable operations under them.
//!
//! A config struct ([`DepthNetConfig`], [`PoseNetConfig`]) says what a network is and is stored beside
//! its weights; `.init(&device)` builds it; `forward` runs it. Networks on an autodiff device train
//! (their batch norms follow the batches); [`Module::valid`](burn::module::Module::valid) gives the
//! network that predicts.
//!
//! Tensors are N×C×H×W. Images are RGB in [0, 1]; their normalisation is part of the network.

mod attention;
mod cost;
mod decoder;
mod depth_net;
mod error;
mod flow_decoder;
mod graph;
mod hce;
mod init;
pub mod layers;
pub mod ops;
mod pose_net;
mod resample;
mod residual_block;
mod resnet;
pub mod weights;

pub use attention::{Attention, AttentionConfig, AttentionForm, AttentionMasks, GlobalAggregation};
pub use cost::ModuleCost;
pub use decoder::{DecoderConfig, DecoderStage, DisparityDecoder, SCALES};
pub use depth_net::{DepthNet, DepthNetConfig, DepthOutput, InputSize, Inspection};
pub use error::Error;
pub use flow_decoder::{FLOW_LEVELS, FlowDecoder, FlowDecoderConfig, FlowLevel, FlowOutput};
pub use graph::{depth_graph, depth_graph_with_uncertainty};
pub use hce::{HceConfig, HierarchicalContext};
pub use init::{WeightInit, WeightRng};
pub use pose_net::{PoseDecoder, PoseNet, PoseNetConfig, PoseOutput, RADIANS_PER_UNIT};
pub use resample::BilinearResize;
pub use residual_block::ResidualBlock;
pub use resnet::{InputNormalisation, ResNet, ResNetConfig, ResNetDepth};
