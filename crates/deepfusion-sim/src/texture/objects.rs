//! Leaves, bark, metal, fences, cars.

use super::facade::courses;
use super::noise::{Noise, band, bands, beyond, hash, length, smoothstep, unit};
use super::{Patch, Rgb, mix, vary};

/// Noise for a surface without coordinates of its own: the sum of two oblique projections of space, so that it varies in every direction of
/// the surface.
#[inline]
fn solid(noise: &Noise, patch: &Patch, wavelength: f32, octaves: u32, gain: f32) -> f32 {
    let p = &patch.point;
    let shift = (patch.seed % 509) as f32 * 1.37;
    let a = noise.fractal(
        p.x + 0.61 * p.z + shift,
        p.y - 0.53 * p.z,
        wavelength,
        octaves,
        gain,
        patch.size,
    );
    let b = noise.fractal(
        p.z - 0.47 * p.x + 57.0,
        p.y + 0.7 * p.x - shift,
        wavelength * 0.83,
        octaves,
        gain,
        patch.size,
    );
    0.75 * (a + b)
}

/// Leaves: clumps, dark gaps, single bright leaves.
pub(crate) fn foliage(noise: &Noise, patch: &Patch, colour: &Rgb) -> Rgb {
    let clumps = solid(noise, patch, 0.4, 2, 0.7);
    let leaves = solid(noise, patch, 0.09, 2, 1.0);
    let shade = smoothstep(-1.0, 1.0, 0.6 * clumps + 1.3 * leaves);
    let dark = colour * 0.1;
    let bright = Rgb::new(colour.x * 1.75, colour.y * 1.5, colour.z * 0.9);
    mix(&dark, &bright, shade)
}

/// Bark: upright furrows.
pub(crate) fn bark(noise: &Noise, patch: &Patch, colour: &Rgb) -> Rgb {
    let p = &patch.point;
    let angle = p.y.atan2(p.x) * 0.4;
    let shift = (patch.seed % 211) as f32;
    let furrows = noise.fractal(angle * 4.0 + shift, p.z * 0.6, 0.35, 4, 0.75, patch.size);
    let patches = noise.wave(angle + shift, p.z, 0.8, patch.size);
    vary(colour, furrows + 0.6 * patches, 0.55)
}

/// Painted metal: scratches, stickers, darker at the bottom.
pub(crate) fn metal(noise: &Noise, patch: &Patch, colour: &Rgb) -> Rgb {
    let p = &patch.point;
    let worn = solid(noise, patch, 0.4, 4, 0.7);
    let code = hash((p.z / 0.5).floor() as i32, 3, patch.seed);
    let sticker = if unit(code, 0) < 0.15 && p.z < 2.2 {
        band(p.z.rem_euclid(0.5), 0.1, 0.35, patch.extent.z)
    } else {
        0.0
    };
    let foot = 1.0 - beyond(p.z, 0.25 + 0.3 * unit(patch.seed, 0), patch.extent.z);
    let poster = Rgb::new(0.7, 0.65 * unit(code, 1), 0.6 * unit(code, 2));
    mix(&vary(colour, worn, 0.35), &poster, sticker) * (1.0 - 0.45 * foot)
}

/// A fence of upright planks, each with its own tone.
pub(crate) fn planks(noise: &Noise, patch: &Patch, colour: &Rgb) -> Rgb {
    let p = &patch.point;
    let (u, fu) = (p.x + p.y, patch.extent.x + patch.extent.y);
    let board = (u / 0.16).floor();
    let seen = (1.6 - 1.2 * fu / 0.16).clamp(0.0, 1.0);
    let tone = 1.0 + 0.5 * seen * (unit(hash(board as i32, 0, patch.seed), 0) - 0.5);
    let gaps = bands(u, 0.16, 0.0, 0.018, fu);
    let shift = (patch.seed % 301) as f32;
    let grain = noise.fractal(
        u * 2.4 + 7.7 * board * seen,
        p.z * 0.35 + shift,
        0.5,
        4,
        0.75,
        patch.size,
    );
    let stains = noise.fractal(u + shift, p.z, 1.8, 3, 0.6, patch.size);
    let rail = bands(p.z, 0.7, 0.3, 0.36, patch.extent.z);
    vary(&(colour * tone), grain + 0.7 * stains, 0.32) * (1.0 - 0.75 * gaps) * (1.0 - 0.2 * rail)
}

