//! The depth, pose and flow networks, and the differentiable operations under them.
//!
//! A config struct ([`DepthNetConfig`], [`PoseNetConfig`]) describes a network and is stored beside its weights; `DepthNet::new(&config,
//! &device)` builds it; `forward` runs it. Networks on an autodiff device are in training mode (their batch norms follow the batches).
//! [`Module::valid`](burn::module::Module::valid) returns the network for inference.
//!
//! Tensors are N×C×H×W. Images are RGB in [0, 1]; their normalisation is part of the network.

mod attention;
mod decoder;
mod depth_net;
pub mod disp_net;
mod explainability;
mod flow_decoder;
mod hce;
mod init;
pub mod layers;
pub mod lite_mono;
pub mod ops;
mod pose_net;
pub mod r_msfm;
mod resample;
mod residual_block;
mod resnet;
pub mod weights;

pub use attention::{Attention, AttentionMasks, GlobalAggregation};
pub use decoder::{DecoderStage, DisparityDecoder, SCALES};
pub use deepfusion_model::{
    ArchitectureProblem, AttentionConfig, AttentionForm, DecoderConfig, DepthNetConfig, DepthScale,
    DispNetConfig, FlowDecoderConfig, HceConfig, InputNormalisation, InputSize, LiteMonoConfig,
    LiteMonoSize, NetworkError as Error, PoseNetConfig, R_MSFM_STATE, RMsfmConfig, RefinementInput,
    ResNetConfig, ResNetDepth,
};
pub use depth_net::{DepthNet, DepthOutput, Inspection};
pub use disp_net::DispNet;
pub use explainability::Explainability;
pub use flow_decoder::{FLOW_LEVELS, FlowDecoder, FlowLevel, FlowOutput};
pub use hce::HierarchicalContext;
pub use init::{WeightInit, WeightRng};
pub use lite_mono::LiteMono;
pub use pose_net::{PoseDecoder, PoseNet, PoseOutput, RADIANS_PER_UNIT};
pub use r_msfm::RMsfm;
pub use resample::{BilinearResize, doubled};
pub use residual_block::ResidualBlock;
pub use resnet::ResNet;
