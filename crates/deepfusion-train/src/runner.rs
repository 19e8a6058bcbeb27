//! What runs a trained depth network: Burn, the fused engine, or whatever else gives disparities.

use std::fmt::Debug;
use std::sync::{Mutex, PoisonError};
use std::time::Duration;

use burn::tensor::{Device, Tensor, TensorData};
use deepfusion_geometry::DepthRange;
use deepfusion_infer::{Engine, Precision};
use deepfusion_nn::weights::{self, Weights};
use deepfusion_nn::{DepthNet, InputSize, depth_graph};

use crate::{Error, TrainConfig};

/// Runs a depth network, one image at a time, from any thread; but not from many tasks of rayon's at once: while one
/// of them waits for the network's own parallel work, its thread may begin another, which then waits for the first.
pub trait DepthRunner: Debug + Send + Sync {
    /// What reports call it.
    fn name(&self) -> &'static str;

    /// Metric disparity, 1/m, of an image.
    ///
    /// # Shapes
    /// - `image`: 3×H×W at network size, RGB in [0, 1], channel by channel
    /// - output: H×W, row by row
    ///
    /// # Errors
    /// Where a library that runs the network fails.
    fn disparity(&self, image: &[f32]) -> Result<Vec<f32>, Error>;

    /// Runs once and tells what each step took, by name; `None` where the engine cannot say.
    fn profile(&self, image: &[f32]) -> Option<Vec<(String, Duration)>> {
        let _ = image;
        None
    }
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
        let net = weights::apply(config.depth_net.init(device)?, weights)?;
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

    fn disparity(&self, image: &[f32]) -> Result<Vec<f32>, Error> {
        let shape = [1, 3, self.size.height, self.size.width];
        let image = Tensor::from_data(TensorData::new(image.to_vec(), shape), &self.device);
        let sigmoid = self.net.forward(image).swap_remove(0).into_data();
        Ok(metric(self.range, sigmoid.iter::<f32>()))
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
        let graph = depth_graph(&config.depth_net, weights)?;
        let engine = Engine::new(graph, config.size.width, config.size.height, precision);
        Ok(Self {
            engine: Mutex::new(engine.map_err(|e| Error::engine("fused", &e))?),
            precision,
            range: config.depth_net.range,
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

    fn disparity(&self, image: &[f32]) -> Result<Vec<f32>, Error> {
        let mut engine = self.engine.lock().unwrap_or_else(PoisonError::into_inner);
        engine.run(image);
        Ok(metric(self.range, engine.output(0).into_iter()))
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
