//! A frequency-modulated LiDAR: 120 lines ahead, with each point's radial velocity.

use crate::light::GroundLight;
use crate::primitive::{Primitive, V3};
use crate::scanner::{Scanner, gaussian};
use crate::scene::World;
use crate::texture::noise::{hash, unit};
use deepfusion_geometry::Se3;
use deepfusion_geometry::cloud::PointCloud;
use nalgebra::Vector3;
use rayon::prelude::*;

/// Number of lines, and the angle between two of them, degrees.
pub(crate) const LINES: usize = 120;
const LINE_STEP_DEG: f32 = 0.08;
/// Elevation of the topmost line, degrees: two thirds of the field of view lie below the horizon.
const TOP_DEG: f32 = 3.2;

/// Field of view to the sides, degrees.
const WIDTH_DEG: f32 = 100.0;

/// Scans a second, in a bag.
pub(crate) const SCAN_RATE_HZ: f64 = 10.0;

/// Angle between two columns of the sensor, degrees.
pub(crate) const COLUMN_STEP_DEG: f32 = 0.1;

/// Nearest and farthest range it reports, metres.
const RANGE: (f32, f32) = (1.0, 150.0);

/// Standard deviations of range, metres, and of radial velocity, m/s.
const RANGE_NOISE: f32 = 0.02;
const VELOCITY_NOISE: f32 = 0.05;

/// Time between the two positions that a velocity is computed from, seconds.
pub(crate) const VELOCITY_STEP_S: f64 = 1e-3;

/// A scan with its ground truth.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct FmcwScan {
    /// Points in the sensor's axes (x forward, y left, z up), metres, with intensity and the radial velocity relative to the sensor in m/s,
    /// positive receding.
    pub cloud: PointCloud,
    /// Whether each point is on a dynamic object.
    pub moving: Vec<bool>,
    /// The exact speed over ground of each point along its ray, m/s, positive receding: 0 for static objects.
    pub ground_radial_mps: Vec<f32>,
}

/// The solids of dynamic objects now and [`VELOCITY_STEP_S`] later.
pub(crate) struct MovingSolids {
    /// The solids now.
    pub now: Vec<Primitive>,
    /// The same solids later, in the same order.
    pub later: Vec<Primitive>,
}

impl MovingSolids {
    /// Velocity over ground of a point of a solid, world axes, m/s.
    fn velocity(&self, index: u32, point: &Vector3<f64>) -> Vector3<f64> {
        let index = index as usize;
        let (Some(now), Some(later)) = (self.now.get(index), self.later.get(index)) else {
            return Vector3::zeros();
        };
        let offset = point - Vector3::from(now.position);
        // The turn between the two headings, in full precision: both are unit vectors in f32.
        let (c, s) = (
            f64::from(now.heading.0) * f64::from(later.heading.0)
                + f64::from(now.heading.1) * f64::from(later.heading.1),
            f64::from(now.heading.0) * f64::from(later.heading.1)
                - f64::from(now.heading.1) * f64::from(later.heading.0),
        );
        let angle = s.atan2(c);
        let shift = Vector3::from(later.position) - Vector3::from(now.position);
        let turn = Vector3::new(-offset.y, offset.x, 0.0) * angle;
        (shift + turn) / VELOCITY_STEP_S
    }
}

/// One scan at one instant, with a column every `column_step_deg`. `velocity` is the sensor's velocity over ground, world axes, m/s; `key`
/// seeds the noise.
pub(crate) fn scan(
    world: &World,
    light: &GroundLight,
    moving: &MovingSolids,
    (world_from_lidar, velocity): (&Se3, &Vector3<f64>),
    column_step_deg: f32,
    key: u32,
) -> FmcwScan {
    let pixel = column_step_deg.to_radians();
    let scanner = Scanner::new(
        world,
        light,
        &moving.now,
        world_from_lidar,
        (RANGE.1, pixel),
    );
    let position = world_from_lidar.translation();
    let columns = (WIDTH_DEG / column_step_deg).round() as usize;
    let lines: Vec<Vec<Point>> = (0..LINES)
        .into_par_iter()
        .map(|line| {
            let elevation = (TOP_DEG - LINE_STEP_DEG * line as f32).to_radians();
            let (sin, cos) = elevation.sin_cos();
            let mut points = Vec::with_capacity(columns);
            for column in 0..columns {
                let azimuth = 0.5 * WIDTH_DEG - column_step_deg * (column as f32 + 0.5);
                let azimuth = azimuth.to_radians();
                let local = V3::new(cos * azimuth.cos(), cos * azimuth.sin(), sin);
                let Some(echo) = scanner.cast(&local).filter(|echo| echo.range <= RANGE.1) else {
                    continue;
                };
                let code = hash(column as i32, line as i32, key);
                let bright: f32 = echo.brightness;
                let weak = (1.2 - 2.0 * bright).clamp(0.1, 1.2);
                if unit(code, 0) < 0.02 + 0.25 * (echo.range / RANGE.1).powi(2) * weak {
                    continue;
                }
                let range = echo.range + RANGE_NOISE * gaussian(code, key);
                if range < RANGE.0 {
                    continue;
                }
                let direction = echo.direction.map(f64::from);
                let over_ground = echo.moving.map_or(0.0, |index| {
                    let point = position + direction * f64::from(echo.range);
                    moving.velocity(index, &point).dot(&direction)
                });
                let against = over_ground - velocity.dot(&direction);
                let noise = VELOCITY_NOISE * gaussian(hash(code as i32, 5, key), key);
                let intensity = (bright * (0.8 + 0.4 * unit(code, 3))).clamp(0.0, 1.0);
                points.push(Point {
                    xyz: [local.x * range, local.y * range, local.z * range],
                    intensity: (intensity * 100.0).round() / 100.0,
                    radial_mps: against as f32 + noise,
                    moving: echo.moving.is_some(),
                    ground_mps: over_ground as f32,
                });
            }
            points
        })
        .collect();
    let points = || lines.iter().flatten();
    FmcwScan {
        cloud: PointCloud {
            xyz: points().map(|p| p.xyz).collect(),
            intensity: Some(points().map(|p| p.intensity).collect()),
            radial_velocity: Some(points().map(|p| p.radial_mps).collect()),
            ..PointCloud::default()
        },
        moving: points().map(|p| p.moving).collect(),
        ground_radial_mps: points().map(|p| p.ground_mps).collect(),
    }
}

struct Point {
    xyz: [f32; 3],
    intensity: f32,
    radial_mps: f32,
    moving: bool,
    ground_mps: f32,
}
