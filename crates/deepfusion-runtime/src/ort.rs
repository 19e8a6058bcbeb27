use std::path::{Path, PathBuf};
use std::sync::Arc;

use deepfusion_model::weights::Weights;
use deepfusion_model::{TrainConfig, depth_graph};
use deepfusion_onnx::runtime::OrtEngine;
use deepfusion_onnx::{DepthModel, write};

use crate::runner::check_image;
use crate::{DepthRunner, Error, NetworkOutput, RunnerPlan};

/// The network as an ONNX model in the user's ONNX Runtime.
#[derive(Debug)]
pub struct OrtRunner {
    engine: OrtEngine,
    /// The serialised model, for more sessions.
    model: Arc<[u8]>,
    library: Option<PathBuf>,
    pixels: usize,
    /// The image as the model's input: H×W×3 bytes.
    rgb: Vec<u8>,
}

impl OrtRunner {
    /// The network with this configuration and these weights, in an ONNX Runtime library: the given one, or the one found on this system.
    ///
    /// # Errors
    /// [`Error::Model`] for weights of another network; [`Error::Onnx`] if there is no library, or it rejects the model.
    pub fn new(
        library: Option<&Path>,
        config: &TrainConfig,
        weights: Weights,
    ) -> Result<Self, Error> {
        let bytes = write(&DepthModel {
            graph: depth_graph(&config.depth_net, weights)?,
            range: config.depth_net.range,
            width: config.size.width,
            height: config.size.height,
            trained_with: None,
            canonical: false,
        })?;
        let pixels = config.size.width * config.size.height;
        Self::open(library, bytes.into(), pixels)
    }

    fn open(library: Option<&Path>, model: Arc<[u8]>, pixels: usize) -> Result<Self, Error> {
        Ok(Self {
            engine: OrtEngine::load(library, &model, rayon::current_num_threads())?,
            model,
            library: library.map(Path::to_owned),
            pixels,
            rgb: Vec::new(),
        })
    }
}

impl DepthRunner for OrtRunner {
    fn name(&self) -> &'static str {
        "ort"
    }

    /// An exported model outputs only the depth.
    fn predicts_uncertainty(&self) -> bool {
        false
    }

    fn run(&mut self, image: &[f32], output: &mut NetworkOutput) -> Result<(), Error> {
        check_image(image, 3 * self.pixels)?;
        // The model takes bytes, and an image's values are bytes / 255.
        let byte = |i: usize| (image[i % 3 * self.pixels + i / 3] * 255.0).round() as u8;
        self.rgb.clear();
        self.rgb.extend((0..3 * self.pixels).map(byte));
        output.log_scale = None;
        output.disparity.resize(self.pixels, 0.0);
        let done = self.engine.run(&self.rgb, &mut output.disparity);
        done.map_err(|error| Error::engine("ort", error))
    }

    fn plan(&self) -> Arc<dyn RunnerPlan> {
        Arc::new(OrtPlan {
            library: self.library.clone(),
            model: Arc::clone(&self.model),
            pixels: self.pixels,
        })
    }
}

/// Each session of ONNX Runtime packs the model anew.
#[derive(Debug)]
struct OrtPlan {
    library: Option<PathBuf>,
    model: Arc<[u8]>,
    pixels: usize,
}

impl RunnerPlan for OrtPlan {
    fn runner(&self) -> Result<Box<dyn DepthRunner>, Error> {
        let (library, model) = (self.library.as_deref(), Arc::clone(&self.model));
        Ok(Box::new(OrtRunner::open(library, model, self.pixels)?))
    }
}
