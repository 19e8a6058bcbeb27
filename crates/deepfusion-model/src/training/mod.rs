//! Everything that decides a training run, as one struct that the command line, a configuration file and a run's `config.toml` share. What
//! a run measures in its data is a separate struct: [`TrainFindings`].

mod assumed_camera;
mod config_file;
mod config_keys;
mod data_set;
mod findings;
mod loss_config;
mod nearest_key;
mod preset;
mod sample_factors;
mod setting_key;
mod train_config;
mod validation;

pub use assumed_camera::{AssumedCamera, LearnedCamera};
pub use config_keys::{ConfigKey, config_keys};
pub use data_set::{DataSetConfig, Learn, SimulatedCamera, SimulatedConfig};
pub use findings::{AveragedNetwork, SetFindings, TrainFindings};
pub use loss_config::{CompareAt, DepthLossConfig, FlowLossConfig, LossConfig, MovingConfig};
pub use preset::{Compute, Preset};
pub use sample_factors::SampleFactors;
pub use train_config::{
    Augmentation, DataConfig, LearningRateSchedule, Reprojection, ReversedPose, TrainConfig,
    ViewMotion,
};
