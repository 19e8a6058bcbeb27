use crate::{Detection, Ground, PerceptionConfig};
use deepfusion_geometry::Se3;
use nalgebra::{Matrix2, Vector2, Vector3};

/// A detection in world coordinates.
pub(super) struct Measurement<'a> {
    /// Its index among the image's detections.
    pub index: usize,
    /// The detection.
    pub detection: &'a Detection,
    /// Angle of its length in the world's horizontal axes, x to z, radians.
    pub heading: f64,
    /// Weight of its heading: the visible length in metres.
    pub heading_weight: f64,
    ground: &'a Ground,
    world_from_cam: &'a Se3,
}

impl<'a> Measurement<'a> {
    /// The measurement of detection `index` on `ground`, by a camera at `world_from_cam`.
    pub(super) fn new(
        (index, detection): (usize, &'a Detection),
        ground: &'a Ground,
        world_from_cam: &'a Se3,
    ) -> Self {
        let (sin, cos) = detection.place.angle.sin_cos();
        let along = |i: usize| f64::from(cos * ground.right[i] + sin * ground.forward[i]);
        let along = world_from_cam.rotate(&Vector3::new(along(0), along(1), along(2)));
        let [length, width] =
            [0, 1].map(|i| detection.place.footprint[i] * detection.place.seen[i]);
        Self {
            index,
            detection,
            heading: along.z.atan2(along.x),
            heading_weight: f64::from(length.max(width)),
            ground,
            world_from_cam,
        }
    }

    /// Centre in the world of the box with this length and width, in metres.
    pub(super) fn centre_with(&self, extents: [f64; 2]) -> Vector3<f64> {
        let [right, forward] = self.detection.place.middle_with(extents.map(|e| e as f32));
        let [low, high] = self.detection.place.heights;
        let p = self.ground.place([right, forward, 0.5 * (low + high)]);
        self.world_from_cam
            .transform(&Vector3::from(p.map(f64::from)))
    }

    /// Covariance of the centre in the world's horizontal axes: the error of depth along the ray, from the box's pixels or else as
    /// configured, and the part of the box that had to be completed.
    pub(super) fn noise(&self, config: &PerceptionConfig) -> Matrix2<f64> {
        let place = &self.detection.place;
        let ray = self
            .world_from_cam
            .rotate(&Vector3::from(std::array::from_fn(|i| {
                f64::from(
                    place.middle[0] * self.ground.right[i]
                        + place.middle[1] * self.ground.forward[i],
                )
            })));
        let ray = Vector2::new(ray.x, ray.z);
        let distance = ray.norm().max(1.0);
        let ray = ray / distance;
        let unseen: f64 = (0..2)
            .map(|i| f64::from(place.footprint[i] * (1.0 - place.seen[i])))
            .sum();
        let across = 0.1 + 0.004 * distance + 0.1 * unseen;
        // The errors of an object's pixels are correlated: their mean is no better than one of them.
        let relative = self.detection.relative_error;
        let relative = f64::from(relative.unwrap_or(config.relative_error));
        let along = across.hypot(relative * distance);
        Matrix2::identity() * across.powi(2)
            + ray * ray.transpose() * (along.powi(2) - across.powi(2))
    }
}
