//! Inspects the contents of recordings.

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

/// Inspects a recording of any layout that [`Dataset::open`] knows. A comma2k19 segment without its video and a bag without a camera
/// are reported with their other streams. If the path has several recordings, unreadable ones are
/// [listed](Inspection::unreadable), and those without images are left out with a note, as by [`Dataset::open`]. A nuScenes data set
/// counts as one recording, because its scenes share their tables.
///
/// Missing times and speeds are not errors, but reported as unknown.
///
/// # Errors
/// Those of [`Dataset::open`] for one recording; for several, only if none can be read, all for the same reason.
pub fn inspect(path: &Path) -> Result<Inspection> {
    inspect_with(path, &OpenOptions::default(), |_| None)
}

/// Like [`inspect`], with a calibration or clock offset from the options, whose camera selection and split are ignored. `time_offset`
/// measures [`DriveInspection::time_offset`]. It is only called for a single drive, and may take long (that of
/// `deepfusion_doctor::inspect` reads a few hundred images).
///
/// # Errors
/// Those of [`inspect`].
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
    // Measuring reads many images. For several drives, the doctor reports the offset of each.
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

/// The contents of several recordings.
#[derive(Default)]
struct InspectedDrives {
    drives: Vec<InspectedDrive>,
    unreadable: Vec<UnopenedRecording>,
    /// Recordings whose only problem is that they have no images.
    without_images: Vec<UnopenedRecording>,
}

impl InspectedDrives {
    /// Adds a recording with its contents.
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

    /// The result. If no drive was opened, recordings without images count as unreadable.
    ///
    /// # Errors
    /// The first error, if no drive was opened and the reason is the same for all.
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
    /// Whether [`Dataset::open`] would leave the recording out: a drive without images of the camera, or a bag without images.
    fn lacks_images(&self) -> bool {
        self.recording.lacks_images(&self.error)
    }

    /// The error's message without the recording's path.
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

/// An opened drive, with its contents.
struct InspectedDrive {
    dataset: Dataset,
    streams: Vec<Stream>,
    drive: DriveInspection,
}

/// Inspects each recording by itself. Training uses the left camera, so the right one is opened only if no recording has images
/// of the left one.
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

/// Pairs slower than this count as unusable, as in training.
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

/// The sum of the known values; `None` if none is known.
fn sum(values: impl Iterator<Item = Option<f64>>) -> Option<f64> {
    values
        .flatten()
        .fold(None, |sum, value| Some(sum.unwrap_or(0.0) + value))
}
