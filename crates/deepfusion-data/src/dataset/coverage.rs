//! How much of a split a set of recordings contains, and where.

use super::drive::Dataset;
use super::split::Split;
use std::collections::{HashMap, HashSet};

/// How much of a split's list a set of recordings contains.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct SplitCoverage {
    /// Number of distinct frames in the list. A line with a scenario counts as the frames found in drives of that
    /// scenario, since their true number is unknown.
    pub expected: usize,
    /// How many of them the recordings contain.
    pub found: usize,
    /// The first line without any frame in the recordings.
    pub first_missing: Option<String>,
}

impl SplitCoverage {
    /// Whether the recordings contain everything in the list.
    #[must_use]
    pub fn is_complete(&self) -> bool {
        self.first_missing.is_none()
    }
}

impl Split {
    /// How many of the split's frames are in `datasets`, which must have been opened with this split.
    #[must_use]
    pub fn coverage(&self, datasets: &[Dataset]) -> SplitCoverage {
        let mut here = HashSet::new();
        let mut of_kinds = HashSet::new();
        for dataset in datasets {
            let kind = dataset.scenario();
            let wanted = kind.is_some_and(|kind| self.scenarios.iter().any(|s| s == kind));
            for frame in dataset.frames() {
                let place = (dataset.split_name(), frame.number, dataset.camera());
                here.insert(place);
                if wanted {
                    of_kinds.insert(place);
                }
            }
        }
        let mut listed = HashSet::new();
        let (mut found, mut missing) = (0, None);
        for entry in &self.entries {
            let place = (entry.folder.as_str(), entry.frame, entry.camera);
            if of_kinds.contains(&place) || !listed.insert(place) {
                continue;
            }
            if here.contains(&place) {
                found += 1
            } else {
                missing.get_or_insert_with(|| entry.to_string());
            }
        }
        let absent = |name: &&String| datasets.iter().all(|d| d.scenario() != Some(name.as_str()));
        let absent = self.scenarios.iter().find(absent);
        SplitCoverage {
            expected: listed.len() + of_kinds.len(),
            found: found + of_kinds.len(),
            first_missing: missing.or(absent.map(|name| format!("scenario = {name}"))),
        }
    }

    /// Positions of the split's frames, in the split's order, then those of its scenarios: index into `datasets`
    /// and index of the frame in that data set. Missing frames are left out.
    #[must_use]
    pub fn locate(&self, datasets: &[Dataset]) -> Vec<(usize, usize)> {
        let mut places = HashMap::new();
        for (d, dataset) in datasets.iter().enumerate() {
            for (f, frame) in dataset.frames().iter().enumerate() {
                places.insert(
                    (dataset.split_name(), frame.number, dataset.camera()),
                    (d, f),
                );
            }
        }
        let entries = self.entries.iter();
        let mut located: Vec<(usize, usize)> = entries
            .filter_map(|e| places.get(&(e.folder.as_str(), e.frame, e.camera)).copied())
            .collect();
        for scenario in &self.scenarios {
            let of_kind = |(_, d): &(usize, &Dataset)| d.scenario() == Some(scenario);
            for (d, dataset) in datasets.iter().enumerate().filter(of_kind) {
                located.extend((0..dataset.frames().len()).map(|f| (d, f)));
            }
        }
        located
    }
}
