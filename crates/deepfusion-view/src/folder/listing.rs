//! The list of frames, kept up to date with the folder.

use std::collections::{HashMap, hash_map};
use std::io;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant, SystemTime};

use super::entry::{Entry, FrameFile, frame_and_kind};
use super::index::Index;
use super::order::natural;
use super::summary::Summary;

/// The folder is listed again after this time in any case: writing into an existing file does not change the folder's modification time.
const RELIST_AFTER: Duration = Duration::from_secs(5);
/// A folder that takes long to list and changes all the time, as while it is written to, is listed during at most one part in this many of the
/// time: listing a hundred thousand frames takes seconds, and every other answer waits for it.
const LISTED_SHARE: u32 = 10;
/// A listing that takes this long counts as long.
const LONG: Duration = Duration::from_millis(500);
/// How long reading small files may delay an answer; the rest is read for the next one.
const READING_TIME: Duration = Duration::from_millis(150);

/// The frames of a folder.
#[derive(Debug)]
pub(super) struct Listing {
    folder: PathBuf,
    entries: Vec<Entry>,
    places: HashMap<String, usize>,
    /// Counts the changes, from 1.
    version: u64,
    last: Option<LastListing>,
}

/// The last listing of the folder.
#[derive(Debug, Clone, Copy)]
struct LastListing {
    /// When it finished.
    done: Instant,
    took: Duration,
    /// The folder's modification time then.
    changed: SystemTime,
}

impl LastListing {
    /// Whether the list is still recent enough for a folder with this modification time.
    fn is_current(self, changed: SystemTime) -> bool {
        let age = self.done.elapsed();
        let unchanged = self.changed == changed && age < RELIST_AFTER;
        unchanged || (self.took >= LONG && age < LISTED_SHARE * self.took)
    }
}

impl Listing {
    pub(super) fn new(folder: &Path) -> Self {
        Self {
            folder: folder.to_owned(),
            entries: Vec::new(),
            places: HashMap::new(),
            version: 1,
            last: None,
        }
    }

    pub(super) fn is_empty(&self) -> bool {
        self.entries.is_empty()
    }

    pub(super) fn len(&self) -> usize {
        self.entries.len()
    }

    pub(super) fn entry(&self, name: &str) -> Option<&Entry> {
        self.places.get(name).map(|i| &self.entries[*i])
    }

    pub(super) fn range(&self, from: usize, count: usize) -> Vec<Entry> {
        self.entries
            .iter()
            .skip(from)
            .take(count)
            .cloned()
            .collect()
    }

    /// Lists the folder again if it may have changed.
    pub(super) fn refresh(&mut self) -> io::Result<()> {
        let changed = std::fs::metadata(&self.folder)?
            .modified()
            .unwrap_or(SystemTime::UNIX_EPOCH);
        if self.last.is_some_and(|last| last.is_current(changed)) {
            return Ok(());
        }
        let begun = Instant::now();
        let mut found: HashMap<String, Entry> = HashMap::new();
        for file in std::fs::read_dir(&self.folder)? {
            let file = file?;
            let Ok(file_name) = file.file_name().into_string() else {
                continue;
            };
            let Some((name, kind)) = frame_and_kind(&file_name) else {
                continue;
            };
            // A file that was removed between the two calls is ignored.
            let Ok(meta) = std::fs::metadata(file.path()) else {
                continue;
            };
            if meta.is_file() {
                let entry = match found.entry(name.to_owned()) {
                    hash_map::Entry::Occupied(there) => there.into_mut(),
                    hash_map::Entry::Vacant(free) => free.insert(Entry::new(name)),
                };
                entry.add(kind, FrameFile::new(file_name, &meta));
            }
        }
        self.replace(found);
        self.last = Some(LastListing {
            done: Instant::now(),
            took: begun.elapsed(),
            changed,
        });
        Ok(())
    }

    /// Replaces the list by what was found, and keeps the summaries of frames that did not change.
    fn replace(&mut self, found: HashMap<String, Entry>) {
        let mut entries: Vec<Entry> = found.into_values().collect();
        for entry in &mut entries {
            let known = self
                .entry(&entry.name)
                .filter(|known| known.revision() == entry.revision());
            entry.summary = known.and_then(|known| known.summary.clone());
            // Without depth or targets, only the content shows whether a JSON file is a frame's sidecar.
            if !entry.may_have_depth() && entry.targets.is_none() && entry.summary.is_none() {
                entry.summary = Some(Summary::read(&self.folder, entry));
            }
        }
        entries.retain(|e| e.summary.as_ref().is_none_or(|s| s.is_frame));
        entries.sort_by(|a, b| natural(&a.name, &b.name));
        let key = |e: &Entry| (e.name.clone(), e.revision());
        if !entries.iter().map(key).eq(self.entries.iter().map(key)) {
            self.version += 1;
        }
        self.places = entries
            .iter()
            .enumerate()
            .map(|(i, e)| (e.name.clone(), i))
            .collect();
        self.entries = entries;
    }

    /// Reads the small files of new frames, for a limited time.
    pub(super) fn summarise(&mut self) {
        let begin = Instant::now();
        for entry in self.entries.iter_mut().filter(|e| e.summary.is_none()) {
            if begin.elapsed() > READING_TIME {
                break;
            }
            entry.summary = Some(Summary::read(&self.folder, entry));
            self.version += 1;
        }
    }

    /// The list as sent to the page; only a note that nothing changed if its `known` version is current.
    pub(super) fn index(&self, known: Option<u64>, failure: Option<String>) -> Index {
        Index::of(&self.entries, self.version, known, failure)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_list_that_took_long_stays_current_for_longer() {
        let done = Instant::now();
        let changed = SystemTime::UNIX_EPOCH;
        let later = changed + Duration::from_secs(1);
        let quick = LastListing {
            done,
            took: LONG / 2,
            changed,
        };
        assert!(quick.is_current(changed));
        assert!(!quick.is_current(later));
        let slow = LastListing {
            took: Duration::from_secs(60),
            ..quick
        };
        assert!(slow.is_current(later));
    }
}
