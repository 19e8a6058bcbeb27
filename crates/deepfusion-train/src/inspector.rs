//! What a trained network sees on the way to depth: the paper's Fig. 5.

use burn::tensor::{Device, Tensor, TensorData};
use deepfusion_nn::{DepthNet, InputSize};

use crate::{Error, StoredNetwork};

/// A map over the image, as coarse as the layer it comes from.
#[derive(Debug, Clone, PartialEq)]
pub struct FeatureMap {
    /// Pixels of a row.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// H×W, row by row.
    pub values: Vec<f32>,
}

/// Where a network looks in an image, from one layer of its encoder.
#[derive(Debug, Clone, PartialEq)]
pub struct LayerMaps {
    /// Mean magnitude of the encoder's feature over its channels.
    pub feature: FeatureMap,
    /// The same of what the decoder reads, where context or attention make it another one.
    pub refined: Option<FeatureMap>,
    /// The spatial mask and the least and greatest value of the channel mask, where there is attention.
    pub attention: Option<(FeatureMap, [f32; 2])>,
}

/// Shows what a depth network computes within. It runs in Burn, beside whatever engine predicts.
#[derive(Debug)]
pub struct Inspector {
    net: DepthNet,
    device: Device,
}

impl Inspector {
    /// For a network, on a device.
    ///
    /// # Errors
    /// As [`StoredNetwork::build`].
    pub fn new(network: &StoredNetwork, device: &Device) -> Result<Self, Error> {
        Ok(Self {
            net: network.build(device)?,
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
