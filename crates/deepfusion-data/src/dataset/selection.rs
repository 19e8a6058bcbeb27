//! Which frames of a recording a split wants.

use super::camera::Camera;
use super::options::OpenOptions;
use super::split::{Split, SplitEntry};
use crate::Error;
use std::collections::HashSet;
use std::path::Path;

/// The frames asked for.
pub(crate) struct Selection<'a> {
    split: Option<(&'a Split, HashSet<&'a SplitEntry>)>,
}

impl<'a> Selection<'a> {
    pub(crate) fn new(options: &'a OpenOptions) -> Self {
        let split = options.split.as_ref();
        Self {
            split: split.map(|split| (split, split.entries.iter().collect())),
        }
    }

    /// Indices into `numbers` of the frames asked for, of a drive of a kind.
    pub(crate) fn of(
        &self,
        folder: &str,
        scenario: Option<&str>,
        camera: Camera,
        numbers: impl Iterator<Item = u64>,
    ) -> Vec<usize> {
        let wanted = |frame: u64| {
            self.split.as_ref().is_none_or(|(split, wanted)| {
                let of_kind = scenario.is_some_and(|s| split.scenarios.iter().any(|w| w == s));
                of_kind
                    || wanted.contains(&SplitEntry {
                        folder: folder.to_owned(),
                        frame,
                        camera,
                    })
            })
        };
        let numbers = numbers.enumerate();
        numbers.filter(|(_, n)| wanted(*n)).map(|n| n.0).collect()
    }

    /// The error of a split that selects nothing of `path`; `None` without a split.
    pub(crate) fn nothing(&self, path: &Path) -> Option<Error> {
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
