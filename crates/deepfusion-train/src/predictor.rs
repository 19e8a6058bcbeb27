use crate::losses::LOG_SCALE_BOUNDS;
use crate::{
    DepthRunner, Error, NetworkOutput, PreparedImage, Preparer, StoredNetwork, TrainConfig,
};
use deepfusion_data::RgbImage;
use deepfusion_geometry::{DepthMap, Intrinsics};
use deepfusion_nn::InputSize;
use deepfusion_nn::weights::Weights;
use std::fmt;
use std::sync::{Arc, Mutex, PoisonError};

/// A trained depth network, ready for images.
#[derive(Debug, Clone)]
pub struct Predictor {
    config: TrainConfig,
    runner: Arc<dyn DepthRunner>,
    /// For input sizes beside the one trained with; none of a network that has no use for them.
    others: Option<Arc<OtherSizes>>,
    /// Steps it was trained for.
    pub step: usize,
}

/// Input sizes beside the one trained with, for which runners are kept: a camera has one.
const SIZES_KEPT: usize = 3;

/// Runners for other input sizes, made when they are asked for.
struct OtherSizes {
    make: Box<MakeRunner>,
    made: Mutex<Vec<(InputSize, Arc<dyn DepthRunner>)>>,
}

type MakeRunner = dyn Fn(InputSize) -> Result<Arc<dyn DepthRunner>, Error> + Send + Sync;

impl fmt::Debug for OtherSizes {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("OtherSizes").finish_non_exhaustive()
    }
}

impl OtherSizes {
    fn runner(&self, size: InputSize) -> Result<Arc<dyn DepthRunner>, Error> {
        let mut made = self.made.lock().unwrap_or_else(PoisonError::into_inner);
        let found = match made.iter().position(|(of, _)| *of == size) {
            Some(place) => made.remove(place),
            None => (size, (self.make)(size)?),
        };
        let runner = Arc::clone(&found.1);
        // The one used last stands last.
        made.push(found);
        if made.len() > SIZES_KEPT {
            made.remove(0);
        }
        Ok(runner)
    }
}

/// The metric depth of an image.
#[derive(Debug, Clone)]
pub struct Prediction {
    /// Metric disparity, 1/m, at network size, row by row; focal correction applied.
    pub disparity: Vec<f32>,
    /// ln b at network size, b the Laplace scale of the error of ln depth; of a network that says so.
    pub log_scale: Option<Vec<f32>>,
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
        self.enlarged(&self.disparity, |disparity| 1.0 / disparity)
    }

    /// Standard deviation of depth in metres at the image's own size, √2·b·depth, 0 outside the window; `None` of a network
    /// that does not say how sure it is. It is what the network expects, and not calibrated.
    #[must_use]
    pub fn sigma(&self) -> Option<DepthMap> {
        self.sigma_of(&self.depth())
    }

    /// As [`Self::sigma`], where [`Self::depth`] is at hand.
    #[must_use]
    pub fn sigma_of(&self, depth: &DepthMap) -> Option<DepthMap> {
        let mut sigma = self.enlarged(self.log_scale.as_ref()?, |log_scale| {
            std::f32::consts::SQRT_2 * log_scale.exp()
        });
        for (relative, depth) in sigma.data.iter_mut().zip(&depth.data) {
            *relative *= depth;
        }
        Some(sigma)
    }

    /// Values at the image's own size, bilinear; `of` each in the window, 0 outside.
    fn enlarged(&self, values: &[f32], of: impl Fn(f32) -> f32) -> DepthMap {
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
                let d = values;
                let upper = d[top + left] + (d[top + right] - d[top + left]) * fx;
                let lower = d[bottom + left] + (d[bottom + right] - d[bottom + left]) * fx;
                *depth = of(upper + (lower - upper) * fy);
            }
        }
        map
    }
}

impl Predictor {
    /// Of a network wherever it is stored; `runner` makes what runs it of its configuration and weights.
    ///
    /// A network with a canonical focal length runs at the input size that fits an image ([`crate::fitting`]): its weights
    /// are kept, and `runner` is asked again for each other size.
    ///
    /// # Errors
    /// The runner's own.
    pub fn of<E: fmt::Display>(
        network: StoredNetwork,
        runner: impl Fn(&TrainConfig, Weights) -> Result<Arc<dyn DepthRunner>, E>
        + Send
        + Sync
        + 'static,
    ) -> Result<Self, E> {
        let StoredNetwork {
            config,
            weights,
            step,
        } = network;
        let kept = config.canonical_focal_px.map(|_| weights.clone());
        let own = runner(&config, weights)?;
        let others = kept.map(|weights| {
            let of = config.clone();
            let make = move |size: InputSize| {
                let config = TrainConfig { size, ..of.clone() };
                runner(&config, weights.clone()).map_err(|e| Error::engine("other size", &e))
            };
            Arc::new(OtherSizes {
                make: Box::new(make),
                made: Mutex::new(Vec::new()),
            })
        });
        Ok(Self {
            runner: own,
            others,
            config,
            step,
        })
    }

    /// What runs the network at the size trained with.
    #[must_use]
    pub fn runner(&self) -> &dyn DepthRunner {
        &*self.runner
    }

    /// The same, for keeps.
    #[must_use]
    pub fn into_runner(self) -> Arc<dyn DepthRunner> {
        self.runner
    }

    /// Whether it says how sure it is of each pixel ([`Prediction::sigma`]).
    #[must_use]
    pub fn knows_uncertainty(&self) -> bool {
        self.config.depth_net.uncertainty && self.runner.tells_uncertainty()
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
            size: self.config.size,
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
        let NetworkOutput {
            mut disparity,
            mut log_scale,
        } = match &self.others {
            Some(others) if image.size != self.config.size => {
                others.runner(image.size)?.run(&image.input)?
            }
            _ => self.runner.run(&image.input)?,
        };
        for d in &mut disparity {
            *d = (f64::from(*d) / image.focal_factor) as f32;
        }
        // As the loss saw it: what lies beyond has never been learned.
        let (low, high) = LOG_SCALE_BOUNDS;
        for log_scale in log_scale.iter_mut().flatten() {
            *log_scale = log_scale.clamp(low as f32, high as f32);
        }
        Ok(Prediction {
            disparity,
            log_scale,
            width: image.size.width,
            height: image.size.height,
            window: image.window,
            image_size: image.image_size,
            focal_factor: image.focal_factor,
        })
    }
}
