//! The list of frames as sent to the page.

use deepfusion_records::ScaleState;
use serde::Serialize;

use super::entry::Entry;
use super::summary::Summary;

/// The answer to a page that has an older list, or none.
#[derive(Debug, Serialize)]
#[serde(untagged)]
pub(crate) enum Index {
    /// The page's list is current.
    Known { unchanged: bool, version: u64 },
    /// The current list, which the page does not have.
    New(Box<Columns>),
}

/// The frames in their order: columns with one entry per frame.
#[derive(Debug, Serialize)]
pub(crate) struct Columns {
    /// Why the folder could not be listed again.
    failure: Option<String>,
    /// 1 if the frame has depth, else 0.
    has_depth: Vec<u8>,
    has_sigma: Vec<u8>,
    names: Vec<String>,
    /// Frames whose small files are still to be read.
    pending: usize,
    revisions: Vec<u64>,
    series: Series,
    version: u64,
}

/// The numbers of the time line; `None` if a frame lacks one or has not been read yet.
#[derive(Debug, Serialize)]
struct Series {
    far_m: Vec<Option<f64>>,
    latency_ms: Vec<Option<f64>>,
    near_m: Vec<Option<f64>>,
    nearest_m: Vec<Option<f64>>,
    problem: Vec<Option<String>>,
    scale_ratio: Vec<Option<f64>>,
    scale_state: Vec<Option<ScaleState>>,
    speed_mps: Vec<Option<f64>>,
    targets: Vec<Option<usize>>,
    time_s: Vec<Option<f64>>,
    time_to_collision_s: Vec<Option<f64>>,
}

impl Index {
    /// [`Index::Known`] if the page's `known` list is current.
    pub(super) fn of(
        entries: &[Entry],
        version: u64,
        known: Option<u64>,
        failure: Option<String>,
    ) -> Self {
        if known == Some(version) && failure.is_none() {
            return Self::Known {
                unchanged: true,
                version,
            };
        }
        let flags = |of: fn(&Entry) -> bool| -> Vec<u8> {
            entries.iter().map(|e| u8::from(of(e))).collect()
        };
        Self::New(Box::new(Columns {
            failure,
            // Before the sidecar has been read, any file of depth counts.
            has_depth: flags(|e| {
                let summary = e.summary.as_ref();
                summary.map_or(e.may_have_depth(), |s| s.has_depth)
            }),
            has_sigma: flags(|e| {
                let summary = e.summary.as_ref();
                summary.map_or(e.sigma.is_some(), |s| s.has_sigma)
            }),
            names: entries.iter().map(|e| e.name.clone()).collect(),
            pending: entries.iter().filter(|e| e.summary.is_none()).count(),
            revisions: entries.iter().map(Entry::revision).collect(),
            series: Series::of(entries),
            version,
        }))
    }
}

impl Series {
    fn of(entries: &[Entry]) -> Self {
        let number = |of: fn(&Summary) -> Option<f64>| column(entries, of);
        Self {
            far_m: number(|s| s.depth_m.map(|d| d[1])),
            latency_ms: number(|s| s.latency_ms),
            near_m: number(|s| s.depth_m.map(|d| d[0])),
            nearest_m: number(|s| s.nearest_m),
            problem: column(entries, |s| s.problem.clone()),
            scale_ratio: number(|s| s.scale_ratio),
            scale_state: column(entries, |s| s.scale_state),
            speed_mps: number(|s| s.speed_mps),
            targets: column(entries, |s| s.targets),
            time_s: number(|s| s.time_s),
            time_to_collision_s: number(|s| s.time_to_collision_s),
        }
    }
}

/// One value of each frame's summary.
fn column<T>(entries: &[Entry], of: fn(&Summary) -> Option<T>) -> Vec<Option<T>> {
    let summaries = entries.iter().map(|e| e.summary.as_ref());
    summaries.map(|summary| summary.and_then(of)).collect()
}
