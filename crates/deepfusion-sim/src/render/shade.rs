//! From a hit to a colour: texture, sun, sky.

use super::{Air, Eye, Hit, Surface};
use crate::light::{Foot, GroundLight};
use crate::primitive::{V3, normal_at};
use crate::texture::ground::{self, GroundPatch};
use crate::texture::noise::hash;
use crate::texture::{Patch, Rgb};
use nalgebra::Vector3;
use std::sync::LazyLock;

/// Longest side of a pixel's footprint on a surface, metres.
const LONGEST: f32 = 30.0;

/// Shades the hits of one eye.
pub(crate) struct Shader<'a> {
    /// The eye.
    pub eye: &'a Eye<'a>,
    /// Light on the ground.
    pub light: &'a GroundLight,
    /// Sky, sun and the air between them and the eye.
    pub air: &'a Air,
    /// Width of a pixel (or of the area that one ray covers) at t = 1, metres.
    pub pixel: f32,
    /// At most this many samples along the longer side of a ray's footprint.
    pub samples: f32,
    /// Footprints of dynamic objects, for their shadows on the ground.
    pub moving: &'a [Foot],
}

impl Shader<'_> {
    /// Linear colour of a hit, for the ray along `d`.
    #[inline]
    pub(crate) fn colour(&self, hit: &Hit, d: &V3) -> Rgb {
        let colour = match hit.surface {
            Surface::Sky => return self.air.radiance(&self.eye.world.noise, d),
            Surface::Solid(index, face) => self.solid(hit.t, d, index, face),
            Surface::Road | Surface::Beside | Surface::Kerb => self.ground(hit, d),
        };
        self.air.through(colour, d, hit.t)
    }

    /// Albedo alone, for a scanner.
    pub(crate) fn albedo(&self, hit: &Hit, d: &V3) -> Rgb {
        match hit.surface {
            Surface::Sky => Rgb::zeros(),
            Surface::Solid(index, face) => self.solid_albedo(hit.t, d, index, face).0,
            _ => self.ground_albedo(hit, d).0,
        }
    }

    fn solid_albedo(&self, t: f32, d: &V3, index: u32, face: u8) -> (Rgb, V3) {
        let world = self.eye.world;
        let solid = &self.eye.solids[index as usize];
        let primitive = &solid.primitive;
        let local = primitive.local_of(d);
        let point = solid.eye + local * t;
        let normal = normal_at(&primitive.shape, &world.hulls, &point, face);
        let minor = t * self.pixel;
        let (step, samples) = stretch(&local, &normal, minor, self.samples);
        let material = &world.materials[primitive.material as usize];
        let count = samples as i32;
        let part = step / samples;
        let mut patch = Patch {
            point,
            face,
            normal,
            size: minor.max(part.norm()),
            extent: part.map(|x| x.abs() + 0.7 * minor),
            seed: primitive.seed,
        };
        let mut sum = Rgb::zeros();
        for i in 0..count {
            patch.point = point + part * (i as f32 + 0.5 - 0.5 * samples);
            sum += material.albedo(&world.noise, &patch);
        }
        (sum / samples, primitive.world_of(&normal))
    }

    #[inline]
    fn solid(&self, t: f32, d: &V3, index: u32, face: u8) -> Rgb {
        let world = self.eye.world;
        let (albedo, normal) = self.solid_albedo(t, d, index, face);
        let (sun, sky) = self.air.light;
        let lit = normal.dot(&world.sun).max(0.0);
        // Below the horizon there is ground, which is darker than the sky; near the ground the sky is hidden.
        let height = self.eye.position.z as f32 + d.z * t;
        let open = (0.62 + 0.38 * normal.z) * (1.0 - 0.35 * (-height.max(0.0) / 0.7).exp());
        let lamps = self.lamps(hit_place(&self.eye.position, d, t), &normal);
        albedo.component_mul(&(sun * lit + sky * open + lamps))
    }

    /// Light of the lamps on a surface.
    fn lamps(&self, place: Vector3<f64>, normal: &V3) -> Rgb {
        let world = self.eye.world;
        if world.lamps.is_empty() {
            return Rgb::zeros();
        }
        let s = world.road.locate(place.x, place.y).s;
        world.lamps.irradiance(&place, s, normal)
    }

    /// Albedo of the ground and the shares of sun and sky it sees.
    fn ground_albedo(&self, hit: &Hit, d: &V3) -> (Rgb, f32, f32) {
        let world = self.eye.world;
        let minor = hit.t * self.pixel;
        let up = if hit.surface == Surface::Kerb {
            -V3::new(d.x, d.y, 0.0).normalize()
        } else {
            V3::z()
        };
        let (step, samples) = stretch(d, &up, minor, self.samples);
        let part = step / samples;
        let (origin, count) = (self.eye.position, samples as i32);
        let height = origin.z as f32 + d.z * hit.t;
        let mut hint = None;
        let (mut colour, mut sun, mut sky) = (Rgb::zeros(), 0.0, 0.0);
        for i in 0..count {
            let at = d * hit.t + part * (i as f32 + 0.5 - 0.5 * samples);
            let (x, y) = (origin.x + f64::from(at.x), origin.y + f64::from(at.y));
            let p = match hint {
                None => world.road.locate(x, y),
                Some(index) => world.road.locate_from(x, y, index),
            };
            hint = Some(p.index);
            let sample = world.road.sample(p.index);
            let (tx, ty) = world.road.tangent(p.index);
            let along = (part.x * tx + part.y * ty).abs();
            let across = (part.y * tx - part.x * ty).abs();
            let size = minor.max(part.norm());
            let patch = GroundPatch {
                x: x as f32,
                y: y as f32,
                s: p.s,
                lateral: p.lateral,
                half_width: world.road.half_width(&p),
                kerb: world.road.kerb_distance(&p),
                size,
                extent: [along + 0.7 * minor, across + 0.7 * minor],
            };
            let number = usize::from(world.stretch_of[p.index]);
            let layout = &world.stretches[number];
            colour += match hit.surface {
                Surface::Road => {
                    let seed = hash(number as i32, 1, world.seed);
                    ground::road(&world.noise, &patch, layout, seed)
                }
                Surface::Kerb => {
                    let height = height.clamp(0.0, world.road.kerb);
                    match &layout.style {
                        Some(style) => style.kerb(&world.noise, &patch, height),
                        None => ground::kerb(&world.noise, &patch, height),
                    }
                }
                _ => {
                    let side = usize::from(p.lateral > 0.0);
                    let (verge, pavement) = (sample.verge[side], sample.pavement[side]);
                    ground::beside(&world.noise, &patch, layout, verge, pavement, world.seed)
                }
            };
            let (a, b) = self.light.at(&p, size);
            sun += a;
            sky += b;
        }
        (colour / samples, sun / samples, sky / samples)
    }

    #[inline]
    fn ground(&self, hit: &Hit, d: &V3) -> Rgb {
        let world = self.eye.world;
        let (mut albedo, mut sun, mut sky) = self.ground_albedo(hit, d);
        if self.air.wet > 0.0 {
            albedo *= self.air.soaked();
        }
        if !self.moving.is_empty() {
            let at = self.eye.position + (d * hit.t).map(f64::from);
            for foot in self.moving {
                let open = foot.open_at(at.x, at.y);
                sky *= open;
                // As soft as the shade from the sky, and as dark as a shadow from the sun.
                sun *= (1.4 * open - 0.4).max(0.0);
            }
        }
        let (sun_light, sky_light) = self.air.light;
        let (facing, open) = if hit.surface == Surface::Kerb {
            (0.5, 0.7)
        } else {
            (world.sun.z, 1.0)
        };
        let normal = if hit.surface == Surface::Kerb {
            -V3::new(d.x, d.y, 0.0).normalize()
        } else {
            V3::z()
        };
        // It is also dark below a car at night.
        let lamps = self.lamps(hit_place(&self.eye.position, d, hit.t), &normal) * sky;
        albedo.component_mul(&(sun_light * (facing * sun) + sky_light * (open * sky) + lamps))
    }
}

