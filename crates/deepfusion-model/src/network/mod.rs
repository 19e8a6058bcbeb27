//! The networks' settings: one config struct each, stored beside the weights.

mod attention;
mod cost;
mod decoder;
mod depth_net;
mod disp_net;
mod disp_net_cost;
mod error;
mod flow_decoder;
mod hce;
mod lite_mono;
mod lite_mono_cost;
mod pose_net;
mod r_msfm;
mod r_msfm_cost;
mod resnet;

pub use attention::{AttentionConfig, AttentionForm};
pub use cost::ModuleCost;
pub use decoder::DecoderConfig;
pub use depth_net::{DepthNetConfig, DepthScale, InputSize, LOG_SCALE_BOUNDS, UNCERTAINTY_PREFIX};
pub use disp_net::{DISP_NET_DISPARITY, DISP_NET_KERNELS, DISP_NET_LEVELS, DispNetConfig};
pub use error::{ArchitectureProblem, ExpectedNetworkSetting, NetworkError};
pub use flow_decoder::FlowDecoderConfig;
pub use hce::HceConfig;
pub use lite_mono::{LAYER_NORM_EPSILON, LiteMonoConfig, LiteMonoSize, POSITION_CHANNELS};
pub use pose_net::{EXPLAINABILITY_WIDTHS, POSE_WIDTH, PoseNetConfig};
pub use r_msfm::{R_MSFM_STATE, RMsfmConfig, RefinementInput};
pub use resnet::{BATCH_NORM_EPSILON, InputNormalisation, ResNetConfig, ResNetDepth};
