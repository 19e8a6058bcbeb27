//! The details of one frame.

use std::collections::BTreeMap;
use std::fs::File;
use std::io::Read;
use std::path::{Path, PathBuf};

use deepfusion_geometry::Intrinsics;
use deepfusion_images::image_size;
use deepfusion_records::PredictionRecord;
use serde::{Serialize, Serializer};
use serde_json::Value;

use super::entry::Entry;
use super::problem::FrameProblem;
use super::small_files::SmallFiles;
use crate::{Error, Result};

/// Fields of the sidecar that the page shows unchanged. `scale_trusted` is from older versions, which had neither `camera_known` nor
/// `scale`.
const PASSED_ON: [&str; 12] = [
    "unit",
    "model",
    "checkpoint_step",
    "intrinsics_from",
    "camera_known",
    "scale",
    "scale_trusted",
    "scale_monitor",
    "focal_factor",
    "window",
    "depth_m",
    "image",
];

/// A frame as sent to the page: the camera, depth and picture, the targets, and the problems with any of them. Everything but
/// `name` may be missing.
#[derive(Debug, Serialize)]
pub(crate) struct FrameDetails {
    /// Name of the file of depth.
    depth: Option<String>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub intrinsics: Option<Intrinsics>,
    name: String,
    #[serde(skip_serializing_if = "Option::is_none")]
    picture: Option<ShownPicture>,
    #[serde(serialize_with = "as_sentences")]
    pub problems: Vec<FrameProblem>,
    revision: u64,
    /// The content of the targets' file.
    targets: Option<Value>,
    /// The sidecar's values of [`PASSED_ON`], as far as they exist.
    #[serde(flatten)]
    passed_on: BTreeMap<&'static str, Value>,
}

/// Path and size of a frame's picture.
#[derive(Debug, Serialize)]
struct ShownPicture {
    path: String,
    /// Width and height.
    size: (u32, u32),
}

fn as_sentences<S: Serializer>(problems: &[FrameProblem], out: S) -> Result<S::Ok, S::Error> {
    out.collect_seq(problems.iter().map(FrameProblem::to_string))
}

/// Everything that is known of a frame.
pub(crate) fn details_of(folder: &Path, entry: &Entry) -> FrameDetails {
    let files = SmallFiles::read(folder, entry);
    let depth = files.depth(entry);
    let SmallFiles {
        sidecar,
        targets,
        mut problems,
        ..
    } = files;
    let record = sidecar.as_ref().map(|s| &s.record);
    let sidecar_size = record.and_then(|r| r.size).map(|[w, h]| (w, h));
    let (mut intrinsics, mut shown) = (None, None);
    match record.map(|r| (r.intrinsics, sidecar_size)) {
        Some((Some(k), Some((width, height)))) => {
            let camera = Intrinsics::from_numbers(k, (width, height));
            match camera.implausible() {
                None => intrinsics = Some(camera),
                Some(why) => problems.push(FrameProblem::Camera(why)),
            }
        }
        Some((None, _)) => problems.push(FrameProblem::NoCamera),
        Some((_, None)) => problems.push(FrameProblem::NoSize),
        None if entry.sidecar.is_none() => {
            let frame = entry.name.clone();
            problems.push(FrameProblem::NoSidecar { frame });
        }
        None => {}
    }
    match picture(folder, entry, record) {
        Ok(picture) => {
            shown = Some(ShownPicture {
                path: picture.path.display().to_string(),
                size: picture.size,
            });
            match sidecar_size.filter(|size| *size != picture.size) {
                Some(expected) => problems.push(FrameProblem::PictureSize {
                    found: picture.size,
                    expected,
                }),
                None if picture.changed => problems.push(FrameProblem::PictureChanged),
                None => {}
            }
        }
        Err(none) => problems.push(none),
    }
    match depth.map(|d| folder.join(&d.file)) {
        // The header of an array is not read here; the page compares the sizes again.
        Some(path) if path.extension().is_some_and(|e| e == "png") => match image_size(&path) {
            Ok(found) => {
                if let Some(expected) = sidecar_size.filter(|size| *size != found) {
                    problems.push(FrameProblem::DepthSize { found, expected });
                }
            }
            Err(e) => problems.push(FrameProblem::Unreadable(e.to_string())),
        },
        Some(_) => {}
        None => problems.push(FrameProblem::NoDepth),
    }
    let value_of = |field: &str| sidecar.as_ref()?.json.get(field).cloned();
    let passed_on = PASSED_ON
        .into_iter()
        .filter_map(|field| Some((field, value_of(field)?)));
    FrameDetails {
        depth: depth.map(|d| d.file.clone()),
        intrinsics,
        name: entry.name.clone(),
        picture: shown,
        problems,
        revision: entry.revision(),
        targets: targets.map(|t| t.json),
        passed_on: passed_on.collect(),
    }
}

