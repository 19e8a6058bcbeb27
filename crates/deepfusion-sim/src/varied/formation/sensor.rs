//! Exposure, noise and clipping.

use super::plane::{Planes, bell, filter};
use super::{Brightness, scale, sometimes, stops};
use crate::varied::draw::FastNoise;
use rand::Rng;
use rand_chacha::ChaCha8Rng;
use serde::Serialize;

/// Weights of red, green and blue in the light that the exposure is measured by (ITU-R BT.709).
pub(super) const LUMA: [f32; 3] = [0.2126, 0.7152, 0.0722];

/// A sensor and its automatic exposure.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(super) struct Sensor {
    /// The mean that the exposure aims at, as a share of full scale, including its error.
    aim: f32,
    /// Additional weight of the lower half of the picture in the measurement.
    below: f32,
    /// Greatest gain: darker scenes stay dark.
    gain: f32,
    /// Variance of the noise per unit of signal, and of the noise without signal.
    noise: [f32; 2],
    /// Standard deviation of the blur of the noise, pixels, where a processor has smoothed it; 0: none.
    #[serde(rename = "grain_px")]
    grain: f32,
    /// Errors of the white balance: gains of red, green and blue.
    balance: [f32; 3],
    /// How far the automatic white balance moves the picture's mean to grey: 0 not at all, 1 completely.
    greying: f32,
    /// Share of the light of the darkest parts that is subtracted as glare, 0 to 1.
    deepening: f32,
}

impl Sensor {
    /// Aims at 0.16 to 0.26 of full scale, measured mostly on the ground (the sky may clip), with an error of 0.4 stops (in one of seven
    /// cameras over one stop). The noise is 0.1 to 1.6 % of full scale, more in the dark, and smoothed to grains in half of the cameras.
    /// Two of three cameras subtract glare from the dark parts.
    pub(super) fn draw(rng: &mut ChaCha8Rng, brightness: Brightness) -> Self {
        let error = if rng.random_bool(0.14) {
            stops(rng, 0.9, 1.3)
        } else {
            stops(rng, 0.38, 2.5)
        };
        let dark = brightness == Brightness::Dark;
        let noise = scale(rng, 0.001, 0.016) * if dark { 2.0 } else { 1.0 };
        // White balance: along the colours of black bodies, with a small deviation.
        let (warm, green) = (stops(rng, 0.14, 2.5), stops(rng, 0.05, 2.0));
        Self {
            aim: rng.random_range(0.16..0.26) * error * if dark { 0.5 } else { 1.0 },
            below: rng.random_range(0.5..6.0),
            gain: if dark { scale(rng, 2.0, 12.0) } else { 20.0 },
            noise: [
                noise * noise * rng.random_range(0.5..3.0),
                noise * noise * 0.15,
            ],
            grain: sometimes(rng, 0.5, 0.0, |rng| rng.random_range(0.4..0.9)),
            balance: [warm, green, 1.0 / warm],
            greying: sometimes(rng, 0.8, 0.0, |rng| rng.random_range(0.3..1.0)),
            deepening: sometimes(rng, 0.67, 0.0, |rng| rng.random_range(0.3..0.85)),
        }
    }

    /// From linear light to the sensor's reading, 0 to 1.
    pub(super) fn expose(&self, planes: &mut Planes, stream: &mut FastNoise) {
        self.deepen(planes);
        let towards_grey = self.towards_grey(planes);
        let gain = (self.aim / self.measured(planes).max(1e-6)).min(self.gain);
        let count = planes.width * planes.height;
        let mut noise = vec![0.0f32; count];
        let mut work = Vec::new();
        for (number, plane) in planes.of.iter_mut().enumerate() {
            for value in &mut noise {
                *value = stream.next();
            }
            if self.grain > 0.0 {
                work.resize(count, 0.0);
                let taps = bell(self.grain);
                filter(&mut noise, &mut work, planes.width, &taps);
                // Restore half of the deviation that smoothing removed: smoothed noise is also weaker.
                let left: f32 =
                    taps[0].powi(2) + 2.0 * taps[1..].iter().map(|t| t * t).sum::<f32>();
                let back = 0.5 + 0.5 / left;
                for value in &mut noise {
                    *value *= back;
                }
            }
            let gain = gain * self.balance[number] * towards_grey[number];
            for (value, noise) in plane.iter_mut().zip(&noise) {
                let signal = *value * gain;
                let deviation = (self.noise[0] * signal.max(0.0) + self.noise[1]).sqrt();
                *value = (signal + deviation * noise).clamp(0.0, 1.0);
            }
        }
    }

    /// Subtracts a part of the light of the darkest hundredth.
    fn deepen(&self, planes: &mut Planes) {
        if self.deepening <= 0.0 {
            return;
        }
        for plane in &mut planes.of {
            let mut some: Vec<f32> = plane.iter().copied().step_by(7).collect();
            let rank = some.len() / 100;
            let darkest = *some.select_nth_unstable_by(rank, f32::total_cmp).1;
            let off = self.deepening * darkest;
            for value in plane.iter_mut() {
                *value = (*value - off).max(0.0);
            }
        }
    }

