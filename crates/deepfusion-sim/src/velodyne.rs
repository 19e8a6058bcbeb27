//! A scanner like KITTI's: 64 lines, ray-cast from its own position.

use crate::light::GroundLight;
use crate::primitive::{Primitive, V3};
use crate::scanner::{Scanner, gaussian};
use crate::scene::World;
use crate::texture::noise::{hash, unit};
use deepfusion_geometry::Se3;
use deepfusion_geometry::cloud::PointCloud;
use rayon::prelude::*;

/// Nearest and farthest range it reports, metres.
const RANGE: (f32, f32) = (1.5, 110.0);

/// Standard deviation of the range noise, metres.
const NOISE: f32 = 0.02;

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
/// `key` seeds the noise of this scan.
pub(crate) fn scan(
    world: &World,
    light: &GroundLight,
    moving: &[Primitive],
    world_from_velo: &Se3,
    step_deg: f64,
    key: u32,
) -> PointCloud {
    let columns = (360.0 / step_deg).round().max(1.0) as usize;
    let pixel = (step_deg as f32).to_radians().max(0.003);
    let scanner = Scanner::new(world, light, moving, world_from_velo, (RANGE.1, pixel));
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
                let Some(echo) = scanner.cast(&local).filter(|echo| echo.range <= RANGE.1) else {
                    continue;
                };
                let code = hash(column as i32, line as i32, key);
                let bright: f32 = echo.brightness;
                // Weak returns are lost: those of dark, distant surfaces.
                let lost: f32 = 0.02
                    + 0.25 * (echo.range / RANGE.1).powi(2) * (1.2 - 2.0 * bright).clamp(0.1, 1.2);
                if unit(code, 0) < lost {
                    continue;
                }
                let range = echo.range + NOISE * gaussian(code, key);
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn elevations_decrease_from_line_to_line() {
        let lines = elevations();
        assert!(lines.windows(2).all(|w| w[1] < w[0]));
        assert!((lines[63].to_degrees() + 24.33).abs() < 1e-3);
    }
}
