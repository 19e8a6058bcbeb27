//! From the sensor's reading to an image: colours, tones, sharpening, the file.

use super::plane::{Planes, bell, filter};
use super::sensor::LUMA;
use super::sometimes;
use crate::varied::draw::normal;
use image::{ImageFormat, RgbImage};
use jpeg_encoder::{ColorType, Encoder};
use rand::Rng;
use rand_chacha::ChaCha8Rng;
use serde::Serialize;

/// Entries of a tone curve.
const TONES: usize = 2048;

/// Unsharp masking.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
struct Sharpen {
    /// Factor on the difference from the blurred picture.
    strength: f32,
    /// Standard deviation of the blur, pixels.
    deviation_px: f32,
}

/// A camera's processor.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(super) struct Processing {
    /// Weights of red, green and blue, if the camera has no colour.
    pub grey: Option<[f32; 3]>,
    /// Saturation of colours: 1 keeps them, 0 removes them.
    saturation: f32,
    /// The exponent of the tone curve is 1 / `gamma`.
    gamma: f32,
    /// Share of an S-shaped tone curve: dark tones darker, bright tones brighter.
    contrast: f32,
    /// Where highlights begin to be compressed, as a share of full scale; 1: they clip.
    shoulder: f32,
    /// Level of black, as a share of white.
    black: f32,
    /// Unsharp masking, if any.
    sharpen: Option<Sharpen>,
    /// Levels per channel, at most 256.
    levels: f32,
}

impl Processing {
    /// Draws a processor; `grey` is the share of cameras without colour.
    pub(super) fn draw(rng: &mut ChaCha8Rng, grey: f64) -> Self {
        Self {
            grey: sometimes(rng, grey, None, |rng| {
                // Some cameras see near infrared in their red pixels.
                let weights: [f32; 3] = [
                    rng.random_range(0.15..0.5),
                    rng.random_range(0.4..0.8),
                    rng.random_range(0.03..0.3),
                ];
                let sum: f32 = weights.iter().sum();
                Some(weights.map(|w| w / sum))
            }),
            saturation: normal(rng, 0.95, 0.25, 2.5) as f32,
            gamma: normal(rng, 2.15, 0.2, 2.5) as f32,
            contrast: normal(rng, 0.75, 0.5, 2.0).clamp(-0.2, 1.7) as f32,
            shoulder: sometimes(rng, 0.6, 1.0, |rng| rng.random_range(0.4..0.9)),
            black: sometimes(rng, 0.2, 0.0, |rng| rng.random_range(0.0..0.07)),
            sharpen: sometimes(rng, 0.6, None, |rng| {
                Some(Sharpen {
                    strength: rng.random_range(0.2..1.3),
                    deviation_px: rng.random_range(0.5..1.3),
                })
            }),
            levels: sometimes(rng, 0.03, 256.0, |rng| rng.random_range(40.0..128.0)),
        }
    }

    /// The image made from a sensor's reading.
    pub(super) fn develop(&self, mut planes: Planes) -> RgbImage {
        self.colour(&mut planes);
        let tones = self.tones();
        let channels = if self.grey.is_some() { 1 } else { 3 };
        for plane in &mut planes.of[..channels] {
            for value in plane.iter_mut() {
                // By the square root, which gives dark tones more entries.
                let at = value.clamp(0.0, 1.0).sqrt() * (TONES - 1) as f32;
                let index = (at as usize).min(TONES - 2);
                let part = at - index as f32;
                *value = tones[index] + (tones[index + 1] - tones[index]) * part;
            }
        }
        if let Some(Sharpen {
            strength,
            deviation_px,
        }) = self.sharpen
        {
            let taps = bell(deviation_px);
            let mut work = vec![0.0; planes.width * planes.height];
            for plane in &mut planes.of[..channels] {
                let mut soft = plane.clone();
                filter(&mut soft, &mut work, planes.width, &taps);
                for (value, soft) in plane.iter_mut().zip(&soft) {
                    *value += strength * (*value - soft);
                }
            }
        }
        let step = 255.0 / (self.levels - 1.0).min(255.0);
        let byte = |value: f32| {
            let level = (value * 255.0 / step + 0.5).floor() * step;
            level.clamp(0.0, 255.0) as u8
        };
        let mut bytes = Vec::with_capacity(3 * planes.width * planes.height);
        for i in 0..planes.width * planes.height {
            let pixel = match channels {
                1 => [byte(planes.of[0][i]); 3],
                _ => [0, 1, 2].map(|c| byte(planes.of[c][i])),
            };
            bytes.extend_from_slice(&pixel);
        }
        let (width, height) = (planes.width as u32, planes.height as u32);
        // The buffer has 3 · width · height bytes by construction.
        RgbImage::from_raw(width, height, bytes).unwrap_or_else(|| RgbImage::new(width, height))
    }

