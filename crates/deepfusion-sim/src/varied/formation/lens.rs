//! Effects of the lens.

use super::plane::{Planes, bell, filter, sample};
use super::{scale, sometimes, stops};
use rand::Rng;
use rand_chacha::ChaCha8Rng;
use serde::Serialize;

/// A lens and its errors, and how the camera was held.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(super) struct Lens {
    /// Standard deviation of the blur, pixels; 0: none.
    #[serde(rename = "blur_px")]
    blur: f32,
    /// Length (pixels) and direction (radians) of the smear of one picture, if the camera turned while the shutter was open.
    #[serde(skip)]
    shake: Option<(f32, f32)>,
    /// Relative enlargement of the red and the blue image, compared with the green one.
    lateral: [f32; 2],
    /// Share of the light that is lost in the corners.
    vignette: f32,
    /// Share of the picture's mean light that dust and glare spread over all of it.
    veil: f32,
}

impl Lens {
    /// Blur: none in half of the lenses, as in pictures that were reduced in size; a deviation of 0.25 to 0.6 pixels in three of eight, and
    /// of up to 1.6 in one of eight. One picture of twenty is smeared by 1.5 to 6 pixels, mostly sideways, as cameras turn.
    pub(super) fn draw(rng: &mut ChaCha8Rng) -> Self {
        Self {
            blur: match rng.random_range(0..8) {
                0..=3 => 0.0,
                4..=6 => scale(rng, 0.25, 0.6),
                _ => scale(rng, 0.6, 1.6),
            },
            shake: shake(rng),
            lateral: sometimes(rng, 0.3, [0.0; 2], |rng| {
                let strength = 0.0015 * stops(rng, 0.5, 2.0);
                [strength, -strength * rng.random_range(0.2..1.0)]
            }),
            vignette: sometimes(rng, 0.6, 0.0, |rng| rng.random_range(0.03..0.45)),
            veil: sometimes(rng, 0.2, 0.0, |rng| scale(rng, 0.02, 0.2)),
        }
    }

    /// The same lens for another picture, with a new smear.
    pub(super) fn of_another_picture(&self, rng: &mut ChaCha8Rng) -> Self {
        Self {
            shake: shake(rng),
            ..self.clone()
        }
    }

    /// Whether its picture is smeared.
    #[cfg(test)]
    pub(super) fn is_shaken(&self) -> bool {
        self.shake.is_some()
    }

    /// Applies the lens to the light.
    pub(super) fn pass(&self, planes: &mut Planes) {
        if self.lateral != [0.0; 2] {
            self.spread_colours(planes);
        }
        if let Some((length, direction)) = self.shake {
            smear(planes, length, direction);
        }
        if self.blur > 0.0 {
            let taps = bell(self.blur);
            let mut work = vec![0.0; planes.width * planes.height];
            for plane in &mut planes.of {
                filter(plane, &mut work, planes.width, &taps);
            }
        }
        if self.vignette > 0.0 || self.veil > 0.0 {
            self.shade(planes);
        }
    }

    fn spread_colours(&self, planes: &mut Planes) {
        let (width, height) = (planes.width, planes.height);
        let (cx, cy) = (0.5 * (width as f32 - 1.0), 0.5 * (height as f32 - 1.0));
        for (number, larger) in [(0, self.lateral[0]), (2, self.lateral[1])] {
            let scale = 1.0 / (1.0 + larger);
            let source = planes.of[number].clone();
            for (v, row) in planes.of[number].chunks_mut(width).enumerate() {
                let y = cy + (v as f32 - cy) * scale;
                for (u, value) in row.iter_mut().enumerate() {
                    *value = sample(&source, width, cx + (u as f32 - cx) * scale, y);
                }
            }
        }
    }

