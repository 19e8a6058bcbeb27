//! What stands beside every prediction. It is written last, so that it also says that the rest is there.

use std::io::Write;
use std::path::{Path, PathBuf};
use std::time::UNIX_EPOCH;

use clap::ValueEnum;
use deepfusion_eval::compare::MetricScale;
use deepfusion_fs::Content;
use deepfusion_runtime::DepthEstimator;
use deepfusion_runtime::ModelSource;
use deepfusion_video::LiveFrame;
use serde::{Deserialize, Serialize};

use super::super::device;
use super::super::live::LiveMark;
use super::super::scene::Scale;
use super::camera::CameraSource;
use crate::cli::{Outputs, PredictionArgs, Save};
use crate::failure::Result;
use crate::model::ModelFacts;
use crate::output;

/// A prediction's description.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Sidecar {
    /// The input.
    pub image: PathBuf,
    /// The input's file, to notice that it changed; of a live source's frame its pixels, and when they arrived.
    pub image_file: FileMark,
    /// The input's width and height.
    pub size: [u32; 2],
    /// What the depths are.
    pub unit: String,
    /// The run or checkpoint given, or the embedded network's name.
    pub model: PathBuf,
    /// SHA-256 of an embedded or packed network's weights: a name alone does not say which version of it this was.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub model_sha256: Option<String>,
    /// Steps the checkpoint was trained for.
    pub checkpoint_step: usize,
    /// fx, fy, cx, cy in pixels of the input.
    pub intrinsics: Option<[f64; 4]>,
    /// `given`, `recording` (its own calibration), `exif` (the lens's nominal focal length), `assumed` or `unknown`.
    pub intrinsics_from: String,
    /// Whether the camera is known, so that depth is right for its focal length: given, the recording's own, or EXIF's.
    #[serde(default)]
    pub camera_known: bool,
    /// What was measured of this checkpoint's metres on recordings that it has not learned from.
    #[serde(default)]
    pub scale: MetricScale,
    /// What depth was multiplied by for another focal length than the one trained with.
    pub focal_factor: f64,
    /// x, y, width and height of the part that was looked at; depth is 0 outside.
    pub window: [u32; 4],
    /// Smallest and largest depth, in metres; none where no pixel has one.
    pub depth_m: Option<[f32; 2]>,
    /// Whether the recording's metres still are what they were, where that is watched.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub scale_monitor: Option<Scale>,
    /// The outputs, in the sidecar's folder.
    pub files: Vec<String>,
    /// The outputs' sizes in bytes, to notice a file that was cut off.
    pub file_bytes: Vec<u64>,
    /// The outputs' CRC-32 as eight hexadecimal digits, to notice one that a power cut left as zeros. A sidecar of an older
    /// version has none: what it stands for is made again.
    #[serde(default)]
    pub file_crc32: Vec<String>,
    /// Of a live source's frame: when it arrived, and how late its depth was.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub live: Option<LiveMark>,
    /// What else the outputs depend on.
    pub made_with: MadeWith,
}

/// A file's size and time of change, as `make` and `rsync` compare them.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct FileMark {
    /// Size in bytes.
    pub bytes: u64,
    /// Time of the last change, nanoseconds since 1970, where the system knows it.
    pub modified_ns: Option<u64>,
}

impl FileMark {
    /// Of a live source's frame.
    pub fn of_frame(frame: &LiveFrame) -> Self {
        let since_1970 = frame.arrived_at.duration_since(UNIX_EPOCH);
        Self {
            bytes: frame.image.as_raw().len() as u64,
            modified_ns: since_1970.ok().map(|d| d.as_nanos() as u64),
        }
    }

    /// The file's mark now.
    pub fn of(path: &Path) -> Result<Self, deepfusion_data::Error> {
        let meta = std::fs::metadata(path).map_err(|e| deepfusion_data::Error::file(path, e))?;
        let since = meta.modified().ok().map(|t| t.duration_since(UNIX_EPOCH));
        let nanoseconds = since.and_then(Result::ok).map(|d| d.as_nanos() as u64);
        Ok(Self {
            bytes: meta.len(),
            modified_ns: nanoseconds,
        })
    }
}

/// Program, weights and options: outputs of the same image with equal ones are equal (on one machine; the last digits
/// depend on the processor).
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct MadeWith {
    /// The program's version.
    pub version: String,
    /// SHA-256 of the network's configuration and weights.
    pub weights: String,
    /// What ran the network: `--engine`, `--precision`.
    pub engine: String,
    /// `--save`.
    pub save: Vec<String>,
    /// `--max-depth`.
    pub max_depth_m: f64,
    /// `--max-sigma`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub max_sigma: Option<f64>,
    /// `--intrinsics`, or those of `--calib`.
    pub intrinsics: Option<[f64; 4]>,
    /// SHA-256 of `--calib`, where that is a calibration tool's file.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub calibration_sha256: Option<String>,
    /// Off: `--no-focal-correction`.
    pub focal_correction: bool,
    /// `--stretch`.
    pub stretch: bool,
    /// `--correct-scale`.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub correct_scale: bool,
    /// `--data-set`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub set: Option<String>,
}

