//! Random surfaces: walls, boards, cloth and boxes of any colour, contrast and grain.
//!
//! A network should learn depth from geometry, not from a colour or the size of a grain. So both are random, over wider ranges than on a
//! real street.

use super::facade::courses;
use super::noise::{Noise, band, bands, beyond, hash, smoothstep, unit};
use super::{Patch, Rgb, mix, vary};
use crate::primitive::V3;
use rand::Rng;
use rand_chacha::ChaCha8Rng;

/// How the two colours are distributed over the surface.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Kind {
    /// The first colour alone.
    Plain,
    /// Cloudy patches.
    Blotches,
    /// Bands of the second colour, with this share of the period.
    Stripes(f32),
    /// A chequered board.
    Checks,
    /// Bricks, stones or tiles: length over height, and width of the joints as a share of the height.
    Courses(f32, f32),
    /// Boards with gaps; each has its own tone.
    Boards,
    /// Corrugated sheet metal.
    Corrugated,
    /// Fine dark and bright grains.
    Speckle,
    /// Rectangles of many colours: posters, books, parcels.
    Mosaic,
    /// Veins.
    Veins,
    /// Wire or bars in front of something dark.
    Mesh,
}

/// A random surface.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Pattern {
    /// Kind of the pattern.
    pub kind: Kind,
    /// The two colours of the pattern.
    pub colours: [Rgb; 2],
    /// Size of the pattern, metres.
    pub scale: f32,
    /// Cosine and sine of the rotation of the pattern in the surface.
    pub turn: (f32, f32),
    /// Wavelength (metres) and strength of fine noise.
    pub grain: [f32; 2],
    /// Wavelength (metres) and strength of coarse noise.
    pub blotch: [f32; 2],
    /// Amount of dirt that rises from the bottom, 0 to 1.
    pub dirt: f32,
    /// Share of the surface under posters and paint, 0 to 1.
    pub posters: f32,
}

/// A random colour with an albedo of 0.02 to 0.85; at `vivid` 0 it is grey, at 1 as vivid as a toy.
pub(crate) fn colour(rng: &mut ChaCha8Rng, vivid: f32) -> Rgb {
    let tone = if rng.random_bool(0.5) {
        rng.random_range(0.02..0.85f32)
    } else {
        // Uniform in the logarithm: the eye sees ratios, so dark and bright surfaces are equally frequent to it.
        0.02 * 40f32.powf(rng.random_range(0.0..1.0))
    };
    let hue = rng.random_range(0.0..std::f32::consts::TAU);
    let strength = vivid * rng.random_range(0.0..1.0f32);
    let wave = |turn: f32| 1.0 + 0.9 * strength * (hue + turn).cos();
    (Rgb::new(wave(0.0), wave(2.094), wave(4.189)) * tone).map(|c| c.clamp(0.012, 0.9))
}

/// A colour of plaster, stone or wood: greys, creams, browns, and sometimes a bold one.
pub(crate) fn wall_colour(rng: &mut ChaCha8Rng) -> Rgb {
    if rng.random_bool(0.18) {
        return colour(rng, 0.8);
    }
    let tone = rng.random_range(0.12..0.8f32);
    let warm = rng.random_range(-0.06..0.32f32);
    let green = rng.random_range(-0.04..0.06f32);
    Rgb::new(
        tone * (1.0 + 0.35 * warm),
        tone * (1.0 + green - 0.05 * warm),
        tone * (1.0 - warm),
    )
}

impl Pattern {
    /// Any pattern at all.
    pub(crate) fn wild(rng: &mut ChaCha8Rng) -> Self {
        let vivid = rng.random_range(0.0..1.0);
        let kind = match rng.random_range(0..13) {
            0 => Kind::Plain,
            1..=2 => Kind::Blotches,
            3 => Kind::Stripes(rng.random_range(0.1..0.9)),
            4 => Kind::Checks,
            5..=6 => Kind::Courses(rng.random_range(0.8..4.0), rng.random_range(0.02..0.2)),
            7 => Kind::Boards,
            8 => Kind::Corrugated,
            9 => Kind::Speckle,
            10 => Kind::Mosaic,
            11 => Kind::Veins,
            _ => Kind::Mesh,
        };
        Self {
            kind,
            colours: [colour(rng, vivid), colour(rng, vivid)],
            scale: 0.05 * 40f32.powf(rng.random_range(0.0..1.0)),
            ..Self::plain(rng, Rgb::zeros())
        }
        .turned(rng)
    }

