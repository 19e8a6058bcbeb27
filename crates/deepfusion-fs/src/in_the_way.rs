//! Checks that a folder is empty before something is written into it.

use std::fs;
use std::io::{self, ErrorKind};
use std::path::{Path, PathBuf};

use deepfusion_hint::Hint;

use crate::partial::Partial;
use crate::partial_folder::{PartialFolder, folder_of_lock};

/// What was found in a folder that should be empty.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum InTheWay {
    /// Visible or other hidden files or folders.
    Content,
    /// Only hidden temporary files or folders of a writer.
    Unfinished(Unfinished),
}

/// A hidden file or folder in an otherwise empty folder. A writer is still writing it, or left it behind when it died. It could not be
/// removed, or another machine wrote it.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{}: the output folder is not empty: a program left this behind or is still writing it", path.display())]
pub struct Unfinished {
    /// The hidden file or folder.
    pub path: PathBuf,
}

impl Hint for Unfinished {
    fn hint(&self) -> Option<String> {
        Some("if no program is writing it, remove it and the file of the same name with .lock, or choose another folder".into())
    }
}

/// Removes what dead writers left in a folder ([`PartialFolder::remove_leftovers`]), and returns what is still in it. The folder need not
/// exist.
///
/// # Errors
/// The system's error if the folder cannot be read.
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
        // The first by name, so that a folder comes before its lock file.
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
    fn hidden_leftovers_are_named() {
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
