//! Lamps: they light a street by night and a garage by day.

use crate::primitive::V3;
use crate::texture::Rgb;
use nalgebra::Vector3;

/// Range of a lamp along the street, metres.
const REACH: f32 = 30.0;

/// Share of the light that reaches a surface turned away from a lamp, reflected by other surfaces.
const INDIRECT: f32 = 0.12;

#[derive(Debug, Clone, Copy)]
struct Lamp {
    place: Vector3<f64>,
    /// Radiant intensity: irradiance at one metre.
    strength: Rgb,
}

/// All lamps that are on, by their position along the street.
#[derive(Debug, Clone, Default)]
pub(crate) struct Lamps {
    lamps: Vec<(f32, Lamp)>,
}

impl Lamps {
    /// Adds a lamp `s` metres along the street.
    pub(crate) fn add(&mut self, s: f32, place: [f64; 3], strength: Rgb) {
        let place = Vector3::from(place);
        self.lamps.push((s, Lamp { place, strength }));
    }

    /// Whether no lamp is on.
    pub(crate) fn is_empty(&self) -> bool {
        self.lamps.is_empty()
    }

    /// Call this once all lamps are added.
    pub(crate) fn sort(&mut self) {
        self.lamps.sort_by(|a, b| a.0.total_cmp(&b.0));
    }

    /// Irradiance of a surface at `place`, `s` metres along the street. It depends on the surface's position and direction alone, never on
    /// the viewer's. Lamps cast no shadows.
    pub(crate) fn irradiance(&self, place: &Vector3<f64>, s: f32, normal: &V3) -> Rgb {
        let first = self.lamps.partition_point(|lamp| lamp.0 < s - REACH);
        let near = self.lamps[first..]
            .iter()
            .take_while(|lamp| lamp.0 <= s + REACH);
        let mut sum = Rgb::zeros();
        for (_, lamp) in near {
            let towards = (lamp.place - place).map(|x| x as f32);
            // Lamps are not points, so the light close to one is bounded.
            let square = towards.norm_squared().max(0.25);
            let facing = normal.dot(&towards) / square.sqrt();
            let fade = (1.0 - square.sqrt() / REACH).max(0.0);
            sum += lamp.strength * (facing.max(INDIRECT) / square * fade);
        }
        sum
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn light_falls_with_distance_and_ends_softly() {
        let mut lamps = Lamps::default();
        lamps.add(40.0, [40.0, 0.0, 6.0], Rgb::new(10.0, 9.0, 8.0));
        lamps.add(0.0, [0.0, 0.0, 6.0], Rgb::new(10.0, 9.0, 8.0));
        lamps.sort();
        let at = |x: f64| {
            lamps
                .irradiance(&Vector3::new(x, 0.0, 0.0), x as f32, &V3::z())
                .x
        };
        assert!(at(0.0) > at(5.0) && at(5.0) > at(12.0));
        assert!((at(0.0) - 10.0 / 36.0 * 0.8).abs() < 1e-3, "{}", at(0.0));
        assert!(at(75.0) == 0.0);
        let away = lamps.irradiance(&Vector3::zeros(), 0.0, &-V3::z()).x;
        assert!(away > 0.0 && away < 0.2 * at(0.0));
    }
}
