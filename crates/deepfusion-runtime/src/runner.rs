//! What runs a trained depth network: the fused engine, ONNX Runtime, or whatever else gives disparities.

use std::fmt::Debug;
use std::time::Duration;

use deepfusion_geometry::DepthRange;

use crate::Error;

/// Runs a depth network of one input size, one image at a time. A thread has one of its own: [`Self::another`].
pub trait DepthRunner: Debug + Send + Sync {
    /// What reports call it.
    fn name(&self) -> &'static str;

    /// What the network says of an image, in place of what `output` holds.
    ///
    /// # Shapes
    /// - `image`: 3×H×W at network size, RGB in [0, 1], channel by channel
    ///
    /// # Errors
    /// [`Error::ImageSize`] for an image of another size; where a library that runs the network fails.
    fn run(&mut self, image: &[f32], output: &mut NetworkOutput) -> Result<(), Error>;

    /// Another one on the same weights, with buffers of its own.
    ///
    /// # Errors
    /// Where memory has no room for them.
    fn another(&self) -> Result<Box<dyn DepthRunner>, Error>;

    /// Metric disparity alone, as [`Self::run`] gives it.
    ///
    /// # Errors
    /// As [`Self::run`].
    fn disparity(&mut self, image: &[f32]) -> Result<Vec<f32>, Error> {
        let mut output = NetworkOutput::default();
        self.run(image, &mut output)?;
        Ok(output.disparity)
    }

    /// Whether [`NetworkOutput::log_scale`] is there of a network that has the head for it.
    fn tells_uncertainty(&self) -> bool {
        true
    }

    /// Runs once and says what each step took, by name; `None` where the engine cannot say.
    fn profile(&mut self, image: &[f32]) -> Option<Vec<(String, Duration)>> {
        let _ = image;
        None
    }
}

/// What a network says of an image, pixel by pixel, row by row.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct NetworkOutput {
    /// Metric disparity, 1/m, H×W.
    pub disparity: Vec<f32>,
    /// ln b, H×W, b the Laplace scale of the error of ln depth; `None` where the network, or what runs it, does not say.
    pub log_scale: Option<Vec<f32>>,
}

/// Sigmoid disparity to metric disparity, in place: d = 1/D_max + (1/D_min − 1/D_max)·σ.
pub fn metric_disparity(range: DepthRange, sigmoid: &mut [f32]) {
    for value in sigmoid {
        *value = range.disparity(f64::from(*value)) as f32;
    }
}

/// That an image has as many values as the network takes.
pub(crate) fn check_image(image: &[f32], expected: usize) -> Result<(), Error> {
    let found = image.len();
    if found == expected {
        Ok(())
    } else {
        Err(Error::ImageSize { expected, found })
    }
}