    fn shade(&self, planes: &mut Planes) {
        let (width, height) = (planes.width, planes.height);
        let (cx, cy) = (0.5 * (width as f32 - 1.0), 0.5 * (height as f32 - 1.0));
        let corner = 1.0 / (cx * cx + cy * cy);
        for plane in &mut planes.of {
            let mean = plane.iter().sum::<f32>() / plane.len() as f32;
            let veil = self.veil * mean;
            for (v, row) in plane.chunks_mut(width).enumerate() {
                let dy = v as f32 - cy;
                for (u, value) in row.iter_mut().enumerate() {
                    let dx = u as f32 - cx;
                    let kept = 1.0 - self.vignette * (dx * dx + dy * dy) * corner;
                    *value = *value * kept + veil;
                }
            }
        }
    }
}

/// Length and direction of the smear, in one picture of twenty.
fn shake(rng: &mut ChaCha8Rng) -> Option<(f32, f32)> {
    sometimes(rng, 0.05, None, |rng| {
        let direction = if rng.random_bool(0.7) {
            rng.random_range(-0.3..0.3)
        } else {
            rng.random_range(-1.6..1.6)
        };
        Some((rng.random_range(1.5..6.0), direction))
    })
}

/// The mean along a line of this length. A turn of the camera moves near and far objects alike, so this is exact for small turns.
fn smear(planes: &mut Planes, length: f32, direction: f32) {
    let (width, height) = (planes.width, planes.height);
    let steps = (1.5 * length).ceil() as i32;
    let shifts: Vec<(f32, f32)> = (0..=steps)
        .map(|i| {
            let along = length * (i as f32 / steps as f32 - 0.5);
            (along * direction.cos(), along * direction.sin())
        })
        .collect();
    let share = 1.0 / shifts.len() as f32;
    for plane in &mut planes.of {
        let source = plane.clone();
        for v in 0..height {
            for u in 0..width {
                let sum: f32 = shifts
                    .iter()
                    .map(|(dx, dy)| sample(&source, width, u as f32 + dx, v as f32 + dy))
                    .sum();
                plane[v * width + u] = sum * share;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn point(width: usize, height: usize, u: usize, v: usize) -> Planes {
        let mut plane = vec![0.0; width * height];
        plane[v * width + u] = 1.0;
        Planes {
            width,
            height,
            of: [plane.clone(), plane.clone(), plane],
        }
    }

    const IDEAL: Lens = Lens {
        blur: 0.0,
        shake: None,
        lateral: [0.0; 2],
        vignette: 0.0,
        veil: 0.0,
    };

    #[test]
    fn an_ideal_lens_changes_nothing() {
        let mut planes = point(20, 10, 3, 4);
        let before = planes.of.clone();
        IDEAL.pass(&mut planes);
        assert_eq!(planes.of, before);
    }

    #[test]
    fn a_sideways_turn_smears_a_point_sideways() {
        let mut planes = point(41, 21, 20, 10);
        Lens {
            shake: Some((6.0, 0.0)),
            ..IDEAL
        }
        .pass(&mut planes);
        let plane = &planes.of[1];
        assert!((plane.iter().sum::<f32>() - 1.0).abs() < 1e-4);
        assert!(plane[10 * 41 + 18] > 0.1 && plane[10 * 41 + 22] > 0.1);
        assert!(plane[9 * 41 + 20] == 0.0 && plane[10 * 41 + 25] == 0.0);
    }

    #[test]
    fn red_lies_farther_out_and_corners_are_darker() {
        let mut planes = Planes {
            width: 101,
            height: 51,
            of: [0, 1, 2].map(|_| (0..101 * 51).map(|i| (i % 101) as f32).collect()),
        };
        let lens = Lens {
            lateral: [0.01, 0.0],
            vignette: 0.4,
            ..IDEAL
        };
        lens.spread_colours(&mut planes);
        // 40 pixels from the middle, red comes from a place 0.4 pixels nearer to it.
        let at = 25 * 101 + 90;
        assert!(
            (planes.of[0][at] - 89.6).abs() < 0.01,
            "{}",
            planes.of[0][at]
        );
        assert!(planes.of[1][at] == 90.0);
        lens.shade(&mut planes);
        assert!((planes.of[1][100] - 60.0).abs() < 0.01);
    }
}
