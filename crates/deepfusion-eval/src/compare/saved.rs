use std::io::Read;
use std::path::{Path, PathBuf};

use crate::{ImageScore, PostProcess, Report};
use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};

use super::{Error, Result};

/// Version of the file's layout.
pub const SAVED_VERSION: u32 = 1;

/// The folder of evaluations inside a run's.
const FOLDER: &str = "eval";

/// An evaluation as `eval` keeps it in `RUN/eval/<name>.json`: the result, what it was measured on, and with which weights.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct SavedEvaluation {
    /// [`SAVED_VERSION`].
    pub format_version: u32,
    /// What was measured on.
    pub measured: MeasuredOn,
    /// The weights that were measured.
    pub model: ModelFile,
    /// The result.
    pub report: Report,
    /// Each image's scores, in order.
    pub images: Vec<FrameScore>,
}

/// What an evaluation was measured on, and how it was asked for.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct MeasuredOn {
    /// The recordings, as given.
    pub data: Vec<PathBuf>,
    /// The split file, if any.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub split: Option<PathBuf>,
    /// The file of ground truth, if any; else the recordings' scans.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub gt: Option<PathBuf>,
    /// Which camera: "2", "3" or "both".
    pub camera: String,
    /// fx, fy, cx, cy in pixels, where they were given in place of the recordings' own.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub intrinsics: Option<[f64; 4]>,
    /// The images' field of view from left to right in degrees, where it was given in place of a calibration.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub hfov_deg: Option<f64>,
    /// How far the camera's clock is ahead of the vehicle's in seconds, where that was given or measured.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub camera_ahead_s: Option<f64>,
    /// Topics of bags that were named, as `role=topic`.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub topics: Vec<String>,
    /// Whether predictions that are no depth were left out.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub allow_holes: bool,
    /// The file of scans for the mean-depth baseline, where one was given.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub trivial: Option<PathBuf>,
    /// What ran the network, and in which numbers.
    pub engine: String,
    /// Which of the data sets that the run learned its metres are of, where it learned several.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub set: Option<String>,
    /// Whether depth was corrected for another focal length than the one trained on.
    pub focal_correction: bool,
    /// The test-time augmentation, if any.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub post_process: Option<PostProcess>,
    /// Whether training saw none of these frames; absent where that is unknown.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub held_out: Option<bool>,
    /// The program's version.
    pub program: String,
    /// The command.
    pub command: String,
    /// When, UTC: `20260131-235959`.
    pub time: String,
}

/// The weights of an evaluation.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct ModelFile {
    /// The checkpoint's name in the run's folder.
    pub checkpoint: String,
    /// SHA-256 of its bytes.
    pub sha256: String,
}

/// One image's scores.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct FrameScore {
    /// Its name.
    pub name: String,
    /// How many pixels were compared.
    pub pixels: usize,
    /// Unscaled.
    pub abs_rel: f64,
    /// Median-scaled.
    pub abs_rel_median_scaled: f64,
    /// median(gt) / median(prediction).
    pub ratio: f64,
}

impl From<&ImageScore> for FrameScore {
    fn from(score: &ImageScore) -> Self {
        Self {
            name: score.name.clone(),
            pixels: score.pixels,
            abs_rel: score.unscaled.abs_rel,
            abs_rel_median_scaled: score.median_scaled.abs_rel,
            ratio: score.ratio,
        }
    }
}

impl SavedEvaluation {
    /// Its file's name: the data's, the checkpoint's and eight digits that follow from all that decides the result, so that
    /// the same evaluation replaces its own file and no other's.
    #[must_use]
    pub fn file_name(&self) -> String {
        let place = |path: &PathBuf| {
            let name = path
                .file_name()
                .map_or_else(String::new, |n| n.to_string_lossy().into_owned());
            slug(&name)
        };
        let mut names: Vec<String> = self.measured.data.iter().map(place).collect();
        names.truncate(2);
        names.extend(self.measured.split.iter().map(|p| {
            slug(
                &p.file_stem()
                    .map_or_else(String::new, |n| n.to_string_lossy().into_owned()),
            )
        }));
        let digest = format!("{:x}", Sha256::digest(self.decides()));
        let checkpoint = self.model.checkpoint.trim_end_matches(".safetensors");
        names.push(slug(checkpoint));
        names.push(digest[..8].to_owned());
        names.retain(|n| !n.is_empty());
        format!("{}.json", names.join("-"))
    }

