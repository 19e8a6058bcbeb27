//! Grounds of varied worlds: the materials and markings of a stretch of road and the land beside it.

use super::facade::courses;
use super::ground::{self, GroundPatch};
use super::noise::{Noise, band, bands, beyond, hash, lerp, smoothstep, unit};
use super::{Rgb, mix, vary};

/// A line painted along the road.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Line {
    /// Metres left of the centreline.
    pub at: f32,
    /// Half its width, metres.
    pub half: f32,
    /// Period and length of its dashes, metres; 0: unbroken.
    pub dash: [f32; 2],
}

/// The material of a ground.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Kind {
    /// Even, with grain and stains: asphalt or concrete.
    Asphalt,
    /// Stones, slabs, tiles or parquet with joints.
    Laid,
    /// Grass of two tones.
    Grass,
    /// Pebbles.
    Gravel,
    /// Rows of plants or furrows.
    Field,
}

/// The look of one piece of ground.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Surface {
    /// Its material.
    pub kind: Kind,
    /// Its main colour.
    pub colour: Rgb,
    /// Colour of joints, furrows, dry grass.
    pub other: Rgb,
    /// Length and width of a stone or a row, metres.
    pub tile: [f32; 2],
    /// Wavelength (metres) and strength of its grain.
    pub grain: [f32; 2],
    /// Strength of large stains.
    pub stain: f32,
}

/// The ground of a stretch of road.
#[derive(Debug, Clone, Copy)]
pub(crate) struct GroundStyle {
    /// The carriageway.
    pub road: Surface,
    /// Pavement: right, left.
    pub pavement: [Surface; 2],
    /// Ground beyond the pavement: right, left.
    pub beyond: [Surface; 2],
    /// The strip between kerb and pavement.
    pub verge: Surface,
    /// Colour of the kerb.
    pub kerb: Rgb,
    /// Lines along the road.
    pub lines: [Option<Line>; 6],
    /// Colour of the paint.
    pub paint: Rgb,
    /// How much of the paint is worn off, 0 to 1.
    pub wear: f32,
    /// Distance after which zebra crossings, stop lines and arrows repeat along the road, metres; 0: none.
    pub crossing: f32,
    /// Share of the carriageway that was mended.
    pub mended: f32,
    /// Strength of cracks.
    pub cracks: f32,
    /// Share of cells of 0.4 m that have a fallen leaf: on the road, beside it.
    pub leaves: [f32; 2],
    /// Whether it is a floor, without anything that only roads have.
    pub indoors: bool,
    /// Edges of a second carriageway beyond the kerb on the left, metres from the kerb; equal: none.
    pub second: [f32; 2],
}

impl Surface {
    /// Albedo of a patch.
    #[inline]
    pub(crate) fn albedo(&self, noise: &Noise, p: &GroundPatch, seed: u32) -> Rgb {
        let shift = (seed % 613) as f32;
        let [fs, fl] = p.extent;
        let fine = noise.fractal(p.x + shift, p.y, self.grain[0], 5, 0.85, p.size);
        let coarse = noise.fractal(p.y + shift, p.x - shift, 5.7, 3, 0.6, p.size);
        let body = match self.kind {
            Kind::Asphalt => self.colour,
            Kind::Laid => {
                let joint = 0.07 * self.tile[1];
                let row = (p.lateral / self.tile[1]).floor();
                let offset = p.s + 0.5 * self.tile[0] * (row - 2.0 * (0.5 * row).floor());
                let joints = (bands(p.lateral, self.tile[1], 0.0, joint, fl)
                    + bands(offset, self.tile[0], 0.0, joint, fs))
                .min(1.0);
                let stone = courses(
                    &self.colour,
                    p.s,
                    p.lateral,
                    self.tile,
                    0.0,
                    fs,
                    fl,
                    seed,
                    0.5,
                );
                mix(&stone, &self.other, joints)
            }
            Kind::Grass => {
                let dry = noise.fractal(p.x + 91.0, p.y + shift, 4.3, 5, 0.65, p.size);
                mix(&self.colour, &self.other, smoothstep(-0.4, 1.0, dry))
            }
            Kind::Gravel => {
                let pebble =
                    noise.wave(p.x, p.y, 0.09, p.size) + noise.wave(p.y + 5.0, p.x, 0.05, p.size);
                mix(&self.colour, &self.other, smoothstep(-0.8, 0.8, pebble))
            }
            Kind::Field => {
                let wobble = 0.15 * noise.at(p.s * 0.21, shift);
                let rows = bands(
                    p.lateral + wobble,
                    self.tile[1],
                    0.0,
                    0.5 * self.tile[1],
                    fl,
                );
                mix(&self.colour, &self.other, rows)
            }
        };
        vary(&body, self.grain[1] * fine + self.stain * coarse, 1.0)
    }
}

