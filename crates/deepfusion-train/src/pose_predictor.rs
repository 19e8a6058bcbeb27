use crate::{CheckpointKind, Checkpoints, Error, RunFolder, TrainConfig};
use burn::tensor::{Device, Tensor, TensorData};
use deepfusion_data::{RgbImage, to_network_input};
use deepfusion_geometry::{Intrinsics, Se3};
use deepfusion_nn::PoseNet;
use nalgebra::Vector3;
use std::path::Path;

/// A trained pose network, ready for consecutive images of a drive.
///
/// It does not correct for a camera other than that of the training: PoseNet sees pixels, and with another focal length the same motion
/// moves them differently.
#[derive(Debug)]
pub struct PosePredictor {
    config: TrainConfig,
    camera: Option<Intrinsics>,
    pose_net: PoseNet,
    device: Device,
    /// The checkpoint it was loaded from.
    pub checkpoint: CheckpointKind,
    /// Steps it was trained for.
    pub step: usize,
}

impl PosePredictor {
    /// Loads a run's folder or a checkpoint in it; a folder means its `best` checkpoint if there is
    /// one. `set` names one of the data sets the run learned from, if there are several.
    ///
    /// # Errors
    /// [`Error::NoPoseNet`] for a run without PoseNet or an imported depth network; [`deepfusion_model::Error::EncodersOnly`]; as
    /// [`RunFolder::open`], [`Checkpoints::load`] and [`TrainConfig::for_set`].
    pub fn load(path: &Path, set: Option<&str>, device: &Device) -> Result<Self, Error> {
        let (folder, kind) = RunFolder::open(path)?;
        let config = folder.read_config()?;
        let camera = folder.read_findings()?.camera_of(&config, set);
        let config = config.for_set(set)?;
        let checkpoint = kind.unwrap_or_else(|| folder.preferred());
        let none = || Error::NoPoseNet {
            run: path.to_owned(),
        };
        if !folder.has_pose_net(checkpoint)? {
            return Err(none());
        }
        let (model, _, state) = folder.load(checkpoint, &config, device)?;
        state.require_trained(&folder.checkpoint_path(checkpoint))?;
        let pose_net = model.pose_net.ok_or_else(none)?;
        Ok(Self {
            config,
            camera,
            pose_net,
            device: device.clone(),
            checkpoint,
            step: state.step,
        })
    }

    /// The run's configuration.
    #[must_use]
    pub fn config(&self) -> &TrainConfig {
        &self.config
    }

    /// The camera of the training, at the size of its images; `None` for imported weights.
    #[must_use]
    pub fn training_camera(&self) -> Option<Intrinsics> {
        self.camera
    }

    /// An image as network input, as in training: the whole image, resized.
    ///
    /// # Shapes
    /// - output: 3×H×W at network size, in [0, 1], channel by channel
    #[must_use]
    pub fn prepare(&self, image: &RgbImage) -> Vec<f32> {
        let whole = [0, 0, image.width(), image.height()];
        let size = self.config.size;
        to_network_input(image, whole, size.width as u32, size.height as u32)
    }

    /// `frame(i+1)_from_frame(i)` of prepared images in time order: one motion fewer than images.
    ///
    /// # Shapes
    /// - `images`: 3×H×W at network size each
    #[must_use]
    pub fn motions(&self, images: &[Vec<f32>]) -> Vec<Se3> {
        let pairs: Vec<f32> = images
            .windows(2)
            .flat_map(|pair| pair[0].iter().chain(&pair[1]).copied())
            .collect();
        let n = images.len().saturating_sub(1);
        if n == 0 {
            return Vec::new();
        }
        let size = self.config.size;
        let shape = [n, 6, size.height, size.width];
        let stacked = Tensor::<4>::from_data(TensorData::new(pairs, shape), &self.device);
        let pose = self.pose_net.forward(stacked);
        let numbers = |t: Tensor<2>| -> Vec<f64> { t.into_data().iter::<f64>().collect() };
        let (turns, moves) = (numbers(pose.axis_angle), numbers(pose.translation));
        turns
            .chunks_exact(3)
            .zip(moves.chunks_exact(3))
            .map(|(r, t)| {
                Se3::from_axis_angle(Vector3::from_column_slice(r), Vector3::from_column_slice(t))
            })
            .collect()
    }
}
