//! What an earlier run left of an image whose outputs are made again, in another way.

use std::io::ErrorKind;
use std::path::Path;

use deepfusion_records::{FileMark, FrameRecord, MadeWith, Sidecar, same_number};

use super::{DepthOutput, TargetOutput};
use crate::Result;
use crate::bulk::{record_path, sidecar_path};

/// The depth of an image that is about to be written.
pub(super) struct NewDepth<'a> {
    /// What the names of the image's outputs begin with.
    pub(super) name: &'a str,
    /// The image's file.
    pub(super) mark: FileMark,
    /// fx, fy, cx, cy.
    pub(super) intrinsics: Option<[f64; 4]>,
    /// What else it depends on.
    pub(super) made_with: &'a MadeWith,
    /// The files that it will have.
    pub(super) files: &'a [String],
}

/// Removes the outputs of the image that its sidecar names and that are not made again, and targets that were found in another depth: beside the new sidecar
/// they would pass for its own. It comes before the new outputs: if the run is stopped then, the old sidecar still names everything that is left,
/// and the image is not done.
pub(super) fn remove_earlier(folder: &Path, new: &NewDepth<'_>) -> Result<()> {
    let text = std::fs::read(sidecar_path(folder, new.name)).unwrap_or_default();
    // Without a sidecar of ours nothing says that a file is.
    let Ok(earlier) = serde_json::from_slice::<Sidecar>(&text) else {
        return Ok(());
    };
    for file in &earlier.files {
        if is_output(file, new.name) && !new.files.contains(file) {
            remove(&folder.join(file))?;
        }
    }
    if new.is_of_other_depth(&earlier) {
        remove_targets(folder, new.name)?;
    }
    Ok(())
}

/// Removes the targets of an image and the pictures of them, if these targets were found by this program.
pub(super) fn remove_targets(folder: &Path, name: &str) -> Result<()> {
    let path = record_path(folder, name);
    let text = std::fs::read(&path).unwrap_or_default();
    let ours = serde_json::from_slice::<FrameRecord>(&text).is_ok_and(|r| r.frame == name);
    if !ours {
        return Ok(());
    }
    for picture in TargetOutput::PICTURES {
        remove(&picture.path(folder, name))?;
    }
    // Last: it says whose the pictures are.
    remove(&path)
}

impl NewDepth<'_> {
    fn is_of_other_depth(&self, earlier: &Sidecar) -> bool {
        let now = self.made_with;
        // In which files depth is kept is no matter.
        let made_with = MadeWith {
            save: now.save.clone(),
            max_depth_m: now.max_depth_m,
            max_sigma: now.max_sigma,
            ..earlier.made_with.clone()
        };
        let then = &earlier.prediction;
        let same_camera = match (then.intrinsics, self.intrinsics) {
            (Some(then), Some(now)) => then.iter().zip(now).all(|(a, b)| same_number(*a, b)),
            (then, now) => then.is_none() && now.is_none(),
        };
        made_with.difference(now).is_some() || then.image_file != Some(self.mark) || !same_camera
    }
}

/// Whether a file can be an output of an image, as sidecars name them: in their own folder.
fn is_output(file: &str, name: &str) -> bool {
    let ending = file.strip_prefix(name);
    ending.is_some_and(|ending| DepthOutput::ALL.iter().any(|o| o.ending() == ending))
}

fn remove(path: &Path) -> Result<()> {
    match std::fs::remove_file(path) {
        Err(e) if e.kind() != ErrorKind::NotFound => {
            Err(deepfusion_data::Error::file(path, e).into())
        }
        _ => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_outputs_of_the_image_itself_are_removed() {
        assert!(is_output("a_depth.npy", "a") && is_output("a.ply", "a"));
        for other in [
            "b_depth.npy",
            "a.json",
            "a_notes.txt",
            "../a_depth.npy",
            "/a.ply",
        ] {
            assert!(!is_output(other, "a"), "{other}");
        }
        assert!(!is_output("a/../../b_depth.npy", "a"));
    }

    #[test]
    fn targets_of_somebody_else_stay() {
        let folder = tempfile::tempdir().unwrap();
        let at = |file: &str| folder.path().join(file);
        std::fs::write(at("a_overlay.png"), "").unwrap();
        for (record, stay) in [
            ("[1, 2]", true),
            (r#"{"frame": "b"}"#, true),
            (r#"{"frame": "a"}"#, false),
        ] {
            std::fs::write(at("a_targets.json"), record).unwrap();
            remove_targets(folder.path(), "a").unwrap();
            for file in ["a_overlay.png", "a_targets.json"] {
                assert_eq!(at(file).exists(), stay, "{record} {file}");
            }
        }
    }
}
