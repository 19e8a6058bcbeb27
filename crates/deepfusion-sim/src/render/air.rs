//! The light of a picture: sky, sun, and the air between objects and camera.

use crate::primitive::V3;
use crate::scene::World;
use crate::texture::Rgb;
use crate::texture::noise::Noise;
use crate::texture::sky::Sky;

/// The weather and the time of day of one picture. They change colours only, never where a ray ends.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Air {
    /// The sky's gradient and clouds.
    pub sky: Sky,
    /// Multiplies the sky's radiance.
    pub tint: Rgb,
    /// The brightness around the sun, if it is visible.
    pub glow: Option<Glow>,
    /// Irradiance of the sun (on a surface that faces it) and of the sky.
    pub light: (Rgb, Rgb),
    /// Fog or haze between objects and camera, if there is any.
    pub fog: Option<Fog>,
    /// Wetness of the ground, 0 to 1: water fills the pores of rough surfaces and darkens them.
    pub wet: f32,
}

/// The sun's disc and its aureole.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Glow {
    /// Towards the sun, unit length, world axes.
    pub sun: V3,
    /// Radiance at the middle of the disc.
    pub strength: Rgb,
}

/// Homogeneous fog or haze (Koschmieder): a surface at range r keeps the share e^(−extinction · r) of its light, and the fog adds its own
/// light for the rest.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Fog {
    /// Extinction, 1/m.
    pub extinction: f32,
    /// Radiance of the fog.
    pub colour: Rgb,
    /// Thickness above the ground, metres: it determines how much of the sky is covered.
    pub height: f32,
}

impl Air {
    /// A world's own light, in clear air.
    pub(crate) fn of(world: &World) -> Self {
        Self {
            sky: world.sky,
            tint: Rgb::new(1.0, 1.0, 1.0),
            glow: None,
            light: world.light,
            fog: None,
            wet: 0.0,
        }
    }

    /// The sky's radiance from a direction, of any length.
    pub(crate) fn radiance(&self, noise: &Noise, d: &V3) -> Rgb {
        let mut sky = self.sky.radiance(noise, d).component_mul(&self.tint);
        if let Some(glow) = &self.glow {
            sky += glow.radiance(d, self.sky.clouds);
        }
        match &self.fog {
            None => sky,
            Some(fog) => {
                let up = (d.z / d.norm()).max(0.02);
                fog.over(sky, fog.height / up)
            }
        }
    }

    /// Light of a surface at `t` along `d` (metres if `d` has unit length), as it reaches the camera.
    #[inline]
    pub(crate) fn through(&self, colour: Rgb, d: &V3, t: f32) -> Rgb {
        match &self.fog {
            None => colour,
            Some(fog) => fog.over(colour, t * d.norm()),
        }
    }

    /// Factor by which wetness darkens the albedo of the ground.
    #[inline]
    pub(crate) fn soaked(&self) -> f32 {
        1.0 - 0.5 * self.wet
    }
}

impl Glow {
    /// The disc is drawn larger than it is, as glare in a lens does; clouds hide it.
    fn radiance(&self, d: &V3, clouds: f32) -> Rgb {
        let cos = (self.sun.dot(d) / d.norm()).max(0.0);
        let wide = cos.powi(12);
        let near = cos.powi(220);
        let disc = if cos > 0.9995 { 1.0 } else { 0.0 };
        let clear = (1.0 - clouds.max(0.0)).max(0.0);
        self.strength * (0.04 * wide + clear * (0.3 * near + disc))
    }
}

impl Fog {
    /// A colour seen through `range` metres of fog.
    #[inline]
    fn over(&self, colour: Rgb, range: f32) -> Rgb {
        let kept = (-self.extinction * range).exp();
        colour * kept + self.colour * (1.0 - kept)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn fog_hides_far_surfaces_and_leaves_near_ones() {
        let fog = Fog {
            extinction: 0.01,
            colour: Rgb::new(0.8, 0.8, 0.8),
            height: 100.0,
        };
        let black = Rgb::zeros();
        assert!(fog.over(black, 0.0).x == 0.0);
        let half = fog.over(black, 100.0 * std::f32::consts::LN_2);
        assert!((half.x - 0.4).abs() < 1e-5);
        assert!((fog.over(black, 1e5).x - 0.8).abs() < 1e-5);
    }
}