    /// Moves colours towards grey or away from it. For a grey camera only the first plane is used.
    fn colour(&self, planes: &mut Planes) {
        let weights = self.grey.unwrap_or(LUMA);
        let [red, green, blue] = &mut planes.of;
        for ((r, g), b) in red.iter_mut().zip(green.iter_mut()).zip(blue.iter_mut()) {
            let luma = weights[0] * *r + weights[1] * *g + weights[2] * *b;
            if self.grey.is_some() {
                *r = luma;
            } else {
                for value in [r, g, b] {
                    *value = luma + self.saturation * (*value - luma);
                }
            }
        }
    }

    /// The tone curve at the squares of evenly spaced numbers.
    fn tones(&self) -> Vec<f32> {
        (0..TONES)
            .map(|i| {
                let x = (i as f32 / (TONES - 1) as f32).powi(2);
                let x = if x > self.shoulder {
                    let rest = 1.0 - self.shoulder;
                    let bent = 1.0 - (-(x - self.shoulder) / rest).exp();
                    self.shoulder + rest * bent / (1.0 - (-1.0f32).exp())
                } else {
                    x
                };
                let value = x.powf(1.0 / self.gamma);
                // Up to 1 a share of the S-curve; beyond that also a share of the S-curve applied twice. Both are increasing.
                let bend = |x: f32, share: f32| x + share * (x * x * (3.0 - 2.0 * x) - x);
                let once = bend(value, self.contrast.min(1.0));
                let toned = bend(once, (self.contrast - 1.0).max(0.0));
                self.black + (1.0 - self.black) * toned
            })
            .collect()
    }
}

/// The image after it was stored as a JPEG file of this quality.
pub(super) fn through_jpeg(image: RgbImage, quality: u8) -> RgbImage {
    let (width, height) = image.dimensions();
    let mut file = Vec::new();
    let encoder = Encoder::new(&mut file, quality);
    // Encoding a valid image in memory and decoding it do not fail. If they did, the image would stay as it is.
    let stored = encoder
        .encode(image.as_raw(), width as u16, height as u16, ColorType::Rgb)
        .is_ok();
    match image::load_from_memory_with_format(&file, ImageFormat::Jpeg) {
        Ok(back) if stored => back.into_rgb8(),
        _ => image,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::varied::draw::generator;

    #[test]
    fn tone_curves_rise_from_black_to_white() {
        for number in 0..500 {
            let processing = Processing::draw(&mut generator(2, number, 1), 0.1);
            let tones = processing.tones();
            assert!(
                tones.windows(2).all(|w| w[1] >= w[0] - 1e-6),
                "{processing:?}"
            );
            assert!(tones[0] < 0.08 && (tones[TONES - 1] - 1.0).abs() < 1e-4);
        }
    }

    #[test]
    fn coarse_jpeg_changes_more_than_fine_jpeg() {
        let image = RgbImage::from_fn(64, 48, |x, y| {
            image::Rgb([(x * 37 + y * 91) as u8, (x * y) as u8, (y * 53) as u8])
        });
        let error = |quality| -> u32 {
            let back = through_jpeg(image.clone(), quality);
            assert_eq!(back.dimensions(), (64, 48));
            back.as_raw()
                .iter()
                .zip(image.as_raw())
                .map(|(a, b)| u32::from(a.abs_diff(*b)))
                .sum()
        };
        assert!(error(30) > error(95) && error(95) > 0);
    }

    #[test]
    fn few_levels_make_bands() {
        let mut processing = Processing::draw(&mut generator(2, 1, 1), 0.0);
        processing.levels = 16.0;
        processing.sharpen = None;
        let ramp: Vec<f32> = (0..512).map(|i| i as f32 / 511.0).collect();
        let image = processing.develop(Planes {
            width: 512,
            height: 1,
            of: [ramp.clone(), ramp.clone(), ramp],
        });
        let mut seen: Vec<u8> = image.pixels().map(|p| p.0[1]).collect();
        seen.dedup();
        assert!(seen.len() <= 16, "{seen:?}");
    }
}
