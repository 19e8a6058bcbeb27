use deepfusion_geometry::Intrinsics;
use deepfusion_images::{RgbImage, to_network_input};
use deepfusion_model::InputSize;

use crate::Augmentation;

/// The shortest side of an input, unless the network was trained with a shorter one. 64 pixels are two cells of the deepest features;
/// shrunk to that, `tiny` predicted depths four times too large.
const SHORTEST_SIDE: usize = 96;

/// Relative difference up to which two aspect ratios count as equal.
const ASPECT_TOLERANCE: f64 = 0.02;

/// Turns images into a network's input. It knows the network's size and camera but not the network, so any thread can prepare images while
/// another one computes.
#[derive(Debug, Clone, Copy)]
pub struct Preparer {
    /// Size of the network's input in training.
    pub size: InputSize,
    /// The camera the network was trained with, at the size of its images; `None` for imported weights.
    pub training_camera: Option<Intrinsics>,
    /// The canonical focal length in pixels, for a network trained with many cameras.
    pub canonical_focal_px: Option<f64>,
    /// The predictions of an image whose mean is its depth.
    pub augmentation: Augmentation,
}

/// An image as network input.
#[derive(Debug, Clone)]
pub struct PreparedImage {
    /// One view for each input size; at least one.
    pub views: Vec<View>,
    /// Whether each view's mirror image is predicted, too.
    pub flip: bool,
    /// The part of the image that the network sees: x, y, width, height.
    pub window: [u32; 4],
    /// Size of the whole image.
    pub image_size: [u32; 2],
}

impl PreparedImage {
    /// The view at the largest input size; `None` if there are no views.
    #[must_use]
    pub fn largest(&self) -> Option<&View> {
        let pixels = |view: &&View| view.size.width * view.size.height;
        self.views.iter().max_by_key(pixels)
    }
}

/// An image at one input size.
#[derive(Debug, Clone)]
pub struct View {
    /// 3×H×W at `size`, in [0, 1], channel by channel.
    pub input: Vec<f32>,
    /// The network's input size.
    pub size: InputSize,
    /// Factor to be applied to depth because the focal length differs from that in training.
    pub focal_factor: f64,
}

impl Preparer {
    /// Resizes an image. With its camera, depth will be corrected for a focal length other than that in training, unless `focal_correction`
    /// is off.
    ///
    /// A network with a canonical focal length was trained with many cameras: it sees the whole image, at the input size that
    /// fits the image's aspect ratio ([`fitting`]). For other networks, an image of a different aspect ratio is cropped about
    /// its principal point, or stretched, depending on `crop`.
    #[must_use]
    pub fn prepare(
        &self,
        image: &RgbImage,
        camera: Option<&Intrinsics>,
        focal_correction: bool,
        crop: bool,
    ) -> PreparedImage {
        let (width, height) = image.dimensions();
        let window = match self.canonical_focal_px {
            Some(_) => [0, 0, width, height],
            None => self.window(image, camera, crop),
        };
        let camera_that_counts = camera.filter(|_| focal_correction);
        let mut sizes = Vec::new();
        for scale in self.augmentation.scales {
            let size = match self.canonical_focal_px {
                Some(_) => fitting_scaled(self.size, width, height, *scale),
                None => self.size,
            };
            // Two scales of a narrow image may fit the same size, which would repeat the prediction.
            if !sizes.contains(&size) {
                sizes.push(size);
            }
        }
        let view = |size: InputSize| View {
            input: to_network_input(image, window, size.width as u32, size.height as u32),
            size,
            focal_factor: self.focal_factor(camera_that_counts, window, size),
        };
        PreparedImage {
            views: sizes.into_iter().map(view).collect(),
            flip: self.augmentation.flip,
            window,
            image_size: [width, height],
        }
    }

