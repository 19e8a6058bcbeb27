use crate::{DepthRunner, Error, PreparedImage, Preparer, StoredNetwork, TrainConfig};
use deepfusion_data::RgbImage;
use deepfusion_geometry::{DepthMap, Intrinsics};
use deepfusion_nn::weights::Weights;
use std::sync::Arc;

/// A trained depth network, ready for images.
#[derive(Debug, Clone)]
pub struct Predictor {
    config: TrainConfig,
    runner: Arc<dyn DepthRunner>,
    /// Steps it was trained for.
    pub step: usize,
}

/// The metric depth of an image.
#[derive(Debug, Clone)]
pub struct Prediction {
    /// Metric disparity, 1/m, at network size, row by row; focal correction applied.
    pub disparity: Vec<f32>,
    /// Width of `disparity`.
    pub width: usize,
    /// Height of `disparity`.
    pub height: usize,
    /// The part of the image that was looked at: x, y, width, height.
    pub window: [u32; 4],
    /// Size of the whole image.
    pub image_size: [u32; 2],
    /// What depth was multiplied by for another focal length than the one trained with.
    pub focal_factor: f64,
}

impl Prediction {
    /// Multiplies depth by `factor`.
    pub fn scale_depth(&mut self, factor: f64) {
        let disparity_factor = (1.0 / factor) as f32;
        for disparity in &mut self.disparity {
            *disparity *= disparity_factor;
        }
    }

    /// Depth at the network's size, and the camera that sees it so; `camera` is the whole image's.
    #[must_use]
    pub fn network_depth(&self, camera: &Intrinsics) -> (DepthMap, Intrinsics) {
        let [x, y, w, h] = self.window;
        let depth = DepthMap {
            width: self.width,
            height: self.height,
            data: self.disparity.iter().map(|d| 1.0 / d).collect(),
        };
        let k = camera.cropped(x, y, w, h);
        (depth, k.resized(self.width as u32, self.height as u32))
    }

    /// Depth at the image's own size: disparity is enlarged (bilinear, half-pixel centres), then
    /// inverted; 0 outside the window that was looked at.
    #[must_use]
    pub fn depth(&self) -> DepthMap {
        let [x0, y0, w, h] = self.window.map(|v| v as usize);
        let mut map = DepthMap::empty(self.image_size[0] as usize, self.image_size[1] as usize);
        let axis = |i: usize, to: usize, from: usize| {
            let p = (i as f32 + 0.5) * from as f32 / to as f32 - 0.5;
            let p = p.clamp(0.0, (from - 1) as f32);
            let low = (p as usize).min(from.saturating_sub(2));
            (low, (low + 1).min(from - 1), p - low as f32)
        };
        let columns: Vec<_> = (0..w).map(|x| axis(x, w, self.width)).collect();
        for y in 0..h {
            let (top, bottom, fy) = axis(y, h, self.height);
            let (top, bottom) = (top * self.width, bottom * self.width);
            let row = &mut map.data[(y0 + y) * self.image_size[0] as usize + x0..][..w];
            for (depth, &(left, right, fx)) in row.iter_mut().zip(&columns) {
                let d = &self.disparity;
                let upper = d[top + left] + (d[top + right] - d[top + left]) * fx;
                let lower = d[bottom + left] + (d[bottom + right] - d[bottom + left]) * fx;
                *depth = 1.0 / (upper + (lower - upper) * fy);
            }
        }
        map
    }
}

impl Predictor {
    /// Of a network wherever it is stored; `runner` makes what runs it of its configuration and weights.
    ///
    /// # Errors
    /// The runner's own.
    pub fn of<E>(
        network: StoredNetwork,
        runner: impl FnOnce(&TrainConfig, Weights) -> Result<Arc<dyn DepthRunner>, E>,
    ) -> Result<Self, E> {
        let StoredNetwork {
            config,
            weights,
            step,
        } = network;
        Ok(Self {
            runner: runner(&config, weights)?,
            config,
            step,
        })
    }

    /// What runs the network.
    #[must_use]
    pub fn runner(&self) -> &dyn DepthRunner {
        &*self.runner
    }

    /// The same, for keeps.
    #[must_use]
    pub fn into_runner(self) -> Arc<dyn DepthRunner> {
        self.runner
    }

    /// The run's configuration.
    #[must_use]
    pub fn config(&self) -> &TrainConfig {
        &self.config
    }

    /// The camera the network learned with, at the size of its images; `None` for imported weights.
    #[must_use]
    pub fn training_camera(&self) -> Option<Intrinsics> {
        self.config.camera
    }

    /// What makes images this network's input.
    #[must_use]
    pub fn preparer(&self) -> Preparer {
        Preparer {
            width: self.config.size.width,
            height: self.config.size.height,
            training_camera: self.config.camera,
            canonical_focal_px: self.config.canonical_focal_px,
        }
    }

    /// Predicts one image: [`Preparer::prepare`], then [`Self::infer`].
    ///
    /// # Errors
    /// As [`DepthRunner::disparity`].
    pub fn predict(
        &self,
        image: &RgbImage,
        camera: Option<&Intrinsics>,
        focal_correction: bool,
        crop: bool,
    ) -> Result<Prediction, Error> {
        let preparer = self.preparer();
        self.infer(&preparer.prepare(image, camera, focal_correction, crop))
    }

    /// Runs the network on an image that [`Self::preparer`] prepared.
    ///
    /// # Errors
    /// As [`DepthRunner::disparity`].
    pub fn infer(&self, image: &PreparedImage) -> Result<Prediction, Error> {
        let mut disparity = self.runner.disparity(&image.input)?;
        for d in &mut disparity {
            *d = (f64::from(*d) / image.focal_factor) as f32;
        }
        Ok(Prediction {
            disparity,
            width: self.config.size.width,
            height: self.config.size.height,
            window: image.window,
            image_size: image.image_size,
            focal_factor: image.focal_factor,
        })
    }
}
