//! Removes what an earlier run left of an image whose outputs are made again in another way.

use std::io::ErrorKind;
use std::path::Path;

use deepfusion_records::{FileMark, FrameRecord, MadeWith, Sidecar, same_number};

use super::{DepthOutput, TargetOutput};
use crate::bulk::{outputs_of, record_path, sidecar_path};
use crate::{Input, Result};

/// The depth of an image, about to be written.
pub(super) struct NewDepth<'a> {
    /// The image.
    pub(super) input: &'a Input,
    /// Mark of its file.
    pub(super) mark: FileMark,
    /// fx, fy, cx, cy in pixels.
    pub(super) intrinsics: Option<[f64; 4]>,
    /// What else it depends on.
    pub(super) made_with: &'a MadeWith,
    /// Names of the files that will be written.
    pub(super) files: &'a [String],
}

/// Removes the outputs that the image's sidecar lists and that are not made again, and targets found in another depth: beside the new
/// sidecar they would be taken for its own. This comes before the new outputs are written. If the run is stopped in between, the old
/// sidecar still lists everything that is left, and the image is not done.
pub(super) fn remove_earlier(folder: &Path, new: &NewDepth<'_>) -> Result<()> {
    let Some(earlier) = earlier_sidecar(folder, &new.input.name) else {
        return Ok(());
    };
    if new.is_of_other_depth(&earlier) {
        remove_targets(folder, new.input)?;
    }
    remove_named(folder, new.input, &earlier, |ending| {
        DepthOutput::ALL.iter().any(|o| o.ending() == ending)
            && !new.files.contains(&format!("{}{ending}", new.input.name))
    })
}

/// Removes the targets that this program found in an image, and the pictures of them that its sidecar lists.
pub(super) fn remove_targets(folder: &Path, input: &Input) -> Result<()> {
    if let Some(earlier) = earlier_sidecar(folder, &input.name) {
        remove_named(folder, input, &earlier, |ending| {
            TargetOutput::PICTURES
                .iter()
                .any(|picture| picture.ending() == ending)
        })?;
    }
    if has_targets(folder, &input.name) {
        remove(&record_path(folder, &input.name))?;
    }
    Ok(())
}

/// Whether this program found targets in an image of that name.
pub(super) fn has_targets(folder: &Path, name: &str) -> bool {
    let text = std::fs::read(record_path(folder, name)).unwrap_or_default();
    serde_json::from_slice::<FrameRecord>(&text).is_ok_and(|record| record.frame == name)
}

/// The sidecar of an earlier run. Without a sidecar of ours, a file cannot be recognised as an output.
fn earlier_sidecar(folder: &Path, name: &str) -> Option<Sidecar> {
    let text = std::fs::read(sidecar_path(folder, name)).ok()?;
    serde_json::from_slice(&text).ok()
}

/// Removes the files that a sidecar lists, if `goes` is true for their ending. A file that has changed since belongs to another program by
/// now, and the image itself is not an output.
fn remove_named(
    folder: &Path,
    input: &Input,
    sidecar: &Sidecar,
    goes: impl Fn(&str) -> bool,
) -> Result<()> {
    for (file, content) in outputs_of(sidecar) {
        let path = folder.join(file);
        if file.strip_prefix(&input.name).is_some_and(&goes)
            && content.is_of(&path)
            && path.canonicalize().ok() != input.path.canonicalize().ok()
        {
            remove(&path)?;
        }
    }
    Ok(())
}

impl NewDepth<'_> {
    fn is_of_other_depth(&self, earlier: &Sidecar) -> bool {
        let now = self.made_with;
        // The kinds of outputs do not matter.
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
    use crate::bulk::{add_output, write_unsynced};
    use deepfusion_records::PredictionRecord;
    use std::path::PathBuf;

    const ALL: fn(&str) -> bool = |_| true;

    fn input(folder: &Path, image: &str) -> Input {
        Input {
            path: folder.join(image),
            name: "a".into(),
            frame: None,
        }
    }

    /// A sidecar of `a` that lists these files; creates them.
    fn sidecar_of(folder: &Path, files: &[&str]) -> Sidecar {
        let mut sidecar = Sidecar {
            prediction: PredictionRecord::default(),
            files: Vec::new(),
            file_bytes: Vec::new(),
            file_crc32: Vec::new(),
            live: None,
            made_with: MadeWith {
                version: "1".into(),
                weights: String::new(),
                engine: String::new(),
                save: Vec::new(),
                max_depth_m: 80.0,
                max_sigma: None,
                intrinsics: None,
                hfov_deg: None,
                calibration_sha256: None,
                focal_correction: true,
                stretch: false,
                correct_scale: false,
                post_process: None,
                set: None,
                topics: Vec::new(),
                camera_height_m: None,
            },
        };
        for file in files {
            std::fs::write(folder.join(file), file).unwrap();
            add_output(&mut sidecar, folder, (*file).to_owned()).unwrap();
        }
        sidecar
    }

    #[test]
    fn only_unchanged_files_are_removed() {
        let folder = tempfile::tempdir().unwrap();
        let root = folder.path();
        let at = root.join("out");
        std::fs::create_dir(&at).unwrap();
        // The last three are not outputs of `a` in that folder, whatever the sidecar lists.
        let outside = root.join("a_depth.npy").display().to_string();
        let files = [
            "a_depth.npy",
            "a_depth.png",
            "a_image.jpg",
            "b_depth.npy",
            "../a_depth.npy",
            outside.as_str(),
        ];
        let sidecar = sidecar_of(&at, &files);
        std::fs::write(at.join("a_depth.png"), "somebody else's").unwrap();
        // A recording was made of saved images, and its outputs go to the same folder.
        remove_named(&at, &input(&at, "a_image.jpg"), &sidecar, ALL).unwrap();
        for file in files {
            let goes = file == "a_depth.npy";
            assert_eq!(at.join(file).exists(), !goes, "{file}");
        }
    }

    #[test]
    fn targets_of_another_program_stay() {
        let folder = tempfile::tempdir().unwrap();
        let at = |file: &str| -> PathBuf { folder.path().join(file) };
        let image = input(folder.path(), "a.png");
        let sidecar = sidecar_of(folder.path(), &["a_overlay.png", "a_depth.npy"]);
        write_unsynced(&sidecar, folder.path(), "a").unwrap();
        // The user's mask beside it, which no run wrote.
        std::fs::write(at("a_segments.png"), "").unwrap();
        for (record, goes) in [
            ("[1, 2]", false),
            (r#"{"frame": "b"}"#, false),
            (r#"{"frame": "a"}"#, true),
        ] {
            std::fs::write(at("a_targets.json"), record).unwrap();
            remove_targets(folder.path(), &image).unwrap();
            assert_eq!(at("a_targets.json").exists(), !goes, "{record}");
        }
        assert!(!at("a_overlay.png").exists());
        assert!(at("a_segments.png").exists() && at("a_depth.npy").exists());
    }
}
