//! The details of one frame.

use std::fs::File;
use std::io::Read;
use std::path::{Path, PathBuf};

use deepfusion_data::image_size;
use deepfusion_geometry::Intrinsics;
use serde_json::{Value, json};

use super::entry::Entry;
use super::summary::{numbers, read_json};
use crate::{Error, Result};

/// Fields of the sidecar that the page shows as they are; `scale_trusted` is older programs', which had neither of the two
/// before it.
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

/// A frame as the page gets it: the camera, which parts there are, the targets, and what is wrong with any of them. Everything but
/// `name` may be missing.
pub(crate) fn frame_json(folder: &Path, entry: &Entry) -> Value {
    let mut problems = Vec::new();
    let mut small = |file: &Option<super::entry::FrameFile>| {
        let outcome = read_json(&folder.join(&file.as_ref()?.file));
        outcome.map_err(|e| problems.push(e.to_string())).ok()
    };
    let sidecar = small(&entry.sidecar);
    let targets = small(&entry.targets).map(|t| checked_targets(&t, &mut problems));
    let said_size = sidecar.as_ref().and_then(|s| numbers::<2>(s.get("size")));
    let said_size = said_size.map(|[w, h]| (w as u32, h as u32));
    let mut frame = json!({
        "name": entry.name,
        "revision": entry.revision(),
        "depth": entry.depth.as_ref().map(|d| &d.file),
        "targets": targets,
    });
    for field in PASSED_ON {
        if let Some(value) = sidecar.as_ref().and_then(|s| s.get(field)) {
            frame[field] = value.clone();
        }
    }
    match sidecar
        .as_ref()
        .map(|s| (numbers::<4>(s.get("intrinsics")), said_size))
    {
        Some((Some(k), Some((width, height)))) => {
            let camera = Intrinsics::from_numbers(k, (width, height));
            match camera.implausible() {
                None => frame["intrinsics"] = json!(camera),
                Some(why) => problems.push(format!("the sidecar's camera cannot be: {why}")),
            }
        }
        Some((None, _)) => {
            problems.push("the camera is unknown: no cloud, no boxes on the picture".into())
        }
        Some((_, None)) => problems.push("the sidecar does not say the image's size".into()),
        None if entry.sidecar.is_none() => {
            problems.push(format!("no {}.json: the camera is unknown", entry.name));
        }
        None => {}
    }
    match picture(folder, entry, sidecar.as_ref()) {
        Ok(picture) => {
            frame["picture"] =
                json!({ "size": picture.size, "path": picture.path.display().to_string() });
            if said_size.is_some_and(|said| said != picture.size) {
                let ((w, h), (said_w, said_h)) = (picture.size, said_size.unwrap_or_default());
                problems.push(format!(
                    "the picture is {w}x{h}, the sidecar says {said_w}x{said_h}"
                ));
            } else if picture.changed {
                problems.push("the picture has changed since its depth was made".into());
            }
        }
        Err(problem) => problems.push(problem),
    }
    match entry.depth.as_ref().map(|d| folder.join(&d.file)) {
        // An array's header is read with its numbers; the page compares the sizes once more.
        Some(path) if path.extension().is_some_and(|e| e == "png") => match image_size(&path) {
            Ok((w, h)) => {
                if let Some((said_w, said_h)) = said_size.filter(|said| *said != (w, h)) {
                    problems.push(format!(
                        "depth is {w}x{h}, the sidecar says {said_w}x{said_h}"
                    ));
                }
            }
            Err(e) => problems.push(e.to_string()),
        },
        Some(_) => {}
        None => problems.push("no depth was saved, neither as depth-png nor as npy".into()),
    }
    frame["problems"] = json!(problems);
    frame
}

/// Targets without a position or size are dropped: they cannot be drawn.
fn checked_targets(frame: &Value, problems: &mut Vec<String>) -> Value {
    let mut frame = frame.clone();
    let Some(list) = frame.get_mut("targets").and_then(Value::as_array_mut) else {
        problems.push("the targets' file has no list of targets".into());
        return frame;
    };
    let all = list.len();
    list.retain(|t| {
        numbers::<3>(t.get("center_m")).is_some()
            && numbers::<3>(t.get("size_m")).is_some_and(|s| s.iter().all(|side| *side > 0.0))
    });
    if list.len() < all {
        let unusable = all - list.len();
        let verb = if unusable == 1 { "has" } else { "have" };
        problems.push(format!(
            "{unusable} of {all} targets {verb} no position or size"
        ));
    }
    frame
}

/// A frame's tracks, short: camera, and id, centre and state of each target; `None` where there are none.
pub(crate) fn targets_of(folder: &Path, entry: &Entry) -> Option<Value> {
    let frame = read_json(&folder.join(&entry.targets.as_ref()?.file)).ok()?;
    let targets = frame.get("targets")?.as_array()?.iter().filter_map(|t| {
        let centre = numbers::<3>(t.get("center_m"))?;
        Some(json!([t.get("id")?, centre]))
    });
    Some(json!({
        "name": entry.name,
        "world_from_cam": frame.get("camera_motion").filter(|m| !m.is_null()),
        "targets": targets.collect::<Vec<_>>(),
    }))
}

/// A frame's picture.
pub(crate) struct Picture {
    /// Where it lies.
    pub path: PathBuf,
    /// PNG or JPEG.
    pub content_type: &'static str,
    /// Width and height.
    pub size: (u32, u32),
    /// Whether it has changed since depth was made from it.
    pub changed: bool,
}

/// The picture of a frame: the one its sidecar names, or `NAME_image.*` beside it.
pub(crate) fn picture_of(folder: &Path, entry: &Entry) -> Result<Picture, String> {
    let sidecar = entry
        .sidecar
        .as_ref()
        .and_then(|s| read_json(&folder.join(&s.file)).ok());
    picture(folder, entry, sidecar.as_ref())
}

fn picture(folder: &Path, entry: &Entry, sidecar: Option<&Value>) -> Result<Picture, String> {
    let named = sidecar
        .and_then(|s| s.get("image")?.as_str())
        .map(PathBuf::from);
    // As it was given to `predict`, whose folder this may still be; or beside the results, which were moved together.
    let mut places: Vec<PathBuf> = named
        .iter()
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
                let said = sidecar
                    .filter(|_| is_named)
                    .and_then(|s| s.get("image_file")?.get("bytes")?.as_u64());
                let bytes = std::fs::metadata(path).map(|m| m.len()).ok();
                return Ok(Picture {
                    path: path.clone(),
                    content_type,
                    size,
                    changed: said.is_some() && said != bytes,
                });
            }
            // A video or a bag is no picture: the one beside the results was taken out of it.
            Ok(None) => {}
            Err(e) => problem = Some(problem.unwrap_or(e.to_string())),
        }
    }
    Err(match (problem, named) {
        (Some(problem), _) => problem,
        (None, Some(named)) => format!("{}: the picture is not there any more", named.display()),
        (None, None) => "no picture is known".into(),
    })
}

/// A picture's type, from its first bytes; `None` if there is no file or it is not a picture. Only accepted files are ever sent,
/// so that a sidecar cannot expose any other file.
fn picture_type(path: &Path) -> Result<Option<(&'static str, (u32, u32))>> {
    // Not a pipe or a device: those may block.
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
