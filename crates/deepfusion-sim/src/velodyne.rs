//! A scanner like KITTI's: 64 lines, ray-cast from its own place.

use crate::light::GroundLight;
use crate::primitive::{Primitive, V3};
use crate::render::{Eye, FrameSolid, Shader, Surface, gather};
use crate::scene::World;
use crate::texture::noise::{hash, unit};
use deepfusion_cloud::PointCloud;
use deepfusion_geometry::Se3;
use rayon::prelude::*;

/// Nearest and farthest range it reports, metres.
const RANGE: (f32, f32) = (1.5, 110.0);

/// Standard deviation of the range noise, metres.
const NOISE: f32 = 0.02;

/// Sectors of azimuth that share a list of candidates.
const SECTORS: usize = 240;

/// Elevations of the lines of an HDL-64E, radians, top to bottom.
fn elevations() -> [f32; 64] {
    std::array::from_fn(|line| {
        let line = line as f32;
        let degrees = if line < 32.0 {
            2.0 - line / 3.0
        } else {
            -8.83 - (line - 32.0) * 0.5
        };
        degrees.to_radians()
    })
}

/// One turn of the scanner at one instant; points in its own axes (x forward, y left, z up), metres.
/// `key` makes the noise of this scan.
pub fn scan(
    world: &World,
    light: &GroundLight,
    moving: &[Primitive],
    world_from_velo: &Se3,
    step_deg: f64,
    key: u32,
) -> PointCloud {
    let position = world_from_velo.translation();
    let mut solids: Vec<(FrameSolid, f32, f32)> = gather(world, moving, &position)
        .into_iter()
        .filter_map(|primitive| {
            let (half_x, half_y, ..) = primitive.bounds(&world.hulls);
            let radius = half_x.hypot(half_y);
            let dx = (primitive.position[0] - position.x) as f32;
            let dy = (primitive.position[1] - position.y) as f32;
            let away = dx.hypot(dy);
            if away - radius > RANGE.1 {
                return None;
            }
            // Half the angle it covers; everything around where the scanner is over it.
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
            Some((solid, dy.atan2(dx), half))
        })
        .collect();
    solids.sort_by(|a, b| a.0.nearest.total_cmp(&b.0.nearest));
    let sector = std::f32::consts::TAU / SECTORS as f32;
    let mut lists = vec![Vec::new(); SECTORS];
    for (index, (_, azimuth, half)) in solids.iter().enumerate() {
        let first = ((azimuth - half) / sector).floor() as i64 - 1;
        let last = ((azimuth + half) / sector).floor() as i64 + 1;
        for number in first..=last.min(first + SECTORS as i64 - 1) {
            lists[number.rem_euclid(SECTORS as i64) as usize].push(index as u32);
        }
    }
    let eye = Eye {
        world,
        position,
        solids: solids.into_iter().map(|s| s.0).collect(),
    };
    let columns = (360.0 / step_deg).round().max(1.0) as usize;
    let shader = Shader {
        eye: &eye,
        light,
        pixel: (step_deg as f32).to_radians().max(0.003),
        samples: 1.0,
        moving: &[],
    };
    let rotation = world_from_velo.rotation().map(|x| x as f32);
    let lines: Vec<Vec<([f32; 3], f32)>> = elevations()
        .par_iter()
        .enumerate()
        .map(|(line, elevation)| {
            let (sin, cos) = elevation.sin_cos();
            let mut points = Vec::with_capacity(columns);
            for column in 0..columns {
                // KITTI's scans begin ahead and turn to the left.
                let azimuth = std::f32::consts::TAU * (column as f32 + 0.5) / columns as f32;
                let local = V3::new(cos * azimuth.cos(), cos * azimuth.sin(), sin);
                let d = rotation * local;
                let heading = d.y.atan2(d.x).rem_euclid(std::f32::consts::TAU);
                let number = ((heading / sector) as usize).min(SECTORS - 1);
                let hit = eye.trace(&lists[number], &d);
                if hit.surface == Surface::Sky || hit.t > RANGE.1 {
                    continue;
                }
                let code = hash(column as i32, line as i32, key);
                let albedo = shader.albedo(&hit, &d);
                let bright: f32 = 0.3 * albedo.x + 0.5 * albedo.y + 0.2 * albedo.z;
                // Weak returns are lost: dark things, far away.
                let lost: f32 =
                    0.02 + 0.25 * (hit.t / RANGE.1).powi(2) * (1.2 - 2.0 * bright).clamp(0.1, 1.2);
                if unit(code, 0) < lost {
                    continue;
                }
                let range = hit.t + NOISE * gaussian(code, key);
                if range < RANGE.0 {
                    continue;
                }
                let intensity = (bright * (0.8 + 0.4 * unit(code, 3))).clamp(0.0, 1.0);
                let intensity = (intensity * 100.0).round() / 100.0;
                points.push((
                    [local.x * range, local.y * range, local.z * range],
                    intensity,
                ));
            }
            points
        })
        .collect();
    let (xyz, intensity) = lines.into_iter().flatten().unzip();
    PointCloud {
        xyz,
        intensity: Some(intensity),
        ..PointCloud::default()
    }
}

/// A standard normal number by Box and Muller's method.
fn gaussian(code: u32, key: u32) -> f32 {
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

    #[test]
    fn the_lines_go_down() {
        let lines = elevations();
        assert!(lines.windows(2).all(|w| w[1] < w[0]));
        assert!((lines[63].to_degrees() + 24.33).abs() < 1e-3);
    }
}
