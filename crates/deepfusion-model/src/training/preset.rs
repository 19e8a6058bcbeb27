use super::{
    Augmentation, DataConfig, LearningRateSchedule, Reprojection, ReversedPose, TrainConfig,
    ViewMotion,
};
use super::{CompareAt, DepthLossConfig, FlowLossConfig, LossConfig, MovingConfig};
use crate::{
    DecoderConfig, DepthNetConfig, FlowDecoderConfig, InputSize, LiteMonoSize, PoseNetConfig,
    ResNetConfig, ResNetDepth,
};
use deepfusion_kernels::Precision;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Named configurations to start from.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Preset {
    /// ResNet-18 at half width, 320×96: learns something useful on two cores in minutes.
    Tiny,
    /// ResNet-18, 640×192.
    Light,
    /// ResNet-50, 640×192, batch 12: the paper's sizes.
    Resnet50,
    /// The paper's network (ResNet-50, context encoding, attention), 640×192, batch 12.
    Paper,
    /// Monodepth2's network and losses (three frames, minimum reprojection) with the speed term.
    Monodepth2,
    /// The same with ResNet-50 in both networks.
    #[serde(rename = "monodepth2-50")]
    Monodepth2R50,
    /// Lite-Mono (3.1 M parameters) with the losses of `monodepth2`, 640×192.
    #[serde(rename = "lite-mono")]
    LiteMono,
    /// Lite-Mono-small (2.5 M parameters).
    #[serde(rename = "lite-mono-small")]
    LiteMonoSmall,
    /// Lite-Mono-tiny (2.2 M parameters).
    #[serde(rename = "lite-mono-tiny")]
    LiteMonoTiny,
    /// Lite-Mono-8M (8.7 M parameters).
    #[serde(rename = "lite-mono-8m")]
    LiteMono8m,
    /// R-MSFM3 (3.5 M parameters), which refines a disparity three times, with the losses of `monodepth2`, 640×192.
    #[serde(rename = "r-msfm3")]
    RMsfm3,
    /// R-MSFM6 (3.8 M parameters), which refines it six times.
    #[serde(rename = "r-msfm6")]
    RMsfm6,
    /// SfMLearner: DispNet (31.6 M parameters), images compared by colour alone, explainability masks; 416×128, batch 4.
    Sfmlearner,
}

/// The device class that a preset's sizes depend on.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Compute {
    /// A few cores.
    #[default]
    Processor,
    /// A graphics card.
    Gpu,
}

/// A network trained from scratch learns hardly anything in fewer steps, however short the drive. On 154 frames, 1,200 steps of `light`
/// reached an abs_rel of 0.24 to 0.26 on another street; 20 epochs would be 240 steps of twelve images (docs/benchmarks/kitti.md).
const MIN_STEPS: usize = 1200;

impl Preset {
    /// All presets.
    pub const ALL: [Self; 13] = [
        Self::Tiny,
        Self::Light,
        Self::Resnet50,
        Self::Paper,
        Self::Monodepth2,
        Self::Monodepth2R50,
        Self::LiteMono,
        Self::LiteMonoSmall,
        Self::LiteMonoTiny,
        Self::LiteMono8m,
        Self::RMsfm3,
        Self::RMsfm6,
        Self::Sfmlearner,
    ];

