//! The ground: a plane found by consensus, then the height profile of the road ahead.

use crate::consensus::consensus;
use crate::{PerceptionConfig, Rays};
use nalgebra::{Matrix3, Vector3};

/// Approximate largest number of samples for the plane.
const SAMPLES: usize = 1_600;
/// Largest distance of a point from the plane, as a share of its distance plus a constant: slopes and the disparity's error both grow with
/// distance.
const TOLERANCE: (f32, f32) = (0.08, 0.006);
/// Length of a piece of the height profile, in metres, and the number of pieces.
const PIECE_M: f32 = 4.0;
const PIECES: usize = 20;

/// The ground below and ahead of the camera.
///
/// Its axes, in the camera's frame (x right, y down, z forward): `up` is the plane's normal, `forward` is the camera's z projected onto the
/// plane, `right` completes them. Heights are measured along `up` from the profile.
#[derive(Debug, Clone, PartialEq)]
pub struct Ground {
    /// Unit normal, away from the ground.
    pub up: [f32; 3],
    /// The camera's z, projected onto the plane.
    pub forward: [f32; 3],
    /// To the right, on the plane.
    pub right: [f32; 3],
    /// Height of the camera above the plane, metres: points p of the plane have up·p + height = 0.
    pub camera_height_m: f32,
    /// Share of the samples near the road that lie on it, 0 to 1.
    pub support: f32,
    /// Height of the road above the plane at every `PIECE_M` forward, in metres.
    profile: [f32; PIECES],
}

impl Ground {
    /// A flat ground from a plane's normal (any length, up) and the camera's height.
    #[must_use]
    pub fn plane(up: [f32; 3], camera_height_m: f32) -> Self {
        let up = normalised(up);
        let along = up[2];
        let forward = normalised([-along * up[0], -along * up[1], 1.0 - along * up[2]]);
        // x right, y down, z forward: right = forward × up.
        let right = [
            forward[1] * up[2] - forward[2] * up[1],
            forward[2] * up[0] - forward[0] * up[2],
            forward[0] * up[1] - forward[1] * up[0],
        ];
        Self {
            up,
            forward,
            right,
            camera_height_m,
            support: 1.0,
            profile: [0.0; PIECES],
        }
    }

    /// Finds the ground of a depth image, row by row at `rays`' size; `before` is the last frame's ground, which is tried first.
    /// `None` if no plausible plane has enough support.
    #[must_use]
    pub fn find(
        depth: &[f32],
        rays: &Rays,
        before: Option<&Self>,
        config: &PerceptionConfig,
    ) -> Option<Self> {
        let samples = Sample::take(depth, rays, config);
        let level: Vec<Sample> = samples
            .iter()
            .filter(|s| s.is_level(config))
            .copied()
            .collect();
        let best = consensus(&samples, &level, before, config)?;
        let plane = refine(&level, best);
        let (up, height) = plane_of(&plane)?;
        let mut ground = Self::plane(up, height);
        if !ground.is_plausible(config) {
            return None;
        }
        ground.support = support(&samples, &plane);
        ground.follow_slope(&level, config);
        Some(ground)
    }

    /// Whether its slope and the camera's height are plausible for a vehicle.
    pub(crate) fn is_plausible(&self, config: &PerceptionConfig) -> bool {
        let [low, high] = config.camera_height_m;
        -self.up[1] >= config.max_tilt_deg.to_radians().cos()
            && (low..=high).contains(&self.camera_height_m)
    }

    /// Height of the profile above the plane at a distance forward, in metres.
    #[must_use]
    pub fn profile_at(&self, forward_m: f32) -> f32 {
        let place = (forward_m / PIECE_M - 0.5).clamp(0.0, PIECES as f32 - 1.0);
        // Through 32 bits, of which processors convert many at a time.
        let index = (place as u32 as usize).min(PIECES - 2);
        let share = place - index as f32;
        self.profile[index] + share * (self.profile[index + 1] - self.profile[index])
    }