/// Where a ray ends, in the world, metres.
fn hit_place(eye: &Vector3<f64>, d: &V3, t: f32) -> Vector3<f64> {
    eye + (d * t).map(f64::from)
}

/// The longer side of a pixel's footprint on a surface, and the number of samples along it.
#[inline]
fn stretch(d: &V3, normal: &V3, minor: f32, most: f32) -> (V3, f32) {
    let length = d.norm();
    let facing = (normal.dot(d).abs() / length).max(0.02);
    let tangent = d - normal * normal.dot(d);
    let size = tangent.norm();
    if size < 1e-6 {
        return (V3::zeros(), 1.0);
    }
    let major = (minor / facing).min(LONGEST);
    let samples = (major / minor / 1.6).ceil().clamp(1.0, most);
    (tangent * (major / size), samples)
}

/// Share of an S-shaped tone curve in place of a straight line.
const CONTRAST: f32 = 0.9;

/// Entries of [`GAMMA`].
const GAMMA_STEPS: usize = 4096;

/// c^(1/2.2), with contrast, as 8 bits, indexed by the square root of c, which gives dark tones more entries.
static GAMMA: LazyLock<Vec<u8>> = LazyLock::new(|| {
    (0..=GAMMA_STEPS)
        .map(|i| {
            let root = (i as f32 + 0.5) / GAMMA_STEPS as f32;
            let value = root.powf(2.0 / 2.2);
            // Contrast as of a camera: dark tones darker, bright tones brighter.
            let curve = value * value * (3.0 - 2.0 * value);
            ((value + CONTRAST * (curve - value)) * 255.0 + 0.5) as u8
        })
        .collect()
});

/// Linear light to 8-bit sRGB, with a soft shoulder so that nothing clips hard.
#[inline]
pub(super) fn encode_srgb(colour: &Rgb) -> [u8; 3] {
    const EXPOSURE: f32 = 0.78;
    [colour.x, colour.y, colour.z].map(|c| {
        let c = (c * EXPOSURE).max(0.0);
        let c = if c > 0.6 {
            0.6 + 0.4 * (1.0 - (-(c - 0.6) / 0.4).exp())
        } else {
            c
        };
        GAMMA[((c.sqrt() * GAMMA_STEPS as f32) as usize).min(GAMMA_STEPS)]
    })
}
