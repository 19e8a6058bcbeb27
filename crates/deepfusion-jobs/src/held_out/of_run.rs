//! Finds out what a run and its ancestors have seen.

use std::collections::HashSet;
use std::path::{Path, PathBuf};

use deepfusion_data::{Dataset, Frame};
use deepfusion_model::{AveragedNetwork, RunFolder, TrainConfig};
use deepfusion_runtime::embedded;
use deepfusion_train::SampleSet;
use deepfusion_weights::Shipped;

use super::{is_run, unseen};
use crate::evaluation::ImageRef;
use crate::recordings::{training_recordings, validates};
use crate::verdict::Unseen;

/// Identifies a frame across copies of its drive: the drive's name, the frame's number and the size of its image's file.
type FrameKey = (String, u64, u64);

/// Whether none of the evaluated frames was a target or a source in the training of this run, of those it started from, and of those that
/// it is the mean of (`averaged`, from its findings). `None` if that is unknown: recordings no longer exist, or a network was trained
/// elsewhere.
#[must_use]
pub fn held_out(
    config: &TrainConfig,
    averaged: &[AveragedNetwork],
    datasets: &[Dataset],
    places: &[ImageRef],
) -> Option<bool> {
    let seen = seen_by(config, averaged, datasets, &mut HashSet::new())?;
    let mut measured = places
        .iter()
        .map(|ImageRef(number, frame)| &datasets[*number].frames()[*frame]);
    Some(measured.all(|frame| !seen.contains(&key(frame))))
}

/// The frames of the recordings that training did not see; training as in [`held_out`].
#[must_use]
pub fn unseen_frames(
    config: &TrainConfig,
    averaged: &[AveragedNetwork],
    datasets: &[Dataset],
) -> Unseen {
    let Some(seen) = seen_by(config, averaged, datasets, &mut HashSet::new()) else {
        return Unseen::NotKnown;
    };
    let mut known = HashSet::new();
    for (number, dataset) in datasets.iter().enumerate() {
        let frames = dataset.frames().iter().enumerate();
        let seen = frames.filter(|(_, frame)| seen.contains(&key(frame)));
        known.extend(seen.map(|(frame, _)| (number, frame)));
    }
    if known.is_empty() {
        Unseen::All
    } else {
        Unseen::Except(known)
    }
}

/// The frames seen by a run, those it started from, and those that it is the mean of. `datasets` are the evaluated recordings.
fn seen_by(
    config: &TrainConfig,
    averaged: &[AveragedNetwork],
    datasets: &[Dataset],
    runs: &mut HashSet<PathBuf>,
) -> Option<HashSet<FrameKey>> {
    let mut config = config.clone();
    if validates(&config) {
        // With separate validation recordings, all training recordings were used.
        config.validation_share = 0.0;
    }
    let recordings = training_recordings(&config).ok()?;
    let (train, _, _) = SampleSet::split_unread(&config, recordings, None).ok()?;
    let mut seen = HashSet::new();
    for sample in &train.samples {
        let of = |(dataset, frame): (usize, usize)| keys(&train.datasets[dataset].frames()[frame]);
        seen.extend(of((sample.dataset, sample.snippet.target)));
        seen.extend(sample.sources().flat_map(of));
    }
    for frame in &train.depth.frames {
        seen.extend(keys(&train.datasets[frame.dataset].frames()[frame.frame]));
    }
    if let Some(init) = &config.init {
        let sha256 = config.init_sha256.as_deref();
        seen.extend(seen_before(init, sha256, datasets, runs)?);
    }
    for network in averaged {
        let sha256 = network.sha256.as_deref();
        seen.extend(seen_before(&network.path, sha256, datasets, runs)?);
    }
    Some(seen)
}

/// The frames seen by weights that a run started from or is the mean of. Weights that are not a run's were trained on other images
/// (ImageNet).
fn seen_before(
    init: &Path,
    sha256: Option<&str>,
    datasets: &[Dataset],
    runs: &mut HashSet<PathBuf>,
) -> Option<HashSet<FrameKey>> {
    let packed = match sha256 {
        Some(sha256) => {
            let network = embedded(init).ok()??;
            // An embedded network with the same name but other weights says nothing about the ancestor.
            (network.card.sha256 == sha256).then_some(())?;
            Some(*network)
        }
        None if Shipped::is_at(init) => Some(Shipped::read(init).ok()?),
        None => None,
    };
    if let Some(network) = packed {
        return unseen(&network.card, datasets).then(HashSet::new);
    }
    if !init.exists() {
        return None;
    }
    if !is_run(init) {
        return Some(HashSet::new());
    }
    let (folder, _) = RunFolder::open(init).ok()?;
    if !runs.insert(folder.path().to_owned()) {
        return Some(HashSet::new());
    }
    let (config, findings) = (folder.read_config().ok()?, folder.read_findings().ok()?);
    seen_by(&config, &findings.averaged, datasets, runs)
}

fn key(frame: &Frame) -> FrameKey {
    key_of(frame, frame.image.path())
}

fn key_of(frame: &Frame, image: &Path) -> FrameKey {
    let size = std::fs::metadata(image).map_or(0, |meta| meta.len());
    (frame.drive.clone(), frame.number, size)
}

/// The keys of a frame that was seen: its own, and that of the stereo pair's other image, which shows the same street at the same time.
fn keys(frame: &Frame) -> impl Iterator<Item = FrameKey> {
    let other = other_camera(frame.image.path()).filter(|image| image.is_file());
    let other = other.map(|image| key_of(frame, &image));
    std::iter::once(key(frame)).chain(other)
}

/// The path of the other colour camera's image in KITTI's layouts.
fn other_camera(image: &Path) -> Option<PathBuf> {
    const PAIRS: [[&str; 2]; 2] = [["image_02", "image_03"], ["image_2", "image_3"]];
    let swapped = |name: &std::ffi::OsStr| {
        let pairs = PAIRS.iter();
        let mut sides = pairs.flat_map(|[left, right]| [(left, right), (right, left)]);
        sides.find_map(|(side, other)| (name == *side).then_some(*other))
    };
    let mut found = false;
    let parts = image.iter().rev().map(|part| match swapped(part) {
        Some(other) if !std::mem::replace(&mut found, true) => std::ffi::OsStr::new(other),
        _ => part,
    });
    // The innermost folder with that name is the camera's.
    let parts: Vec<_> = parts.collect();
    found.then(|| parts.into_iter().rev().collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_other_cameras_image_is_found_by_its_path() {
        let other = |path: &str| other_camera(Path::new(path));
        let left = "/kitti/image_02/2011_09_26_drive_0005_sync/image_02/data/0000000004.png";
        let right = "/kitti/image_02/2011_09_26_drive_0005_sync/image_03/data/0000000004.png";
        assert_eq!(other(left), Some(right.into()));
        assert_eq!(other(right), Some(left.into()));
        assert_eq!(
            other("04/image_3/000004.png"),
            Some("04/image_2/000004.png".into())
        );
        assert_eq!(other("images/0000000004.png"), None);
    }
}