    /// The factor for depth with this camera, at network size: f_y(test)/f_y(train) (docs/concepts/scale.md), or f_y(test)/f_c
    /// with a canonical focal length. Without a camera the training camera is assumed.
    fn focal_factor(&self, camera: Option<&Intrinsics>, window: [u32; 4], size: InputSize) -> f64 {
        let at =
            |k: Intrinsics, size: InputSize| k.resized(size.width as u32, size.height as u32).fy;
        let [x, y, w, h] = window;
        let test = camera.map(|k| at(k.cropped(x, y, w, h), size));
        let train = self.training_camera.map(|k| at(k, self.size));
        let Some(canonical) = self.canonical_focal_px else {
            return match (test.or(train), train) {
                (Some(test), Some(train)) => test / train,
                _ => 1.0,
            };
        };
        // The training camera, for an image with the same horizontal field of view.
        let assumed = train.map(|fy| fy * size.width as f64 / self.size.width as f64);
        test.or(assumed).map_or(1.0, |test| test / canonical)
    }

    /// The part of the image with the training aspect ratio: the whole image if its ratio is the same, else cropped about the principal
    /// point.
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
            // Too tall: the principal row keeps its relative position in the image.
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

/// The input size for an image, for a network trained with many cameras. It has about as many pixels as `trained` and stretches the image
/// least, of all sizes that the encoder accepts; it is `trained` itself if that fits.
#[must_use]
pub fn fitting(trained: InputSize, width: u32, height: u32) -> InputSize {
    fitting_scaled(trained, width, height, 1.0)
}

/// Like [`fitting`], for images `scale` times as wide and high.
fn fitting_scaled(trained: InputSize, width: u32, height: u32, scale: f64) -> InputSize {
    let aspect = f64::from(width) / f64::from(height);
    let pixels = |size: InputSize| (size.width * size.height) as f64;
    let wanted = pixels(trained) * scale * scale;
    let cost = |size: InputSize| {
        let stretched = (size.width as f64 / size.height as f64 / aspect).ln().abs();
        stretched + 0.5 * (pixels(size) / wanted).ln().abs()
    };
    let longest = (2.0 * scale * trained.width.max(trained.height) as f64) as usize;
    let shortest = trained.width.min(trained.height).clamp(32, SHORTEST_SIDE);
    let sides = || (shortest..=longest.max(shortest)).step_by(32);
    sides()
        .flat_map(|width| sides().map(move |height| InputSize { width, height }))
        .chain((scale == 1.0).then_some(trained))
        .min_by(|a, b| cost(*a).total_cmp(&cost(*b)))
        .unwrap_or(trained)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn size(width: usize, height: usize) -> InputSize {
        InputSize { width, height }
    }

    #[test]
    fn the_size_fits_the_image() {
        let trained = size(320, 96);
        for (image, expected) in [
            ((1242, 375), trained),
            ((640, 192), trained),
            ((1920, 1080), size(224, 128)),
            ((640, 480), size(192, 160)),
            ((1000, 500), size(256, 128)),
            ((1080, 1920), size(128, 224)),
            ((9000, 300), size(640, 96)),
        ] {
            assert_eq!(fitting(trained, image.0, image.1), expected, "{image:?}");
        }
        // The sizes listed in docs/guides/export-to-onnx.md.
        for (image, larger, smaller) in [
            ((1242, 375), (640, 192), (320, 96)),
            ((1000, 500), (512, 256), (256, 128)),
            ((1920, 1080), (448, 256), (224, 128)),
            ((1920, 1200), (448, 288), (224, 128)),
            ((640, 480), (384, 288), (192, 160)),
            ((800, 800), (352, 352), (160, 160)),
            ((1080, 1920), (256, 448), (128, 224)),
        ] {
            let fits = |of| fitting(of, image.0, image.1);
            let both = [fits(size(640, 192)), fits(trained)];
            let expected = [larger, smaller].map(|(width, height)| size(width, height));
            assert_eq!(both, expected, "{image:?}");
        }
        let scaled = |scale| fitting_scaled(size(640, 192), 1242, 375, scale);
        assert_eq!(
            [0.8, 1.0, 1.2].map(scaled),
            [size(512, 160), size(640, 192), size(736, 224)]
        );
        let of_a_small = |scale| fitting_scaled(size(320, 96), 1242, 375, scale);
        // No side is shorter than 96, so there is no input smaller than the training size.
        assert_eq!([0.8, 1.2].map(of_a_small), [size(320, 96), size(416, 128)]);
    }

    /// Only one size fits a narrow image at every scale, so there is one prediction.
    #[test]
    fn equal_sizes_are_predicted_once() {
        let preparer = Preparer {
            size: size(320, 96),
            training_camera: None,
            canonical_focal_px: Some(185.0),
            augmentation: Augmentation::MULTI_SCALE,
        };
        let prepared = preparer.prepare(&RgbImage::new(100, 400), None, true, true);
        let sizes: Vec<_> = prepared.views.iter().map(|view| view.size).collect();
        assert_eq!(sizes, [size(96, 384)]);
    }

    /// Each size has its own factor.
    #[test]
    fn an_image_is_prepared_at_each_scale() {
        let preparer = Preparer {
            size: size(640, 192),
            training_camera: None,
            canonical_focal_px: Some(185.0),
            augmentation: Augmentation::MULTI_SCALE_FLIP,
        };
        let camera = Intrinsics::centred(721.5, (1242, 375));
        let prepared = preparer.prepare(&RgbImage::new(1242, 375), Some(&camera), true, true);
        assert!(prepared.flip);
        let sizes: Vec<_> = prepared.views.iter().map(|view| view.size).collect();
        assert_eq!(sizes, [size(512, 160), size(736, 224)]);
        for view in &prepared.views {
            assert_eq!(view.input.len(), 3 * view.size.width * view.size.height);
            let factor = 721.5 * view.size.height as f64 / 375.0 / 185.0;
            assert!((view.focal_factor - factor).abs() < 1e-9);
        }
    }

    /// A wall 10 m away is predicted 10 m away, whatever the lens and the picture's shape: the factor is the ratio of focal lengths at the
    /// size that the network sees.
    #[test]
    fn the_factor_is_that_of_the_fitted_size() {
        let preparer = Preparer {
            size: size(320, 96),
            training_camera: Some(Intrinsics {
                fx: 230.4,
                fy: 230.4,
                cx: 159.5,
                cy: 47.5,
                width: 320,
                height: 96,
            }),
            canonical_focal_px: Some(185.0),
            augmentation: Augmentation::NONE,
        };
        let camera = Intrinsics {
            fx: 585.0,
            fy: 585.0,
            cx: 320.0,
            cy: 240.0,
            width: 640,
            height: 480,
        };
        let image = RgbImage::new(640, 480);
        for crop in [true, false] {
            let known = preparer.prepare(&image, Some(&camera), true, crop);
            assert_eq!(known.window, [0, 0, 640, 480]);
            let [view] = known.views.as_slice() else {
                panic!("{} views", known.views.len())
            };
            assert_eq!(view.size, size(192, 160));
            assert_eq!(view.input.len(), 3 * 192 * 160);
            assert!((view.focal_factor - 585.0 / 3.0 / 185.0).abs() < 1e-9);
        }
        let factor = |prepared: &PreparedImage| prepared.views[0].focal_factor;
        let unknown = preparer.prepare(&image, None, true, true);
        assert!((factor(&unknown) - 230.4 * 0.6 / 185.0).abs() < 1e-9);
        let uncorrected = preparer.prepare(&image, Some(&camera), false, true);
        assert_eq!(factor(&uncorrected), factor(&unknown));
        // A network of one camera crops.
        let own = Preparer {
            canonical_focal_px: None,
            ..preparer
        };
        let cut = own.prepare(&image, Some(&camera), true, true);
        assert_eq!(
            (cut.views[0].size, cut.window[2..].to_vec()),
            (size(320, 96), vec![640, 192])
        );
        assert!((factor(&cut) - 0.5 * 585.0 / 230.4).abs() < 1e-9);
    }
}
