//! Value noise, hashes and box-filtered patterns: the elements of every texture.
//!
//! Every function takes the size of the pixel's footprint on the surface, in metres, and leaves out detail that such a pixel cannot
//! resolve. So a texture is the same from every viewpoint.

use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// Cells of the noise table along each axis: a power of two, so that a mask wraps coordinates.
const SIZE: usize = 256;

/// Ratio of the wavelengths of two octaves. Not 1/2, so that repetitions of the table never line up.
const LACUNARITY: f32 = 0.46;

/// Two-dimensional value noise from a random table.
pub(crate) struct Noise {
    table: Vec<f32>,
}

impl Noise {
    /// The noise with this seed.
    pub(crate) fn new(seed: u64) -> Self {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        Self {
            table: (0..SIZE * SIZE)
                .map(|_| rng.random_range(-1.0..1.0))
                .collect(),
        }
    }

    /// Smooth noise of wavelength 1 in [−1, 1].
    #[inline]
    pub(crate) fn at(&self, x: f32, y: f32) -> f32 {
        let (x0, y0) = (x.floor(), y.floor());
        let (fx, fy) = (x - x0, y - y0);
        // The mask wraps negative coordinates too.
        let (ix, iy) = (x0 as i32 as usize, y0 as i32 as usize);
        let (left, right) = (ix & (SIZE - 1), ix.wrapping_add(1) & (SIZE - 1));
        let top = (iy & (SIZE - 1)) * SIZE;
        let bottom = (iy.wrapping_add(1) & (SIZE - 1)) * SIZE;
        let sx = fx * fx * (3.0 - 2.0 * fx);
        let sy = fy * fy * (3.0 - 2.0 * fy);
        let a = lerp(self.table[top + left], self.table[top + right], sx);
        let b = lerp(self.table[bottom + left], self.table[bottom + right], sx);
        lerp(a, b, sy)
    }

    /// Noise of one wavelength in metres, faded out for pixels of size `footprint` that cannot resolve it.
    #[inline]
    pub(crate) fn wave(&self, x: f32, y: f32, wavelength: f32, footprint: f32) -> f32 {
        let weight = visibility(wavelength, footprint);
        if weight <= 0.0 {
            return 0.0;
        }
        weight * self.at(x / wavelength, y / wavelength)
    }

    /// Several octaves, from `wavelength` (metres) down; the amplitude of each is `gain` times that of the one before. Stops at octaves
    /// that a pixel of size `footprint` cannot resolve.
    #[inline]
    pub(crate) fn fractal(
        &self,
        x: f32,
        y: f32,
        wavelength: f32,
        octaves: u32,
        gain: f32,
        footprint: f32,
    ) -> f32 {
        let (mut sum, mut amplitude, mut length) = (0.0, 1.0, wavelength);
        for octave in 0..octaves {
            let weight = visibility(length, footprint);
            if weight <= 0.0 {
                break;
            }
            let shift = 17.3 * octave as f32;
            sum += amplitude * weight * self.at(x / length + shift, y / length - shift);
            amplitude *= gain;
            length *= LACUNARITY;
        }
        sum
    }

    /// Thin lines where the noise changes sign: cracks, veins. 1 on a line, 0 off it; `width` in metres. A line thinner than the footprint
    /// gets fainter instead of thinner.
    #[inline]
    pub(crate) fn ridge(&self, x: f32, y: f32, wavelength: f32, width: f32, footprint: f32) -> f32 {
        let weight = visibility(wavelength, footprint);
        if weight <= 0.0 {
            return 0.0;
        }
        let wide = width.max(footprint);
        let distance = self.at(x / wavelength, y / wavelength).abs() * wavelength * 0.6;
        weight * (width / wide) * (1.0 - distance / wide).max(0.0)
    }
}

/// Share of the contrast of a wave of this length that remains in a pixel of this size, in [0, 1].
#[inline]
fn visibility(wavelength: f32, footprint: f32) -> f32 {
    ((wavelength / footprint.max(1e-4) - 1.0) * 0.9).clamp(0.0, 1.0)
}

#[inline]
pub(crate) fn lerp(a: f32, b: f32, t: f32) -> f32 {
    a + (b - a) * t
}

/// 0 below `a`, 1 above `b`, smooth between.
#[inline]
pub(crate) fn smoothstep(a: f32, b: f32, x: f32) -> f32 {
    let t = ((x - a) / (b - a)).clamp(0.0, 1.0);
    t * t * (3.0 - 2.0 * t)
}