    /// A smooth surface of one colour with some grain.
    pub(crate) fn plain(rng: &mut ChaCha8Rng, colour: Rgb) -> Self {
        Self {
            kind: Kind::Plain,
            colours: [colour; 2],
            scale: 1.0,
            turn: (1.0, 0.0),
            grain: [
                0.05 * 30f32.powf(rng.random_range(0.0..1.0)),
                rng.random_range(0.0..1.0f32).powi(2) * 0.5,
            ],
            blotch: [
                rng.random_range(0.6..6.0),
                rng.random_range(0.0..1.0f32).powi(2) * 0.5,
            ],
            dirt: rng.random_range(0.0..0.7),
            posters: 0.0,
        }
    }

    /// Cladding of houses.
    pub(crate) fn wall(rng: &mut ChaCha8Rng) -> Self {
        let base = wall_colour(rng);
        let mut pattern = Self::plain(rng, base);
        let brick = Rgb::new(
            rng.random_range(0.16..0.5),
            rng.random_range(0.09..0.26),
            rng.random_range(0.06..0.2),
        );
        match rng.random_range(0..20) {
            0..=8 => {}
            9..=11 => {
                pattern.kind =
                    Kind::Courses(rng.random_range(2.2..3.6), rng.random_range(0.08..0.2));
                pattern.scale = rng.random_range(0.06..0.1);
                pattern.colours = [brick, wall_colour(rng) * 0.8];
            }
            12..=13 => {
                pattern.kind =
                    Kind::Courses(rng.random_range(1.2..2.6), rng.random_range(0.03..0.09));
                pattern.scale = rng.random_range(0.2..0.6);
                pattern.colours[1] = base * rng.random_range(0.4..1.4);
            }
            14 => {
                pattern.kind = Kind::Boards;
                pattern.scale = rng.random_range(0.08..0.25);
                pattern.colours[1] = base * 0.3;
                if rng.random_bool(0.5) {
                    pattern.turn = (0.0, 1.0);
                }
            }
            15 => {
                // Glass and panels of an office.
                pattern.kind =
                    Kind::Courses(rng.random_range(0.5..2.0), rng.random_range(0.02..0.06));
                pattern.scale = rng.random_range(0.8..2.0);
                pattern.colours[1] = base * rng.random_range(0.3..2.0);
            }
            16 => {
                pattern.kind = Kind::Blotches;
                pattern.scale = rng.random_range(0.3..3.0);
                pattern.colours[1] = base * rng.random_range(0.5..1.2);
            }
            17 => {
                // Ivy.
                pattern.kind = Kind::Blotches;
                pattern.scale = rng.random_range(1.0..4.0);
                pattern.colours[1] = Rgb::new(0.06, 0.11, 0.03) * rng.random_range(0.6..1.5);
                pattern.grain = [0.25, 0.6];
            }
            _ => {
                pattern = Self::wild(rng);
                pattern.scale = pattern.scale.max(0.1);
            }
        }
        pattern
    }

    fn turned(mut self, rng: &mut ChaCha8Rng) -> Self {
        self.turn = match rng.random_range(0..4) {
            0 => (0.0, 1.0),
            1 => {
                let angle: f32 = rng.random_range(0.0..3.0);
                (angle.cos(), angle.sin())
            }
            _ => (1.0, 0.0),
        };
        self
    }

    /// Albedo of a patch.
    pub(crate) fn albedo(&self, noise: &Noise, patch: &Patch) -> Rgb {
        let (u, v, fu, fv) = unwrapped(patch);
        self.at(
            noise,
            [u, v],
            [fu, fv],
            patch.point.z,
            patch.size,
            patch.seed,
        )
    }

