//! Selects the frames of a recording that are in a split.

use super::camera::Camera;
use super::options::OpenOptions;
use super::split::{Split, SplitEntry};
use crate::Error;
use std::collections::HashMap;
use std::path::Path;

/// The frames to select.
pub(crate) struct Selection<'a> {
    /// The split, and the place of each of its frames in the list; of duplicate lines the first counts.
    split: Option<(&'a Split, HashMap<&'a SplitEntry, usize>)>,
}

impl<'a> Selection<'a> {
    pub(crate) fn new(options: &'a OpenOptions) -> Self {
        let split = options.split.as_ref();
        Self {
            split: split.map(|split| (split, places_of(split))),
        }
    }

    /// The frames to select from a drive, as indices into `numbers`, each with its place among the split's frames if it has one.
    pub(crate) fn of(
        &self,
        folder: &str,
        scenario: Option<&str>,
        camera: Camera,
        numbers: impl Iterator<Item = u64>,
    ) -> Vec<(usize, Option<usize>)> {
        let Some((split, places)) = &self.split else {
            return numbers
                .enumerate()
                .map(|(index, _)| (index, None))
                .collect();
        };
        let of_kind = scenario.is_some_and(|s| split.scenarios.iter().any(|w| w == s));
        let place = |frame: u64| {
            let entry = SplitEntry {
                folder: folder.to_owned(),
                frame,
                camera,
            };
            places.get(&entry).copied()
        };
        let placed = numbers.enumerate().map(|(index, n)| (index, place(n)));
        placed
            .filter(|(_, place)| of_kind || place.is_some())
            .collect()
    }

    /// The error of a split that selects nothing of `path`; `None` without a split.
    pub(crate) fn nothing_selected(&self, path: &Path) -> Option<Error> {
        let (split, _) = self.split.as_ref()?;
        let frame = split.entries.first().map(SplitEntry::to_string);
        let scenario = split.scenarios.first().map(|s| format!("scenario = {s}"));
        Some(Error::SplitSelectsNothing {
            split: split.path.clone(),
            path: path.to_owned(),
            entries: split.len(),
            first: frame.or(scenario).unwrap_or_default(),
        })
    }
}

fn places_of(split: &Split) -> HashMap<&SplitEntry, usize> {
    let mut places = HashMap::new();
    for (place, entry) in split.entries.iter().enumerate() {
        places.entry(entry).or_insert(place);
    }
    places
}
