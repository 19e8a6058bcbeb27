//! Compares the chained motions of the pose network with the drives' true trajectories.

use std::path::Path;

use deepfusion_data::{Camera, CameraPath, Dataset, DatasetKind};
use deepfusion_eval::odometry::{
    PoseFile, TrackError, TrackPair, chain, from_first, kitti_text, tum_text,
};
use deepfusion_geometry::{Intrinsics, Se3};
use deepfusion_render::TopView;
use deepfusion_train::PosePredictor;

use crate::Result;
use crate::files::{UniqueNames, write};

/// File with the exact poses of simulated drives.
const EXACT_POSES: &str = "poses.txt";
/// Number of frame pairs in a batch.
const PAIRS: usize = 8;
/// Largest accepted relative difference between the focal length and the one trained with, at the network's size; a larger one gives a
/// warning.
const FOCAL_TOLERANCE: f64 = 0.05;

/// Why a trajectory of the pose network may be wrong.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum OdometryWarning {
    /// The network's motion depends on the focal length, which differs from the one trained with.
    #[error(
        "{drive}: its focal length is {ratio:.2} times the one trained with, at network size; poses are not corrected for it"
    )]
    OtherFocalLength {
        /// The drive's name.
        drive: String,
        /// Its focal length divided by the one trained with, both at the network's size.
        ratio: f64,
    },
}

/// A track for each section of the recordings without a gap, and a description of its ground truth. `progress` receives the number of
/// frames done, and of all; `warn` receives warnings.
///
/// # Errors
/// [`TrackError::TooShort`] if no section has two frames; recordings without poses; images that cannot be read.
pub fn tracks(
    predictor: &PosePredictor,
    datasets: &[Dataset],
    warn: &mut dyn FnMut(OdometryWarning),
    progress: &mut dyn FnMut(usize, usize),
) -> Result<(Vec<TrackPair>, &'static str)> {
    let mut stretches = Vec::new();
    let (mut exact, mut integrated, mut tracked) = (0, 0, 0);
    for dataset in datasets {
        if let Some(ratio) = focal_ratio(predictor, dataset)
            && (ratio - 1.0).abs() > FOCAL_TOLERANCE
        {
            let drive = dataset.name().to_owned();
            warn(OdometryWarning::OtherFocalLength { drive, ratio });
        }
        let paths = match exact_paths(dataset)? {
            Some(paths) => {
                exact += 1;
                paths
            }
            None => {
                match dataset.kind() {
                    DatasetKind::KittiRaw => integrated += 1,
                    _ => tracked += 1,
                }
                dataset.camera_paths()?
            }
        };
        let several = paths.len() > 1;
        stretches.extend(paths.into_iter().map(|path| (dataset, path, several)));
    }
    let total = stretches.iter().map(|(_, p, _)| p.frames.len()).sum();
    let both_cameras = datasets.iter().any(|d| d.camera() != datasets[0].camera());
    let mut done = 0;
    let mut tracks = Vec::new();
    let mut names = UniqueNames::default();
    for (dataset, path, several) in stretches {
        let mut motions = Vec::new();
        let mut images: Vec<Vec<f32>> = Vec::new();
        for &frame in &path.frames {
            images.push(predictor.prepare(&dataset.load_image(frame)?));
            if images.len() > PAIRS {
                motions.extend(predictor.motions(&images));
                // The last image of one batch is the first of the next.
                images.drain(..images.len() - 1);
            }
            done += 1;
            progress(done, total);
        }
        motions.extend(predictor.motions(&images));
        let name = names.take(&track_name(dataset, &path, several, both_cameras));
        let track = TrackPair::new(name, path.world_from_cam, chain(&motions))?;
        tracks.push(track.with_times(path.times_s));
    }
    if tracks.is_empty() {
        let name = datasets.first().map_or("the given data", Dataset::name);
        return Err(TrackError::TooShort {
            name: name.to_owned(),
            poses: 1,
        }
        .into());
    }
    let truth = match (exact, integrated, tracked) {
        (_, 0, 0) => "the simulator's exact poses",
        (0, _, 0) => "OXTS attitude and integrated velocity",
        (0, 0, _) => "the recordings' own poses",
        (_, _, 1..) => "each recording's own: exact poses, OXTS, or a tracker's poses",
        _ => {
            "the simulator's exact poses if available, otherwise OXTS attitude and integrated velocity"
        }
    };
    Ok((tracks, truth))
}

