use deepfusion_data::{RgbImage, to_network_input};
use deepfusion_geometry::Intrinsics;

/// How far two aspect ratios may differ and still count as the same camera's.
const ASPECT_TOLERANCE: f64 = 0.02;

/// Makes a network's input of images. It knows the network's size and camera but not the network, so that any
/// thread can prepare images while another one computes.
#[derive(Debug, Clone, Copy)]
pub struct Preparer {
    /// Width of the network's input.
    pub width: usize,
    /// Height of the network's input.
    pub height: usize,
    /// The camera the network learned with, at the size of its images; `None` for imported weights.
    pub training_camera: Option<Intrinsics>,
    /// The focal length in pixels that the network's depth is of, where it learned with many cameras.
    pub canonical_focal_px: Option<f64>,
}

/// An image as the network takes it.
#[derive(Debug, Clone)]
pub struct PreparedImage {
    /// 3×H×W at network size, in [0, 1], channel by channel.
    pub input: Vec<f32>,
    /// The part of the image that is looked at: x, y, width, height.
    pub window: [u32; 4],
    /// Size of the whole image.
    pub image_size: [u32; 2],
    /// What depth will be multiplied by for another focal length than the one trained with.
    pub focal_factor: f64,
}

impl Preparer {
    /// Cuts and resizes an image. With its camera, depth will be corrected for a focal length other than the
    /// one trained with, unless `focal_correction` is off; `crop` cuts another aspect ratio instead of
    /// stretching it.
    #[must_use]
    pub fn prepare(
        &self,
        image: &RgbImage,
        camera: Option<&Intrinsics>,
        focal_correction: bool,
        crop: bool,
    ) -> PreparedImage {
        let window = self.window(image, camera, crop);
        let camera_that_counts = camera.filter(|_| focal_correction);
        let focal_factor = self.focal_factor(camera_that_counts, window);
        let (width, height) = (self.width as u32, self.height as u32);
        PreparedImage {
            input: to_network_input(image, window, width, height),
            window,
            image_size: [image.width(), image.height()],
            focal_factor,
        }
    }

    /// What depth must be multiplied by for an image of this camera, at network size: f_y(test)/f_y(train) (SPEC 5), or
    /// f_y(test)/f_c of a network with a canonical focal length. An unknown camera is taken for the one trained with.
    fn focal_factor(&self, camera: Option<&Intrinsics>, window: [u32; 4]) -> f64 {
        let fy = |k: &Intrinsics| k.resized(self.width as u32, self.height as u32).fy;
        let [x, y, w, h] = window;
        let test = camera.map(|k| fy(&k.cropped(x, y, w, h)));
        let train = self.training_camera.as_ref().map(fy);
        let reference = self.canonical_focal_px.or(train);
        match (test.or(train), reference) {
            (Some(test), Some(reference)) => test / reference,
            _ => 1.0,
        }
    }

    /// The part of the image with the aspect ratio trained with: all of it where they agree, else cut
    /// about the principal point.
    fn window(&self, image: &RgbImage, camera: Option<&Intrinsics>, crop: bool) -> [u32; 4] {
        let (width, height) = image.dimensions();
        let whole = [0, 0, width, height];
        let Some(train) = self.training_camera else {
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
}
