use std::path::{Path, PathBuf};

use deepfusion_eval::IntervalFactors;
use deepfusion_eval::compare::MetricScale;
use deepfusion_records::{MadeWith, PredictionRecord, ScaleRecord, Sidecar};
use deepfusion_runtime::{LayerMaps, ModelSource, Prediction};

use super::depth::{Maps, write};
use super::earlier::{NewDepth, remove_earlier};
use super::{DepthOutput, DepthOutputs};
use crate::bulk::{LoadedImage, add_output, sidecar_path, write_unsynced};
use crate::{Input, Result, intervals};

/// A network's results for an image.
pub struct SeenDepth {
    /// Its depth.
    pub prediction: Prediction,
    /// What its layers compute; empty unless [`DepthOutput::Features`] was requested.
    pub layers: Vec<LayerMaps>,
    /// Whether the scale has changed, if it is monitored.
    pub scale: Option<ScaleRecord>,
}

/// Writes the outputs of every image of a run.
pub struct DepthWriter<'a> {
    /// The output folder.
    pub folder: &'a Path,
    /// The outputs to write.
    pub outputs: DepthOutputs,
    /// The factors of the network's intervals.
    pub intervals: IntervalFactors,
    /// The network.
    pub model: &'a ModelSource,
    /// Number of its training steps.
    pub step: usize,
    /// The measured scale of its depth.
    pub scale: MetricScale,
    /// What the outputs depend on besides the image.
    pub made_with: MadeWith,
}

impl DepthWriter<'_> {
    /// The paths of all outputs of an image from a file or a recording.
    #[must_use]
    pub fn paths(&self, input: &Input) -> Vec<PathBuf> {
        let saves = self
            .outputs
            .of_image(has_file(input) && !self.may_undistort(input))
            .into_iter();
        let files = saves.map(|save| self.folder.join(file_of(input, save)));
        files
            .chain([sidecar_path(self.folder, &input.name)])
            .collect()
    }

    /// Writes an image's outputs, then its sidecar, without waiting for the disk.
    ///
    /// # Errors
    /// As [`Self::write_outputs`].
    pub fn write(&self, input: &Input, loaded: &LoadedImage, seen: &SeenDepth) -> Result<Sidecar> {
        let sidecar = self.write_outputs(input, loaded, seen)?;
        write_unsynced(&sidecar, self.folder, &input.name)?;
        Ok(sidecar)
    }

    /// Writes an image's outputs without waiting for the disk, and returns the sidecar to write once they are on it. Outputs that the
    /// sidecar of an earlier run lists, and that are not written again, are removed first.
    ///
    /// # Errors
    /// A file that cannot be written or removed; [`crate::Error::NoCamera`], [`crate::Error::NoUncertainty`] and [`crate::Error::NoLayers`]
    /// if an output needs what is not available.
    pub fn write_outputs(
        &self,
        input: &Input,
        loaded: &LoadedImage,
        seen: &SeenDepth,
    ) -> Result<Sidecar> {
        let (image, prediction) = (&loaded.image, &seen.prediction);
        let depth = prediction.depth();
        let sigma = if self.outputs.have_sigma() {
            intervals::sigma(prediction, &depth, &self.intervals)
        } else {
            None
        };
        let maps = Maps {
            prediction,
            depth: &depth,
            layers: &seen.layers,
            sigma: sigma.as_ref(),
        };
        let is_file = loaded.live.is_none() && has_file(input) && !loaded.undistorted;
        let saves = self.outputs.of_image(is_file);
        let files: Vec<String> = saves.iter().map(|save| file_of(input, *save)).collect();
        let new = NewDepth {
            input,
            mark: loaded.mark,
            intrinsics: loaded.camera.map(|k| [k.fx, k.fy, k.cx, k.cy]),
            made_with: &self.made_with,
            files: &files,
        };
        remove_earlier(self.folder, &new)?;
        for (save, file) in saves.into_iter().zip(&files) {
            let (path, camera) = (self.folder.join(file), loaded.camera.as_ref());
            write(save, self.outputs.limits, image, camera, &maps, &path)?;
        }
        let mut sidecar = Sidecar {
            prediction: self.record(input, loaded, seen, &depth.data),
            files: Vec::new(),
            file_bytes: Vec::new(),
            file_crc32: Vec::new(),
            live: loaded.live,
            made_with: self.made_with.clone(),
        };
        for file in files {
            add_output(&mut sidecar, self.folder, file)?;
        }
        Ok(sidecar)
    }

    /// Whether a distortion may be removed; whether the lens distorts is only known once the image is read.
    fn may_undistort(&self, input: &Input) -> bool {
        match &input.frame {
            Some((dataset, _)) => dataset.corrects_lens(),
            None => self.made_with.calibration_sha256.is_some(),
        }
    }

    /// The sidecar's record of the prediction; `depth_m` is its range of depths.
    fn record(
        &self,
        input: &Input,
        loaded: &LoadedImage,
        seen: &SeenDepth,
        depth_m: &[f32],
    ) -> PredictionRecord {
        let known = depth_m.iter().copied().filter(|d| *d > 0.0);
        let ends = |[low, high]: [f32; 2], d: f32| [low.min(d), high.max(d)];
        PredictionRecord {
            image: Some(input.path.clone()),
            image_file: Some(loaded.mark),
            size: Some([loaded.image.width(), loaded.image.height()]),
            undistorted: loaded.undistorted,
            unit: "metres along the camera's axis (z)".into(),
            model: self.model.given().to_owned(),
            model_sha256: self.model.packed_sha256().map(str::to_owned),
            checkpoint_step: self.step,
            intrinsics: loaded.camera.map(|k| [k.fx, k.fy, k.cx, k.cy]),
            intrinsics_from: loaded.camera_from.word().into(),
            camera_known: loaded.camera_from.is_known(),
            scale: self.scale,
            focal_factor: seen.prediction.focal_factor,
            window: seen.prediction.window,
            depth_m: known
                .map(|d| [d, d])
                .reduce(|ends_so_far, [d, _]| ends(ends_so_far, d)),
            scale_monitor: seen.scale,
        }
    }
}

fn file_of(input: &Input, save: DepthOutput) -> String {
    format!("{}{}", input.name, save.ending())
}

/// Whether an image is a file that a viewer of its depth can open.
fn has_file(input: &Input) -> bool {
    let frame = input.frame.as_ref();
    frame.is_none_or(|(dataset, index)| dataset.frames()[*index].image.file().is_some())
}
