use std::sync::Arc;
use std::time::Duration;

use deepfusion_geometry::DepthRange;
use deepfusion_infer::{Engine, EnginePlan, Precision, SeenInputs};
use deepfusion_model::weights::Weights;
use deepfusion_model::{Int8Calibration, TrainConfig, depth_graph_with_uncertainty};

use crate::runner::check_image;
use crate::{DepthRunner, Error, NetworkOutput, RunnerPlan, metric_disparity};

/// A network that was laid out and packed once for this processor.
///
/// Its sigmoid differs from the training framework's in f32 only by rounding (below 1e-4 in the tests), in bf16 by the rounding to eight
/// bits of mantissa, and in int8 by quantisation to 255 steps of each convolution's input and of each channel's weights.
#[derive(Debug)]
pub struct FusedRunner {
    engine: Engine,
    precision: Precision,
    range: DepthRange,
    uncertainty: bool,
}

impl FusedRunner {
    /// The network with this configuration and these weights, in f32 or bf16.
    ///
    /// # Errors
    /// As for [`Self::with_calibration`].
    pub fn new(
        config: &TrainConfig,
        weights: Weights,
        precision: Precision,
    ) -> Result<Self, Error> {
        Self::with_calibration(config, weights, precision, None)
    }

    /// Like [`Self::new`], in any precision: int8 needs a calibration of the network.
    ///
    /// # Errors
    /// [`Error::Model`] for weights of another network, [`Error::Engine`] if the processor lacks bf16 or int8, [`Error::NotCalibrated`] for
    /// int8 without a calibration.
    pub fn with_calibration(
        config: &TrainConfig,
        weights: Weights,
        precision: Precision,
        int8: Option<&Int8Calibration>,
    ) -> Result<Self, Error> {
        let mut graph = depth_graph_with_uncertainty(&config.depth_net, weights)?;
        if precision == Precision::Int8 {
            // Checked first: a calibration does not help if the processor lacks int8.
            Self::check_int8()?;
            let set = graph.set_input_ranges(&int8.ok_or(Error::NotCalibrated)?.ranges);
            set.map_err(|e| Error::engine("fused-int8", e))?;
        }
        let engine = Engine::new(graph, config.size.width, config.size.height, precision);
        Ok(Self {
            engine: engine.map_err(|e| Error::engine("fused", e))?,
            precision,
            range: config.depth_net.range,
            uncertainty: config.depth_net.uncertainty,
        })
    }

    /// Checks that this processor can compute in int8.
    ///
    /// # Errors
    /// [`Error::Engine`] if it cannot.
    pub fn check_int8() -> Result<(), Error> {
        if Engine::has_int8() {
            return Ok(());
        }
        Err(Error::engine("fused-int8", deepfusion_infer::Error::NoInt8))
    }

    /// Names of the network's convolutions that are computed in int8.
    ///
    /// # Errors
    /// [`Error::Model`] for weights of another network.
    pub fn computed_in_int8(config: &TrainConfig, weights: Weights) -> Result<Vec<String>, Error> {
        let graph = depth_graph_with_uncertainty(&config.depth_net, weights)?;
        Ok(graph.computed_in_int8().map(str::to_owned).collect())
    }

    /// Runs the network on an image and collects the distribution of its convolutions' input values, for int8.
    ///
    /// # Errors
    /// [`Error::ImageSize`].
    ///
    /// # Shapes
    /// - `image`: as in [`DepthRunner::run`]
    pub fn observe(&mut self, image: &[f32], seen: &mut SeenInputs) -> Result<(), Error> {
        check_image(image, self.values())?;
        self.engine.observe(image, seen);
        Ok(())
    }

    fn values(&self) -> usize {
        let (width, height) = self.engine.size();
        3 * width * height
    }
}

impl DepthRunner for FusedRunner {
    fn name(&self) -> &'static str {
        match self.precision {
            Precision::F32 => "fused",
            Precision::Bf16 => "fused-bf16",
            Precision::Int8 => "fused-int8",
        }
    }

    fn run(&mut self, image: &[f32], output: &mut NetworkOutput) -> Result<(), Error> {
        check_image(image, self.values())?;
        self.engine.run(image);
        self.engine.read_output(0, &mut output.disparity);
        metric_disparity(self.range, &mut output.disparity);
        if self.uncertainty {
            let log_scale = output.log_scale.get_or_insert_default();
            self.engine.read_output(1, log_scale);
        } else {
            output.log_scale = None
        }
        Ok(())
    }

    fn plan(&self) -> Arc<dyn RunnerPlan> {
        Arc::new(FusedPlan {
            engine: self.engine.plan(),
            precision: self.precision,
            range: self.range,
            uncertainty: self.uncertainty,
        })
    }

    fn profile(&mut self, image: &[f32]) -> Option<Vec<(String, Duration)>> {
        check_image(image, self.values()).ok()?;
        Some(self.engine.profile(image))
    }
}

#[derive(Debug)]
struct FusedPlan {
    engine: EnginePlan,
    precision: Precision,
    range: DepthRange,
    uncertainty: bool,
}

impl RunnerPlan for FusedPlan {
    fn runner(&self) -> Result<Box<dyn DepthRunner>, Error> {
        let engine = self.engine.engine();
        Ok(Box::new(FusedRunner {
            engine: engine.map_err(|e| Error::engine("fused", e))?,
            precision: self.precision,
            range: self.range,
            uncertainty: self.uncertainty,
        }))
    }
}