    /// All that decides the result.
    fn decides(&self) -> String {
        let measured = &self.measured;
        let mut decides = format!(
            "{:?} {:?} {:?} {} {} {:?} {} {:?} {}",
            measured.data,
            measured.split,
            measured.gt,
            measured.camera,
            measured.engine,
            measured.set,
            measured.focal_correction,
            self.report.protocol,
            self.model.checkpoint,
        );
        // The rest is named only where it is there: files of earlier evaluations keep their names.
        if let Some(how) = measured.post_process {
            decides += &format!(" {how:?}");
        }
        if let Some(fixed) = &self.report.fixed_scaled {
            decides += &format!(" scale {}", fixed.factor);
        }
        if let Some(numbers) = measured.intrinsics {
            decides += &format!(" intrinsics {numbers:?}");
        }
        if let Some(degrees) = measured.hfov_deg {
            decides += &format!(" hfov {degrees}");
        }
        if let Some(seconds) = measured.camera_ahead_s {
            decides += &format!(" ahead {seconds}");
        }
        if !measured.topics.is_empty() {
            decides += &format!(" topics {:?}", measured.topics);
        }
        if measured.allow_holes {
            decides += " holes";
        }
        if let Some(baseline) = &measured.trivial {
            decides += &format!(" trivial {baseline:?}");
        }
        decides
    }

    /// Writes it into the run's folder, whole or not at all; the file's path.
    ///
    /// # Errors
    /// [`Error::File`] naming the file.
    pub fn write(&self, run: &Path) -> Result<PathBuf> {
        let folder = run.join(FOLDER);
        std::fs::create_dir_all(&folder).map_err(|e| Error::file(&folder, e))?;
        let path = folder.join(self.file_name());
        let failed = |e| Error::file(&path, e);
        let text = serde_json::to_string_pretty(self).map_err(|e| failed(e.into()))?;
        deepfusion_fs::write(&path, text + "\n").map_err(failed)?;
        Ok(path)
    }

    /// The files of evaluations in a run's folder, by name; none where it was never evaluated.
    pub(crate) fn files(run: &Path) -> Vec<PathBuf> {
        let Ok(entries) = std::fs::read_dir(run.join(FOLDER)) else {
            return Vec::new();
        };
        let paths = entries.flatten().map(|entry| entry.path());
        let mut files: Vec<_> = paths
            .filter(|p| p.extension().is_some_and(|e| e == "json"))
            .collect();
        files.sort();
        files
    }
}

/// SHA-256 of a file's bytes, in hexadecimal.
///
/// # Errors
/// [`Error::File`] naming the file.
pub fn sha256_of_file(path: &Path) -> Result<String> {
    let failed = |e| Error::file(path, e);
    let mut file = std::fs::File::open(path).map_err(failed)?;
    let mut digest = Sha256::new();
    let mut buffer = vec![0; 1 << 16];
    loop {
        match file.read(&mut buffer).map_err(failed)? {
            0 => return Ok(format!("{:x}", digest.finalize())),
            n => digest.update(&buffer[..n]),
        }
    }
}

/// Letters and digits, everything else as one dash; at most 40.
fn slug(name: &str) -> String {
    let mut out = String::new();
    for c in name.chars() {
        if c.is_ascii_alphanumeric() || c == '_' {
            out.push(c);
        } else if !out.is_empty() && !out.ends_with('-') {
            out.push('-');
        }
    }
    out.truncate(40);
    out.trim_matches('-').to_owned()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_of_files_are_plain() {
        assert_eq!(slug("2011_09_26 drive/é.x"), "2011_09_26-drive-x");
        assert_eq!(slug("..//"), "");
        assert!(slug(&"a".repeat(99)).len() == 40);
    }

    #[test]
    fn a_files_digest_is_the_published_one() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("abc");
        std::fs::write(&path, "abc").unwrap();
        // FIPS 180-2, appendix B.1.
        let expected = "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad";
        assert_eq!(sha256_of_file(&path).unwrap(), expected);
        assert!(sha256_of_file(&folder.path().join("none")).is_err());
    }
}
