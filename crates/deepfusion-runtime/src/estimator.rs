use std::path::Path;
use std::sync::Arc;

use deepfusion_geometry::{DepthMap, Intrinsics};
use deepfusion_images::RgbImage;
use deepfusion_infer::Precision;
use deepfusion_model::weights::Weights;
use deepfusion_model::{InputSize, LOG_SCALE_BOUNDS, StoredNetwork, TrainConfig};

use crate::augmentation::{blend_flipped, mirror};
use crate::other_sizes::OtherSizes;
use crate::resample::Resample;
use crate::{
    Augmentation, DepthRunner, EngineProblem, Error, FusedRunner, ModelSource, NetworkOutput,
    Prediction, PreparedImage, Preparer, View,
};

/// A trained depth network, ready for images. It belongs to one thread; [`Self::another`] makes one for another thread.
#[derive(Debug)]
pub struct DepthEstimator {
    config: Arc<TrainConfig>,
    /// The camera it was trained with.
    camera: Option<Intrinsics>,
    runner: Box<dyn DepthRunner>,
    /// Runners for other input sizes; `None` for a network that runs at one size only.
    others: Option<OtherSizes>,
    /// Number of steps it was trained for.
    pub step: usize,
}

impl DepthEstimator {
    /// Loads a network, for the fused engine in f32, by its path (a run's folder, a checkpoint in it, a packed file) or by the name of an
    /// embedded network. If a run was trained on several data sets, use [`ModelSource::load`] with the name of one, then [`Self::fused`]:
    /// each data set has its own metric scale.
    ///
    /// # Errors
    /// As for [`ModelSource::named`] and [`ModelSource::load`].
    pub fn load(model: impl AsRef<Path>) -> Result<Self, Error> {
        let network = ModelSource::named(model.as_ref())?.load(None)?;
        Self::fused(network, Precision::F32)
    }

    /// An estimator for a stored network in the fused engine.
    ///
    /// # Errors
    /// As for [`FusedRunner::with_calibration`].
    pub fn fused(network: StoredNetwork, precision: Precision) -> Result<Self, Error> {
        let int8 = match precision {
            Precision::Int8 => network.int8.clone()?,
            _ => None,
        };
        Self::of(network, move |config, weights| {
            let runner = FusedRunner::with_calibration(config, weights, precision, int8.as_ref())?;
            Ok::<_, Error>(Box::new(runner) as Box<dyn DepthRunner>)
        })
    }

    /// An estimator for a stored network; `runner` makes its [`DepthRunner`] from configuration and weights.
    ///
    /// A network with a canonical focal length runs at the input size that fits an image ([`crate::fitting`]): its weights are kept, and
    /// `runner` is called again for each other size.
    ///
    /// # Errors
    /// The runner's error.
    pub fn of<E: Into<EngineProblem>>(
        network: StoredNetwork,
        runner: impl Fn(&TrainConfig, Weights) -> Result<Box<dyn DepthRunner>, E>
        + Send
        + Sync
        + 'static,
    ) -> Result<Self, E> {
        let StoredNetwork {
            config,
            camera,
            weights,
            step,
            int8: _,
        } = network;
        let config = Arc::new(config);
        let kept = config.canonical_focal_px.map(|_| weights.clone());
        let own = runner(&config, weights)?;
        let others = kept.map(|weights| {
            let of = Arc::clone(&config);
            OtherSizes::new(move |size| {
                let config = TrainConfig {
                    size,
                    ..of.as_ref().clone()
                };
                runner(&config, weights.clone()).map_err(|e| Error::engine("other size", e))
            })
        });
        Ok(Self {
            runner: own,
            others,
            config,
            camera,
            step,
        })
    }

    /// An estimator for another thread, which shares the weights, including those for input sizes added later, and has its own buffers.
    /// With the fused engine, the packed weights are shared for the first 24 other input sizes; each session of ONNX Runtime packs its own.
    ///
    /// # Errors
    /// As for [`DepthRunner::another`].
    pub fn another(&self) -> Result<Self, Error> {
        let others = self.others.as_ref().map(OtherSizes::another);
        Ok(Self {
            config: Arc::clone(&self.config),
            camera: self.camera,
            runner: self.runner.another()?,
            others: others.transpose()?,
            step: self.step,
        })
    }