/// Writes both trajectories of a track relative to their first pose, and their picture from above, into an existing folder.
///
/// # Errors
/// A file that cannot be written.
pub fn write_track(folder: &Path, track: &TrackPair) -> Result<()> {
    let (truth, predicted) = (from_first(&track.truth), from_first(&track.predicted));
    for (what, poses) in [("truth", &truth), ("predicted", &predicted)] {
        let file = |kind: &str| folder.join(format!("{}_{what}.{kind}", track.name));
        write(&file("txt"), kitti_text(poses))?;
        if track.times_s.len() == poses.len() {
            write(&file("tum"), tum_text(poses, &track.times_s))?;
        }
    }
    // From above: the first camera's x to the right, its z upwards.
    let seen = |poses: &[Se3]| -> Vec<[f64; 2]> {
        let place = |p: &Se3| [p.translation().x, p.translation().z];
        poses.iter().map(place).collect()
    };
    let title = format!("{}: {:.0} m from above", track.name, track.distance_m());
    let svg = TopView::new(title)
        .path("truth", seen(&truth))
        .path("predicted, unscaled", seen(&predicted))
        .to_svg();
    Ok(write(&folder.join(format!("{}.svg", track.name)), svg)?)
}

/// The exact trajectory of a simulated drive; `None` for real ones.
fn exact_paths(dataset: &Dataset) -> Result<Option<Vec<CameraPath>>> {
    let file = dataset.folder().join(EXACT_POSES);
    if dataset.kind() != DatasetKind::KittiRaw
        || dataset.camera() != Camera::Left
        || !file.is_file()
    {
        return Ok(None);
    }
    let poses = PoseFile::read(&file)?.poses;
    let pose = |frame: &usize| -> Option<(usize, f64, Se3)> {
        let number = dataset.frames()[*frame].number;
        let pose = poses.get(usize::try_from(number).ok()?)?;
        Some((*frame, dataset.time_of(number)?, *pose))
    };
    let mut paths = Vec::new();
    for stretch in dataset.stretches() {
        let known: Vec<_> = stretch.iter().filter_map(pose).collect();
        if known.len() == stretch.len() {
            paths.push(CameraPath {
                frames: stretch,
                times_s: known.iter().map(|k| k.1).collect(),
                world_from_cam: known.iter().map(|k| k.2).collect(),
            });
        }
    }
    Ok(Some(paths))
}

/// A drive's name, with the camera if both are evaluated, and with the first frame if the drive has gaps.
fn track_name(dataset: &Dataset, path: &CameraPath, several: bool, cameras: bool) -> String {
    let mut name = dataset.name().to_owned();
    if cameras {
        name += &format!("_{:02}", dataset.camera().number());
    }
    if several {
        let first = path.frames.first().map(|f| dataset.frames()[*f].number);
        name += &format!("_from_{}", first.unwrap_or_default());
    }
    name
}

/// A drive's focal length divided by the one trained with, both at the network's size; `None` if either is unknown.
fn focal_ratio(predictor: &PosePredictor, dataset: &Dataset) -> Option<f64> {
    let train = predictor.training_camera()?;
    let frame = *dataset.selected().first()?;
    let size = predictor.config().size;
    let at_network_size = |k: Intrinsics| k.resized(size.width as u32, size.height as u32);
    let here = at_network_size(dataset.intrinsics(frame));
    Some(here.fx / at_network_size(train).fx)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn another_focal_length_is_reported_as_a_ratio() {
        let warning = OdometryWarning::OtherFocalLength {
            drive: "park".into(),
            ratio: 1.234,
        };
        assert_eq!(
            warning.to_string(),
            "park: its focal length is 1.23 times the one trained with, at network size; poses are not corrected for it"
        );
    }
}
