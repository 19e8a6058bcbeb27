//! Intermediate feature maps of a trained network, as in the paper's Fig. 5.

use burn::tensor::{Device, Tensor, TensorData};
use deepfusion_nn::{DepthNet, InputSize};
use deepfusion_runtime::{FeatureMap, LayerMaps};

use crate::runner::depth_net;
use crate::{Error, StoredNetwork};

/// Computes a depth network's intermediate feature maps, always in Burn, whichever engine predicts.
#[derive(Debug)]
pub struct Inspector {
    net: DepthNet,
    device: Device,
}

impl Inspector {
    /// An inspector of a network, on a device.
    ///
    /// # Errors
    /// [`Error::Model`] for weights of another architecture.
    pub fn new(network: &StoredNetwork, device: &Device) -> Result<Self, Error> {
        Ok(Self {
            net: depth_net(&network.config, &network.weights, device)?,
            device: device.clone(),
        })
    }

    /// The maps of the encoder's five features, fine to coarse.
    ///
    /// # Shapes
    /// - `image`: 3×H×W at `size`, RGB in [0, 1], channel by channel
    ///
    /// # Panics
    /// When the image has another size.
    #[must_use]
    pub fn inspect(&self, image: &[f32], size: InputSize) -> Vec<LayerMaps> {
        let shape = [1, 3, size.height, size.width];
        let image = Tensor::from_data(TensorData::new(image.to_vec(), shape), &self.device);
        let seen = self.net.inspect(image);
        let has_context = !self.net.hce.is_empty() || !self.net.attention.is_empty();
        let levels = seen.features.into_iter().zip(seen.refined).enumerate();
        levels
            .map(|(level, (feature, refined))| LayerMaps {
                feature: magnitude(feature),
                refined: (has_context && level > 0).then(|| magnitude(refined)),
                attention: level
                    .checked_sub(1)
                    .and_then(|k| seen.masks.get(k))
                    .map(|masks| {
                        let channel: Vec<f32> = masks.channel.clone().into_data().iter().collect();
                        let ends = channel
                            .iter()
                            .fold([1.0_f32, 0.0], |[low, high], v| [low.min(*v), high.max(*v)]);
                        (map_of(masks.spatial.clone()), ends)
                    }),
            })
            .collect()
    }
}

/// Mean of |x| over the channels.
fn magnitude(x: Tensor<4>) -> FeatureMap {
    map_of(x.abs().mean_dim(1))
}

/// The only channel of the only image.
fn map_of(x: Tensor<4>) -> FeatureMap {
    let [_, _, height, width] = x.dims();
    FeatureMap {
        width,
        height,
        values: x.into_data().iter().collect(),
    }
}
