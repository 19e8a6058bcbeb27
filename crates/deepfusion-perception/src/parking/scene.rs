//! Test scenes: upright boxes in front of a level camera.

use super::View;
use crate::obstacles::NONE;
use crate::{Detection, Ground, GroundBox, Obstacles, PerceptionConfig, Rays, Run};
use deepfusion_geometry::Intrinsics;

/// Height of the camera above the ground, in metres.
const CAMERA_M: f32 = 1.6;

/// The image of some boxes, from a camera of 640×192.
pub(super) struct Scene {
    depth: Vec<f32>,
    obstacles: Obstacles,
    rays: Rays,
    ground: Ground,
    config: PerceptionConfig,
}

impl Scene {
    /// Renders these boxes.
    pub(super) fn of(boxes: &[GroundBox]) -> Self {
        let (width, height) = (640, 192);
        let rays = Rays::of(&Intrinsics {
            fx: 370.0,
            fy: 370.0,
            cx: 320.0,
            cy: 96.0,
            width: width as u32,
            height: height as u32,
        });
        let mut scene = Self {
            depth: vec![0.0; width * height],
            obstacles: Obstacles {
                height: vec![NONE; width * height],
            },
            rays,
            ground: Ground::plane([0.0, -1.0, 0.0], CAMERA_M),
            config: PerceptionConfig::default(),
        };
        for pixel in 0..width * height {
            let (x, y) = (scene.rays.x[pixel % width], scene.rays.y[pixel / width]);
            let hits = boxes.iter().filter_map(|seen| hit(seen, x, y));
            if let Some(z) = hits.min_by(f32::total_cmp) {
                scene.depth[pixel] = z;
                scene.obstacles.height[pixel] = CAMERA_M - y * z;
            }
        }
        scene
    }

    /// A detection of one of the boxes, with the pixels that show it.
    pub(super) fn detection(&self, place: GroundBox) -> Detection {
        let width = self.rays.x.len();
        let shows = |pixel: &usize| {
            let (x, y) = (self.rays.x[pixel % width], self.rays.y[pixel / width]);
            hit(&place, x, y).is_some_and(|z| z == self.depth[*pixel])
        };
        let pixels = (0..self.depth.len()).filter(shows).map(|pixel| Run {
            v: (pixel / width) as u32,
            from: (pixel % width) as u32,
            to: (pixel % width) as u32 + 1,
        });
        let runs: Vec<Run> = pixels.collect();
        Detection {
            place,
            pixels: runs.len(),
            bounds: [0; 4],
            runs,
            confidence: 0.5,
            relative_error: None,
            kind: None,
        }
    }

    /// The image data for the code under test.
    pub(super) fn view(&self) -> View<'_> {
        View {
            depth: &self.depth,
            obstacles: &self.obstacles,
            rays: &self.rays,
            ground: &self.ground,
            config: &self.config,
        }
    }
}

/// A standing person: right, forward in metres.
pub(super) fn person(middle: [f32; 2]) -> GroundBox {
    GroundBox {
        middle,
        angle: 0.0,
        footprint: [0.5, 0.5],
        heights: [0.0, 1.75],
        seen: [1.0, 1.0],
        anchor: middle,
    }
}

/// Forward distance at which a ray (x, y, 1) meets a side of a box, in metres.
fn hit(seen: &GroundBox, x: f32, y: f32) -> Option<f32> {
    let (sin, cos) = seen.angle.sin_cos();
    let [right, forward] = seen.middle;
    let from = [
        -(cos * right + sin * forward),
        -(cos * forward - sin * right),
    ];
    let along = [cos * x + sin, cos - sin * x];
    let (mut near, mut far) = (0.1f32, 60.0f32);
    for i in 0..2 {
        let half = 0.5 * seen.footprint[i];
        let [a, b] = [-half, half].map(|end| (end - from[i]) / along[i]);
        near = near.max(a.min(b));
        far = far.min(a.max(b));
    }
    let height = CAMERA_M - y * near;
    (near < far && (seen.heights[0]..seen.heights[1]).contains(&height)).then_some(near)
}
