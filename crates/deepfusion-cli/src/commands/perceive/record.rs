//! What is written of a frame: one JSON object, and a line of all of them.

use std::io::{BufWriter, Write};
use std::path::{Path, PathBuf};

use deepfusion_perception::{Collision, Surroundings, Target};
use serde::Serialize;

use crate::output;

use super::super::scene::{Motion, Scale};
use crate::failure::Result;

/// A frame's targets; everything in the camera's axes (x right, y down, z forward), metres and seconds.
#[derive(Debug, Clone, Serialize)]
pub struct FrameRecord {
    /// The frame's name.
    pub frame: String,
    /// When it was taken, seconds from the recording's first stamp.
    pub time_s: Option<f64>,
    /// In order of distance.
    pub targets: Vec<Target>,
    /// The road.
    pub ground: Option<GroundPlane>,
    /// `world_from_cam`, 3×4 row by row; the world is the recording's first camera.
    pub camera_motion: Option<[f64; 12]>,
    /// The vehicle's speed, m/s.
    pub speed_mps: Option<f64>,
    /// When its front would meet a target, if all went on as they do.
    pub time_to_collision_s: Option<f64>,
    /// That target.
    pub collision_with: Option<u64>,
    /// Whether metres still are what they were, where that is watched.
    pub scale_monitor: Option<Scale>,
    /// From opening the file, or from a live frame's arrival, to having the targets.
    pub latency_ms: f64,
    /// When a live frame arrived, seconds since 1970.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub arrived_unix_s: Option<f64>,
    /// Frames of the live source that were skipped so far.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub dropped: Option<u64>,
}

/// Points p with normal·p + offset = 0.
#[derive(Debug, Clone, Serialize)]
pub struct GroundPlane {
    /// Upwards, of length 1.
    pub normal: [f32; 3],
    /// The camera's height above it, metres.
    pub offset_m: f32,
}

impl FrameRecord {
    /// Of what was found.
    pub fn new(
        frame: &str,
        surroundings: &Surroundings,
        motion: &Motion,
        collision: Option<Collision>,
        latency_ms: f64,
    ) -> Self {
        Self {
            frame: frame.to_owned(),
            time_s: motion.stamp.map(|s| s.time_s),
            targets: surroundings.targets.clone(),
            ground: surroundings.ground.as_ref().map(|ground| GroundPlane {
                normal: ground.up,
                offset_m: ground.camera_height_m,
            }),
            camera_motion: motion.stamp.map(|stamp| {
                let matrix = stamp.world_from_cam.matrix();
                std::array::from_fn(|i| matrix[(i / 4, i % 4)])
            }),
            speed_mps: motion.speed_mps,
            time_to_collision_s: collision.map(|c| c.time_s),
            collision_with: collision.map(|c| c.id),
            scale_monitor: None,
            latency_ms,
            arrived_unix_s: None,
            dropped: None,
        }
    }

    /// As one line.
    pub fn line(&self) -> Result<String> {
        Ok(serde_json::to_string(self)? + "\n")
    }

    /// As a file of its own.
    pub fn write(&self, path: &Path) -> Result<()> {
        let text = serde_json::to_string_pretty(self)? + "\n";
        output::write_unsynced(path, text)
    }
}

/// All frames, a line each, growing beside its final place.
pub struct Lines {
    path: PathBuf,
    partial: PathBuf,
    file: BufWriter<std::fs::File>,
}

impl Lines {
    /// Begins the file that will be at `path`.
    pub fn begin(path: &Path) -> Result<Self> {
        let partial = path.with_extension("jsonl.partial");
        let file = std::fs::File::create(&partial)
            .map_err(|e| deepfusion_data::Error::file(&partial, e))?;
        Ok(Self {
            path: path.to_owned(),
            partial,
            file: BufWriter::new(file),
        })
    }

    /// Adds a line.
    pub fn add(&mut self, line: &str) -> Result<()> {
        let failed = |e| deepfusion_data::Error::file(&self.partial, e);
        // Line by line: who watches the file sees whole frames.
        self.file.write_all(line.as_bytes()).map_err(failed)?;
        Ok(self.file.flush().map_err(failed)?)
    }

    /// Takes it away: nothing came.
    pub fn discard(self) {
        // What is left is an empty file that the next run takes over.
        let _ = std::fs::remove_file(&self.partial);
    }

    /// Puts it in its place.
    pub fn finish(self) -> Result<()> {
        deepfusion_fs::publish(&self.partial, &self.path)
            .map_err(|e| deepfusion_data::Error::file(&self.path, e))?;
        Ok(())
    }
}
