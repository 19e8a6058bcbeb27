//! Casts a scanner's rays into the street; shared by both scanners.

use crate::light::GroundLight;
use crate::primitive::{Primitive, V3};
use crate::render::{Air, Eye, FrameSolid, LARGEST_M, Shader, Surface, gather};
use crate::scene::World;
use crate::texture::noise::hash;
use deepfusion_geometry::Se3;
use nalgebra::Matrix3;

/// Sectors of azimuth, each with its list of candidate solids.
const SECTORS: usize = 240;

/// A scanner at one place and instant.
pub(crate) struct Scanner<'a> {
    eye: Eye<'a>,
    light: &'a GroundLight,
    air: Air,
    /// Angle between neighbouring rays, radians.
    pixel: f32,
    /// Candidates of each sector (indices of solids), nearest first.
    lists: Vec<Vec<u32>>,
    /// For each solid, its index among the moving ones.
    moving: Vec<Option<u32>>,
    world_from_sensor: Matrix3<f32>,
}

/// The return of a ray.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Echo {
    /// Exact range, metres.
    pub range: f32,
    /// Brightness of the surface, 0 to 1.
    pub brightness: f32,
    /// The ray in world axes, unit length.
    pub direction: V3,
    /// Index of the solid among the moving ones, if it is one.
    pub moving: Option<u32>,
}

impl<'a> Scanner<'a> {
    /// A scanner with a range of `reach` metres; `pixel` is the angle between neighbouring rays.
    pub(crate) fn new(
        world: &'a World,
        light: &'a GroundLight,
        moving: &[Primitive],
        world_from_sensor: &Se3,
        (reach, pixel): (f32, f32),
    ) -> Self {
        let position = world_from_sensor.translation();
        // The scanner turns, so solids behind it count too, and large ones whose middle is out of reach.
        let all = gather(world, moving, &position, reach + LARGEST_M);
        let first_moving = all.len() - moving.len();
        let mut solids: Vec<(FrameSolid, f32, f32, Option<u32>)> = all
            .into_iter()
            .enumerate()
            .filter_map(|(index, primitive)| {
                let (half_x, half_y, ..) = primitive.bounds(&world.hulls);
                let radius = half_x.hypot(half_y);
                let dx = (primitive.position[0] - position.x) as f32;
                let dy = (primitive.position[1] - position.y) as f32;
                let away = dx.hypot(dy);
                if away - radius > reach {
                    return None;
                }
                // Half the angle that the solid covers; the full circle if the scanner is above it.
                let half = if away > radius * 1.001 {
                    (radius / away).asin()
                } else {
                    std::f32::consts::PI
                };
                let solid = FrameSolid {
                    eye: primitive.local_point(&position),
                    primitive,
                    nearest: (away - radius).max(0.0) * 0.999,
                };
                let number = index.checked_sub(first_moving).map(|i| i as u32);
                Some((solid, dy.atan2(dx), half, number))
            })
            .collect();
        solids.sort_by(|a, b| a.0.nearest.total_cmp(&b.0.nearest));
        let sector = std::f32::consts::TAU / SECTORS as f32;
        let mut lists = vec![Vec::new(); SECTORS];
        for (index, (_, azimuth, half, _)) in solids.iter().enumerate() {
            let first = ((azimuth - half) / sector).floor() as i64 - 1;
            let last = ((azimuth + half) / sector).floor() as i64 + 1;
            for number in first..=last.min(first + SECTORS as i64 - 1) {
                lists[number.rem_euclid(SECTORS as i64) as usize].push(index as u32);
            }
        }
        Self {
            moving: solids.iter().map(|s| s.3).collect(),
            eye: Eye {
                world,
                position,
                solids: solids.into_iter().map(|s| s.0).collect(),
            },
            light,
            air: Air::of(world),
            pixel,
            lists,
            world_from_sensor: world_from_sensor.rotation().map(|x| x as f32),
        }
    }

    /// The first surface along a ray (unit length, in the sensor's axes); `None` for the sky.
    pub(crate) fn cast(&self, local: &V3) -> Option<Echo> {
        let direction = self.world_from_sensor * local;
        let heading = direction.y.atan2(direction.x);
        let sector = std::f32::consts::TAU / SECTORS as f32;
        let heading = heading.rem_euclid(std::f32::consts::TAU);
        let number = ((heading / sector) as usize).min(SECTORS - 1);
        let hit = self.eye.trace(&self.lists[number], &direction);
        if hit.surface == Surface::Sky {
            return None;
        }
        let shader = Shader {
            eye: &self.eye,
            light: self.light,
            air: &self.air,
            pixel: self.pixel,
            samples: 1.0,
            moving: &[],
        };
        let albedo = shader.albedo(&hit, &direction);
        Some(Echo {
            range: hit.t,
            brightness: 0.3 * albedo.x + 0.5 * albedo.y + 0.2 * albedo.z,
            direction,
            moving: match hit.surface {
                Surface::Solid(index, _) => self.moving[index as usize],
                _ => None,
            },
        })
    }
}

/// A standard normal number, by the Box–Muller method.
pub(crate) fn gaussian(code: u32, key: u32) -> f32 {
    let other = hash(code as i32, 17, key);
    let a = ((code >> 8) as f32 + 0.5) / 16_777_216.0;
    let b = (other >> 8) as f32 / 16_777_216.0;
    (-2.0 * a.ln()).sqrt() * (std::f32::consts::TAU * b).cos()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_noise_is_standard_normal() {
        let n = 20_000;
        let samples: Vec<f32> = (0..n).map(|i| gaussian(hash(i, 3, 9), 9)).collect();
        let mean = samples.iter().sum::<f32>() / n as f32;
        let variance = samples.iter().map(|x| (x - mean).powi(2)).sum::<f32>() / n as f32;
        assert!(
            mean.abs() < 0.03 && (variance - 1.0).abs() < 0.05,
            "{mean} {variance}"
        );
    }
}
