//! Whether a folder is as empty as a writer wants it.

use std::fs;
use std::io::{self, ErrorKind};
use std::path::{Path, PathBuf};

use deepfusion_hint::Hint;

use crate::partial::Partial;
use crate::partial_folder::{PartialFolder, folder_of_lock};

/// What a folder holds that was to be empty.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum InTheWay {
    /// Files or folders.
    Content,
    /// Nothing that is seen.
    Unfinished(Unfinished),
}

/// Why a folder that looks empty is not: a hidden file or folder, this one, that a writer is writing, or left when it died, and which cannot be
/// removed or is another machine's.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{}: the output folder is not empty: a writer left this in it, or is still writing it", path.display())]
pub struct Unfinished {
    /// The hidden file or folder.
    pub path: PathBuf,
}

impl Hint for Unfinished {
    fn hint(&self) -> Option<String> {
        Some("if no program is writing there, remove it, and the file of its name with .lock; or choose another folder".into())
    }
}

/// Removes what writers that died left in a folder ([`PartialFolder::remove_leftovers`]), and says whether something is in it still; there may be
/// no such folder.
///
/// # Errors
/// The system's error where it cannot be read.
pub fn in_the_way(folder: &Path) -> io::Result<Option<InTheWay>> {
    PartialFolder::remove_leftovers(folder);
    let entries = match fs::read_dir(folder) {
        Err(error) if error.kind() == ErrorKind::NotFound => return Ok(None),
        entries => entries?,
    };
    let mut unfinished: Option<PathBuf> = None;
    for entry in entries {
        let path = entry?.path();
        let is_aside = Partial::target_of(&path).is_some() || folder_of_lock(&path).is_some();
        if !is_aside {
            return Ok(Some(InTheWay::Content));
        }
        // The first by name, and so a folder before its lock's file.
        if unfinished.as_ref().is_none_or(|first| path < *first) {
            unfinished = Some(path);
        }
    }
    Ok(unfinished.map(|path| InTheWay::Unfinished(Unfinished { path })))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_hidden_is_named() {
        let dir = tempfile::tempdir().unwrap();
        let folder = dir.path().join("out");
        assert_eq!(in_the_way(&folder).unwrap(), None);
        fs::create_dir(&folder).unwrap();
        assert_eq!(in_the_way(&folder).unwrap(), None);
        let dead = PartialFolder::beside(&folder.join("a")).unwrap();
        dead.abandon();
        assert_eq!(in_the_way(&folder).unwrap(), None);
        let alive = PartialFolder::beside(&folder.join("b")).unwrap();
        let path = alive.path().to_owned();
        let unfinished = Unfinished { path };
        assert!(unfinished.to_string().contains("still writing it"));
        let unfinished = InTheWay::Unfinished(unfinished);
        assert_eq!(in_the_way(&folder).unwrap(), Some(unfinished));
        fs::write(folder.join(".gitkeep"), "").unwrap();
        assert_eq!(in_the_way(&folder).unwrap(), Some(InTheWay::Content));
        fs::remove_file(folder.join(".gitkeep")).unwrap();
        drop(alive);
        assert_eq!(in_the_way(&folder).unwrap(), None);
        fs::write(folder.join("file"), "x").unwrap();
        assert_eq!(in_the_way(&folder).unwrap(), Some(InTheWay::Content));
        in_the_way(&folder.join("file")).unwrap_err();
    }
}
