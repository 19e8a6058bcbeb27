use crate::{CheckpointKind, Error, Model, RunFolder, TrainConfig};
use burn::tensor::{Device, Tensor, TensorData};
use deepfusion_data::{RgbImage, resize_rgb, to_chw};
use deepfusion_geometry::{DepthMap, Intrinsics};
use std::path::Path;

/// How far two aspect ratios may differ and still count as the same camera's.
const ASPECT_TOLERANCE: f64 = 0.02;

/// A trained depth network, ready for images.
#[derive(Debug, Clone)]
pub struct Predictor {
    config: TrainConfig,
    model: Model,
    device: Device,
    /// Which checkpoint it was loaded from.
    pub checkpoint: CheckpointKind,
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
        for y in 0..h {
            let (top, bottom, fy) = axis(y, h, self.height);
            let (top, bottom) = (top * self.width, bottom * self.width);
            let row = &mut map.data[(y0 + y) * self.image_size[0] as usize + x0..][..w];
            for (x, depth) in row.iter_mut().enumerate() {
                let (left, right, fx) = axis(x, w, self.width);
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
    /// Loads a run's folder or a checkpoint in it; the folder means `best` where there is one.
    ///
    /// # Errors
    /// As [`RunFolder::open`] and [`RunFolder::load`].
    pub fn load(path: &Path, device: &Device) -> Result<Self, Error> {
        let (folder, kind) = RunFolder::open(path)?;
        let config = folder.read_config()?;
        let checkpoint = kind.unwrap_or_else(|| folder.preferred());
        let (model, _, state) = folder.load(checkpoint, &config, device)?;
        Ok(Self {
            config,
            model,
            device: device.clone(),
            checkpoint,
            step: state.step,
        })
    }

    /// The depth network.
    #[must_use]
    pub fn depth_net(&self) -> &deepfusion_nn::DepthNet {
        &self.model.depth_net
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

    /// What depth must be multiplied by for an image of another camera, f_y(test)/f_y(train), both at
    /// network size (SPEC 5).
    fn focal_factor(&self, camera: Option<&Intrinsics>, window: [u32; 4]) -> f64 {
        let size = self.config.size;
        let fy = |k: &Intrinsics| k.resized(size.width as u32, size.height as u32).fy;
        match (camera, self.training_camera()) {
            (Some(test), Some(train)) => {
                let [x, y, w, h] = window;
                fy(&test.cropped(x, y, w, h)) / fy(&train)
            }
            _ => 1.0,
        }
    }

    /// The part of the image with the aspect ratio trained with: all of it where they agree, else cut
    /// about the principal point.
    fn window(&self, image: &RgbImage, camera: Option<&Intrinsics>, crop: bool) -> [u32; 4] {
        let (width, height) = image.dimensions();
        let whole = [0, 0, width, height];
        let Some(train) = self.training_camera() else {
            return whole;
        };
        let wanted = f64::from(train.width) / f64::from(train.height);
        let aspect = f64::from(width) / f64::from(height);
        if !crop || (aspect / wanted - 1.0).abs() < ASPECT_TOLERANCE {
            return whole;
        }
        let cut = |size: u32, keep: f64, centre: f64, share: f64| {
            let keep = (keep.round() as u32).clamp(1, size);
            let start = (centre - share * f64::from(keep)).round();
            (start.clamp(0.0, f64::from(size - keep)) as u32, keep)
        };
        if aspect < wanted {
            // Too tall: the principal row keeps its place in the image.
            let centre = camera.map_or(f64::from(height) / 2.0, |k| k.cy);
            let share = train.cy / f64::from(train.height);
            let (y, h) = cut(height, f64::from(width) / wanted, centre, share);
            [0, y, width, h]
        } else {
            let centre = camera.map_or(f64::from(width) / 2.0, |k| k.cx);
            let share = train.cx / f64::from(train.width);
            let (x, w) = cut(width, f64::from(height) * wanted, centre, share);
            [x, 0, w, height]
        }
    }

    /// Predicts one image. With its camera, depth is corrected for a focal length other than the one
    /// trained with, unless `focal_correction` is off; `crop` cuts another aspect ratio instead of
    /// stretching it.
    #[must_use]
    pub fn predict(
        &self,
        image: &RgbImage,
        camera: Option<&Intrinsics>,
        focal_correction: bool,
        crop: bool,
    ) -> Prediction {
        let window = self.window(image, camera, crop);
        let focal_factor = if focal_correction {
            self.focal_factor(camera, window)
        } else {
            1.0
        };
        let (w, h) = (self.config.size.width, self.config.size.height);
        let small = resize_rgb(&cut_out(image, window), w as u32, h as u32);
        let input = TensorData::new(to_chw(&small), [1, 3, h, w]);
        let output = self
            .model
            .depth_net
            .forward(Tensor::from_data(input, &self.device));
        let sigmoid = output[0].clone().into_data();
        let range = self.model.range();
        let disparity = sigmoid
            .iter::<f32>()
            .map(|s| (range.disparity(f64::from(s)) / focal_factor) as f32)
            .collect();
        Prediction {
            disparity,
            width: w,
            height: h,
            window,
            image_size: [image.width(), image.height()],
            focal_factor,
        }
    }
}

fn cut_out(image: &RgbImage, [x, y, width, height]: [u32; 4]) -> RgbImage {
    if [width, height] == [image.width(), image.height()] {
        return image.clone();
    }
    RgbImage::from_fn(width, height, |i, j| *image.get_pixel(x + i, y + j))
}