    /// Albedo at coordinates of a flat surface, metres; `height` is above the bottom of the solid.
    #[inline]
    pub(crate) fn at(
        &self,
        noise: &Noise,
        [u, v]: [f32; 2],
        [fu, fv]: [f32; 2],
        height: f32,
        size: f32,
        seed: u32,
    ) -> Rgb {
        let shift = (seed % 887) as f32 * 0.73;
        let (c, s) = self.turn;
        let (x, y) = (c * u + s * v, c * v - s * u);
        let (fx, fy) = (c.abs() * fu + s.abs() * fv, c.abs() * fv + s.abs() * fu);
        let [a, b] = &self.colours;
        let period = self.scale;
        let mut colour = match self.kind {
            Kind::Plain => *a,
            Kind::Blotches => {
                let n = noise.fractal(x + shift, y - shift, period * 1.6, 4, 0.6, size);
                mix(a, b, smoothstep(-0.25, 0.35, n))
            }
            Kind::Stripes(share) => mix(a, b, bands(x, period, 0.0, share * period, fx)),
            Kind::Checks => {
                let p = bands(x, 2.0 * period, 0.0, period, fx);
                let q = bands(y, 2.0 * period, 0.0, period, fy);
                mix(a, b, p + q - 2.0 * p * q)
            }
            Kind::Courses(aspect, joint) => laid(
                [a, b],
                x,
                y,
                [period * aspect, period],
                joint * period,
                fx,
                fy,
                seed,
            ),
            Kind::Boards => {
                let board = (x / period).floor();
                let seen = (1.6 - 1.2 * fx / period).clamp(0.0, 1.0);
                let tone = 1.0 + 0.55 * seen * (unit(hash(board as i32, 0, seed), 0) - 0.5);
                let along = noise.fractal(
                    x * 2.2 + 7.3 * board * seen,
                    y * 0.3 + shift,
                    0.4,
                    4,
                    0.75,
                    size,
                );
                let gap = bands(x, period, 0.0, 0.07 * period, fx);
                mix(&vary(&(a * tone), along, 0.3), b, gap)
            }
            Kind::Corrugated => {
                let phase = (x / period * std::f32::consts::TAU).sin();
                let seen = (1.2 - 1.5 * fx / period).clamp(0.0, 1.0);
                a * (1.0 + 0.45 * phase * seen)
            }
            Kind::Speckle => {
                let n = noise.fractal(x + shift, y, period.min(0.3), 3, 0.9, size);
                mix(a, b, smoothstep(-0.5, 0.6, n))
            }
            Kind::Mosaic => mosaic([a, b], x, y, period, fx, fy, seed),
            Kind::Veins => {
                let n = noise.ridge(x + shift, y, period * 1.5, 0.05 * period, size)
                    + noise.ridge(y - shift, x, period * 0.6, 0.03 * period, size);
                mix(a, b, n.min(1.0))
            }
            Kind::Mesh => {
                let wire = bands(x, period, 0.0, 0.2 * period, fx).max(bands(
                    y,
                    period,
                    0.0,
                    0.2 * period,
                    fy,
                ));
                mix(a, b, wire)
            }
        };
        if self.posters > 0.0 {
            colour = self.pasted(noise, colour, u, v, fu, fv, height, size, seed);
        }
        let fine = noise.fractal(u + shift, v - shift, self.grain[0], 4, 0.75, size);
        let coarse = noise.fractal(v + shift, u, self.blotch[0], 3, 0.6, size);
        let foot = (-height.max(0.0) / 0.5).exp() * self.dirt;
        vary(
            &colour,
            self.grain[1] * fine + self.blotch[1] * coarse - 0.6 * foot,
            1.0,
        )
    }

    /// Posters, notices and graffiti at the height of people.
    #[inline]
    fn pasted(
        &self,
        noise: &Noise,
        under: Rgb,
        u: f32,
        v: f32,
        fu: f32,
        fv: f32,
        height: f32,
        size: f32,
        seed: u32,
    ) -> Rgb {
        if !(0.2..2.9).contains(&height) {
            return under;
        }
        let mut colour = under;
        let (cu, cv) = ((u / 1.3).floor(), (v / 1.5).floor());
        let code = hash(cu as i32, cv as i32, seed ^ 0x90);
        if unit(code, 0) < self.posters {
            let (x, y) = (u - 1.3 * cu, v - 1.5 * cv);
            let (w, h) = (0.3 + 0.9 * unit(code, 1), 0.3 + 1.1 * unit(code, 2));
            let inside = band(x, 0.05, w, fu) * band(y, 0.1, h, fv);
            let n = noise.fractal(u * 2.0, v * 2.0, 0.4 + unit(code, 3), 3, 0.6, size);
            let (p, q) = (code.rotate_left(7), code.rotate_left(19));
            let ink = |k: u32| Rgb::new(unit(k, 0), unit(k, 1), unit(k, 2)) * 0.8;
            colour = mix(
                &colour,
                &mix(&ink(p), &ink(q), smoothstep(-0.1, 0.1, n)),
                inside,
            );
        }
        let word = noise.wave(u, v * 0.5 + 31.0, 4.0, size);
        if word > 0.35 - 0.5 * self.posters {
            let stroke = noise.ridge(u + 9.0, v, 0.9, 0.045, size);
            let tint = hash((u / 4.0).floor() as i32, 3, seed);
            let ink = Rgb::new(unit(tint, 0), unit(tint, 1), unit(tint, 2)) * 0.7;
            colour = mix(
                &colour,
                &ink,
                (stroke * 1.4).min(1.0) * beyond(2.1, v.max(0.0), fv),
            );
        }
        colour
    }
}