/// A garden wall: courses, a pale coping, moss.
pub(crate) fn masonry(noise: &Noise, patch: &Patch, colour: &Rgb) -> Rgb {
    let p = &patch.point;
    let (u, fu) = (p.x + p.y, patch.extent.x + patch.extent.y);
    let laid = courses(
        colour,
        u,
        p.z,
        [0.31, 0.11],
        0.016,
        fu,
        patch.extent.z,
        patch.seed,
        0.6,
    );
    let shift = (patch.seed % 401) as f32;
    let grain = noise.fractal(u + shift, p.z + shift, 1.5, 6, 0.7, patch.size);
    let moss = (noise.fractal(u - shift, p.z * 2.0, 2.2, 3, 0.6, patch.size) - 0.1).clamp(0.0, 0.7);
    mix(&vary(&laid, grain, 0.3), &Rgb::new(0.07, 0.1, 0.035), moss)
}

/// Two colours in bold shapes, with a border.
pub(crate) fn sign(noise: &Noise, patch: &Patch, a: &Rgb, b: &Rgb) -> Rgb {
    let p = &patch.point;
    let shift = (patch.seed % 613) as f32;
    let bold = noise.fractal(p.x + p.y + shift, p.z, 0.7, 2, 0.5, patch.size);
    let fine = noise.fractal(p.x + p.y, p.z * 2.0 + shift, 0.16, 2, 0.7, patch.size);
    mix(a, b, smoothstep(-0.15, 0.15, bold + 0.35 * fine))
}

/// Black rubber around a grey rim with spokes.
pub(crate) fn tyre(noise: &Noise, patch: &Patch) -> Rgb {
    let p = &patch.point;
    let radius = length(p.x, p.z);
    let grain = solid(noise, patch, 0.1, 2, 0.6);
    let rim = 1.0 - beyond(radius, 0.2, patch.size);
    let spoke = (p.z.atan2(p.x) * 5.0).cos();
    let metal = 0.3 + 0.2 * smoothstep(-0.3, 0.3, spoke) * (1.0 - (4.0 * patch.size).min(1.0));
    mix(
        &vary(&Rgb::new(0.025, 0.025, 0.027), grain, 0.5),
        &Rgb::new(metal, metal, metal),
        rim,
    )
}

/// The outside of a car: paint on the body, glass in the cabin.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Paint {
    /// Colour of the paint.
    pub colour: Rgb,
    /// Length, width and height of the whole car, metres.
    pub size: [f32; 3],
    /// Height of the part's origin above the road, metres.
    pub base: f32,
    /// Whether this part is the cabin.
    pub cabin: bool,
}

