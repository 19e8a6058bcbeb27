//! The interface of the engines that run a trained depth network: the fused engine, ONNX Runtime, Burn.

use std::fmt::Debug;
use std::sync::Arc;
use std::time::Duration;

use deepfusion_geometry::DepthRange;

use crate::Error;

/// Runs a depth network of one input size, one image at a time. Every thread has its own: [`Self::another`].
pub trait DepthRunner: Debug + Send + Sync {
    /// Its name for reports.
    fn name(&self) -> &'static str;

    /// Runs the network on an image and writes the result into `output`.
    ///
    /// # Shapes
    /// - `image`: 3×H×W at network size, RGB in [0, 1], channel by channel
    ///
    /// # Errors
    /// [`Error::ImageSize`] for an image of another size; [`Error::Engine`] or [`Error::Onnx`] if the network fails to run.
    fn run(&mut self, image: &[f32], output: &mut NetworkOutput) -> Result<(), Error>;

    /// What it shares with runners on other threads: the weights as packed by the fused engine, without its buffers.
    fn plan(&self) -> Arc<dyn RunnerPlan>;

    /// A second runner on the same weights, with its own buffers.
    ///
    /// # Errors
    /// If there is no memory for them.
    fn another(&self) -> Result<Box<dyn DepthRunner>, Error> {
        self.plan().runner()
    }

    /// Like [`Self::run`], but returns only the metric disparity.
    ///
    /// # Errors
    /// As for [`Self::run`].
    fn disparity(&mut self, image: &[f32]) -> Result<Vec<f32>, Error> {
        let mut output = NetworkOutput::default();
        self.run(image, &mut output)?;
        Ok(output.disparity)
    }

    /// Whether it sets [`NetworkOutput::log_scale`] for a network with an uncertainty head.
    fn predicts_uncertainty(&self) -> bool {
        true
    }

    /// Peak of the GPU memory it has used, in bytes; `None` on a processor, or if the GPU's allocator does not report it.
    fn peak_device_bytes(&self) -> Option<u64> {
        None
    }

    /// Runs once and returns each step's name and duration; `None` if the engine cannot measure them.
    fn profile(&mut self, image: &[f32]) -> Option<Vec<(String, Duration)>> {
        let _ = image;
        None
    }
}

/// A network packed for one input size, from which any thread can create its own runner.
pub trait RunnerPlan: Debug + Send + Sync {
    /// A runner with its own buffers.
    ///
    /// # Errors
    /// If there is no memory for them.
    fn runner(&self) -> Result<Box<dyn DepthRunner>, Error>;
}

/// A network's output for an image, row by row.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct NetworkOutput {
    /// Metric disparity, 1/m, H×W.
    pub disparity: Vec<f32>,
    /// ln b, H×W, with b the Laplace scale of the error of ln depth; `None` if the network or its runner does not predict it.
    pub log_scale: Option<Vec<f32>>,
}

/// A map over the image, at the resolution of the layer it comes from.
#[derive(Debug, Clone, PartialEq)]
pub struct FeatureMap {
    /// Width in pixels of the map.
    pub width: usize,
    /// Height in pixels of the map.
    pub height: usize,
    /// H×W, row by row.
    pub values: Vec<f32>,
}

/// Feature and attention maps of one layer of a network's encoder.
#[derive(Debug, Clone, PartialEq)]
pub struct LayerMaps {
    /// Mean magnitude of the encoder's feature over its channels.
    pub feature: FeatureMap,
    /// The same for the feature that the decoder reads, if context or attention change it.
    pub refined: Option<FeatureMap>,
    /// The spatial mask, and the smallest and largest value of the channel mask, if there is attention.
    pub attention: Option<(FeatureMap, [f32; 2])>,
}

/// Sigmoid disparity to metric disparity, in place: d = 1/D_max + (1/D_min − 1/D_max)·σ.
pub fn metric_disparity(range: DepthRange, sigmoid: &mut [f32]) {
    for value in sigmoid {
        *value = range.disparity(f64::from(*value)) as f32;
    }
}

/// Checks that an image has as many values as the network expects.
pub(crate) fn check_image(image: &[f32], expected: usize) -> Result<(), Error> {
    let found = image.len();
    if found == expected {
        Ok(())
    } else {
        Err(Error::ImageSize { expected, found })
    }
}