impl MadeWith {
    /// For these arguments and this network.
    pub fn new(
        args: &PredictionArgs,
        outputs: &Outputs,
        model: &ModelSource,
        estimator: &DepthEstimator,
        camera: &CameraSource,
    ) -> Result<Self> {
        Ok(Self {
            version: env!("CARGO_PKG_VERSION").into(),
            weights: model.content_sha256()?,
            engine: format!(
                "{} on {}",
                estimator.engine(),
                device::name(args.engine.device)
            ),
            save: outputs.save.iter().map(|s| word(*s)).collect(),
            max_depth_m: outputs.max_depth_m,
            max_sigma: outputs.max_sigma,
            intrinsics: match camera {
                CameraSource::Given(k) => Some([k.fx, k.fy, k.cx, k.cy]),
                CameraSource::File(k) => Some([k.fx, k.fy, k.cx, k.cy]),
                CameraSource::Lens(_) | CameraSource::Trained(_) | CameraSource::Unknown => None,
            },
            calibration_sha256: match camera {
                CameraSource::Lens(file) => Some(file.sha256.clone()),
                _ => None,
            },
            focal_correction: !args.no_focal_correction,
            stretch: args.stretch,
            correct_scale: args.correct_scale,
            set: args.engine.set.clone(),
        })
    }

    fn same_camera(&self, other: &Self) -> bool {
        match (self.intrinsics, other.intrinsics) {
            (Some(a), Some(b)) => a.iter().zip(b).all(|(a, b)| equal(*a, b)),
            (a, b) => a.is_none() && b.is_none(),
        }
    }

    /// The first thing that differs, in the command line's words.
    pub fn difference(&self, other: &Self) -> Option<&'static str> {
        [
            (self.version != other.version, "another program version"),
            (self.weights != other.weights, "other weights (--model)"),
            (
                self.engine != other.engine,
                "another engine (--engine, --precision)",
            ),
            (self.save != other.save, "another --save"),
            (self.set != other.set, "another --data-set"),
            (
                !equal(self.max_depth_m, other.max_depth_m),
                "another --max-depth",
            ),
            (self.max_sigma != other.max_sigma, "another --max-sigma"),
            (
                !self.same_camera(other) || self.calibration_sha256 != other.calibration_sha256,
                "another camera (--intrinsics, --calib)",
            ),
            (
                self.focal_correction != other.focal_correction,
                "another --no-focal-correction",
            ),
            (self.stretch != other.stretch, "another --stretch"),
            (
                self.correct_scale != other.correct_scale,
                "another --correct-scale",
            ),
        ]
        .into_iter()
        .find_map(|(differs, what)| differs.then_some(what))
    }
}

/// Whether two numbers are the same but for the last digits, which JSON may lose.
fn equal(a: f64, b: f64) -> bool {
    (a - b).abs() <= 1e-12 * a.abs()
}

fn word(save: Save) -> String {
    save.to_possible_value()
        .map_or_else(String::new, |v| v.get_name().to_owned())
}

impl Sidecar {
    /// Where the sidecar of a name lies.
    pub fn path(folder: &Path, name: &str) -> PathBuf {
        folder.join(format!("{name}.json"))
    }

    /// Adds an output that is there, as it is now.
    pub fn add(&mut self, folder: &Path, file: String) -> Result<()> {
        let path = folder.join(&file);
        let content = Content::of(&path).map_err(|e| deepfusion_data::Error::file(&path, e))?;
        self.files.push(file);
        self.file_bytes.push(content.bytes);
        self.file_crc32.push(format!("{:08x}", content.crc32));
        Ok(())
    }

    /// Writes sidecars into the folder, by their names, once all their outputs are on the disk: where one is, there are its
    /// outputs, whatever happens to the power. Returns when the sidecars are on the disk, too.
    pub fn write_all<'a>(
        folder: &Path,
        group: impl Iterator<Item = (&'a str, &'a Self)>,
    ) -> Result<()> {
        let group: Vec<_> = group.collect();
        let failed = |e| deepfusion_data::Error::file(folder, e);
        let outputs = group.iter().flat_map(|(_, sidecar)| &sidecar.files);
        let outputs: Vec<PathBuf> = outputs.map(|file| folder.join(file)).collect();
        deepfusion_fs::sync_files(&outputs).map_err(failed)?;
        deepfusion_fs::sync_folder(folder).map_err(failed)?;
        let mut aside = Vec::new();
        for (name, sidecar) in group {
            let (path, text) = (Self::path(folder, name), as_json(sidecar)?);
            let failed = |e| deepfusion_data::Error::file(&path, e);
            let filled = deepfusion_fs::write_aside(&path, failed, |out| put(out, &text, &path));
            aside.push(filled?);
        }
        Ok(deepfusion_fs::publish_all(aside).map_err(failed)?)
    }

    /// Writes it into the folder, whole or not at all, without waiting for the disk: where nothing goes on from it.
    pub fn write_unsynced(&self, folder: &Path, name: &str) -> Result<()> {
        let path = Self::path(folder, name);
        output::write_unsynced(&path, as_json(self)?)
    }

    /// Whether every output is there with the content that was written.
    pub fn is_complete(&self, folder: &Path) -> bool {
        let files = self.files.len();
        if (self.file_bytes.len(), self.file_crc32.len()) != (files, files) {
            return false;
        }
        let contents = self.file_bytes.iter().zip(&self.file_crc32);
        self.files
            .iter()
            .zip(contents)
            .all(|(file, (bytes, crc32))| {
                u32::from_str_radix(crc32, 16).is_ok_and(|crc32| {
                    let bytes = *bytes;
                    Content { bytes, crc32 }.is_of(&folder.join(file))
                })
            })
    }
}

/// Writes a value as indented JSON, atomically.
pub fn write_json<T: Serialize>(value: &T, path: &Path) -> Result<()> {
    output::write(path, as_json(value)?)
}

fn as_json<T: Serialize>(value: &T) -> Result<Vec<u8>> {
    let mut text = serde_json::to_vec_pretty(value)?;
    text.push(b'\n');
    Ok(text)
}

fn put(out: &mut impl Write, text: &[u8], path: &Path) -> Result<(), deepfusion_data::Error> {
    out.write_all(text)
        .map_err(|e| deepfusion_data::Error::file(path, e))
}
