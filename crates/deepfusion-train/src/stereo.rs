//! The other camera's view of the same moment.

use std::collections::{BTreeSet, HashMap};
use std::path::Path;

use deepfusion_data::{Camera, Dataset};
use deepfusion_geometry::{Intrinsics, Se3};

use crate::{Error, NoStereo, SampleSet, TrainConfig, TrainWarning};

/// How far the two cameras' intrinsics may differ, in pixels. Rectified cameras have the same.
const SAME_CAMERA_PX: f64 = 0.5;

/// A view by the drive's other camera.
#[derive(Debug, Clone, PartialEq)]
pub struct StereoSource {
    /// Index of that camera's recording in [`crate::SampleSet::datasets`].
    pub dataset: usize,
    /// Its frame of the same moment.
    pub frame: usize,
    /// Transforms points of the target's camera to that camera, in metres.
    pub source_from_target: Se3,
}

/// Number of these recordings that have a second camera among them with images of the same moments.
///
/// # Errors
/// [`Error::NoStereo`] if a second camera cannot be used as a view: not rectified, or without a common frame.
pub fn recordings_with_stereo(datasets: &[Dataset]) -> Result<usize, Error> {
    let one_set = vec![0; datasets.len()];
    let others = OtherCameras::of(datasets, &one_set);
    let found = (0..datasets.len()).map(|dataset| others.beside(dataset));
    let found: Vec<_> = found.collect::<Result<_, _>>()?;
    Ok(found.into_iter().flatten().count())
}

/// The other cameras of a run's recordings.
pub(crate) struct OtherCameras<'a> {
    datasets: &'a [Dataset],
    /// Indices of the recordings by set, folder, name and camera.
    places: HashMap<(usize, &'a Path, &'a str, Camera), usize>,
    set_of: &'a [usize],
}

/// The other camera of one recording.
pub(crate) struct OtherCamera {
    dataset: usize,
    /// Its frames by their numbers.
    frames: HashMap<u64, usize>,
    source_from_target: Se3,
}

impl<'a> OtherCameras<'a> {
    pub(crate) fn of(datasets: &'a [Dataset], set_of: &'a [usize]) -> Self {
        let place =
            |(i, d): (usize, &'a Dataset)| ((set_of[i], d.folder(), d.name(), d.camera()), i);
        Self {
            places: datasets.iter().enumerate().map(place).collect(),
            datasets,
            set_of,
        }
    }

    /// The second camera of a recording; `None` if it has only one.
    ///
    /// # Errors
    /// [`Error::NoStereo`] if there are two cameras and neither can be used as a view of the other.
    pub(crate) fn beside(&self, dataset: usize) -> Result<Option<OtherCamera>, Error> {
        let own = &self.datasets[dataset];
        let fail = |why| Error::NoStereo {
            drive: own.name().to_owned(),
            why,
        };
        let camera = match own.camera() {
            Camera::Left => Camera::Right,
            Camera::Right => Camera::Left,
        };
        let place = (self.set_of[dataset], own.folder(), own.name(), camera);
        let Some(&other) = self.places.get(&place) else {
            return Ok(None);
        };
        let theirs = &self.datasets[other];
        let mounts = own.cam_from_vehicle().zip(theirs.cam_from_vehicle());
        let (here, there) = mounts.ok_or_else(|| fail(NoStereo::NoBaseline))?;
        let source_from_target = there * here.inverse();
        let (angle, baseline_m) = (
            source_from_target.angle(),
            source_from_target.translation().norm(),
        );
        if baseline_m < 1e-3 {
            return Err(fail(NoStereo::NoBaseline));
        }
        let first = own.selected().first().zip(theirs.selected().first());
        let (a, b) = first.ok_or_else(|| fail(NoStereo::NoCommonFrame))?;
        if angle > 1e-3 || !same(own.intrinsics(*a), theirs.intrinsics(*b)) {
            return Err(fail(NoStereo::NotRectified));
        }
        let frames = theirs.frames().iter().enumerate();
        let frames: HashMap<u64, usize> = frames.map(|(i, frame)| (frame.number, i)).collect();
        let mut own_frames = own.selected().iter().map(|i| own.frames()[*i].number);
        if !own_frames.any(|number| frames.contains_key(&number)) {
            return Err(fail(NoStereo::NoCommonFrame));
        }
        Ok(Some(OtherCamera {
            dataset: other,
            frames,
            source_from_target,
        }))
    }
}

impl OtherCamera {
    /// This camera's view of the frame with this number, if it has that frame.
    pub(crate) fn at(&self, number: u64) -> Option<StereoSource> {
        Some(StereoSource {
            dataset: self.dataset,
            frame: *self.frames.get(&number)?,
            source_from_target: self.source_from_target,
        })
    }
}

/// The warning about drives that learn without a second camera's view in a run with stereo.
pub(crate) fn warning(config: &TrainConfig, samples: &SampleSet) -> Option<TrainWarning> {
    if !config.stereo {
        return None;
    }
    let alone = samples.samples.iter().filter(|s| s.stereo.is_none());
    let alone: BTreeSet<usize> = alone.map(|sample| sample.dataset).collect();
    let first = samples.datasets.get(*alone.first()?)?.name();
    Some(TrainWarning::OneCamera {
        drive: first.to_owned(),
        others: alone.len() - 1,
    })
}

fn same(a: Intrinsics, b: Intrinsics) -> bool {
    let apart = [a.fx - b.fx, a.fy - b.fy, a.cx - b.cx, a.cy - b.cy];
    (a.width, a.height) == (b.width, b.height) && apart.iter().all(|d| d.abs() < SAME_CAMERA_PX)
}