    /// A point of the camera's frame as (right, forward, height above the ground), in metres.
    #[must_use]
    pub fn locate(&self, p: [f32; 3]) -> [f32; 3] {
        let forward = dot(self.forward, p);
        let height = dot(self.up, p) + self.camera_height_m - self.profile_at(forward);
        [dot(self.right, p), forward, height]
    }

    /// The point of the camera's frame at (right, forward, height above the ground), in metres.
    #[must_use]
    pub fn place(&self, at: [f32; 3]) -> [f32; 3] {
        let height = at[2] - self.camera_height_m + self.profile_at(at[1]);
        std::array::from_fn(|i| {
            self.right[i] * at[0] + self.forward[i] * at[1] + self.up[i] * height
        })
    }

    /// Median height of the samples in each piece of the profile, as long as it continues the piece before.
    fn follow_slope(&mut self, samples: &[Sample], config: &PerceptionConfig) {
        let mut heights: Vec<Vec<f32>> = vec![Vec::new(); PIECES];
        for sample in samples {
            let p = sample.point();
            let forward = dot(self.forward, p);
            // Points beside the path say little about the path itself.
            if dot(self.right, p).abs() > 4.0 + 0.1 * forward {
                continue;
            }
            if let Some(piece) = heights.get_mut((forward / PIECE_M) as usize) {
                piece.push(dot(self.up, p) + self.camera_height_m);
            }
        }
        let mut last = 0.0f32;
        let mut rise = 0.0f32;
        for (i, piece) in heights.iter_mut().enumerate() {
            let expected = last + rise;
            let reach = TOLERANCE.0 + 0.25 * config.max_slope * PIECE_M;
            piece.retain(|h| (h - expected).abs() < reach);
            if piece.len() >= 8 {
                piece.sort_by(f32::total_cmp);
                // Below the median, because objects on the road add heights on one side only.
                let height = piece[piece.len() * 2 / 5];
                rise = if i == 0 {
                    0.0
                } else {
                    (0.5 * rise + 0.5 * (height - last)).clamp(-0.2 * PIECE_M, 0.2 * PIECE_M)
                };
                last = height;
            } else {
                // Without samples, the slope continues, decaying.
                last = expected;
                rise *= 0.7;
            }
            self.profile[i] = last;
        }
    }
}

/// A pixel's ray and disparity.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Sample {
    pub ray: [f32; 2],
    pub disparity: f32,
    pub depth: f32,
    /// Increase of the disparity from row to row, per unit of the ray's y: 1 / (the camera's height above it) on a level surface, 0 on an
    /// upright one.
    gain: f32,
}

impl Sample {
    fn take(depth: &[f32], rays: &Rays, config: &PerceptionConfig) -> Vec<Self> {
        let (width, height) = (rays.x.len(), rays.y.len());
        // Only rows that can show ground: below the horizon of the most tilted camera.
        let lowest = -(config.max_tilt_deg.to_radians().tan());
        let first = rays.y.iter().position(|y| *y > lowest).unwrap_or(height);
        let pixels = (height - first) * width;
        let step = ((pixels as f32 / SAMPLES as f32).sqrt() as usize).max(1);
        let mut samples = Vec::with_capacity(2 * SAMPLES);
        // The rows are some distance apart, so that rounding of the depth does not dominate the gain.
        let apart = (height / 60).max(1);
        for (row, v) in (first..height.saturating_sub(apart))
            .step_by(step)
            .enumerate()
        {
            // Every row starts at another column, so that a pattern in the image does not coincide with the grid.
            for u in ((row * 7) % step..width).step_by(step) {
                let at = |v: usize| depth[v * width + u];
                let z = at(v);
                if z > 0.0 && z <= config.max_depth_m {
                    let gain = |upper: usize, lower: usize| {
                        let (a, b) = (at(upper), at(lower));
                        let known = a > 0.0 && b > 0.0;
                        known.then(|| (1.0 / b - 1.0 / a) / (rays.y[lower] - rays.y[upper]))
                    };
                    // Level above and below, since the foot of a wall is not ground.
                    let below = gain(v, v + apart).unwrap_or(0.0);
                    let above = v.checked_sub(apart).and_then(|upper| gain(upper, v));
                    samples.push(Self {
                        ray: [rays.x[u], rays.y[v]],
                        disparity: 1.0 / z,
                        depth: z,
                        gain: above.map_or(below, |above| above.min(below)),
                    });
                }
            }
        }
        samples
    }

