use std::io::Read;
use std::path::{Path, PathBuf};

use crate::{ImageScore, PostProcess, Report};
use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};

use super::{Error, Result};

/// Version of the file format.
pub const SAVED_VERSION: u32 = 1;

/// Name of the folder with the evaluations inside a run's folder.
const FOLDER: &str = "eval";

/// An evaluation as `eval` saves it in `RUN/eval/<name>.json`: the result, the data it was measured on, and the weights.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct SavedEvaluation {
    /// Version of the file format, [`SAVED_VERSION`].
    pub format_version: u32,
    /// The data that were measured on, and the options.
    pub measured: MeasuredOn,
    /// The weights that were measured.
    pub model: ModelFile,
    /// The result.
    pub report: Report,
    /// Each image's scores, in order.
    pub images: Vec<FrameScore>,
}

/// The data an evaluation was measured on, and the options it was asked for with.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct MeasuredOn {
    /// The recordings, as given.
    pub data: Vec<PathBuf>,
    /// The split file, if any.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub split: Option<PathBuf>,
    /// The file of ground truth, if any; otherwise the recordings' scans are used.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub gt: Option<PathBuf>,
    /// The camera: "2", "3" or "both".
    pub camera: String,
    /// fx, fy, cx, cy in pixels, if given in place of the recordings' own.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub intrinsics: Option<[f64; 4]>,
    /// The images' horizontal field of view in degrees, if given in place of a calibration.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub hfov_deg: Option<f64>,
    /// How far the camera's clock is ahead of the vehicle's, in seconds, if given or measured.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub camera_ahead_s: Option<f64>,
    /// Topics chosen for bags, as `role=topic`.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub topics: Vec<String>,
    /// Whether predicted values that are not valid depths were left out.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub allow_holes: bool,
    /// The file of scans for the mean-depth baseline, if given.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub trivial: Option<PathBuf>,
    /// The engine that ran the network, and its number format.
    pub engine: String,
    /// The data set whose metres were used, if the run learned several.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub set: Option<String>,
    /// Whether depth was corrected for a focal length other than the one trained on.
    pub focal_correction: bool,
    /// The test-time augmentation, if any.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub post_process: Option<PostProcess>,
    /// Whether training saw none of these frames; absent if unknown.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub held_out: Option<bool>,
    /// The program's version.
    pub program: String,
    /// The command line that was run.
    pub command: String,
    /// Time of the evaluation, in UTC: `20260131-235959`.
    pub time: String,
}

/// The weights that were evaluated.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct ModelFile {
    /// The checkpoint's file name in the run's folder.
    pub checkpoint: String,
    /// SHA-256 of the file's bytes.
    pub sha256: String,
}

/// One image's scores.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct FrameScore {
    /// The image's name.
    pub name: String,
    /// Number of pixels compared.
    pub pixels: usize,
    /// Metrics without scaling.
    pub abs_rel: f64,
    /// Metrics after median scaling.
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
    /// The file's name: the data's, the checkpoint's and eight digits derived from everything that affects the result. So the same
    /// evaluation replaces its own file and no other.
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

    /// Everything that affects the result, as text.
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
        // The rest is added only if set, so that files of earlier evaluations keep their names.
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

    /// Writes the evaluation atomically into the run's folder and returns the file's path.
    ///
    /// # Errors
    /// [`Error::File`], naming the file.
    pub fn write(&self, run: &Path) -> Result<PathBuf> {
        let folder = run.join(FOLDER);
        std::fs::create_dir_all(&folder).map_err(|e| Error::file(&folder, e))?;
        let path = folder.join(self.file_name());
        let failed = |e| Error::file(&path, e);
        let text = serde_json::to_string_pretty(self).map_err(|e| failed(e.into()))?;
        deepfusion_fs::write(&path, text + "\n").map_err(failed)?;
        Ok(path)
    }

    /// The files of evaluations in a run's folder, sorted by name; empty if it was never evaluated.
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
/// [`Error::File`], naming the file.
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

/// Keeps letters and digits, replaces everything else by single dashes; at most 40 characters.
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
    fn file_names_have_only_plain_characters() {
        assert_eq!(slug("2011_09_26 drive/é.x"), "2011_09_26-drive-x");
        assert_eq!(slug("..//"), "");
        assert!(slug(&"a".repeat(99)).len() == 40);
    }

    #[test]
    fn sha256_equals_the_published_digest() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("abc");
        std::fs::write(&path, "abc").unwrap();
        // FIPS 180-2, appendix B.1.
        let expected = "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad";
        assert_eq!(sha256_of_file(&path).unwrap(), expected);
        assert!(sha256_of_file(&folder.path().join("none")).is_err());
    }
}
