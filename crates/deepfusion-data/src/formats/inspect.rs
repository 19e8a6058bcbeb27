//! What is in a recording.

use super::layout::Layout;
use super::shared::files::name_of;
use super::{bag, comma};
use crate::{
    Cameras, ClockOffset, DataWarning, Dataset, DatasetKind, DriveInspection, Error, GtKind,
    IncompleteWarning, Inspection, IntrinsicsSummary, OpenOptions, Result, SpeedRange, Stream,
    Unreadable,
};
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Looks into a recording of any layout that [`Dataset::open`] knows. A comma2k19 segment whose video is
/// absent, and a bag without a camera, are reported by their other streams. Where the path holds several recordings, those that cannot be
/// read are [listed](Inspection::unreadable) beside the others, and those without images are left out as [`Dataset::open`] leaves them out,
/// with a note; a nuScenes data set is one, as its scenes share their tables.
///
/// # Errors
/// As [`Dataset::open`] of one recording, and of several where none can be read and all for one reason; times and speeds may be missing and
/// are then reported as unknown.
pub fn inspect(path: &Path) -> Result<Inspection> {
    inspect_with(path, &OpenOptions::default(), |_| None)
}

/// [`inspect`] with a camera or a clock offset given; camera and split of the options are not taken. `time_offset` measures
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
    layout.check_options(path, options)?;
    let passed_over = layout.passed_over(path);
    let mut inspection = inspect_layout(path, layout, options, time_offset)?;
    if let Some(first) = inspection.drives.first_mut() {
        first.warnings.extend(passed_over.map(DataWarning::from));
    }
    Ok(inspection)
}

fn inspect_layout(
    path: &Path,
    layout: Layout,
    options: &OpenOptions,
    time_offset: impl FnOnce(&Dataset) -> Option<ClockOffset>,
) -> Result<Inspection> {
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
    let kind = layout.kind();
    let InspectedDrives {
        mut drives,
        unreadable,
        without_images,
    } = inspect_all(path, layout, options).or_one_reason()?;
    // Measuring reads many pictures: of many drives the doctor reports it one by one.
    if let [only] = drives.as_mut_slice() {
        only.drive.time_offset = time_offset(&only.dataset);
    }
    if let Some(first) = drives.first_mut()
        && !without_images.is_empty()
    {
        let names = without_images.iter().map(|one| name_of(&one.path));
        let left_out = IncompleteWarning::NoImages {
            camera: (kind != DatasetKind::Bag).then_some(first.drive.camera),
            recordings: names.collect(),
        };
        first.drive.warnings.push(left_out.into());
    }
    let several = drives.len() > 1;
    let mut streams = Vec::new();
    for one in &mut drives {
        for mut stream in std::mem::take(&mut one.streams) {
            if several {
                stream.name = format!("{}/{}", one.dataset.name(), stream.name);
            }
            streams.push(stream);
        }
    }
    let k = drives.first().map(|first| first.dataset.intrinsics(0));
    Ok(Inspection {
        kind,
        frames: drives.iter().map(|one| one.drive.frames).sum(),
        size: k.map(|k| [k.width, k.height]),
        intrinsics: k.map(IntrinsicsSummary::from),
        streams,
        speed_mps: SpeedRange::of(drives.iter().flat_map(|one| speeds(&one.dataset))),
        distance_m: sum(drives.iter().map(|one| one.drive.distance_m)),
        duration_s: sum(drives.iter().map(|one| one.drive.duration_s)),
        drives: drives.into_iter().map(|one| one.drive).collect(),
        unreadable: unreadable
            .into_iter()
            .map(UnopenedRecording::listed)
            .collect(),
    })
}

/// What several recordings hold.
#[derive(Default)]
struct InspectedDrives {
    drives: Vec<InspectedDrive>,
    unreadable: Vec<UnopenedRecording>,
    /// Those with which nothing is wrong but that they have no images.
    without_images: Vec<UnopenedRecording>,
}