    /// Whether the surface could be ground below the camera.
    fn is_level(&self, config: &PerceptionConfig) -> bool {
        let [low, high] = config.camera_height_m;
        (0.5 / high..2.0 / low).contains(&self.gain)
    }

    fn point(&self) -> [f32; 3] {
        let z = self.depth;
        [self.ray[0] * z, self.ray[1] * z, z]
    }

    /// The point's height above the plane and its tolerance, in metres; `height` is 1 / |plane|, the camera's height.
    fn residual(&self, plane: &Vector3<f32>, height: f32) -> (f32, f32) {
        let on_plane = plane.x * self.ray[0] + plane.y * self.ray[1] + plane.z;
        let above = (self.disparity - on_plane) * self.depth * height;
        // A point above the plane is nearer than the plane: its disparity is larger.
        (above, self.tolerance())
    }

    /// Tolerance of its height above or below the plane, metres.
    pub(crate) fn tolerance(&self) -> f32 {
        TOLERANCE.0 + TOLERANCE.1 * self.depth
    }
}

/// A plane as (a, b, c) with 1/z = a·x + b·y + c over the rays (x, y, 1).
pub(crate) type DisparityPlane = Vector3<f32>;

/// Normal (up) and height of the camera above a plane.
pub(crate) fn plane_of(plane: &DisparityPlane) -> Option<([f32; 3], f32)> {
    let norm = plane.norm();
    // plane·p = 1 on the plane, and the camera (p = 0) is above it: up = −plane / |plane|.
    (norm > 1e-3 && norm.is_finite()).then(|| {
        (
            [-plane.x / norm, -plane.y / norm, -plane.z / norm],
            1.0 / norm,
        )
    })
}

/// Weighted least squares on the points near the plane, repeated with Tukey's weights and ever smaller tolerances. What lies in front of
/// the camera counts most, so that the road wins over a pavement a kerb higher.
fn refine(level: &[Sample], mut plane: DisparityPlane) -> DisparityPlane {
    for narrow in [1.0, 0.8, 0.6, 0.6, 0.6] {
        let height = 1.0 / plane.norm();
        let mut normal = Matrix3::<f32>::zeros();
        let mut right = Vector3::<f32>::zeros();
        for sample in level {
            let (above, tolerance) = sample.residual(&plane, height);
            let tolerance = narrow * tolerance;
            let x = above / tolerance;
            if x.abs() >= 1.0 {
                continue;
            }
            let aside = sample.ray[0] * sample.depth / 3.0;
            // Residuals in metres: disparity residual × depth × camera height.
            let weight =
                (1.0 - x * x).powi(2) * (sample.depth / tolerance).powi(2) / (1.0 + aside.powi(4));
            let ray = Vector3::new(sample.ray[0], sample.ray[1], 1.0);
            normal += weight * ray * ray.transpose();
            right += weight * sample.disparity * ray;
        }
        match normal.try_inverse() {
            Some(inverse) => plane = inverse * right,
            None => break,
        }
    }
    plane
}

/// Share of samples on the plane among those not above it.
fn support(samples: &[Sample], plane: &DisparityPlane) -> f32 {
    let mut on = 0.0;
    let mut all = 0.0f32;
    let height = 1.0 / plane.norm();
    for sample in samples {
        let (above, tolerance) = sample.residual(plane, height);
        if above < tolerance {
            all += 1.0;
            on += f32::from(above > -tolerance);
        }
    }
    on / all.max(1.0)
}

pub(crate) fn dot(a: [f32; 3], b: [f32; 3]) -> f32 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

fn normalised(v: [f32; 3]) -> [f32; 3] {
    let norm = dot(v, v).sqrt().max(f32::MIN_POSITIVE);
    v.map(|x| x / norm)
}