impl Paint {
    /// Albedo of the body or the cabin; the part's axes are the car's, moved up by `base`.
    pub(crate) fn albedo(&self, noise: &Noise, patch: &Patch) -> Rgb {
        let p = &patch.point;
        let z = p.z + self.base;
        let f = &patch.extent;
        // Dirt, and soft blotches in place of reflections: they are fixed to the paint, since textures do not know the viewer.
        let dirt = solid(noise, patch, 0.5, 5, 0.7);
        let blotches = solid(noise, patch, 1.7, 2, 0.5);
        let paint = vary(&self.colour, 0.7 * dirt + blotches, 0.34);
        let sideways = patch.normal.y.abs() > 0.7;
        if self.cabin {
            return self.cabin_albedo(noise, patch, &paint, z, sideways);
        }
        let mut colour = paint;
        let half = 0.5 * self.size[0];
        if sideways {
            let doors = [0.02f32, -0.24, 0.27]
                .iter()
                .map(|at| {
                    band(
                        p.x,
                        at * self.size[0] - 0.012,
                        at * self.size[0] + 0.012,
                        f.x,
                    )
                })
                .sum::<f32>();
            let crease = band(z, 0.62, 0.65, f.z);
            let skirt = 1.0 - beyond(z, 0.36, f.z);
            let handles = (band(p.x, -0.2, -0.02, f.x) + band(p.x, 0.85, 1.03, f.x))
                * band(z, 0.72, 0.77, f.z);
            colour *= (1.0 - 0.7 * doors.min(1.0)) * (1.0 - 0.4 * crease) * (1.0 - 0.3 * handles);
            colour = mix(&colour, &Rgb::new(0.03, 0.03, 0.03), skirt);
            // The wheel arches.
            for wheel in [0.3f32, -0.3] {
                let away = length(p.x - wheel * self.size[0], z - 0.31);
                let arch = 1.0 - beyond(away, 0.38, patch.size);
                colour = mix(&colour, &Rgb::new(0.015, 0.015, 0.015), arch);
            }
        } else if patch.normal.x.abs() > 0.5 {
            let front = patch.normal.x > 0.0;
            let out = p.y.abs() / (0.5 * self.size[1]);
            let lamps = band(out, 0.55, 0.93, f.y) * band(z, 0.6, 0.78, f.z);
            let lamp = if front {
                Rgb::new(0.75, 0.75, 0.72)
            } else {
                Rgb::new(0.45, 0.02, 0.02)
            };
            colour = mix(&colour, &lamp, lamps);
            let plate = band(p.y, -0.26, 0.26, f.y) * band(z, 0.45, 0.57, f.z);
            let digits = 0.7 - 0.5 * bands(p.y, 0.09, 0.0, 0.05, f.y) * band(z, 0.47, 0.55, f.z);
            colour = mix(&colour, &Rgb::new(digits, digits, digits), plate);
            let grille =
                band(p.y, -0.45, 0.45, f.y) * band(z, 0.6, 0.72, f.z) * f32::from(u8::from(front));
            let bumper = band(z, 0.28, 0.42, f.z);
            colour = mix(
                &colour,
                &Rgb::new(0.03, 0.03, 0.035),
                (0.8 * grille).max(0.75 * bumper),
            );
        } else {
            // Hood and boot: joints along the edges.
            let joint = band(
                p.y.abs(),
                0.42 * self.size[1] - 0.015,
                0.42 * self.size[1] + 0.015,
                f.y,
            ) + band(p.x.abs(), 0.93 * half, 0.93 * half + 0.03, f.x);
            colour *= 1.0 - 0.5 * joint.min(1.0);
        }
        colour
    }

    fn cabin_albedo(
        &self,
        noise: &Noise,
        patch: &Patch,
        paint: &Rgb,
        z: f32,
        sideways: bool,
    ) -> Rgb {
        let p = &patch.point;
        let f = &patch.extent;
        if patch.normal.z > 0.9 {
            return *paint;
        }
        let top = self.size[2] - 0.1;
        let glass_height = band(z, self.base + 0.06, top, f.z);
        let room = noise.fractal(
            p.x + p.y + (patch.seed % 97) as f32,
            z * 1.3,
            0.7,
            3,
            0.6,
            patch.size,
        );
        let up = ((z - self.base) / (self.size[2] - self.base)).clamp(0.0, 1.0);
        let glass = vary(&Rgb::new(0.07, 0.085, 0.1), room, 0.7) * (0.5 + 1.1 * up);
        let pillars = if sideways {
            band(p.x, -0.07, 0.03, f.x) + band(p.x, -1.25, -1.13, f.x)
        } else {
            beyond(p.y.abs(), 0.5 * self.size[1] - 0.17, f.y)
        };
        mix(paint, &glass, glass_height * (1.0 - pillars.min(1.0)))
    }
}
