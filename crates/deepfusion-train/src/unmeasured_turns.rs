//! Drives whose turns are not known.

use std::collections::BTreeSet;

use crate::{SampleSet, TrainConfig, ViewMotion};

impl SampleSet {
    /// The names of the drives with samples of video whose turns are not known, in the order of their recordings.
    #[must_use]
    pub fn without_turns(&self) -> Vec<&str> {
        let used: BTreeSet<usize> = self.samples.iter().map(|s| s.dataset).collect();
        let drives = used
            .into_iter()
            .filter_map(|dataset| self.datasets.get(dataset));
        drives
            .filter(|drive| !drive.yaw_known())
            .map(deepfusion_data::Dataset::name)
            .collect()
    }
}

/// With `auto`: which drives are warped by PoseNet's turns.
pub(crate) fn warning(config: &TrainConfig, samples: &SampleSet) -> Option<String> {
    if config.view_motion != ViewMotion::Auto {
        return None;
    }
    let drives = samples.without_turns();
    let first = drives.first()?;
    let others = match drives.len() {
        1 => String::new(),
        2 => " and 1 other drive".into(),
        n => format!(" and {} other drives", n - 1),
    };
    Some(format!(
        "no turns are known of {first}{others}: warped by PoseNet's at the measured distance"
    ))
}