/// A short form of a frame's targets.
#[derive(Debug, Serialize)]
pub(crate) struct Track {
    name: String,
    /// Track id, and centre in camera axes, in metres.
    targets: Vec<(u64, [f64; 3])>,
    /// 3×4, row by row.
    world_from_cam: Option<[f64; 12]>,
}

/// A frame's targets; `None` without a readable file of targets.
pub(crate) fn targets_of(folder: &Path, entry: &Entry) -> Option<Track> {
    let frame = SmallFiles::read(folder, entry).targets?.record;
    Some(Track {
        name: entry.name.clone(),
        targets: frame.targets.iter().map(|t| (t.id, t.center_m)).collect(),
        world_from_cam: frame.camera_motion,
    })
}

/// A frame's picture.
pub(crate) struct Picture {
    /// Path of the file.
    pub path: PathBuf,
    /// Media type: PNG or JPEG.
    pub content_type: &'static str,
    /// Width and height.
    pub size: (u32, u32),
    /// Whether it has changed since depth was made from it.
    pub changed: bool,
}

/// The picture of a frame: the one its sidecar names, or `NAME_image.*` beside it.
pub(crate) fn picture_of(folder: &Path, entry: &Entry) -> Result<Picture, FrameProblem> {
    let sidecar = SmallFiles::read(folder, entry).sidecar;
    picture(folder, entry, sidecar.as_ref().map(|s| &s.record))
}

fn picture(
    folder: &Path,
    entry: &Entry,
    sidecar: Option<&PredictionRecord>,
) -> Result<Picture, FrameProblem> {
    let named = sidecar.and_then(|s| s.image.clone());
    // The path as it was given to `predict`, from the current folder, if that is still the same, or from the results' folder, if both were
    // moved together.
    let undistorted = sidecar.is_some_and(|s| s.undistorted);
    let mut places: Vec<PathBuf> = named
        .iter()
        // That picture still has the lens's distortion, and depth has not.
        .filter(|_| !undistorted)
        .flat_map(|p| [p.clone(), folder.join(p)])
        .collect();
    let beside = entry.image.as_ref().map(|i| folder.join(&i.file));
    places.dedup();
    let mut problem = None;
    for (path, is_named) in places
        .iter()
        .map(|p| (p, true))
        .chain(beside.iter().map(|p| (p, false)))
    {
        match picture_type(path) {
            Ok(Some((content_type, size))) => {
                let recorded = sidecar
                    .filter(|_| is_named)
                    .and_then(|s| s.image_file)
                    .map(|file| file.bytes);
                let bytes = std::fs::metadata(path).map(|m| m.len()).ok();
                return Ok(Picture {
                    path: path.clone(),
                    content_type,
                    size,
                    changed: recorded.is_some() && recorded != bytes,
                });
            }
            // A video or a bag is not a picture; its frame may be beside the results.
            Ok(None) => {}
            Err(e) => problem = Some(problem.unwrap_or(e)),
        }
    }
    Err(match (problem, named) {
        (None, Some(named)) if undistorted => FrameProblem::Distorted(named),
        (Some(problem), _) => FrameProblem::Unreadable(problem.to_string()),
        (None, Some(named)) if places.iter().any(|path| path.is_file()) => {
            FrameProblem::PictureAmongOthers(named)
        }
        (None, Some(named)) => FrameProblem::PictureGone(named),
        (None, None) => FrameProblem::NoPicture,
    })
}

/// A picture's type, from its first bytes; `None` if there is no file or it is not a picture. Only accepted files are ever sent,
/// so that a sidecar cannot expose any other file.
fn picture_type(path: &Path) -> Result<Option<(&'static str, (u32, u32))>> {
    // Pipes and devices are not opened: they may block.
    if !std::fs::metadata(path).is_ok_and(|m| m.is_file()) {
        return Ok(None);
    }
    let mut begin = [0; 8];
    let read = File::open(path).and_then(|mut f| {
        let mut filled = 0;
        while filled < begin.len() {
            match f.read(&mut begin[filled..])? {
                0 => break,
                n => filled += n,
            }
        }
        Ok(filled)
    });
    read.map_err(|e| Error::file(path, e))?;
    let content_type = match begin {
        [0x89, b'P', b'N', b'G', ..] => "image/png",
        [0xff, 0xd8, 0xff, ..] => "image/jpeg",
        _ => return Ok(None),
    };
    Ok(Some((content_type, image_size(path)?)))
}
