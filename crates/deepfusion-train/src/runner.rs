//! What runs a trained depth network: Burn, the fused engine, or whatever else gives disparities.

use std::fmt::Debug;
use std::sync::{Mutex, PoisonError};
use std::time::Duration;

use burn::tensor::{Device, Tensor, TensorData};
use deepfusion_geometry::DepthRange;
use deepfusion_infer::{Engine, Precision};
use deepfusion_nn::weights::Weights;
use deepfusion_nn::{DepthNet, InputSize, depth_graph_with_uncertainty};

use crate::{Error, TrainConfig};

/// Runs a depth network, one image at a time, from any thread; but not from many tasks of rayon's at once: while one
/// of them waits for the network's own parallel work, its thread may begin another, which then waits for the first.
pub trait DepthRunner: Debug + Send + Sync {
    /// What reports call it.
    fn name(&self) -> &'static str;

    /// What the network says of an image.
    ///
    /// # Shapes
    /// - `image`: 3×H×W at network size, RGB in [0, 1], channel by channel
    ///
    /// # Errors
    /// Where a library that runs the network fails.
    fn run(&self, image: &[f32]) -> Result<NetworkOutput, Error>;

    /// Metric disparity alone, as [`Self::run`] gives it.
    ///
    /// # Errors
    /// As [`Self::run`].
    fn disparity(&self, image: &[f32]) -> Result<Vec<f32>, Error> {
        Ok(self.run(image)?.disparity)
    }

    /// Whether [`NetworkOutput::log_scale`] is there of a network that has the head for it.
    fn tells_uncertainty(&self) -> bool {
        true
    }

    /// Runs once and tells what each step took, by name; `None` where the engine cannot say.
    fn profile(&self, image: &[f32]) -> Option<Vec<(String, Duration)>> {
        let _ = image;
        None
    }
}

/// What a network says of an image, pixel by pixel, row by row.
#[derive(Debug, Clone, PartialEq)]
pub struct NetworkOutput {
    /// Metric disparity, 1/m, H×W.
    pub disparity: Vec<f32>,
    /// ln b, H×W, b the Laplace scale of the error of ln depth; `None` where the network, or what runs it, does not say.
    pub log_scale: Option<Vec<f32>>,
}

/// The network as it is trained, on any of Burn's devices.
#[derive(Debug)]
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
    /// [`Error::Network`] for weights of another network.
    pub fn new(config: &TrainConfig, weights: &Weights, device: &Device) -> Result<Self, Error> {
        let (net, _) = config.depth_net.init(device)?.with_weights(weights)?;
        Ok(Self {
            net,
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

    fn run(&self, image: &[f32]) -> Result<NetworkOutput, Error> {
        let shape = [1, 3, self.size.height, self.size.width];
        let image = Tensor::from_data(TensorData::new(image.to_vec(), shape), &self.device);
        let mut seen = self.net.forward_with_uncertainty(image);
        let sigmoid = seen.disparities.swap_remove(0).into_data();
        Ok(NetworkOutput {
            disparity: metric(self.range, sigmoid.iter::<f32>()),
            log_scale: seen.log_scale.map(|b| b.into_data().iter().collect()),
        })
    }
}

/// The network laid out and packed once for this processor.
///
/// In f32 its sigmoid differs from [`BurnRunner`]'s by rounding alone (below 1e-4 in the tests); in
/// bf16 by what eight bits of mantissa lose.
#[derive(Debug)]
pub struct FusedRunner {
    engine: Mutex<Engine>,
    precision: Precision,
    range: DepthRange,
    uncertainty: bool,
}

impl FusedRunner {
    /// The network of a configuration with these weights.
    ///
    /// # Errors
    /// [`Error::Network`] for weights of another network, [`Error::Engine`] where the processor has no bf16.
    pub fn new(
        config: &TrainConfig,
        weights: Weights,
        precision: Precision,
    ) -> Result<Self, Error> {
        let graph = depth_graph_with_uncertainty(&config.depth_net, weights)?;
        let engine = Engine::new(graph, config.size.width, config.size.height, precision);
        Ok(Self {
            engine: Mutex::new(engine.map_err(|e| Error::engine("fused", &e))?),
            precision,
            range: config.depth_net.range,
            uncertainty: config.depth_net.uncertainty,
        })
    }
}

impl DepthRunner for FusedRunner {
    fn name(&self) -> &'static str {
        match self.precision {
            Precision::F32 => "fused",
            Precision::Bf16 => "fused-bf16",
        }
    }

    fn run(&self, image: &[f32]) -> Result<NetworkOutput, Error> {
        let mut engine = self.engine.lock().unwrap_or_else(PoisonError::into_inner);
        engine.run(image);
        Ok(NetworkOutput {
            disparity: metric(self.range, engine.output(0).into_iter()),
            log_scale: self.uncertainty.then(|| engine.output(1)),
        })
    }

    fn profile(&self, image: &[f32]) -> Option<Vec<(String, Duration)>> {
        let mut engine = self.engine.lock().unwrap_or_else(PoisonError::into_inner);
        Some(engine.profile(image))
    }
}

/// d = 1/D_max + (1/D_min − 1/D_max)·σ.
fn metric(range: DepthRange, sigmoid: impl Iterator<Item = f32>) -> Vec<f32> {
    sigmoid
        .map(|s| range.disparity(f64::from(s)) as f32)
        .collect()
}