impl GroundStyle {
    /// The carriageway.
    pub(crate) fn carriageway(&self, noise: &Noise, p: &GroundPatch, seed: u32) -> Rgb {
        let mut colour = self.road.albedo(noise, p, seed);
        if self.indoors {
            return colour;
        }
        if self.road.kind == Kind::Asphalt {
            colour *= self.worn(noise, p, seed);
        }
        let paint = self.painted(noise, p);
        if paint > 0.0 {
            colour = mix(&colour, &self.paint, paint);
        }
        colour = ground::manhole(noise, p, &colour, seed);
        ground::leaves(
            p,
            &colour,
            self.leaves[0] * (0.3 + smoothstep(-1.4, -0.1, p.kerb)),
            seed,
        )
    }

    /// Factor by which patches, wheel tracks, cracks and seams change the tone of asphalt.
    #[inline]
    fn worn(&self, noise: &Noise, p: &GroundPatch, seed: u32) -> f32 {
        let mut tone = 1.0;
        let drift = 1.7 * noise.at(p.s * 0.02, 0.5);
        let (cell_s, cell_l) = (9.1, 2.3);
        let (cs, cl) = (
            (p.s / cell_s).floor(),
            ((p.lateral + drift) / cell_l).floor(),
        );
        let code = hash(cs as i32, cl as i32, seed);
        if unit(code, 0) < self.mended {
            let (u, v) = (p.s - cs * cell_s, p.lateral + drift - cl * cell_l);
            let (a, b) = (0.3 + 3.0 * unit(code, 1), 4.0 + 5.0 * unit(code, 2));
            let c = 0.1 + 0.9 * unit(code, 3);
            let inside = band(u, a, b, p.extent[0]) * band(v, c, 2.2, p.extent[1]);
            let core =
                band(u, a + 0.06, b - 0.06, p.extent[0]) * band(v, c + 0.06, 2.14, p.extent[1]);
            let new = 0.55 + 0.9 * unit(code.rotate_left(11), 0);
            tone *= lerp(1.0, new, inside) * (1.0 - 0.5 * (inside - core));
        }
        let lane = p.lateral.abs() - 0.5 * p.half_width.min(3.6);
        let track = (-(lane.abs() - 0.75).powi(2) * 9.0).exp();
        tone *= 1.0 - 0.12 * track - 0.12 * (-lane * lane * 7.0).exp();
        if self.cracks > 0.0 {
            let crack = noise.ridge(p.x, p.y, 2.7, 0.025, p.size)
                + noise.ridge(p.y - 7.0, p.x, 1.1, 0.014, p.size);
            tone *= 1.0 - self.cracks * crack.min(1.0);
        }
        if seed.is_multiple_of(3) {
            let seam = p.lateral - 0.15 - 0.09 * noise.at(p.s * 0.7, 3.0);
            tone *= 1.0 - 0.5 * band(seam, -0.035, 0.035, p.extent[1]);
        }
        tone
    }