/// √(x² + y²), without the handling of huge numbers that makes `hypot` slow.
#[inline]
pub(crate) fn length(x: f32, y: f32) -> f32 {
    (x * x + y * y).sqrt()
}

/// A well-mixed hash of a cell.
#[inline]
pub(crate) fn hash(x: i32, y: i32, seed: u32) -> u32 {
    let mut h = (x as u32).wrapping_mul(0x9E37_79B1)
        ^ (y as u32).wrapping_mul(0x85EB_CA77).rotate_left(13)
        ^ seed.wrapping_mul(0xC2B2_AE3D);
    h ^= h >> 15;
    h = h.wrapping_mul(0x2C1B_3C6D);
    h ^= h >> 12;
    h = h.wrapping_mul(0x297A_2D39);
    h ^ (h >> 15)
}

/// A number in [0, 1) from 8 bits of a hash; the values 0 to 3 of `byte` give four independent ones.
#[inline]
pub(crate) fn unit(hash: u32, byte: u32) -> f32 {
    ((hash >> (8 * byte)) & 0xFF) as f32 / 256.0
}

/// Share of the pixel [x − f/2, x + f/2] inside the band [a, b].
#[inline]
pub(crate) fn band(x: f32, a: f32, b: f32, footprint: f32) -> f32 {
    let f = footprint.max(1e-4);
    (((x + 0.5 * f).min(b) - (x - 0.5 * f).max(a)) / f).clamp(0.0, 1.0)
}

/// Share of the pixel [x − f/2, x + f/2] beyond `edge`.
#[inline]
pub(crate) fn beyond(x: f32, edge: f32, footprint: f32) -> f32 {
    ((x - edge) / footprint.max(1e-4) + 0.5).clamp(0.0, 1.0)
}

/// Share of the pixel inside bands [a, b] that repeat every `period` (0 ≤ a ≤ b ≤ period): exact for footprints of any size.
#[inline]
pub(crate) fn bands(x: f32, period: f32, a: f32, b: f32, footprint: f32) -> f32 {
    let f = footprint.max(1e-4);
    let covered = |x: f32| {
        let cell = (x / period).floor();
        cell * (b - a) + (x - cell * period - a).clamp(0.0, b - a)
    };
    ((covered(x + 0.5 * f) - covered(x - 0.5 * f)) / f).clamp(0.0, 1.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn noise_is_bounded_continuous_and_fixed_by_its_seed() {
        let (a, b) = (Noise::new(1), Noise::new(2));
        let mut differ = false;
        for i in 0..2000 {
            let (x, y) = (i as f32 * 0.731 - 700.0, i as f32 * -0.377 + 90.0);
            let here = a.at(x, y);
            assert!((-1.0..=1.0).contains(&here));
            assert!((here - a.at(x + 1e-3, y)).abs() < 5e-3);
            differ |= (here - b.at(x, y)).abs() > 0.1;
        }
        assert!(differ);
    }

    #[test]
    fn fine_waves_vanish_from_coarse_pixels() {
        let noise = Noise::new(3);
        for i in 0..100 {
            let x = i as f32 * 0.37;
            assert_eq!(noise.wave(x, -x, 0.5, 0.55), 0.0);
            assert_eq!(noise.fractal(x, x, 0.5, 6, 0.6, 0.55), 0.0);
        }
    }

    /// The closed form equals a brute-force average of the pattern over the pixel.
    #[test]
    fn bands_are_exactly_filtered() {
        for (x, f) in [(0.3f32, 0.2f32), (1.7, 0.9), (-4.2, 3.3), (10.0, 0.05)] {
            let (period, a, b) = (1.3f32, 0.2f32, 0.7f32);
            let n = 20_000;
            let inside = (0..n)
                .filter(|i| {
                    let p = x - 0.5 * f + f * (*i as f32 + 0.5) / n as f32;
                    let phase = p.rem_euclid(period);
                    phase > a && phase < b
                })
                .count();
            let mean = inside as f32 / n as f32;
            assert!((bands(x, period, a, b, f) - mean).abs() < 2e-3, "{x} {f}");
        }
    }

    #[test]
    fn hashes_spread() {
        let mean: f32 = (0..4096)
            .map(|i| unit(hash(i % 64, i / 64, 7), 1))
            .sum::<f32>()
            / 4096.0;
        assert!((mean - 0.5).abs() < 0.02, "{mean}");
    }
}
