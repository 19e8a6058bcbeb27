//! What `perceive` writes for a frame.

use deepfusion_perception::{Collision, Stamp, Surroundings, Target};
use serde::{Deserialize, Serialize};

use crate::ScaleRecord;

/// A frame's targets. Everything is in the camera's axes (x right, y down, z forward), in metres and seconds.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct FrameRecord {
    /// The frame's name.
    pub frame: String,
    /// When it was taken, in seconds from the recording's first time stamp.
    pub time_s: Option<f64>,
    /// The targets, nearest first.
    pub targets: Vec<Target>,
    /// The road plane.
    pub ground: Option<GroundPlane>,
    /// `world_from_cam`, 3×4 row by row; the world is the recording's first camera.
    pub camera_motion: Option<[f64; 12]>,
    /// The vehicle's speed, in m/s.
    pub speed_mps: Option<f64>,
    /// Time until the vehicle's front reaches a target, if both continue to move as they do.
    pub time_to_collision_s: Option<f64>,
    /// Id of that target.
    pub collision_with: Option<u64>,
    /// Whether the scale of depth has changed, if it is monitored.
    pub scale_monitor: Option<ScaleRecord>,
    /// Time from opening the file, or from a live frame's arrival, to its targets, in milliseconds.
    pub latency_ms: Option<f64>,
    /// When a live frame arrived, in seconds since 1970.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub arrived_unix_s: Option<f64>,
    /// Number of frames of the live source that were skipped so far.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub dropped: Option<u64>,
}

/// The road plane: points p with normal·p + offset = 0.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct GroundPlane {
    /// Unit normal, pointing up.
    pub normal: [f32; 3],
    /// The camera's height above the plane, in metres.
    pub offset_m: f32,
}

impl FrameRecord {
    /// The record of the `surroundings` found in a frame taken at `stamp` by a vehicle moving at `speed_mps` m/s.
    #[must_use]
    pub fn new(
        frame: &str,
        surroundings: &Surroundings,
        (stamp, speed_mps): (Option<Stamp>, Option<f64>),
        collision: Option<Collision>,
        latency_ms: f64,
    ) -> Self {
        Self {
            frame: frame.to_owned(),
            time_s: stamp.map(|s| s.time_s),
            targets: surroundings.targets.clone(),
            ground: surroundings.ground.as_ref().map(|ground| GroundPlane {
                normal: ground.up,
                offset_m: ground.camera_height_m,
            }),
            camera_motion: stamp.map(|stamp| {
                let matrix = stamp.world_from_cam.matrix();
                std::array::from_fn(|i| matrix[(i / 4, i % 4)])
            }),
            speed_mps,
            time_to_collision_s: collision.map(|c| c.time_s),
            collision_with: collision.map(|c| c.id),
            scale_monitor: None,
            latency_ms: Some(latency_ms),
            arrived_unix_s: None,
            dropped: None,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_json_of_a_frame_is_fixed_and_can_be_read_back() {
        let record = FrameRecord {
            frame: "0000000005".into(),
            time_s: Some(0.5),
            targets: vec![Target {
                id: 7,
                center_m: [1.0, 0.5, 14.0],
                size_m: [4.0, 1.8, 1.5],
                yaw_rad: 0.6,
                distance_m: 14.1,
                sigma_m: None,
                velocity_mps: Some([0.0, 0.0, -5.0]),
                likely_velocity_mps: None,
                moving: Some(true),
                confidence: 0.9,
                pixels: 120,
                class: None,
                bounds: Some([1, 2, 30, 40]),
                detection: None,
            }],
            ground: Some(GroundPlane {
                normal: [0.0, -1.0, 0.1],
                offset_m: 1.65,
            }),
            speed_mps: Some(8.0),
            latency_ms: Some(12.0),
            ..FrameRecord::default()
        };
        let text = serde_json::to_string(&record).unwrap();
        assert_eq!(
            text,
            concat!(
                r#"{"frame":"0000000005","time_s":0.5,"targets":[{"id":7,"center_m":[1.0,0.5,14.0],"#,
                r#""size_m":[4.0,1.8,1.5],"yaw_rad":0.6,"distance_m":14.1,"velocity_mps":[0.0,0.0,-5.0],"#,
                r#""moving":true,"confidence":0.9,"pixels":120,"bounds":[1,2,30,40]}],"#,
                r#""ground":{"normal":[0.0,-1.0,0.1],"offset_m":1.65},"camera_motion":null,"speed_mps":8.0,"#,
                r#""time_to_collision_s":null,"collision_with":null,"scale_monitor":null,"latency_ms":12.0}"#,
            )
        );
        assert_eq!(serde_json::from_str::<FrameRecord>(&text).unwrap(), record);
    }

    #[test]
    fn missing_fields_take_their_defaults() {
        let text =
            r#"{"targets": [], "camera_motion": [0, 0, 1, 7, 0, 1, 0, 8, -1, 0, 0, 9], "new": 1}"#;
        let record: FrameRecord = serde_json::from_str(text).unwrap();
        assert_eq!(record.camera_motion.map(|m| m[3]), Some(7.0));
        assert_eq!((record.latency_ms, record.ground), (None, None));
    }
}
