//! Split files: lists of frames or scenarios, one per line.

use super::camera::Camera;
use crate::{Error, Result, SplitProblem};
use std::path::{Path, PathBuf};

/// A list of frames, in the file's order.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Split {
    /// Path of the file.
    pub path: PathBuf,
    /// The lines that name a frame.
    pub entries: Vec<SplitEntry>,
    /// The scenarios that are named, such as `garage`: they select every frame of such drives.
    pub scenarios: Vec<String>,
}

/// One line of a split file, `folder index side`.
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
pub struct SplitEntry {
    /// The drive's [`crate::Dataset::split_name`], such as `<date>/<drive>`; a number has no leading zeros.
    pub folder: String,
    /// The frame's number.
    pub frame: u64,
    /// The camera: 2 for `l` or no side, 3 for `r`.
    pub camera: Camera,
}

impl Split {
    /// Reads lines like `2011_09_26/2011_09_26_drive_0009_sync 0000000016 l`. The index may be padded
    /// with zeros. Empty lines are skipped. A line `scenario = garage` selects every frame of the drives with that
    /// [`crate::Dataset::scenario`].
    ///
    /// # Errors
    /// [`Error::File`], or [`Error::Split`] with the number of a bad line.
    pub fn read(path: &Path) -> Result<Self> {
        let bytes = std::fs::read(path).map_err(|e| Error::file(path, e))?;
        let (mut entries, mut scenarios) = (Vec::new(), Vec::new());
        for (i, line) in String::from_utf8_lossy(&bytes).lines().enumerate() {
            if line.trim().is_empty() {
                continue;
            }
            if let Some(name) = scenario(line) {
                scenarios.push(name.to_owned());
                continue;
            }
            entries.push(parse(line).map_err(|problem| Error::Split {
                path: path.to_owned(),
                line: i + 1,
                problem,
            })?);
        }
        if entries.is_empty() && scenarios.is_empty() {
            return Err(Error::Split {
                path: path.to_owned(),
                line: 1,
                problem: SplitProblem::NoFrame,
            });
        }
        Ok(Self {
            path: path.to_owned(),
            entries,
            scenarios,
        })
    }

    /// Number of frames and scenarios in the split.
    #[must_use]
    pub fn len(&self) -> usize {
        self.entries.len() + self.scenarios.len()
    }

    /// Whether the split is empty; one that was read from a file never is.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }
}

impl std::fmt::Display for SplitEntry {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let side = match self.camera {
            Camera::Left => 'l',
            Camera::Right => 'r',
        };
        write!(f, "{} {} {side}", self.folder, self.frame)
    }
}

/// A drive's name in split files. Names that are numbers lose leading zeros, because the lists for KITTI odometry write sequence `09` as
/// `9`.
pub(crate) fn drive_name(name: &str) -> String {
    let number = !name.is_empty() && name.bytes().all(|b| b.is_ascii_digit());
    match name.trim_start_matches('0') {
        "" if number => "0".into(),
        digits if number => digits.into(),
        _ => name.into(),
    }
}

/// The name in a line like `scenario = garage`.
fn scenario(line: &str) -> Option<&str> {
    let (key, name) = line.split_once('=')?;
    let name = name.trim().trim_matches('"');
    (key.trim() == "scenario" && !name.is_empty()).then_some(name)
}

fn parse(line: &str) -> std::result::Result<SplitEntry, SplitProblem> {
    let words: Vec<&str> = line.split_whitespace().collect();
    let (folder, index, side) = match words.as_slice() {
        [folder, index] => (folder, index, "l"),
        [folder, index, side] => (folder, index, *side),
        _ => {
            let found = words.len();
            return Err(SplitProblem::Words { found });
        }
    };
    let frame = index.parse().map_err(|_| SplitProblem::Index {
        text: (*index).to_owned(),
    })?;
    let camera = match side {
        "l" => Camera::Left,
        "r" => Camera::Right,
        _ => {
            let text = side.to_owned();
            return Err(SplitProblem::Side { text });
        }
    };
    Ok(SplitEntry {
        folder: drive_name(folder.trim_end_matches('/')),
        frame,
        camera,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn padded_and_plain_indices_are_equal() {
        let padded = parse("2011_09_26/2011_09_26_drive_0009_sync 0000000016 l").unwrap();
        let plain = parse("2011_09_26/2011_09_26_drive_0009_sync 16").unwrap();
        assert_eq!(padded, plain);
        assert_eq!(parse("a/b 3 r").unwrap().camera, Camera::Right);
    }

    #[test]
    fn numeric_names_lose_leading_zeros() {
        for (written, name) in [
            ("09", "9"),
            ("9", "9"),
            ("00", "0"),
            ("0", "0"),
            ("03_a", "03_a"),
        ] {
            let entry = parse(&format!("{written} 1 l")).unwrap();
            assert_eq!(entry.folder, name);
        }
    }

    #[test]
    fn a_bad_line_is_named_with_its_number() {
        let file = tempfile::NamedTempFile::new().unwrap();
        for bad in ["a/b", "a/b x l", "a/b 3 m", "a b c d"] {
            std::fs::write(file.path(), format!("a/b 1 l\n\n{bad}\n")).unwrap();
            let error = Split::read(file.path()).unwrap_err();
            assert!(matches!(error, Error::Split { line: 3, .. }), "{error}");
        }
        std::fs::write(file.path(), "\n\n").unwrap();
        assert!(Split::read(file.path()).is_err(), "no frames at all");
    }

    #[test]
    fn scenarios_are_read_from_their_own_lines() {
        let file = tempfile::NamedTempFile::new().unwrap();
        std::fs::write(
            file.path(),
            "scenario = garage\na/b 1 l\nscenario=\"night\"\n",
        )
        .unwrap();
        let split = Split::read(file.path()).unwrap();
        assert_eq!(split.scenarios, ["garage", "night"]);
        assert_eq!((split.entries.len(), split.len()), (1, 3));
        std::fs::write(file.path(), "scenario =\n").unwrap();
        let error = Split::read(file.path()).unwrap_err();
        assert!(matches!(error, Error::Split { line: 1, .. }), "{error}");
    }

    proptest! {
        #[test]
        fn garbage_never_panics(line in ".{0,60}") {
            let _ = parse(&line);
        }

        #[test]
        fn a_printed_entry_is_read_back(frame in any::<u64>(), right in any::<bool>()) {
            let camera = if right { Camera::Right } else { Camera::Left };
            let entry = SplitEntry { folder: "d/e_sync".into(), frame, camera };
            prop_assert_eq!(parse(&entry.to_string()).unwrap(), entry);
        }
    }
}
