//! What is in a recording.

use super::layout::Layout;
use super::{bag, comma};
use crate::{
    Cameras, ClockOffset, Dataset, DriveInspection, Error, GtKind, Inspection, IntrinsicsSummary,
    OpenOptions, Result, SpeedRange,
};
use std::path::Path;

/// Looks into a recording of any layout that [`Dataset::open`] knows. A comma2k19 segment whose video is
/// absent, and a bag without a camera, are reported by their other streams.
///
/// # Errors
/// As [`Dataset::open`]; times and speeds may be missing and are then reported as unknown.
pub fn inspect(path: &Path) -> Result<Inspection> {
    inspect_with(path, &OpenOptions::default(), |_| None)
}

/// [`inspect`] with a camera or a clock offset given; camera and split of the options are not looked at. `time_offset` measures
/// [`DriveInspection::time_offset`]: it is asked where there is one drive, and may take long (`deepfusion_doctor::inspect`
/// has one that reads a few hundred pictures).
///
/// # Errors
/// As [`inspect`].
pub fn inspect_with(
    path: &Path,
    options: &OpenOptions,
    time_offset: impl FnOnce(&Dataset) -> Option<ClockOffset>,
) -> Result<Inspection> {
    let layout = Layout::of(path)?;
    layout.check_topics(path, options)?;
    if let Layout::Comma(segment) = &layout
        && !comma::has_video(segment)
    {
        return comma::inspect(segment, options);
    }
    if let Layout::Bags(bags) = &layout
        && let [bag] = bags.as_slice()
        && let Some(inspection) = bag::without_images(bag, options)?
    {
        return Ok(inspection);
    }
    let open = |camera| {
        let options = OpenOptions {
            camera,
            split: None,
            ..options.clone()
        };
        layout.open(path, &options)
    };
    let datasets = match open(Cameras::Left) {
        Err(Error::NoImages { .. }) => open(Cameras::Right),
        other => other,
    }?;
    let mut streams = Vec::new();
    let mut drives = Vec::new();
    for dataset in &datasets {
        for mut stream in dataset.streams()? {
            if datasets.len() > 1 {
                stream.name = format!("{}/{}", dataset.name(), stream.name);
            }
            streams.push(stream);
        }
        drives.push(look_at(dataset)?);
    }
    // Measuring reads many pictures: of many drives the doctor reports it one by one.
    if let ([dataset], [drive]) = (datasets.as_slice(), drives.as_mut_slice()) {
        drive.time_offset = time_offset(dataset);
    }
    let k = datasets[0].intrinsics(0);
    Ok(Inspection {
        kind: datasets[0].kind(),
        frames: drives.iter().map(|d| d.frames).sum(),
        size: Some([k.width, k.height]),
        intrinsics: Some(IntrinsicsSummary::from(k)),
        streams,
        speed_mps: SpeedRange::of(datasets.iter().flat_map(speeds)),
        distance_m: sum(drives.iter().map(|d| d.distance_m)),
        duration_s: sum(drives.iter().map(|d| d.duration_s)),
        drives,
    })
}

/// Pairs slower than this are counted as unusable, as in training.
const MIN_SPEED_MPS: f64 = 0.5;

fn look_at(dataset: &Dataset) -> Result<DriveInspection> {
    let frames = dataset.frames();
    let (usable_pairs, why_no_pairs) = match dataset.snippets(&[1], MIN_SPEED_MPS) {
        Ok(snippets) => (snippets.len(), None),
        Err(why) => (0, Some(why.to_string())),
    };
    let (mut distance_m, mut turn_rad) = (None, None);
    for pair in frames.windows(2) {
        let (Some(track), Some(from), Some(to)) = (dataset.track(), pair[0].time_s, pair[1].time_s)
        else {
            continue;
        };
        if let Some(motion) = track.motion(from, to) {
            *distance_m.get_or_insert(0.0) += motion.distance_m.abs();
            if dataset.yaw_known() {
                *turn_rad.get_or_insert(0.0) += motion.yaw_rad;
            }
        }
    }
    let ends = frames.first().zip(frames.last());
    Ok(DriveInspection {
        mounts: dataset.mounts().to_vec(),
        name: dataset.name().to_owned(),
        camera: dataset.camera().number(),
        frames: frames.len(),
        missing_frames: frames
            .windows(2)
            .filter(|pair| pair[1].number > pair[0].number + 1)
            .map(|pair| [pair[0].number + 1, pair[1].number - 1])
            .collect(),
        usable_pairs,
        why_no_pairs,
        scans: (0..frames.len())
            .filter(|i| dataset.has_ground_truth(*i, GtKind::Z))
            .count(),
        speed_mps: SpeedRange::of(speeds(dataset)),
        distance_m,
        turn_rad,
        duration_s: ends.and_then(|(first, last)| Some(last.time_s? - first.time_s?)),
        camera_ahead_s: dataset.camera_ahead_s(),
        time_offset: None,
        warnings: dataset.warnings().to_vec(),
    })
}

fn speeds(dataset: &Dataset) -> impl Iterator<Item = f64> {
    dataset.frames().iter().filter_map(|f| f.speed_mps)
}

/// The sum of what is known; `None` if nothing is.
fn sum(values: impl Iterator<Item = Option<f64>>) -> Option<f64> {
    values
        .flatten()
        .fold(None, |sum, value| Some(sum.unwrap_or(0.0) + value))
}