    /// Paint on the road, 0 to 1.
    #[inline]
    fn painted(&self, noise: &Noise, p: &GroundPatch) -> f32 {
        let [fs, fl] = p.extent;
        let mut paint = 0.0f32;
        for line in self.lines.iter().flatten() {
            let mut across = band(p.lateral, line.at - line.half, line.at + line.half, fl);
            if across > 0.0 && line.dash[0] > 0.0 {
                across *= bands(p.s, line.dash[0], 0.0, line.dash[1], fs);
            }
            paint = paint.max(across);
        }
        if self.crossing > 0.0 {
            let cell = (p.s / self.crossing).floor();
            let along = p.s - cell * self.crossing;
            let code = hash(cell as i32, 5, 77);
            let middle = self.crossing * (0.3 + 0.4 * unit(code, 0));
            let from = along - middle;
            if from.abs() < 2.2 + fs {
                if unit(code, 1) < 0.4 {
                    let bars = bands(p.lateral + 50.0, 1.0, 0.0, 0.5, fl);
                    paint = paint.max(bars * band(from, -1.9, 1.9, fs));
                } else if unit(code, 1) < 0.7 {
                    let right = f32::from(u8::from(p.lateral < 0.0));
                    paint = paint.max(right * band(from, -0.25, 0.25, fs));
                } else {
                    // An arrow in the lane.
                    let x = p.lateral + 1.65;
                    let shaft = band(x, -0.09, 0.09, fl) * band(from, -2.0, 0.8, fs);
                    let wide = (2.0 - from).max(0.0) * 0.42;
                    let head = band(x, -wide, wide, fl) * band(from, 0.8, 2.0, fs);
                    paint = paint.max(shaft.max(head));
                }
            }
        }
        if paint <= 0.0 {
            return 0.0;
        }
        let worn = noise.fractal(p.x + 3.0, p.y, 0.9, 5, 0.8, p.size);
        let kept = (1.0 - self.wear * (0.6 + 0.9 * worn)).clamp(0.05, 1.0);
        paint * kept * beyond(-p.kerb, 0.05, fl)
    }

    /// The upright face of the kerb, `height` metres above the road.
    pub(crate) fn kerb(&self, noise: &Noise, p: &GroundPatch, height: f32) -> Rgb {
        let plain = ground::kerb(noise, p, height);
        plain.component_mul(&self.kerb) * 3.0
    }

    /// Albedo of the ground beside the carriageway.
    pub(crate) fn beside(
        &self,
        noise: &Noise,
        p: &GroundPatch,
        verge: f32,
        pavement: f32,
        seed: u32,
    ) -> Rgb {
        let side = usize::from(p.lateral > 0.0);
        let fl = p.extent[1];
        if side == 1 && p.kerb > self.second[0] && p.kerb < self.second[1] {
            return self.second(noise, p, seed);
        }
        let stone = if pavement > 0.0 { 0.16 } else { 0.0 };
        if p.kerb < stone - 0.5 * fl {
            return self.kerb(noise, p, 0.13);
        }
        let (inner, outer) = (stone + verge, stone + verge + pavement);
        let paved = band(p.kerb, inner, outer, fl);
        let mut colour = Rgb::zeros();
        if paved > 0.0 {
            colour += self.pavement[side].albedo(noise, p, seed) * paved;
        }
        if paved < 1.0 {
            let rest = if p.kerb < inner {
                &self.verge
            } else {
                &self.beyond[side]
            };
            colour += rest.albedo(noise, p, seed ^ 7) * (1.0 - paved);
        }
        ground::leaves(p, &colour, self.leaves[1], seed)
    }

    /// The second carriageway, with its own lines.
    fn second(&self, noise: &Noise, p: &GroundPatch, seed: u32) -> Rgb {
        let [fs, fl] = p.extent;
        let colour = self.road.albedo(noise, p, seed);
        let [from, to] = self.second;
        let across = p.kerb - from;
        let width = to - from;
        let edges = band(across, 0.4, 0.55, fl).max(band(across, width - 0.55, width - 0.4, fl));
        let lanes = bands(across - 0.5, 3.75, 0.0, 0.15, fl) * bands(p.s, 18.0, 0.0, 6.0, fs);
        mix(&colour, &self.paint, edges.max(lanes))
    }
}
