//! Parts that several records share.

use std::path::Path;
use std::time::{SystemTime, UNIX_EPOCH};

use deepfusion_motion::ScaleReading;
use serde::{Deserialize, Serialize};

/// A file's size and modification time, as `make` and `rsync` compare them.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct FileMark {
    /// Size in bytes.
    pub bytes: u64,
    /// Modification time in nanoseconds since 1970, if the system knows it.
    pub modified_ns: Option<u64>,
}

impl FileMark {
    /// The mark of an image without a file: its size in bytes, and when it arrived.
    #[must_use]
    pub fn of_arrival(bytes: u64, arrived_at: SystemTime) -> Self {
        let since_1970 = arrived_at.duration_since(UNIX_EPOCH);
        Self {
            bytes,
            modified_ns: since_1970.ok().map(|d| d.as_nanos() as u64),
        }
    }

    /// The file's current mark.
    ///
    /// # Errors
    /// The system's error if it cannot read the file's metadata.
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

/// What is recorded of a live frame.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct LiveMark {
    /// When it arrived, in seconds since 1970.
    pub arrived_unix_s: f64,
    /// Number of frames of the source that were skipped so far.
    pub dropped: u64,
    /// Time from its arrival to its depth (`predict`) or targets (`perceive`), in milliseconds.
    pub latency_ms: f64,
}

impl LiveMark {
    /// The mark of a frame that has not been processed yet.
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

/// The scale monitor's reading for a frame.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct ScaleRecord {
    /// The reading.
    #[serde(flatten)]
    pub reading: ScaleReading,
    /// What the next frame's depth is multiplied by, if correction is on.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub correction: Option<f64>,
}