    /// Its name, on the command line and in files.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Tiny => "tiny",
            Self::Light => "light",
            Self::Resnet50 => "resnet50",
            Self::Paper => "paper",
            Self::Monodepth2 => "monodepth2",
            Self::Monodepth2R50 => "monodepth2-50",
            Self::LiteMono => "lite-mono",
            Self::LiteMonoSmall => "lite-mono-small",
            Self::LiteMonoTiny => "lite-mono-tiny",
            Self::LiteMono8m => "lite-mono-8m",
            Self::RMsfm3 => "r-msfm3",
            Self::RMsfm6 => "r-msfm6",
            Self::Sfmlearner => "sfmlearner",
        }
    }

    /// The configuration for training on such a device. On a processor, every preset uses images of 320×96 and a batch of 4, which trains in
    /// minutes: twelve of 640×192 are twelve times as many pixels.
    #[must_use]
    pub fn config_on(self, compute: Compute) -> TrainConfig {
        let mut config = self.config();
        if compute == Compute::Processor {
            config.size = InputSize {
                width: 320,
                height: 96,
            };
            config.batch = 4;
        }
        config
    }

    /// The configuration at the preset's full size.
    #[must_use]
    pub fn config(self) -> TrainConfig {
        let base = |depth: ResNetDepth| TrainConfig {
            preset: self,
            size: InputSize {
                width: 640,
                height: 192,
            },
            frames: vec![1],
            frame_distance_m: 0.0,
            reprojection: Reprojection::Bidirectional,
            reversed_pose: ReversedPose::Predicted,
            stereo: false,
            batch: 12,
            depth_batch: 0,
            accumulate: 1,
            epochs: 20,
            steps: None,
            min_steps: MIN_STEPS,
            learning_rate: 1e-4,
            learning_rate_warmup_steps: 0,
            learning_rate_schedule: LearningRateSchedule::Drop,
            learning_rate_steps: None,
            learning_rate_drop: 0.75,
            weight_decay: 0.0,
            clip_norm: 10.0,
            seed: 0,
            precision: Precision::F32,
            init: None,
            init_sha256: None,
            min_speed_mps: 0.5,
            validation_share: 0.1,
            validate_every: 0,
            checkpoint_minutes: 10.0,
            start_moving: false,
            view_motion: ViewMotion::PoseNet,
            canonical_focal_px: None,
            assumed_camera: None,
            freeze: Vec::new(),
            data: DataConfig::default(),
            loss: LossConfig {
                ssim_weight: 0.85,
                compare_at: CompareAt::Full,
                smoothness: 1e-3,
                speed: 0.2,
                rotation: 0.0,
                speed_warmup_steps: 500,
                automask: true,
                explainability: 0.0,
                affine: 0.0,
                flow: FlowLossConfig::default(),
                moving: MovingConfig::default(),
                depth: DepthLossConfig::default(),
            },
            augmentation: Augmentation {
                flip: true,
                jitter: 0.5,
                brightness: 0.2,
                hue: 0.1,
                zoom: 1.0,
                sizes: Vec::new(),
                video_sizes: Vec::new(),
            },
            depth_net: DepthNetConfig::new(depth),
            pose_net: PoseNetConfig {
                // Measured from the data when training starts.
                metres_per_unit: 0.0,
                ..PoseNetConfig::new(depth)
            },
            flow_decoder: FlowDecoderConfig::default(),
        };
        let lite_mono = |size: LiteMonoSize| TrainConfig {
            preset: self,
            epochs: 35,
            learning_rate: 5e-4,
            learning_rate_schedule: LearningRateSchedule::Cosine,
            weight_decay: 1e-2,
            depth_net: DepthNetConfig::lite_mono(size),
            ..Self::Monodepth2.config()
        };
        // Lite-Mono's AdamW and gradient clipping. Its one-cycle schedule is closest to a cosine with warm-up.
        let r_msfm = |iterations: usize| TrainConfig {
            preset: self,
            epochs: 40,
            learning_rate_schedule: LearningRateSchedule::Cosine,
            weight_decay: 5e-5,
            clip_norm: 1.0,
            depth_net: DepthNetConfig::r_msfm(iterations),
            ..Self::Monodepth2.config()
        };
        let monodepth2 = |depth: ResNetDepth| {
            let mut config = base(depth);
            config.frames = vec![-1, 1];
            config.reprojection = Reprojection::Minimum;
            config.depth_net = DepthNetConfig {
                // A metric pose needs an initial depth that keeps pixels in view.
                initial_depth_m: Some(10.0),
                ..DepthNetConfig::monodepth2(depth)
            };
            config.pose_net = PoseNetConfig {
                metres_per_unit: 0.0,
                ..PoseNetConfig::monodepth2(depth)
            };
            config
        };
        match self {
            Self::RMsfm3 => r_msfm(3),
            Self::RMsfm6 => r_msfm(6),
            Self::Sfmlearner => {
                let mut config = monodepth2(ResNetDepth::ResNet18);
                config.size = InputSize {
                    width: 416,
                    height: 128,
                };
                config.batch = 4;
                // SfMLearner's learning rate does not fall.
                (config.learning_rate, config.learning_rate_drop) = (2e-4, 1.0);
                config.depth_net = DepthNetConfig::disp_net();
                // Every source counts, weighted by its mask.
                config.reprojection = Reprojection::Mean;
                config.pose_net.explainability = true;
                config.loss.explainability = 0.2;
                (config.loss.ssim_weight, config.loss.automask) = (0.0, false);
                config
            }
            Self::LiteMono => lite_mono(LiteMonoSize::Full),
            Self::LiteMonoSmall => lite_mono(LiteMonoSize::Small),
            Self::LiteMonoTiny => lite_mono(LiteMonoSize::Tiny),
            Self::LiteMono8m => lite_mono(LiteMonoSize::EightM),
            Self::Tiny => {
                let narrow = |config: ResNetConfig| config.with_base_width(32);
                let mut config = base(ResNetDepth::ResNet18);
                config.size = InputSize {
                    width: 320,
                    height: 96,
                };
                config.batch = 4;
                config.learning_rate = 1e-3;
                config.learning_rate_warmup_steps = 100;
                config.reversed_pose = ReversedPose::Inverted;
                config.start_moving = true;
                config.view_motion = ViewMotion::Auto;
                config.depth_net.encoder = narrow(config.depth_net.encoder);
                config.depth_net.decoder = DecoderConfig {
                    widths: [128, 64, 32, 16, 16],
                };
                config.pose_net.encoder = narrow(config.pose_net.encoder).with_base_width(16);
                config
            }
            Self::Light => {
                let mut config = base(ResNetDepth::ResNet18);
                config.reversed_pose = ReversedPose::Inverted;
                config.start_moving = true;
                config.view_motion = ViewMotion::Auto;
                config
            }
            Self::Resnet50 => base(ResNetDepth::ResNet50),
            Self::Paper => {
                let mut config = base(ResNetDepth::ResNet50);
                config.depth_net = DepthNetConfig::paper();
                config.loss = config.loss.with_every_term();
                config
            }
            Self::Monodepth2 => monodepth2(ResNetDepth::ResNet18),
            Self::Monodepth2R50 => monodepth2(ResNetDepth::ResNet50),
        }
    }
}

impl std::fmt::Display for Preset {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(self.name())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A processor trains on small images. On a GPU, or without training, the sizes are the published ones.
    #[test]
    fn sizes_follow_the_device() {
        for preset in Preset::ALL {
            let on = |compute| {
                let config = preset.config_on(compute);
                config.validate().unwrap();
                (config.size.width, config.size.height, config.batch)
            };
            assert_eq!(on(Compute::Processor), (320, 96, 4), "{preset}");
            let full = match preset {
                Preset::Tiny => (320, 96, 4),
                Preset::Sfmlearner => (416, 128, 4),
                _ => (640, 192, 12),
            };
            assert_eq!(on(Compute::Gpu), full, "{preset}");
            assert_eq!(preset.config_on(Compute::Gpu), preset.config());
        }
    }

    #[test]
    fn every_preset_is_valid_and_survives_its_file() {
        for preset in Preset::ALL {
            let config = preset.config();
            config.validate().unwrap();
            let text = config.to_toml().unwrap();
            assert!(text.contains(&format!("preset = \"{preset}\"\n")), "{text}");
            assert_eq!(
                toml::from_str::<TrainConfig>(&text).unwrap(),
                config,
                "{text}"
            );
        }
    }
}