    /// Gains of the automatic white balance.
    fn towards_grey(&self, planes: &Planes) -> [f32; 3] {
        let means: [f32; 3] = [0, 1, 2].map(|c| {
            let plane = &planes.of[c];
            plane.iter().step_by(5).map(|x| x.min(2.0)).sum::<f32>() + 1e-6
        });
        let grey = (means[0] * means[1] * means[2]).cbrt();
        means.map(|mean| (grey / mean).clamp(0.4, 2.5).powf(self.greying))
    }

    /// The light that the automatic exposure measures; very bright spots count as bright ones.
    fn measured(&self, planes: &Planes) -> f32 {
        let (mut sum, mut weights) = (0.0, 0.0);
        let rows = planes.height;
        let luma = |i: usize| -> f32 { (0..3).map(|c| LUMA[c] * planes.of[c][i]).sum() };
        for v in (0..rows).step_by(3) {
            let weight = if 2 * v >= rows { 1.0 + self.below } else { 1.0 };
            for u in (0..planes.width).step_by(3) {
                sum += weight * luma(v * planes.width + u).min(2.0);
                weights += weight;
            }
        }
        sum / weights
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::varied::draw::generator;

    fn flat(value: f32) -> Planes {
        Planes {
            width: 64,
            height: 64,
            of: [0, 1, 2].map(|_| vec![value; 64 * 64]),
        }
    }

    fn plain() -> Sensor {
        Sensor {
            aim: 0.2,
            below: 1.0,
            gain: 10.0,
            noise: [0.0; 2],
            grain: 0.0,
            balance: [1.0; 3],
            greying: 0.0,
            deepening: 0.0,
        }
    }

    #[test]
    fn the_exposure_reaches_its_aim_unless_the_gain_is_too_low() {
        for (light, expected) in [(0.05, 0.2), (1.7, 0.2), (0.001, 0.01)] {
            let mut planes = flat(light);
            plain().expose(&mut planes, &mut FastNoise::new(1));
            assert!((planes.of[1][77] - expected).abs() < 1e-5);
        }
    }

    #[test]
    fn overexposed_light_is_clipped() {
        let mut planes = flat(0.1);
        planes.of[1][5] = 9.0;
        plain().expose(&mut planes, &mut FastNoise::new(1));
        assert_eq!(planes.of[1][5], 1.0);
    }

    #[test]
    fn a_tint_is_removed_and_dark_parts_become_black() {
        let mut planes = flat(0.1);
        planes.of[0] = (0..64 * 64)
            .map(|i| 0.15 + 0.1 * (i % 64) as f32 / 64.0)
            .collect();
        let sensor = Sensor {
            greying: 1.0,
            deepening: 1.0,
            ..plain()
        };
        planes.of[1] = planes.of[0].iter().map(|x| 0.5 * x).collect();
        planes.of[2] = planes.of[0].clone();
        sensor.expose(&mut planes, &mut FastNoise::new(1));
        assert!(planes.of[1].iter().all(|x| (0.0..=1.0).contains(x)));
        let mean = |c: usize| planes.of[c].iter().sum::<f32>() / 4096.0;
        assert!(
            (mean(0) / mean(1) - 1.0).abs() < 0.01,
            "{} {}",
            mean(0),
            mean(1)
        );
        assert!(planes.of[0].iter().copied().fold(1.0, f32::min) < 0.01);
    }

    /// The variance of shot noise grows with the signal.
    #[test]
    fn noise_has_its_variance() {
        let sensor = Sensor {
            noise: [0.001, 0.0001],
            ..plain()
        };
        let mut planes = flat(0.3);
        sensor.expose(&mut planes, &mut FastNoise::new(7));
        let n = 64.0 * 64.0;
        let mean = planes.of[0].iter().sum::<f32>() / n;
        let variance = planes.of[0].iter().map(|x| (x - mean).powi(2)).sum::<f32>() / n;
        assert!((mean - 0.2).abs() < 0.002, "{mean}");
        assert!((variance / 0.0003 - 1.0).abs() < 0.1, "{variance}");
    }

    #[test]
    fn draws_are_within_their_bounds() {
        for number in 0..2000 {
            for brightness in [Brightness::Day, Brightness::Dark] {
                let sensor = Sensor::draw(&mut generator(1, number, 1), brightness);
                assert!(sensor.aim > 0.02 && sensor.aim < 0.8, "{sensor:?}");
                assert!(sensor.noise[0].sqrt() < 0.06 && sensor.noise[1] >= 0.0);
                assert!(sensor.balance.iter().all(|b| (0.75..1.35).contains(b)));
            }
        }
    }
}
