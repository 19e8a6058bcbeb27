use serde::{Deserialize, Serialize};

/// An object that stands on the ground: a box in the camera's frame (x right, y down, z forward).
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Target {
    /// Its track's id, constant over frames.
    pub id: u64,
    /// Centre of the box, metres.
    pub center_m: [f64; 3],
    /// Length, width and height, metres.
    pub size_m: [f64; 3],
    /// KITTI's rotation_y: the length points along (cos, 0, −sin) of this angle. Without a velocity it is ambiguous by half a turn.
    pub yaw_rad: f64,
    /// Distance from the camera to the centre, in metres.
    pub distance_m: f64,
    /// Standard deviation of the distance, in metres, if the depth came with one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub sigma_m: Option<f64>,
    /// Velocity over ground, in the camera's axes, m/s; `None` before it could be measured.
    pub velocity_mps: Option<[f64; 3]>,
    /// The best estimate of that velocity, whether certain or not; `None` if the target is not tracked.
    #[serde(skip)]
    pub likely_velocity_mps: Option<[f64; 3]>,
    /// Whether it is dynamic (moves over ground); `None` until that is known.
    pub moving: Option<bool>,
    /// Confidence that the target exists, 0 to 1.
    pub confidence: f64,
    /// Number of pixels in this frame; 0 if the track continues unseen.
    #[serde(default)]
    pub pixels: usize,
    /// Its class from a segmentation model, if there is one: the class with the most votes.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub class: Option<String>,
    /// Left, top, right and bottom of its pixels, in pixels of the depth image; [`crate::scale_bounds`] converts them to another size.
    pub bounds: Option<[u32; 4]>,
    /// Its index among the image's detections.
    #[serde(skip)]
    pub detection: Option<usize>,
}

impl Target {
    /// The eight corners in the camera's frame, metres: the lower four first.
    #[must_use]
    pub fn corners(&self) -> [[f64; 3]; 8] {
        let (sin, cos) = self.yaw_rad.sin_cos();
        let [length, width, height] = self.size_m;
        std::array::from_fn(|i| {
            let along = if matches!(i % 4, 0 | 3) { 0.5 } else { -0.5 } * length;
            let across = if matches!(i % 4, 0 | 1) { 0.5 } else { -0.5 } * width;
            let up = if i < 4 { 0.5 } else { -0.5 } * height;
            [
                self.center_m[0] + cos * along + sin * across,
                self.center_m[1] + up,
                self.center_m[2] - sin * along + cos * across,
            ]
        })
    }
}
