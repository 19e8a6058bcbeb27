//! How far an image is from what its network takes.

use std::fmt;

use deepfusion_runtime::PreparedImage;

/// The factor by which an image's aspect ratio may differ from the network's input's, as a fraction: 4:3 is exactly that far from 10:3.
const MOST_ASPECT: (u64, u64) = (5, 2);
/// The part of an image that the network sees may be enlarged so many times, in either direction.
const MOST_ENLARGED: u64 = 4;

/// An image so unlike what the network learned from that its depth means little.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct PoorFit {
    /// Width and height of the image.
    pub image: [u32; 2],
    /// Of the part of it that the network sees.
    pub seen: [u32; 2],
    /// Of the network's input.
    pub input: [u32; 2],
}

impl PoorFit {
    /// Whether an image is one: its aspect ratio and that of the network's input differ by more than a factor of 2.5, or a side of the
    /// part that the network sees is shorter than a quarter of the input's. A network that learned with many cameras has inputs of many shapes,
    /// and is only asked about the one that fits the image best; of several input sizes the largest counts.
    #[must_use]
    pub fn of(prepared: &PreparedImage) -> Option<Self> {
        let size = prepared.largest()?.size;
        let [_, _, width, height] = prepared.window;
        let fit = Self {
            image: prepared.image_size,
            seen: [width, height],
            input: [size.width as u32, size.height as u32],
        };
        let (wider, higher) = fit.aspects();
        let (most, of) = MOST_ASPECT;
        let odd = of * wider.max(higher) > most * wider.min(higher);
        let mut sides = fit.seen.iter().zip(&fit.input);
        let tiny = sides.any(|(seen, input)| MOST_ENLARGED * u64::from(*seen) < u64::from(*input));
        (odd || tiny).then_some(fit)
    }

    /// Two numbers whose ratio is the image's aspect ratio over the input's.
    fn aspects(&self) -> (u64, u64) {
        let ([w, h], [width, height]) = (self.image.map(u64::from), self.input.map(u64::from));
        (w * height, h * width)
    }
}

impl fmt::Display for PoorFit {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { image, seen, input } = self;
        let [w, h] = image;
        write!(f, "{w}x{h} pixels")?;
        if seen != image {
            write!(f, ", of which the network sees {}x{}", seen[0], seen[1])?;
        }
        let (wider, higher) = self.aspects();
        let ratio = wider.max(higher) as f64 / wider.min(higher).max(1) as f64;
        let times = |side: usize| f64::from(input[side]) / f64::from(seen[side].max(1));
        write!(
            f,
            ", resized to {}x{} ({:.2} times the width, {:.2} times the height; the aspect ratios differ by a factor of {ratio:.1}): the network \
             learned from nothing like it, and its depth means little",
            input[0],
            input[1],
            times(0),
            times(1)
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use deepfusion_data::RgbImage;
    use deepfusion_geometry::Intrinsics;
    use deepfusion_model::InputSize;
    use deepfusion_runtime::{Augmentation, Preparer};

    const NETWORK: Preparer = Preparer {
        size: InputSize {
            width: 320,
            height: 96,
        },
        training_camera: None,
        canonical_focal_px: None,
        augmentation: Augmentation::NONE,
    };

    fn fit(network: &Preparer, (width, height): (u32, u32)) -> Option<PoorFit> {
        let image = RgbImage::new(width, height);
        PoorFit::of(&network.prepare(&image, None, true, true))
    }

    #[test]
    fn what_is_far_from_the_input_is_told_from_what_is_not() {
        // 4:3 is as far from 10:3 as may be; so is a quarter of the size.
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

    /// A network of one camera cuts what has another shape, one of many cameras takes an input that fits.
    #[test]
    fn it_depends_on_what_the_network_does_with_another_shape() {
        let cuts = Preparer {
            training_camera: Some(Intrinsics::centred(230.0, (320, 96))),
            ..NETWORK
        };
        let cut = fit(&cuts, (1080, 1920)).unwrap();
        assert_eq!(cut.seen, [1080, 324]);
        let text = cut.to_string();
        assert!(
            text.contains("of which the network sees 1080x324"),
            "{text}"
        );
        let many = Preparer {
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
