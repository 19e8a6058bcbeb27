//! Colour jitter of the networks' input.

use crate::Augmentation;
use rand::{Rng, seq::SliceRandom};

/// One draw of brightness, contrast, saturation and hue, and the order they are applied in. All
/// frames of a sample share it: the change must not look like motion.
#[derive(Debug, Clone, PartialEq)]
pub struct Jitter {
    changes: Vec<Change>,
}

#[derive(Debug, Clone, Copy, PartialEq)]
enum Change {
    Brightness(f32),
    Contrast(f32),
    Saturation(f32),
    /// Hue shift, in turns of the colour wheel.
    Hue(f32),
}

/// Weights of red, green and blue in grey (ITU-R BT.601).
const GREY: [f32; 3] = [0.299, 0.587, 0.114];

impl Jitter {
    /// Draws a jitter with probability `settings.jitter`, else `None`.
    pub fn draw(settings: &Augmentation, rng: &mut impl Rng) -> Option<Self> {
        if !rng.random_bool(settings.jitter.clamp(0.0, 1.0)) {
            return None;
        }
        let mut around = |limit: f32| limit * (2.0 * rng.random::<f32>() - 1.0);
        let mut changes = vec![
            Change::Brightness(1.0 + around(settings.brightness)),
            Change::Contrast(1.0 + around(settings.brightness)),
            Change::Saturation(1.0 + around(settings.brightness)),
            Change::Hue(around(settings.hue)),
        ];
        changes.shuffle(rng);
        Some(Self { changes })
    }

    /// Applies it to an image.
    ///
    /// # Shapes
    /// `image` is 3×H×W, RGB in [0, 1], before and after.
    pub fn apply(&self, image: &mut [f32]) {
        let area = image.len() / 3;
        let (red, rest) = image.split_at_mut(area);
        let (green, blue) = rest.split_at_mut(area);
        let grey = |r: f32, g: f32, b: f32| GREY[0] * r + GREY[1] * g + GREY[2] * b;
        for change in &self.changes {
            let mean = if matches!(change, Change::Contrast(_)) {
                let pixels = red.iter().zip(green.iter()).zip(blue.iter());
                pixels.map(|((r, g), b)| grey(*r, *g, *b)).sum::<f32>() / area as f32
            } else {
                0.0
            };
            for ((r, g), b) in red.iter_mut().zip(green.iter_mut()).zip(blue.iter_mut()) {
                let mix =
                    |v: f32, with: f32, factor: f32| (with + (v - with) * factor).clamp(0.0, 1.0);
                match *change {
                    Change::Brightness(f) => {
                        (*r, *g, *b) = (mix(*r, 0.0, f), mix(*g, 0.0, f), mix(*b, 0.0, f));
                    }
                    Change::Contrast(f) => {
                        (*r, *g, *b) = (mix(*r, mean, f), mix(*g, mean, f), mix(*b, mean, f));
                    }
                    Change::Saturation(f) => {
                        let v = grey(*r, *g, *b);
                        (*r, *g, *b) = (mix(*r, v, f), mix(*g, v, f), mix(*b, v, f));
                    }
                    Change::Hue(turns) => (*r, *g, *b) = turn_hue(*r, *g, *b, turns),
                }
            }
        }
    }
}

/// Shifts the hue of a pixel, keeping its value and saturation (HSV).
fn turn_hue(r: f32, g: f32, b: f32, turns: f32) -> (f32, f32, f32) {
    let (max, min) = (r.max(g).max(b), r.min(g).min(b));
    let chroma = max - min;
    if chroma <= 0.0 {
        return (r, g, b);
    }
    let sixth = if max == r {
        (g - b) / chroma
    } else if max == g {
        2.0 + (b - r) / chroma
    } else {
        4.0 + (r - g) / chroma
    };
    let sixth = (sixth + 6.0 * turns).rem_euclid(6.0);
    // Each channel is a trapezoid over the wheel.
    let channel = |shift: f32| {
        let k = (shift + sixth).rem_euclid(6.0);
        max - chroma * k.min(4.0 - k).clamp(0.0, 1.0)
    };
    (channel(5.0), channel(3.0), channel(1.0))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_full_turn_of_the_hue_changes_nothing() {
        for (r, g, b) in [
            (0.1, 0.5, 0.9),
            (0.7, 0.2, 0.3),
            (0.3, 0.8, 0.3),
            (0.4, 0.4, 0.4),
        ] {
            let (x, y, z) = turn_hue(r, g, b, 1.0);
            assert!((x - r).abs() + (y - g).abs() + (z - b).abs() < 1e-5);
        }
        let (r, g, b) = turn_hue(1.0, 0.0, 0.0, 1.0 / 3.0);
        assert!(
            r.abs() + (g - 1.0).abs() + b.abs() < 1e-5,
            "red becomes green"
        );
    }

    #[test]
    fn each_change_has_its_effect() {
        let image = [0.2, 0.4, 0.6, 0.8, 0.1, 0.3];
        let with = |change| {
            let mut copy = image;
            Jitter {
                changes: vec![change],
            }
            .apply(&mut copy);
            copy
        };
        assert!((with(Change::Brightness(0.5))[3] - 0.4).abs() < 1e-6);
        let grey = with(Change::Saturation(0.0));
        assert!((grey[0] - grey[2]).abs() < 1e-6 && (grey[0] - grey[4]).abs() < 1e-6);
        let flat = with(Change::Contrast(0.0));
        assert!((flat[0] - flat[1]).abs() < 1e-6 && (flat[0] - flat[4]).abs() < 1e-6);
    }
}
