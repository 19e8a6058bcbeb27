//! From the light in a picture to the bytes of an image: lens, sensor, processing, file.
//!
//! The order is that of a camera: lateral colour, softness and vignetting of the lens; exposure, shot and read noise and clipping in the
//! sensor; white balance, saturation, tone curve and sharpening in its processor; the file's JPEG.

mod lens;
mod plane;
mod processing;
mod sensor;

use super::draw::{FastNoise, log_uniform, normal};
use super::weather::Weather;
use crate::texture::Rgb;
use image::RgbImage;
use plane::Planes;
use rand::Rng;
use rand_chacha::ChaCha8Rng;
use serde::Serialize;

/// One camera's image formation, with the random effects of one picture.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(super) struct Formation {
    lens: lens::Lens,
    sensor: sensor::Sensor,
    processing: processing::Processing,
    /// JPEG quality, if the image was stored in a file.
    #[serde(rename = "jpeg_quality")]
    quality: Option<u8>,
}

/// Brightness of the scene, for the automatic exposure.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Brightness {
    /// Daylight: the exposure is right, apart from its error.
    Day,
    /// Lamps: the exposure stays too short, and the gain is high.
    Dark,
}

impl Brightness {
    /// The brightness in this weather.
    pub(super) fn of(weather: Weather) -> Self {
        match weather {
            Weather::Night | Weather::Indoor => Self::Dark,
            _ => Self::Day,
        }
    }
}

impl Formation {
    /// Draws the image formation of a camera; `grey` is the share of cameras without colour.
    pub(super) fn draw(rng: &mut ChaCha8Rng, brightness: Brightness, grey: f64) -> Self {
        Self {
            lens: lens::Lens::draw(rng),
            sensor: sensor::Sensor::draw(rng, brightness),
            processing: processing::Processing::draw(rng, grey),
            // Half of the pictures show JPEG blocks at their own size; the others were reduced in size after compression.
            quality: rng
                .random_bool(0.5)
                .then(|| normal(rng, 78.0, 14.0, 3.5).clamp(30.0, 95.0) as u8),
        }
    }

    /// The same camera for another picture: only the smear is drawn anew.
    pub(super) fn of_another_picture(&self, rng: &mut ChaCha8Rng) -> Self {
        Self {
            lens: self.lens.of_another_picture(rng),
            ..self.clone()
        }
    }

    /// Whether the camera has no colour.
    pub(super) fn is_grey(&self) -> bool {
        self.processing.grey.is_some()
    }

    /// The image made from the light of `width` × `height` pixels, row by row; `seed` is that of the noise.
    pub(super) fn image(&self, light: &[Rgb], width: usize, height: usize, seed: u64) -> RgbImage {
        let mut planes = Planes::of(light, width, height);
        self.lens.pass(&mut planes);
        self.sensor.expose(&mut planes, &mut FastNoise::new(seed));
        let image = self.processing.develop(planes);
        match self.quality {
            Some(quality) => processing::through_jpeg(image, quality),
            None => image,
        }
    }
}

/// A value for this share of draws, and `none` for the others.
fn sometimes<T>(
    rng: &mut ChaCha8Rng,
    share: f64,
    none: T,
    some: impl FnOnce(&mut ChaCha8Rng) -> T,
) -> T {
    if rng.random_bool(share) {
        some(rng)
    } else {
        none
    }
}

/// 2 to the power of a normal draw: a factor in stops.
fn stops(rng: &mut ChaCha8Rng, deviation: f64, most: f64) -> f32 {
    normal(rng, 0.0, deviation, most).exp2() as f32
}

/// As [`log_uniform`], in single precision.
fn scale(rng: &mut ChaCha8Rng, least: f64, most: f64) -> f32 {
    log_uniform(rng, least, most) as f32
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::varied::draw::generator;

    fn ramp(width: usize, height: usize) -> Vec<Rgb> {
        (0..width * height)
            .map(|i| {
                let x = (i % width) as f32 / width as f32;
                Rgb::new(0.9, 0.8, 0.7) * (0.02 + x * x)
            })
            .collect()
    }

    #[test]
    fn equal_draws_give_equal_images_and_others_differ() {
        let light = ramp(96, 48);
        let image = |number| {
            let formation = Formation::draw(&mut generator(1, number, 2), Brightness::Day, 0.15);
            formation.image(&light, 96, 48, 5)
        };
        assert_eq!(image(3).as_raw(), image(3).as_raw());
        assert_ne!(image(3).as_raw(), image(4).as_raw());
    }

    /// Between pictures of a camera only the smear changes, which one of twenty has.
    #[test]
    fn pictures_of_one_camera_differ_in_the_smear_only() {
        let formation = Formation::draw(&mut generator(1, 3, 2), Brightness::Day, 0.15);
        let mut smeared = 0;
        for number in 0..1000 {
            let other = formation.of_another_picture(&mut generator(1, number, 7));
            smeared += usize::from(other.lens.is_shaken());
            assert_eq!(other.sensor, formation.sensor);
            assert_eq!(other.processing, formation.processing);
            assert_eq!(other.quality, formation.quality);
        }
        assert!((20..100).contains(&smeared), "{smeared}");
    }

    /// Every image formation keeps the order of brightness of the scene and shows something.
    #[test]
    fn every_camera_keeps_the_order_of_brightness() {
        let light = ramp(96, 48);
        let (mut grey, mut clipped) = (0, 0);
        for number in 0..400 {
            let brightness = if number % 5 == 0 {
                Brightness::Dark
            } else {
                Brightness::Day
            };
            let formation = Formation::draw(&mut generator(1, number, 2), brightness, 0.15);
            let image = formation.image(&light, 96, 48, number);
            let mean = |from: u32, to: u32| {
                let sum: u32 = image
                    .enumerate_pixels()
                    .filter(|(x, ..)| (from..to).contains(x))
                    .map(|(_, _, p)| u32::from(p.0[1]))
                    .sum();
                f64::from(sum) / f64::from((to - from) * 48)
            };
            let (dark, bright) = (mean(8, 24), mean(64, 80));
            assert!(
                bright > dark + 6.0,
                "{number}: {dark} to {bright}: {formation:?}"
            );
            clipped += usize::from(image.pixels().filter(|p| p.0[1] == 255).count() > 96);
            if formation.is_grey() {
                grey += 1;
                assert!(image.pixels().all(|p| p.0[0] == p.0[1] && p.0[1] == p.0[2]));
            }
        }
        assert!((35..90).contains(&grey), "{grey}");
        assert!(clipped > 8, "only {clipped} are overexposed");
    }
}