/// Coordinates of a patch on its surface (metres), and its extents along them.
#[inline]
pub(crate) fn unwrapped(patch: &Patch) -> (f32, f32, f32, f32) {
    let (p, n, f) = (&patch.point, patch.normal, &patch.extent);
    if n.z.abs() > 0.75 {
        (p.x, p.y, f.x, f.y)
    } else if n.x.abs() > n.y.abs() {
        (p.y, p.z, f.y, f.z)
    } else {
        (p.x, p.z, f.x, f.z)
    }
}

/// Tiles of the first colour, each with its own tone, with joints of the second.
#[inline]
fn laid(
    [a, b]: [&Rgb; 2],
    x: f32,
    y: f32,
    tile: [f32; 2],
    joint: f32,
    fx: f32,
    fy: f32,
    seed: u32,
) -> Rgb {
    let row = (y / tile[1]).floor();
    let offset = x + 0.5 * tile[0] * (row - 2.0 * (0.5 * row).floor());
    let joints =
        (bands(y, tile[1], 0.0, joint, fy) + bands(offset, tile[0], 0.0, joint, fx)).min(1.0);
    // Uses the tones of `courses`, without its joints.
    let body: V3 = courses(a, x, y, tile, 0.0, fx, fy, seed, 0.5);
    mix(&body, b, joints)
}

/// Rectangles of mixed colours in rows; the columns differ from row to row.
#[inline]
fn mosaic([a, b]: [&Rgb; 2], x: f32, y: f32, period: f32, fx: f32, fy: f32, seed: u32) -> Rgb {
    let row = (y / period).floor();
    let width = period * (0.4 + 1.4 * unit(hash(row as i32, 9, seed), 0));
    let column = (x / width).floor();
    let code = hash(column as i32, row as i32, seed);
    let seen = (1.4 - fx.max(fy) / period.min(width)).clamp(0.0, 1.0);
    let tint = Rgb::new(unit(code, 0), unit(code, 1), unit(code, 2)) * 0.7;
    let own = mix(&mix(a, b, unit(code, 3)), &tint, 0.5);
    let mean = (a + b) * 0.25 + Rgb::new(0.17, 0.17, 0.17);
    mix(&mean, &own, seen)
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::SeedableRng;

    #[test]
    fn albedos_are_in_range_and_coarse_pixels_get_the_mean() {
        let mut rng = ChaCha8Rng::seed_from_u64(3);
        let noise = Noise::new(3);
        let (mut darkest, mut brightest) = (1.0f32, 0.0f32);
        for number in 0..400 {
            let pattern = if number % 2 == 0 {
                Pattern::wild(&mut rng)
            } else {
                Pattern::wall(&mut rng)
            };
            let spread = |f: f32| {
                let tones: Vec<f32> = (0..60)
                    .map(|i| {
                        let at = [i as f32 * 0.171, i as f32 * 0.093];
                        let c = pattern.at(&noise, at, [f, f], 3.5, f, number);
                        assert!(c.iter().all(|x| x.is_finite() && *x >= 0.0), "{pattern:?}");
                        c.sum() / 3.0
                    })
                    .collect();
                let mean = tones.iter().sum::<f32>() / 60.0;
                let varies = tones.iter().map(|t| (t - mean).abs()).sum::<f32>() / 60.0;
                (mean, varies)
            };
            let (mean, fine) = spread(0.01);
            let (_, coarse) = spread(20.0);
            assert!(coarse <= fine + 0.02, "{pattern:?}: {coarse} {fine}");
            (darkest, brightest) = (darkest.min(mean), brightest.max(mean));
        }
        assert!(darkest < 0.05 && brightest > 0.55, "{darkest} {brightest}");
    }
}
