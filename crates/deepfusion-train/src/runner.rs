use std::sync::Arc;

use burn::tensor::{Device, Tensor, TensorData};
use deepfusion_geometry::DepthRange;
use deepfusion_nn::weights::Weights;
use deepfusion_nn::{DepthNet, InputSize};
use deepfusion_runtime::{
    DepthRunner, Error as RuntimeError, NetworkOutput, RunnerPlan, metric_disparity,
};

use crate::{Error, TrainConfig};

/// Runs a depth network in Burn, as in training, on any of its devices.
#[derive(Debug, Clone)]
pub struct BurnRunner {
    net: DepthNet,
    range: DepthRange,
    size: InputSize,
    device: Device,
}

impl BurnRunner {
    /// The network of a configuration with these weights.
    ///
    /// # Errors
    /// [`Error::Model`] for weights of another network.
    pub fn new(config: &TrainConfig, weights: &Weights, device: &Device) -> Result<Self, Error> {
        Ok(Self {
            net: depth_net(config, weights, device)?,
            range: config.depth_net.range,
            size: config.size,
            device: device.clone(),
        })
    }
}

impl DepthRunner for BurnRunner {
    fn name(&self) -> &'static str {
        "burn"
    }

    fn run(&mut self, image: &[f32], output: &mut NetworkOutput) -> Result<(), RuntimeError> {
        let shape = [1, 3, self.size.height, self.size.width];
        let (expected, found) = (shape.iter().product(), image.len());
        if found != expected {
            return Err(RuntimeError::ImageSize { expected, found });
        }
        let image = Tensor::from_data(TensorData::new(image.to_vec(), shape), &self.device);
        let mut seen = self.net.forward_with_uncertainty(image);
        let sigmoid = seen.disparities.swap_remove(0).into_data();
        output.disparity.clear();
        output.disparity.extend(sigmoid.iter::<f32>());
        metric_disparity(self.range, &mut output.disparity);
        output.log_scale = seen.log_scale.map(|b| b.into_data().iter().collect());
        Ok(())
    }

    fn peak_device_bytes(&self) -> Option<u64> {
        peak_device_bytes(&self.device)
    }

    fn plan(&self) -> Arc<dyn RunnerPlan> {
        Arc::new(self.clone())
    }
}

impl RunnerPlan for BurnRunner {
    /// The weights' tensors are shared.
    fn runner(&self) -> Result<Box<dyn DepthRunner>, RuntimeError> {
        Ok(Box::new(self.clone()))
    }
}

/// The peak memory that the GPU allocator reserved for this process, in bytes. It includes what is kept for later tensors, as in the GPU
/// vendor's tools. `None` on a processor, or if the allocator does not report it.
#[must_use]
pub fn peak_device_bytes(device: &Device) -> Option<u64> {
    let pools = device.clone().inner().memory_pool_report()?;
    Some(
        pools
            .iter()
            .map(|pool| pool.pages_peak * pool.page_size)
            .sum(),
    )
}

/// The depth network of a configuration with these weights, on a device.
///
/// # Errors
/// [`Error::Model`] for weights of another architecture.
pub fn depth_net(
    config: &TrainConfig,
    weights: &Weights,
    device: &Device,
) -> Result<DepthNet, Error> {
    let net = DepthNet::new(&config.depth_net, device)?;
    Ok(net.with_weights(weights)?.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Preset, StoredNetwork};
    use deepfusion_nn::weights::{collect, write_safetensors};

    #[test]
    fn a_packed_network_has_the_original_weights() {
        let mut config = Preset::Tiny.config();
        config.data.paths = vec!["/data/street".into()];
        config.init = Some("/data/first".into());
        let device = Device::flex();
        let net = DepthNet::with_seed(&config.depth_net, 3, &device).unwrap();
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("street.safetensors");
        let saved = collect(&net);
        write_safetensors(&file, &saved).unwrap();
        let bytes = std::fs::read(&file).unwrap();
        let table = || toml::Table::try_from(config.without_places()).unwrap();
        let packed = StoredNetwork::packed("street", table(), &bytes, 7, None).unwrap();
        assert_eq!(packed.config, config.without_places());
        assert!(packed.config.data.paths.is_empty() && packed.config.init.is_none());
        assert_eq!(packed.config.depth_net, config.depth_net);
        assert_eq!(packed.step, 7);
        let built = depth_net(&packed.config, &packed.weights, &device).unwrap();
        assert!(collect(&built).tensors == saved.tensors);
        // Errors name the network.
        let cut = StoredNetwork::packed("street", table(), &bytes[..bytes.len() / 2], 7, None);
        assert!(cut.unwrap_err().to_string().contains("street"));
        let mut broken = table();
        broken.insert("batch".into(), "many".into());
        let error = StoredNetwork::packed("street", broken, &bytes, 7, None).unwrap_err();
        assert!(error.to_string().contains("street"), "{error}");
    }
}
