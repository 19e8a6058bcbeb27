use serde::{Deserialize, Serialize};

/// What counts as ground, obstacle and target, and how much its depth can be trusted.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct PerceptionConfig {
    /// Farthest camera z that is looked at, in metres.
    pub max_depth_m: f32,
    /// Height above the ground from which on something is an obstacle, in metres: kerbs are lower.
    pub min_height_m: f32,
    /// Height up to which pixels are joined into clusters, in metres: what hangs above, a tree's crown or a
    /// sign, would join the cars below it. Where a cluster reaches it, its box goes on to [`Self::max_target_height_m`].
    pub join_height_m: f32,
    /// Lowest and highest target, in metres.
    pub min_target_height_m: f32,
    /// See [`Self::min_target_height_m`].
    pub max_target_height_m: f32,
    /// Largest footprint of a target, length and width in metres.
    pub max_footprint_m: [f32; 2],
    /// Fewest pixels of a target in an image of 640×192; other sizes in proportion to their area.
    pub min_pixels: f32,
    /// Least confidence of a target that is told; tracks below it go on in silence.
    pub min_confidence: f64,
    /// Frames in which a target must have been seen before it is told.
    pub confirm_frames: u32,
    /// Standard deviation of a disparity over itself: 0.01 says that a depth of 30 m is good to 30 cm for each
    /// of its pixels. Exact depth: 0. It widens the gaps that a cluster may bridge.
    pub relative_error: f32,
    /// Jump of depth, as a share of it, from which on a pixel that hangs between a near and a far surface is left out
    /// ([`crate::flying_pixels`]); 0 keeps all.
    pub edge_jump: f32,
    /// How far such a pixel may lie from both, in pixels of an image 640 wide.
    pub edge_radius: f32,
    /// Steepest ground, rise over run, in the direction of sight.
    pub max_slope: f32,
    /// Lowest and highest place of a camera above the ground, in metres.
    pub camera_height_m: [f32; 2],
    /// Largest angle between the camera's up and the ground's normal, in degrees.
    pub max_tilt_deg: f32,
}

impl PerceptionConfig {
    /// For depth that a network predicted: its edges bleed, and its error grows with depth.
    #[must_use]
    pub fn predicted() -> Self {
        Self {
            min_pixels: 100.0,
            min_confidence: 0.4,
            confirm_frames: 2,
            relative_error: 0.03,
            edge_jump: 0.025,
            ..Self::default()
        }
    }
}

/// For exact depth.
impl Default for PerceptionConfig {
    fn default() -> Self {
        Self {
            max_depth_m: 60.0,
            min_height_m: 0.25,
            join_height_m: 2.6,
            min_target_height_m: 0.4,
            max_target_height_m: 4.5,
            max_footprint_m: [13.0, 3.5],
            min_pixels: 30.0,
            min_confidence: 0.2,
            confirm_frames: 1,
            relative_error: 0.0,
            edge_jump: 0.0,
            edge_radius: 3.0,
            max_slope: 0.2,
            camera_height_m: [0.3, 4.0],
            max_tilt_deg: 20.0,
        }
    }
}
