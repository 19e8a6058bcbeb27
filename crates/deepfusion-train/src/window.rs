use crate::TrainConfig;
use deepfusion_data::RgbImage;
use deepfusion_geometry::{DepthMap, Intrinsics};
use image::imageops;
use rand::Rng;
use std::borrow::Cow;

/// How far two aspect ratios may differ and still count as the same.
const ASPECT_TOLERANCE: f64 = 0.02;

/// The part of an image that becomes network input, with the input's aspect ratio: nothing is stretched.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Window {
    x: u32,
    y: u32,
    width: u32,
    height: u32,
}

impl Window {
    /// The largest window, centred in the image.
    pub(crate) fn centred(camera: &Intrinsics, config: &TrainConfig) -> Self {
        let [width, height] = largest(camera, config);
        Self {
            x: (camera.width - width) / 2,
            y: (camera.height - height) / 2,
            width,
            height,
        }
    }

    /// A random window, smaller by a factor of up to `augmentation.zoom`, as seen by a longer lens.
    pub(crate) fn draw(camera: &Intrinsics, config: &TrainConfig, rng: &mut impl Rng) -> Self {
        let zoom = f64::from(config.augmentation.zoom.max(1.0));
        // Uniform in the logarithm: half of the draws are below the root of `zoom`.
        let share = zoom.powf(-rng.random::<f64>());
        let [width, height] =
            largest(camera, config).map(|side| ((f64::from(side) * share).round() as u32).max(1));
        Self {
            x: rng.random_range(0..=camera.width - width),
            y: rng.random_range(0..=camera.height - height),
            width,
            height,
        }
    }

    fn is_whole(&self, width: u32, height: u32) -> bool {
        (self.width, self.height) == (width, height)
    }

    /// The window's part of the image.
    pub(crate) fn of_image<'a>(&self, image: &'a RgbImage) -> Cow<'a, RgbImage> {
        if self.is_whole(image.width(), image.height()) {
            return Cow::Borrowed(image);
        }
        let part = imageops::crop_imm(image, self.x, self.y, self.width, self.height);
        Cow::Owned(part.to_image())
    }

    /// The window's part of the depth map.
    pub(crate) fn of_depth<'a>(&self, depth: &'a DepthMap) -> Cow<'a, DepthMap> {
        if self.is_whole(depth.width as u32, depth.height as u32) {
            return Cow::Borrowed(depth);
        }
        let [x, y, width, height] = [self.x, self.y, self.width, self.height].map(|v| v as usize);
        let rows = (y..y + height).map(|row| &depth.data[row * depth.width + x..][..width]);
        Cow::Owned(DepthMap {
            width,
            height,
            data: rows.flatten().copied().collect(),
        })
    }

    /// The camera of this window alone.
    pub(crate) fn of_camera(&self, camera: &Intrinsics) -> Intrinsics {
        camera.cropped(self.x, self.y, self.width, self.height)
    }
}

/// The largest size with the aspect ratio of the network's input.
fn largest(camera: &Intrinsics, config: &TrainConfig) -> [u32; 2] {
    let wanted = config.size.width as f64 / config.size.height as f64;
    let (width, height) = (f64::from(camera.width), f64::from(camera.height));
    let aspect = width / height;
    if (aspect / wanted - 1.0).abs() < ASPECT_TOLERANCE {
        return [camera.width, camera.height];
    }
    let side = |value: f64, most: u32| (value.round() as u32).clamp(1, most);
    if aspect < wanted {
        [camera.width, side(width / wanted, camera.height)]
    } else {
        [side(height * wanted, camera.width), camera.height]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Preset;
    use crate::sampler::stream;

    fn camera(width: u32, height: u32) -> Intrinsics {
        Intrinsics {
            fx: 500.0,
            fy: 500.0,
            cx: f64::from(width) / 2.0,
            cy: f64::from(height) / 2.0,
            width,
            height,
        }
    }

    /// Image, depth and camera are cropped in the same way, and nothing is stretched.
    #[test]
    fn image_depth_and_camera_are_cropped_alike() {
        let mut config = Preset::Tiny.config();
        config.augmentation.zoom = 2.0;
        let camera = camera(640, 480);
        let image = RgbImage::from_fn(640, 480, |x, y| {
            image::Rgb([(x % 256) as u8, (x / 256) as u8, (y % 256) as u8])
        });
        let depth = DepthMap {
            width: 640,
            height: 480,
            data: (0..640 * 480).map(|i| (i + 1) as f32).collect(),
        };
        for draw in 0..20 {
            let window = Window::draw(&camera, &config, &mut stream(1, 2, draw));
            let (cut, map) = (window.of_image(&image), window.of_depth(&depth));
            let k = window.of_camera(&camera);
            assert_eq!((k.width, k.height), cut.dimensions());
            assert_eq!(
                (map.width, map.height),
                (k.width as usize, k.height as usize)
            );
            let aspect = f64::from(k.width) / f64::from(k.height);
            assert!((aspect / (320.0 / 96.0) - 1.0).abs() < 0.02, "{aspect}");
            assert!(k.width >= 320 && k.fx == 500.0);
            let [r, g, b] = cut.get_pixel(0, 0).0.map(u32::from);
            let (x, y) = (
                (map.data[0] as u32 - 1) % 640,
                (map.data[0] as u32 - 1) / 640,
            );
            assert_eq!((x, y % 256), (r + 256 * g, b));
            assert!((k.cx - (camera.cx - f64::from(x))).abs() < 1e-9);
        }
        let whole = Window::centred(&self::camera(1242, 375), &config);
        assert_eq!(
            (whole.width, whole.height),
            (1242, 375),
            "within the tolerance"
        );
    }
}