    /// The runner at the training size.
    pub fn runner(&mut self) -> &mut dyn DepthRunner {
        &mut *self.runner
    }

    /// Consumes the estimator and returns the runner at the training size.
    #[must_use]
    pub fn into_runner(self) -> Box<dyn DepthRunner> {
        self.runner
    }

    /// The runner's name for reports.
    #[must_use]
    pub fn engine(&self) -> &'static str {
        self.runner.name()
    }

    /// Whether it predicts each pixel's uncertainty ([`Prediction::sigma`]).
    #[must_use]
    pub fn predicts_uncertainty(&self) -> bool {
        self.config.depth_net.uncertainty && self.runner.predicts_uncertainty()
    }

    /// The run's configuration.
    #[must_use]
    pub fn config(&self) -> &TrainConfig {
        &self.config
    }

    /// The camera the network was trained with, at the size of its images; `None` for imported weights.
    #[must_use]
    pub fn training_camera(&self) -> Option<Intrinsics> {
        self.camera
    }

    /// The preparer that turns images into this network's input.
    #[must_use]
    pub fn preparer(&self) -> Preparer {
        Preparer {
            size: self.config.size,
            training_camera: self.camera,
            canonical_focal_px: self.config.canonical_focal_px,
            augmentation: Augmentation::NONE,
        }
    }

    /// A preparer for several predictions of each image (test-time augmentation).
    ///
    /// # Errors
    /// [`Error::OneSize`] for several input sizes of a network that has no canonical focal length.
    pub fn augmented(&self, augmentation: Augmentation) -> Result<Preparer, Error> {
        if augmentation.resizes() && self.others.is_none() {
            return Err(Error::OneSize);
        }
        Ok(Preparer {
            augmentation,
            ..self.preparer()
        })
    }

    /// The metric depth of an image. `camera` is the image's own; without it the training camera is assumed, and the metric scale is only
    /// as good as that assumption.
    ///
    /// # Errors
    /// As for [`DepthRunner::run`].
    pub fn estimate(
        &mut self,
        image: &RgbImage,
        camera: Option<&Intrinsics>,
    ) -> Result<Prediction, Error> {
        self.predict(image, camera, true, true)
    }

    /// Like [`Self::estimate`], but writes the depth in metres, at the image's own size, into `depth`.
    ///
    /// # Errors
    /// As for [`DepthRunner::run`].
    pub fn estimate_into(
        &mut self,
        image: &RgbImage,
        camera: Option<&Intrinsics>,
        depth: &mut DepthMap,
    ) -> Result<(), Error> {
        self.estimate(image, camera)?.depth_into(depth);
        Ok(())
    }

    /// Like [`Self::estimate`], but the caller decides about focal correction and about cropping to the training aspect ratio:
    /// [`Preparer::prepare`], then [`Self::infer`].
    ///
    /// # Errors
    /// As for [`DepthRunner::run`].
    pub fn predict(
        &mut self,
        image: &RgbImage,
        camera: Option<&Intrinsics>,
        focal_correction: bool,
        crop: bool,
    ) -> Result<Prediction, Error> {
        let preparer = self.preparer();
        self.infer(&preparer.prepare(image, camera, focal_correction, crop))
    }

    /// Runs the network on an image that [`Self::preparer`] or [`Self::augmented`] prepared, on any thread. Several views yield the mean of
    /// their disparities, at the size of the largest. The mean of ln b, if the network predicts it, is the uncertainty of a single
    /// prediction, not of the mean disparity.
    ///
    /// # Errors
    /// As for [`DepthRunner::run`].
    pub fn infer(&mut self, image: &PreparedImage) -> Result<Prediction, Error> {
        self.mean_over_views(image, |of, view| of.infer_view(view, image.flip))
    }

    /// Like [`Self::infer`], but of the mirror image alone, mirrored back, so that it can be compared with the image's own prediction pixel
    /// by pixel.
    ///
    /// # Errors
    /// As for [`DepthRunner::run`].
    pub fn infer_mirrored(&mut self, image: &PreparedImage) -> Result<Prediction, Error> {
        self.mean_over_views(image, Self::run_mirrored)
    }

    fn mean_over_views(
        &mut self,
        image: &PreparedImage,
        run: impl Fn(&mut Self, &View) -> Result<NetworkOutput, Error>,
    ) -> Result<Prediction, Error> {
        let Some(&View {
            size, focal_factor, ..
        }) = image.largest()
        else {
            return Err(Error::ImageSize {
                expected: 3 * self.config.size.width * self.config.size.height,
                found: 0,
            });
        };
        let mut predictions = Vec::with_capacity(image.views.len());
        for view in &image.views {
            predictions.push((view.size, run(self, view)?));
        }
        let NetworkOutput {
            disparity,
            log_scale,
        } = mean_of(predictions, size);
        Ok(Prediction {
            disparity,
            log_scale,
            width: size.width,
            height: size.height,
            window: image.window,
            image_size: image.image_size,
            focal_factor,
        })
    }

    /// The network's prediction of one view, with the focal correction applied; blended with its mirror image's if `flip` is set.
    fn infer_view(&mut self, view: &View, flip: bool) -> Result<NetworkOutput, Error> {
        let mut own = self.run(&view.input, view.size, view.focal_factor)?;
        if flip {
            let (mirrored, width) = (self.run_mirrored(view)?, view.size.width);
            blend_flipped(&mut own.disparity, &mirrored.disparity, width);
            if let (Some(own), Some(mirrored)) = (&mut own.log_scale, &mirrored.log_scale) {
                blend_flipped(own, mirrored, width);
            }
        }
        Ok(own)
    }

    /// The network's prediction of the mirror image of one view, mirrored back, with the focal correction applied.
    fn run_mirrored(&mut self, view: &View) -> Result<NetworkOutput, Error> {
        let width = view.size.width;
        let mut input = view.input.clone();
        mirror(&mut input, width);
        let mut seen = self.run(&input, view.size, view.focal_factor)?;
        mirror(&mut seen.disparity, width);
        if let Some(log_scale) = &mut seen.log_scale {
            mirror(log_scale, width);
        }
        Ok(seen)
    }

    /// Runs the network once.
    fn run(&mut self, input: &[f32], size: InputSize, factor: f64) -> Result<NetworkOutput, Error> {
        let runner = match &mut self.others {
            Some(others) if size != self.config.size => others.runner(size)?,
            _ => &mut *self.runner,
        };
        let mut output = NetworkOutput::default();
        runner.run(input, &mut output)?;
        for d in &mut output.disparity {
            *d = (f64::from(*d) / factor) as f32;
        }
        // Limited as in the loss: training never used values beyond.
        let (low, high) = LOG_SCALE_BOUNDS;
        for log_scale in output.log_scale.iter_mut().flatten() {
            *log_scale = log_scale.clamp(low as f32, high as f32);
        }
        Ok(output)
    }
}

/// The mean of a network's predictions at several sizes, at one of these sizes.
fn mean_of(mut predictions: Vec<(InputSize, NetworkOutput)>, size: InputSize) -> NetworkOutput {
    if predictions.len() == 1
        && let Some((_, only)) = predictions.pop()
    {
        return only;
    }
    let share = 1.0 / predictions.len() as f32;
    let mean = |of: &dyn Fn(&NetworkOutput) -> Option<&Vec<f32>>| {
        let mut sum = vec![0.0; size.width * size.height];
        for (from, prediction) in &predictions {
            let resample = Resample::new((from.width, from.height), (size.width, size.height));
            for (sum, value) in sum.iter_mut().zip(resample.map(of(prediction)?)) {
                *sum += share * value;
            }
        }
        Some(sum)
    };
    NetworkOutput {
        disparity: mean(&|prediction| Some(&prediction.disparity)).unwrap_or_default(),
        log_scale: mean(&|prediction| prediction.log_scale.as_ref()),
    }
}
