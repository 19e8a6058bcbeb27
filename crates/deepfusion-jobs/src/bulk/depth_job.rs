//! What all images of a run share: how they are read, predicted and written.

use std::path::Path;

use deepfusion_model::InputSize;
use deepfusion_motion::ScaleMonitorConfig;
use deepfusion_runtime::{DepthEstimator, LayerMaps, ModelSource, PreparedImage};
use deepfusion_video::LiveFrame;

use super::warnings::Warnings;
use super::{BulkJob, DepthSettings, ImageLoader, LoadedImage, Shard, Warn};
use crate::outputs::{DepthOutput, DepthOutputs, DepthWriter, SeenDepth};
use crate::scene::DepthWatch;
use crate::{Error, Input, ModelFacts, Result};

/// Shows what a network's layers compute for an image 3×H×W of this size, RGB in [0, 1], channel by channel.
pub type ShowLayers = Box<dyn Fn(&[f32], InputSize) -> Vec<LayerMaps> + Sync>;

/// Depth of many images by one network, into one folder. Threads share it.
pub struct DepthJob<'a> {
    /// Reads each image.
    pub loader: ImageLoader,
    /// Writes the outputs of each image.
    pub writer: DepthWriter<'a>,
    show_layers: Option<ShowLayers>,
    scale: ScaleMonitorConfig,
    correct_scale: bool,
    warnings: Warnings<'a>,
}

impl<'a> DepthJob<'a> {
    /// The job for these settings. `estimator` runs the network of `model`. `show_layers` shows what its layers compute, if pictures of
    /// that are saved ([`DepthOutputs::need_layers`]). Warnings about an image's metres go to `warn`.
    ///
    /// # Errors
    /// [`Error::NoUncertainty`] for outputs that need an uncertainty head which the network lacks; [`Error::NoLayers`] for outputs that
    /// need `show_layers`; a camera's file that cannot be read; files beside the network that cannot be read.
    pub fn new(
        settings: DepthSettings,
        folder: &'a Path,
        outputs: DepthOutputs,
        model: &'a ModelSource,
        estimator: &DepthEstimator,
        show_layers: Option<ShowLayers>,
        warn: Warn<'a>,
    ) -> Result<Self> {
        if outputs.need_uncertainty() && !estimator.predicts_uncertainty() {
            return Err(Error::NoUncertainty);
        }
        if outputs.need_layers() && show_layers.is_none() {
            return Err(Error::NoLayers);
        }
        let loader = settings.loader(estimator)?;
        let writer = DepthWriter {
            folder,
            made_with: settings.made_with(&outputs, model, estimator, &loader.camera)?,
            outputs,
            intervals: model.interval_factors()?,
            scale: model.scale(
                settings.set.as_deref(),
                settings.focal_correction,
                settings.post_process,
                estimator.step,
            )?,
            model,
            step: estimator.step,
        };
        Ok(Self {
            loader,
            writer,
            show_layers,
            scale: settings.scale,
            correct_scale: settings.correct_scale,
            warnings: Warnings::new(warn),
        })
    }

    /// The job as its folder records it.
    #[must_use]
    pub fn bulk(&self, shard: Shard, overwrite: bool, videos: bool) -> BulkJob<'_> {
        // Frames of a video may have more outputs than a photograph, so these cover both.
        let save = self.writer.outputs.of_image(false).into_iter();
        BulkJob {
            folder: self.writer.folder,
            endings: save.map(DepthOutput::ending).collect(),
            made_with: &self.writer.made_with,
            overwrite,
            shard,
            videos,
        }
    }

    /// Reads an image; warns if its camera may not be its own, or if its size and shape are far from the network's input.
    ///
    /// # Errors
    /// As [`ImageLoader::load`].
    pub fn load(&self, input: &Input) -> Result<(LoadedImage, PreparedImage)> {
        let (loaded, prepared) = self.loader.load(input)?;
        self.warnings.of_camera(input, &loaded);
        self.warn_of_fit(&input.path, &prepared);
        Ok((loaded, prepared))
    }

    /// Takes a live source's frame; warns if its size and shape are far from the network's input.
    ///
    /// # Errors
    /// As [`ImageLoader::load_live`].
    pub fn load_live(
        &self,
        input: &Input,
        frame: LiveFrame,
    ) -> Result<(LoadedImage, PreparedImage)> {
        let (loaded, prepared) = self.loader.load_live(frame)?;
        self.warn_of_fit(&input.path, &prepared);
        Ok((loaded, prepared))
    }

    fn warn_of_fit(&self, image: &Path, prepared: &PreparedImage) {
        let network = &self.loader.preparer;
        self.warnings.of_fit(image, network, prepared);
    }

    /// Predicts an image, and shows what the network's layers compute if that is saved.
    ///
    /// # Errors
    /// The error of the network's engine.
    pub fn predict(
        &self,
        estimator: &mut DepthEstimator,
        prepared: &PreparedImage,
    ) -> Result<SeenDepth> {
        Ok(SeenDepth {
            prediction: estimator.infer(prepared)?,
            layers: match (&self.show_layers, prepared.largest()) {
                (Some(show), Some(view)) => show(&view.input, view.size),
                _ => Vec::new(),
            },
            scale: None,
        })
    }

    /// A watch over the scale, starting at the first frame.
    pub(super) fn watch(&self) -> DepthWatch {
        DepthWatch::new(self.scale.clone(), self.correct_scale)
    }

    /// As [`Self::predict`], for the next image of a sequence whose scale is watched; warns if it has changed.
    ///
    /// # Errors
    /// As [`Self::predict`].
    pub(super) fn predict_next(
        &self,
        estimator: &mut DepthEstimator,
        watch: &mut DepthWatch,
        input: &Input,
        (loaded, prepared): (&LoadedImage, &PreparedImage),
    ) -> Result<SeenDepth> {
        let mut seen = self.predict(estimator, prepared)?;
        let (image, camera) = (&loaded.image, loaded.camera);
        seen.scale = watch.observe(input, image, camera, &mut seen.prediction);
        self.warn_of_drift(&input.name, watch.first_drift());
        Ok(seen)
    }

    /// Warns if the scale has drifted by this factor.
    pub(crate) fn warn_of_drift(&self, frame: &str, drift: Option<f64>) {
        if let Some(ratio) = drift {
            self.warnings.of_drift(frame, ratio);
        }
    }
}
