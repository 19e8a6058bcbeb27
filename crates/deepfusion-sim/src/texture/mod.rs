//! Textures: albedo as a function of the position on the surface, never of the viewer.

pub(crate) mod facade;
pub(crate) mod ground;
pub(crate) mod ground_style;
pub(crate) mod leaves;
pub(crate) mod noise;
pub(crate) mod objects;
pub(crate) mod pattern;
pub(crate) mod sky;

use crate::primitive::V3;
use facade::Facade;
use noise::Noise;

/// A colour, linear red, green, blue.
pub(crate) type Rgb = V3;

/// A piece of a surface that is visible in one pixel, or in one sample of it.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Patch {
    /// Middle of the patch, in the solid's axes, metres.
    pub point: V3,
    /// Face of the solid.
    pub face: u8,
    /// Outward normal, in the solid's axes.
    pub normal: V3,
    /// Size of the patch, metres.
    pub size: f32,
    /// Extent along each of the solid's axes, metres.
    pub extent: V3,
    /// Seed of the solid's texture.
    pub seed: u32,
}

/// The material of a solid.
#[derive(Debug, Clone)]
pub(crate) enum Material {
    /// Walls with windows and doors; also the flat top of the house.
    Facade(Box<Facade>),
    /// A tiled roof of this colour.
    Roof(Rgb),
    /// Leaves of this colour.
    Foliage(Rgb),
    /// A trunk of this colour.
    Bark(Rgb),
    /// Painted metal with rings and wear.
    Metal(Rgb),
    /// Upright planks.
    Planks(Rgb),
    /// Masonry of this colour.
    Masonry(Rgb),
    /// Car paint; the windows of the cabin are `glass`.
    Paint(objects::Paint),
    /// A tyre with a rim.
    Tyre,
    /// A sign or a poster: two colours in large shapes.
    Sign(Rgb, Rgb),
    /// Leaves of a lobe of a crown.
    Leaves(leaves::Leaves),
    /// A random surface.
    Pattern(Box<pattern::Pattern>),
}

impl Material {
    /// Albedo of a patch.
    pub(crate) fn albedo(&self, noise: &Noise, patch: &Patch) -> Rgb {
        match self {
            Self::Facade(facade) => facade.albedo(noise, patch),
            Self::Roof(colour) => facade::roof(noise, patch, colour),
            Self::Foliage(colour) => objects::foliage(noise, patch, colour),
            Self::Bark(colour) => objects::bark(noise, patch, colour),
            Self::Metal(colour) => objects::metal(noise, patch, colour),
            Self::Planks(colour) => objects::planks(noise, patch, colour),
            Self::Masonry(colour) => objects::masonry(noise, patch, colour),
            Self::Paint(paint) => paint.albedo(noise, patch),
            Self::Tyre => objects::tyre(noise, patch),
            Self::Sign(a, b) => objects::sign(noise, patch, a, b),
            Self::Leaves(leaves) => leaves.albedo(noise, patch),
            Self::Pattern(pattern) => pattern.albedo(noise, patch),
        }
    }
}

/// `colour` scaled by noise: noise of about ±1 changes it by about ±`strength`. Never below zero.
#[inline]
pub(crate) fn vary(colour: &Rgb, noise: f32, strength: f32) -> Rgb {
    colour * (1.0 + strength * noise).max(0.05)
}

/// Two colours mixed: `a` at t = 0, `b` at t = 1.
#[inline]
pub(crate) fn mix(a: &Rgb, b: &Rgb, t: f32) -> Rgb {
    a + (b - a) * t
}
