//! The few numbers of a frame that the time line shows, from its small files.

use std::path::Path;

use serde_json::Value;

use super::entry::Entry;
use crate::{Error, Result};

/// No sidecar or list of targets is as large; what is, is another program's file.
const MOST_JSON_BYTES: u64 = 16 << 20;

/// What the time line says about a frame. Numbers are `None` where they are absent or not finite.
#[derive(Debug, Clone, Default, PartialEq)]
pub(crate) struct Summary {
    /// Whether this is a frame at all: other JSON files may lie in the folder.
    pub is_frame: bool,
    /// The problem with a small file, if any.
    pub problem: Option<String>,
    pub time_s: Option<f64>,
    pub depth_m: Option<[f64; 2]>,
    pub targets: Option<usize>,
    pub nearest_m: Option<f64>,
    pub speed_mps: Option<f64>,
    pub time_to_collision_s: Option<f64>,
    pub scale_ratio: Option<f64>,
    pub scale_state: Option<String>,
    pub latency_ms: Option<f64>,
}

impl Summary {
    /// Reads the frame's sidecar and targets. What cannot be read becomes [`Summary::problem`].
    pub fn read(folder: &Path, entry: &Entry) -> Self {
        let mut summary = Self {
            is_frame: entry.depth.is_some() || entry.targets.is_some(),
            ..Self::default()
        };
        let mut problems = Vec::new();
        let mut small = |file: &Option<super::entry::FrameFile>| {
            let outcome = read_json(&folder.join(&file.as_ref()?.file));
            outcome.map_err(|e| problems.push(e.to_string())).ok()
        };
        let sidecar = small(&entry.sidecar);
        let targets = small(&entry.targets);
        if let Some(sidecar) = &sidecar {
            summary.is_frame |= sidecar.get("image").is_some() && sidecar.get("size").is_some();
            summary.depth_m = numbers(sidecar.get("depth_m"));
            summary.add_scale(sidecar);
        }
        // A sidecar that is being written is a frame that comes.
        summary.is_frame |= !problems.is_empty();
        if let Some(frame) = &targets {
            summary.add_targets(frame);
        }
        summary.problem = (!problems.is_empty()).then(|| problems.join("; "));
        summary
    }

    fn add_targets(&mut self, frame: &Value) {
        let number = |key: &str| frame.get(key).and_then(Value::as_f64);
        self.time_s = number("time_s");
        self.speed_mps = number("speed_mps");
        self.time_to_collision_s = number("time_to_collision_s");
        self.latency_ms = number("latency_ms");
        if let Some(list) = frame.get("targets").and_then(Value::as_array) {
            self.targets = Some(list.len());
            let distances = list.iter().filter_map(|t| t.get("distance_m")?.as_f64());
            self.nearest_m = distances.min_by(f64::total_cmp);
        }
        self.add_scale(frame);
    }

    /// The scale fields of the sidecar of `predict` and `perceive`.
    fn add_scale(&mut self, file: &Value) {
        if let Some(monitor) = file.get("scale_monitor").filter(|m| m.is_object()) {
            self.scale_ratio = monitor.get("ratio").and_then(Value::as_f64);
            let state = monitor.get("state").and_then(Value::as_str);
            self.scale_state = state.map(str::to_owned);
        }
    }
}

/// N finite numbers; JSON has no others.
pub(crate) fn numbers<const N: usize>(value: Option<&Value>) -> Option<[f64; N]> {
    let list: Option<Vec<f64>> = value?.as_array()?.iter().map(Value::as_f64).collect();
    list?.try_into().ok()
}

/// A small JSON file.
pub(super) fn read_json(path: &Path) -> Result<Value> {
    let meta = std::fs::metadata(path).map_err(|e| Error::file(path, e))?;
    if meta.len() > MOST_JSON_BYTES {
        return Err(Error::content(
            path,
            format!(
                "{} bytes are too many for a frame's description",
                meta.len()
            ),
        ));
    }
    let bytes = std::fs::read(path).map_err(|e| Error::file(path, e))?;
    serde_json::from_slice(&bytes).map_err(|e| {
        let what = if e.is_eof() {
            "half-written, or cut off"
        } else {
            "no JSON"
        };
        Error::content(path, format!("{what}: {e}"))
    })
}