impl InspectedDrives {
    /// A recording, and what is in it.
    fn add(&mut self, path: PathBuf, recording: Layout, inspected: Result<Vec<InspectedDrive>>) {
        let error = match inspected {
            Ok(drives) => {
                self.drives.extend(drives);
                return;
            }
            Err(error) => error,
        };
        let unread = UnopenedRecording {
            path,
            recording,
            error,
        };
        if unread.lacks_images() {
            self.without_images.push(unread);
        } else {
            self.unreadable.push(unread);
        }
    }

    /// What was found. Where no drive was opened, those without images are among what cannot be read.
    ///
    /// # Errors
    /// The first where no drive was opened and one reason says why.
    fn or_one_reason(mut self) -> Result<Self> {
        if !self.drives.is_empty() {
            return Ok(self);
        }
        let lack_images = self.unreadable.is_empty();
        self.unreadable.append(&mut self.without_images);
        let mut reasons = self.unreadable.iter().map(UnopenedRecording::reason);
        let first = reasons.next();
        if lack_images || reasons.all(|reason| Some(reason) == first) {
            let first = self.unreadable.into_iter().next();
            return match first {
                Some(first) => Err(first.error),
                None => Ok(Self::default()),
            };
        }
        Ok(self)
    }
}

/// A recording that was not opened.
struct UnopenedRecording {
    path: PathBuf,
    recording: Layout,
    error: Error,
}

impl UnopenedRecording {
    /// As [`Dataset::open`] leaves recordings out: drives without images of the camera, and bags that give none.
    fn lacks_images(&self) -> bool {
        self.recording.lacks_images(&self.error)
    }

    /// What is wrong, without the recording's own name.
    fn reason(&self) -> String {
        let path = self.path.display().to_string();
        self.error.to_string().replace(&path, "")
    }

    fn listed(self) -> Unreadable {
        Unreadable {
            path: self.path,
            error: Arc::new(self.error),
        }
    }
}

/// A drive that was opened, and what is in it.
struct InspectedDrive {
    dataset: Dataset,
    streams: Vec<Stream>,
    drive: DriveInspection,
}

/// Inspects each recording by itself. The left camera is the one that is trained on: the right one is opened only where no recording
/// has images of the left one.
fn inspect_all(path: &Path, layout: Layout, options: &OpenOptions) -> InspectedDrives {
    let mut found = InspectedDrives::default();
    for (path, recording) in layout.apart(path) {
        let inspected = inspect_one(&path, &recording, Cameras::Left, options);
        found.add(path, recording, inspected);
    }
    if found.drives.is_empty() && found.unreadable.is_empty() {
        for unread in std::mem::take(&mut found.without_images) {
            let UnopenedRecording {
                path,
                recording,
                error,
            } = unread;
            let inspected = match error {
                Error::NoImages { .. } => inspect_one(&path, &recording, Cameras::Right, options),
                other => Err(other),
            };
            found.add(path, recording, inspected);
        }
    }
    found
}

fn inspect_one(
    path: &Path,
    recording: &Layout,
    camera: Cameras,
    options: &OpenOptions,
) -> Result<Vec<InspectedDrive>> {
    let options = OpenOptions {
        camera,
        split: None,
        ..options.clone()
    };
    let inspect = |dataset: Dataset| -> Result<InspectedDrive> {
        let (streams, drive) = (dataset.streams()?, inspect_dataset(&dataset)?);
        Ok(InspectedDrive {
            dataset,
            streams,
            drive,
        })
    };
    let datasets = recording.open(path, &options)?;
    datasets.into_iter().map(inspect).collect()
}

/// Pairs slower than this are counted as unusable, as in training.
const MIN_SPEED_MPS: f64 = 0.5;

fn inspect_dataset(dataset: &Dataset) -> Result<DriveInspection> {
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
