//! Checks how far an image is from what its network was trained on.

use std::fmt;

use deepfusion_runtime::{PreparedImage, Preparer};

/// The largest factor, as a fraction, by which two aspect ratios may differ: 4:3 is exactly that far from 10:3.
const MOST_ASPECT: (u64, u64) = (5, 2);
/// The largest factor by which the part of an image that the network sees may be enlarged, in either direction.
const MOST_ENLARGED: u64 = 4;

/// An image so unlike the training images that its depth is unreliable.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct PoorFit {
    /// Width and height of the image.
    pub image: [u32; 2],
    /// Width and height of the part of it that the network sees.
    pub seen: [u32; 2],
    /// Width and height of the network's input.
    pub input: [u32; 2],
    /// Width and height of the training images; `None` if the network was trained with many cameras, or if they are unknown.
    pub learned: Option<[u32; 2]>,
}

impl PoorFit {
    /// Checks an image that was prepared for a network. It fits poorly if a side of the part that the network sees is shorter than a
    /// quarter of the input's side, or if the part's aspect ratio differs by more than a factor of 2.5 from that of the training images.
    /// Training resizes images to the network's input whatever their shape, so the input's aspect ratio does not matter.
    ///
    /// A network trained with many cameras has inputs of many shapes. The part is then compared with the input that fits the image best; of
    /// several input sizes, with the largest. If nothing records what the network was trained on, it is compared with the input, too.
    #[must_use]
    pub fn of(network: &Preparer, prepared: &PreparedImage) -> Option<Self> {
        let size = prepared.largest()?.size;
        let [_, _, width, height] = prepared.window;
        let camera = network.training_camera;
        let only = camera.filter(|_| network.canonical_focal_px.is_none());
        let fit = Self {
            image: prepared.image_size,
            seen: [width, height],
            input: [size.width as u32, size.height as u32],
            learned: only.map(|k| [k.width, k.height]),
        };
        let mut sides = fit.seen.iter().zip(&fit.input);
        let tiny = sides.any(|(seen, input)| MOST_ENLARGED * u64::from(*seen) < u64::from(*input));
        (tiny || fit.is_odd()).then_some(fit)
    }

    /// Whether the aspect ratio of the part that the network sees is too far from that of the training images, or of the input.
    fn is_odd(&self) -> bool {
        let (wider, higher) = self.aspects();
        let (most, of) = MOST_ASPECT;
        of * wider.max(higher) > most * wider.min(higher)
    }

    /// Two numbers whose ratio is that of the two aspect ratios.
    fn aspects(&self) -> (u64, u64) {
        let [w, h] = self.seen.map(u64::from);
        let [width, height] = self.learned.unwrap_or(self.input).map(u64::from);
        (w * height, h * width)
    }
}

impl fmt::Display for PoorFit {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self {
            image,
            seen,
            input,
            learned,
        } = self;
        let [w, h] = image;
        write!(f, "{w}x{h} pixels")?;
        if seen != image {
            write!(f, ", of which the network sees {}x{}", seen[0], seen[1])?;
        }
        let times = |side: usize| f64::from(input[side]) / f64::from(seen[side].max(1));
        write!(
            f,
            ", resized to {}x{} ({:.2} times the width, {:.2} times the height",
            input[0],
            input[1],
            times(0),
            times(1)
        )?;
        if self.is_odd() {
            let (wider, higher) = self.aspects();
            let ratio = wider.max(higher) as f64 / wider.min(higher).max(1) as f64;
            write!(
                f,
                "; the aspect ratio of what the network sees differs by a factor of {ratio:.1} from that of "
            )?;
            match learned {
                Some([width, height]) => {
                    write!(f, "the {width}x{height} images that it learned from")?;
                }
                None => write!(f, "its input")?,
            }
        }
        write!(
            f,
            "): the network was not trained on such images, so its depth is unreliable"
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use deepfusion_data::RgbImage;
    use deepfusion_geometry::Intrinsics;
    use deepfusion_model::InputSize;
    use deepfusion_runtime::Augmentation;

    const NETWORK: Preparer = Preparer {
        size: InputSize {
            width: 320,
            height: 96,
        },
        training_camera: None,
        canonical_focal_px: None,
        augmentation: Augmentation::NONE,
    };

    fn fit(network: &Preparer, size: (u32, u32)) -> Option<PoorFit> {
        prepared(network, size, true)
    }

    /// How well an image fits, cropped to the network's aspect ratio or stretched.
    fn prepared(network: &Preparer, (width, height): (u32, u32), crop: bool) -> Option<PoorFit> {
        let image = RgbImage::new(width, height);
        PoorFit::of(network, &network.prepare(&image, None, true, crop))
    }

    #[test]
    fn images_far_from_the_input_fit_poorly() {
        // The limits: 4:3 is just close enough to 10:3, and so is a quarter of the size.
        for size in [(1242, 375), (640, 480), (80, 24), (1000, 120)] {
            assert_eq!(fit(&NETWORK, size), None, "{size:?}");
        }
        for size in [
            (1, 1),
            (5000, 20),
            (640, 484),
            (79, 24),
            (80, 23),
            (1080, 1920),
        ] {
            let found = fit(&NETWORK, size).map(|fit| fit.image);
            assert_eq!(found, Some([size.0, size.1]));
        }
        let text = fit(&NETWORK, (5000, 20)).unwrap().to_string();
        for part in [
            "5000x20 pixels, resized to 320x96",
            "0.06 times the width, 4.80 times the height",
            "a factor of 75.0",
        ] {
            assert!(text.contains(part), "{part}: {text}");
        }
    }

    /// For a network trained with one camera: images of that camera fit, whatever the shape of the input. Other shapes are cropped to it,
    /// and what is left may be tiny.
    #[test]
    fn images_of_the_training_camera_fit() {
        let own = Preparer {
            size: InputSize {
                width: 640,
                height: 192,
            },
            training_camera: Some(Intrinsics::centred(900.0, (1280, 1024))),
            ..NETWORK
        };
        for size in [(1280, 1024), (640, 512)] {
            for crop in [true, false] {
                assert_eq!(prepared(&own, size, crop), None, "{size:?} {crop}");
            }
        }
        for size in [(1280, 192), (1080, 1920)] {
            assert_eq!(prepared(&own, size, true), None, "{size:?}");
        }
        let text = prepared(&own, (1280, 192), false).unwrap().to_string();
        for part in [
            "1280x192 pixels, resized to 640x192",
            "sees differs by a factor of 5.3 from that of the 1280x1024 images that it learned from",
        ] {
            assert!(text.contains(part), "{part}: {text}");
        }
        let cut = prepared(&own, (5000, 20), true).unwrap();
        assert_eq!(cut.seen, [25, 20]);
        let text = cut.to_string();
        assert!(text.contains("of which the network sees 25x20"), "{text}");
        assert!(!text.contains("aspect"), "{text}");
    }

    #[test]
    fn a_network_of_many_cameras_fits_many_shapes() {
        let many = Preparer {
            training_camera: Some(Intrinsics::centred(230.0, (320, 96))),
            canonical_focal_px: Some(185.0),
            ..NETWORK
        };
        for size in [(1080, 1920), (640, 480), (3000, 500)] {
            assert_eq!(fit(&many, size), None, "{size:?}");
        }
        for size in [(5000, 20), (1, 1), (9000, 300)] {
            assert!(fit(&many, size).is_some(), "{size:?}");
        }
    }
}
