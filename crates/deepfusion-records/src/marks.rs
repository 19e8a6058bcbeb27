//! What records have in common.

use std::path::Path;
use std::time::{SystemTime, UNIX_EPOCH};

use deepfusion_motion::ScaleReading;
use serde::{Deserialize, Serialize};

/// A file's size and time of change, as `make` and `rsync` compare them.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct FileMark {
    /// Size in bytes.
    pub bytes: u64,
    /// Time of the last change, nanoseconds since 1970, where the system knows it.
    pub modified_ns: Option<u64>,
}

impl FileMark {
    /// Of an image that came without a file: its size in bytes, and when it came.
    #[must_use]
    pub fn of_arrival(bytes: u64, arrived_at: SystemTime) -> Self {
        let since_1970 = arrived_at.duration_since(UNIX_EPOCH);
        Self {
            bytes,
            modified_ns: since_1970.ok().map(|d| d.as_nanos() as u64),
        }
    }

    /// The file's mark now.
    ///
    /// # Errors
    /// Where the system does not tell.
    pub fn of(path: &Path) -> std::io::Result<Self> {
        let meta = std::fs::metadata(path)?;
        let since = meta.modified().ok().map(|t| t.duration_since(UNIX_EPOCH));
        let nanoseconds = since.and_then(Result::ok).map(|d| d.as_nanos() as u64);
        Ok(Self {
            bytes: meta.len(),
            modified_ns: nanoseconds,
        })
    }
}

/// What a frame has for having been live.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct LiveMark {
    /// When it arrived, seconds since 1970.
    pub arrived_unix_s: f64,
    /// Frames of the source that were skipped so far.
    pub dropped: u64,
    /// From there to its depth (`predict`) or targets (`perceive`), milliseconds.
    pub latency_ms: f64,
}

impl LiveMark {
    /// Of a frame at which nobody has looked yet.
    #[must_use]
    pub fn of_arrival(arrived_at: SystemTime, dropped: u64) -> Self {
        let since_1970 = arrived_at.duration_since(UNIX_EPOCH);
        Self {
            arrived_unix_s: since_1970.map_or(0.0, |d| d.as_secs_f64()),
            dropped,
            latency_ms: 0.0,
        }
    }
}

/// What the scale monitor says of a frame.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct ScaleRecord {
    /// The reading.
    #[serde(flatten)]
    pub reading: ScaleReading,
    /// What the next frame's depth is multiplied by, where that was asked for.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub correction: Option<f64>,
}
