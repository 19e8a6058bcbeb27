//! Recognises layouts.

mod found_instead;
mod neighbours;

use super::kitti::{self, Drive, drive_around, find_drives};
use super::{bag, comma, folder, kitti_odometry, kitti360, nuscenes, rgbd, video};
use crate::dataset::selection::Selection;
use crate::dataset_toml::FolderConfig;
use crate::formats::shared::files::{folders, name_of};
use crate::{
    ConfigProblem, Dataset, DatasetKind, Error, FoundInstead, IncompleteWarning, OpenOptions,
    Result,
};
use deepfusion_rosbag::MessageSource;
use deepfusion_video::is_video;
use neighbours::{NeighbourSearch, contains_outputs, unread};
use std::path::{Path, PathBuf};
use std::sync::Arc;

impl Dataset {
    /// Opens a recording of any known layout, which is recognised by its files. A KITTI raw drive, date or root gives one data set for
    /// each drive and camera, in order of names; KITTI odometry one for each sequence, KITTI-360 one for each drive, nuScenes one for
    /// each scene. A bag, a folder of images, a video file, a comma2k19 segment and a folder of RGB-D frames give one. A folder of such
    /// recordings whose `dataset.toml` has `for_folders = true` gives those of each. Drives without images of the camera, or without a
    /// selected frame, are left out.
    ///
    /// The sizes of all images are checked against the calibration. Times and speeds may be missing
    /// (evaluation needs neither), but must be readable if they exist. If something else in the folder looks like a recording, the
    /// first data set has a [warning](Self::warnings) about it ([`Self::passed_over`]).
    ///
    /// # Errors
    /// [`Error::UnknownLayout`] if no layout fits, [`Error::FolderOfRecordings`], [`Error::File`], [`Error::Missing`]
    /// (calibration), [`Error::NoImages`], [`Error::OneCamera`], [`Error::FrameSize`], [`Error::Image`],
    /// [`Error::SplitSelectsNothing`], and errors in the layout's files:
    /// [`Error::Calibration`], [`Error::TimeStamp`], [`Error::NoTimeStamp`], [`Error::Oxts`],
    /// [`Error::Table`], [`Error::Config`], [`Error::Clocks`], [`Error::Video`], [`Error::Topic`],
    /// [`Error::Frames`], [`Error::NoTopics`], [`Error::Pose`], [`Error::Json`],
    /// [`Error::SeveralVersions`].
    pub fn open(path: &Path, options: &OpenOptions) -> Result<Vec<Self>> {
        Layout::of(path)?.open_warning(path, options)
    }

    /// The layout as which [`Self::open`] would read a path, found without opening it.
    ///
    /// # Errors
    /// [`Error::UnknownLayout`], [`Error::FolderOfRecordings`], [`Error::File`], [`Error::Config`], [`Error::SeveralVersions`].
    pub fn kind_at(path: &Path) -> Result<DatasetKind> {
        Ok(Layout::of(path)?.kind())
    }

    /// Whether every recording at a path is marked as simulated by the files beside its images ([`Self::is_simulated`]), found without
    /// opening it; for a bag, only the file beside it counts. `false` if there is no recording.
    #[must_use]
    pub fn all_simulated_at(path: &Path) -> bool {
        Layout::of(path).is_ok_and(|layout| layout.marked_as_simulated())
    }

    /// Opens a recording of messages, such as a bag in another format, like [`Self::open`] opens a bag: topics are found
    /// by type, and the file beside [`MessageSource::path`] adds settings.
    ///
    /// # Errors
    /// Those of [`Self::open`].
    pub fn from_messages(source: Arc<dyn MessageSource>, options: &OpenOptions) -> Result<Self> {
        let path = source.path().to_owned();
        bag::open_bag(source, options)?.select(&path, options)
    }
}

/// The recording at a path.
#[derive(Debug)]
pub(crate) enum Layout {
    Kitti(Vec<Drive>),
    KittiOdometry(Vec<PathBuf>),
    Kitti360(Vec<kitti360::Drive>),
    NuScenes(nuscenes::TableFolder),
    Comma(PathBuf),
    RgbD(Vec<PathBuf>),
    Bags(Vec<PathBuf>),
    Folder(PathBuf),
    Video(PathBuf),
    /// The recordings in the subfolders of a folder whose settings apply to them.
    Several(Vec<(PathBuf, Layout)>),
}

impl Layout {
    /// The first layout that fits.
    ///
    /// # Errors
    /// [`Error::File`], [`Error::UnknownLayout`], [`Error::FolderOfRecordings`], [`Error::SeveralVersions`].
    pub(crate) fn of(path: &Path) -> Result<Self> {
        if let Some(layout) = Self::known(path)? {
            return Ok(layout);
        }
        let mut recordings = folders(path)?;
        if FolderConfig::read_for_folders(path)?.is_some() {
            let mut found = Vec::new();
            // Skip predictions and decoded frames, which are images too.
            for folder in recordings.iter().filter(|folder| !contains_outputs(folder)) {
                // An invalid recording is an error, not silently left out.
                found.extend(Self::known(folder)?.map(|layout| (folder.clone(), layout)));
            }
            if !found.is_empty() {
                return Ok(Self::Several(found));
            }
        }
        recordings.retain(|inner| matches!(Self::known(inner), Ok(Some(_))));
        let path = path.to_owned();
        Err(match recordings.first() {
            Some(first) => Error::FolderOfRecordings {
                count: recordings.len(),
                such_as: first.clone(),
                path,
            },
            None => Error::UnknownLayout {
                found: found_instead::folder(&path)?,
                path,
            },
        })
    }

    /// The first layout that fits; `None` for a folder that fits none.
    ///
    /// # Errors
    /// Those of [`Self::of`].
    fn known(path: &Path) -> Result<Option<Self>> {
        let sequences = kitti_odometry::find(path)?;
        if !sequences.is_empty() {
            return Ok(Some(Self::KittiOdometry(sequences)));
        }
        // Before KITTI raw: KITTI-360's fisheye cameras 2 and 3 have the same names as KITTI raw's cameras.
        let drives = kitti360::find(path)?;
        if !drives.is_empty() {
            return Ok(Some(Self::Kitti360(drives)));
        }
        if let Some(place) = nuscenes::find(path)? {
            return Ok(Some(Self::NuScenes(place)));
        }
        let drives = find_drives(path)?;
        if !drives.is_empty() {
            return Ok(Some(Self::Kitti(drives)));
        }
        // Resolve `.` and links to get a name.
        let real = path.canonicalize().map_err(|e| Error::file(path, e))?;
        let unknown = |found| Error::UnknownLayout {
            path: path.to_owned(),
            found,
        };
        let given = named(path, &real);
        // Check both names: the link or its target may have no extension.
        if bag::is_bag(&given) || bag::is_bag(&real) {
            return Ok(Some(Self::Bags(vec![given])));
        }
        if !real.is_dir() {
            return if is_video(&real) {
                Ok(Some(Self::Video(real)))
            } else {
                Err(unknown(found_instead::file(&real)))
            };
        }
        if let Some(drive) = drive_around(&real) {
            return Err(unknown(FoundInstead::PartOf { drive }));
        }
        if comma::is_segment(&real) {
            return Ok(Some(Self::Comma(real)));
        }
        let bags = bag::bags_in(&real)?;
        if !bags.is_empty() {
            return Ok(Some(Self::Bags(bags)));
        }
        let rgbd = rgbd::find(&real)?;
        if !rgbd.is_empty() {
            return Ok(Some(Self::RgbD(rgbd)));
        }
        let (images, video) = (folder::has_images(&real)?, video::in_folder(&real)?);
        match (images, video) {
            (true, Some(video)) if !video.named => Err(Error::Config {
                path: real.join(FolderConfig::NAME),
                problem: ConfigProblem::ImagesAndVideo { video: video.file },
            }),
            (_, Some(_)) => Ok(Some(Self::Video(real))),
            (true, None) => Ok(Some(Self::Folder(real))),
            (false, None) => Ok(None),
        }
    }

    /// The layout's kind.
    pub(crate) fn kind(&self) -> DatasetKind {
        match self {
            Self::Kitti(_) => DatasetKind::KittiRaw,
            Self::KittiOdometry(_) => DatasetKind::KittiOdometry,
            Self::Kitti360(_) => DatasetKind::Kitti360,
            Self::NuScenes(_) => DatasetKind::NuScenes,
            Self::Comma(_) => DatasetKind::Comma2k19,
            Self::RgbD(_) => DatasetKind::RgbD,
            Self::Bags(_) => DatasetKind::Bag,
            Self::Folder(_) => DatasetKind::Folder,
            Self::Video(_) => DatasetKind::Video,
            Self::Several(all) => {
                let mut kinds = all.iter().map(|(_, layout)| layout.kind());
                let first = kinds.next().unwrap_or(DatasetKind::Other);
                if kinds.all(|kind| kind == first) {
                    first
                } else {
                    DatasetKind::Other
                }
            }
        }
    }

    /// Whether the files beside the images mark every recording as simulated.
    fn marked_as_simulated(&self) -> bool {
        let is_marked =
            |folder: &Path| FolderConfig::read(folder).is_ok_and(|config| config.simulated);
        match self {
            Self::Kitti(drives) => drives.iter().all(Drive::is_simulated),
            Self::Bags(bags) => bags.iter().all(|bag| bag::marked_as_simulated(bag)),
            Self::RgbD(folders) => folders.iter().all(|folder| is_marked(folder)),
            Self::Comma(folder) | Self::Folder(folder) => is_marked(folder),
            Self::Video(place) if place.is_dir() => is_marked(place),
            Self::Video(file) => file.parent().is_some_and(is_marked),
            Self::Several(all) => all.iter().all(|(_, layout)| layout.marked_as_simulated()),
            Self::KittiOdometry(_) | Self::Kitti360(_) | Self::NuScenes(_) => false,
        }
    }

    /// Whether an error only means that a recording has no images, so that it is left out if there are several.
    pub(crate) fn lacks_images(&self, error: &Error) -> bool {
        match error {
            Error::NoImages { .. } => true,
            Error::NoFrames { .. } => self.kind() == DatasetKind::Bag,
            _ => false,
        }
    }

    /// Refuses topics for recordings other than bags, and a camera for layouts with a calibration, instead of silently ignoring them.
    ///
    /// # Errors
    /// [`Error::NoTopics`], [`Error::OwnCalibration`].
    pub(crate) fn check_options(&self, path: &Path, options: &OpenOptions) -> Result<()> {
        if let Self::Several(all) = self {
            let check = |(folder, layout): &(PathBuf, Self)| layout.check_options(folder, options);
            return all.iter().try_for_each(check);
        }
        if let (false, Some(topic)) = (matches!(self, Self::Bags(_)), options.topics.first()) {
            return Err(Error::NoTopics {
                path: path.to_owned(),
                layout: self.kind().label(),
                topic: topic.clone(),
            });
        }
        if options.gives_camera() && self.kind().has_own_calibration() {
            return Err(Error::OwnCalibration {
                path: path.to_owned(),
                layout: self.kind().label(),
            });
        }
        Ok(())
    }

    /// The warning about what else in the folder at a path looks like a recording and is not read; `None` if there is nothing, or the path
    /// is a file.
    pub(crate) fn passed_over(&self, path: &Path) -> Option<IncompleteWarning> {
        let folder = path.canonicalize().ok()?;
        // A ROS 2 bag may be a folder of files.
        if !folder.is_dir() || [path, folder.as_path()].into_iter().any(bag::is_bag) {
            return None;
        }
        let used = self.used(&folder);
        let wanted = NeighbourSearch {
            used: &used,
            // For these layouts a video is the recording itself, or excluded by `dataset.toml`.
            videos: !matches!(self, Self::Comma(_) | Self::Folder(_) | Self::Video(_)),
            folders: match self {
                Self::Kitti(_) => !used.contains(&folder),
                Self::RgbD(_)
                | Self::Bags(_)
                | Self::Folder(_)
                | Self::Video(_)
                | Self::Several(_) => true,
                _ => false,
            },
        };
        let recordings = unread(&folder, wanted);
        (!recordings.is_empty()).then(|| IncompleteWarning::PassedOver {
            // `.` and `..` are not names.
            folder: match path.file_name() {
                Some(_) => path.to_owned(),
                None => folder,
            },
            layout: self.kind(),
            recordings,
        })
    }

    /// The files and folders that are read for a recording in a folder, if they could be mistaken for other recordings.
    fn used(&self, folder: &Path) -> Vec<PathBuf> {
        match self {
            Self::Kitti(drives) => drives.iter().map(|drive| drive.folder.clone()).collect(),
            Self::RgbD(places) | Self::Bags(places) => places.clone(),
            Self::Several(all) => {
                let names = all.iter().filter_map(|(place, _)| place.file_name());
                names.map(|name| folder.join(name)).collect()
            }
            Self::Folder(_) | Self::Video(_) => {
                let config = FolderConfig::read(folder).unwrap_or_default();
                let mut places = config.places(folder);
                if matches!(self, Self::Folder(_)) {
                    places.extend(folder::images_folder(folder, &config).ok());
                }
                // Resolve `..` and links too.
                let resolved = places.iter().filter_map(|place| place.canonicalize().ok());
                let resolved: Vec<PathBuf> = resolved.collect();
                places.extend(resolved);
                places
            }
            _ => Vec::new(),
        }
    }

    /// Splits several recordings into single ones, with their files or folders. Those with common tables stay together.
    pub(crate) fn apart(self, path: &Path) -> Vec<(PathBuf, Self)> {
        match self {
            Self::Kitti(drives) => each(drives, |drive| drive.folder.clone(), Self::Kitti),
            Self::KittiOdometry(sequences) => each(sequences, PathBuf::clone, Self::KittiOdometry),
            Self::Kitti360(drives) => each(drives, |drive| drive.folder.clone(), Self::Kitti360),
            Self::RgbD(sequences) => each(sequences, PathBuf::clone, Self::RgbD),
            Self::Bags(bags) => each(bags, PathBuf::clone, Self::Bags),
            Self::Several(all) => {
                let apart = |(folder, layout): (PathBuf, Self)| layout.apart(&folder);
                all.into_iter().flat_map(apart).collect()
            }
            single => vec![(path.to_owned(), single)],
        }
    }

    /// Opens what was found, and adds a warning to the first data set about what else looks like a recording.
    fn open_warning(&self, path: &Path, options: &OpenOptions) -> Result<Vec<Dataset>> {
        let mut datasets = self.open(path, options)?;
        if let (Some(first), Some(warning)) = (datasets.first_mut(), self.passed_over(path)) {
            first.warn(warning);
        }
        Ok(datasets)
    }

    /// Opens what was found.
    pub(crate) fn open(&self, path: &Path, options: &OpenOptions) -> Result<Vec<Dataset>> {
        self.check_options(path, options)?;
        let one = |dataset: Result<Dataset>| Ok(vec![dataset?.select(path, options)?]);
        match self {
            Self::Kitti(drives) => kitti::open(path, drives, options),
            Self::KittiOdometry(sequences) => kitti_odometry::open(path, sequences, options),
            Self::Kitti360(drives) => kitti360::open(path, drives, options),
            Self::NuScenes(place) => nuscenes::open(path, place, options),
            Self::Comma(folder) => one(comma::open(folder, options)),
            Self::RgbD(folders) => rgbd::open(path, folders, options),
            Self::Bags(bags) => bag::open(path, bags, options),
            Self::Folder(folder) => one(folder::open(folder, options)),
            Self::Video(place) => one(video::open(place, options)),
            Self::Several(all) => open_several(path, all, options),
        }
    }
}

/// Opens several recordings, except those without images of the camera or without a selected frame.
fn open_several(
    path: &Path,
    all: &[(PathBuf, Layout)],
    options: &OpenOptions,
) -> Result<Vec<Dataset>> {
    let (mut datasets, mut without_images) = (Vec::<Dataset>::new(), Vec::new());
    let mut refused = None;
    for (folder, layout) in all {
        match layout.open_warning(folder, options) {
            Ok(found) => datasets.extend(found),
            Err(Error::SplitSelectsNothing { .. }) => {
                refused = Selection::new(options).nothing_selected(path);
            }
            Err(error) if layout.lacks_images(&error) => {
                without_images.push(name_of(folder));
                refused = refused.or(Some(error));
            }
            Err(other) => return Err(other),
        }
    }
    match (datasets.first_mut(), refused) {
        (None, Some(error)) => Err(error),
        (Some(first), _) if !without_images.is_empty() => {
            first.warn(IncompleteWarning::NoImages {
                camera: None,
                recordings: without_images,
            });
            Ok(datasets)
        }
        _ => Ok(datasets),
    }
}

/// A layout for each item, with its path.
fn each<T>(
    all: Vec<T>,
    place: impl Fn(&T) -> PathBuf,
    layout: impl Fn(Vec<T>) -> Layout,
) -> Vec<(PathBuf, Layout)> {
    let single = |one: T| (place(&one), layout(vec![one]));
    all.into_iter().map(single).collect()
}

/// The path as given, with unresolved links, since a bag's file may be beside the link; the resolved path if the given
/// one does not end in a name (`..`).
fn named(path: &Path, real: &Path) -> PathBuf {
    let given = std::path::absolute(path).ok();
    given
        .filter(|given| given.file_name().is_some())
        .unwrap_or_else(|| real.to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs;

    /// Writes empty files, with their folders.
    fn write(at: &Path, files: &[&str]) {
        for file in files {
            let path = at.join(file);
            fs::create_dir_all(path.parent().unwrap()).unwrap();
            fs::write(path, "").unwrap();
        }
    }

    fn passed_over(at: &Path) -> Option<String> {
        let found = Layout::of(at).unwrap().passed_over(at);
        found.map(|warning| warning.to_string())
    }

    #[test]
    fn files_named_in_dataset_toml_are_not_other_recordings() {
        let root = tempfile::tempdir().unwrap();
        let at = root.path();
        write(
            at,
            &[
                "clips/drive.mp4",
                "logs/speed.csv",
                "unit/speed.csv",
                "kept/speed.csv",
            ],
        );
        // The cache's path is relative to the video's folder.
        let named = "video = 'clips/drive.mp4'\nspeed = './logs/speed.csv'\nimu = 'logs/../unit/speed.csv'\ncache = '../kept'\n";
        fs::write(at.join(FolderConfig::NAME), named).unwrap();
        assert_eq!(Layout::of(at).unwrap().kind(), DatasetKind::Video);
        assert_eq!(passed_over(at), None);
        // The outputs of a live run are not recordings either.
        write(at, &["live/live_video.mp4", "live/live-0.json"]);
        assert_eq!(passed_over(at), None);
        write(at, &["other/clip.mp4"]);
        let expected = format!(
            "{} is read only as a video; other in it looks like a recording and is not read (give it by its own path)",
            at.display()
        );
        assert_eq!(passed_over(at), Some(expected));
    }

    /// In a folder whose settings apply to its subfolders.
    #[test]
    fn outputs_are_not_recordings_and_deeper_folders_are_reported() {
        let root = tempfile::tempdir().unwrap();
        let at = root.path();
        let files = [
            "monday/0.png",
            "tuesday/0.png",
            "out/0_depth.png",
            "out/predict-1-of-1.manifest.json",
            "found/0_overlay.png",
            "found/targets.jsonl",
            "drive.mp4.frames/0000000000.jpg",
            "drive.mp4.frames/origin.json",
            "notes/read.me",
        ];
        write(at, &files);
        fs::write(at.join(FolderConfig::NAME), "for_folders = true\n").unwrap();
        let Layout::Several(found) = Layout::of(at).unwrap() else {
            panic!("no fleet");
        };
        let names: Vec<String> = found.iter().map(|(place, _)| name_of(place)).collect();
        assert_eq!(names, ["monday", "tuesday"]);
        assert_eq!(passed_over(at), None);
        write(at, &["week/monday/0.png", "week/dataset.toml"]);
        let message = passed_over(at).unwrap();
        assert!(
            message.contains("week in it looks like a recording and is not read"),
            "{message}"
        );
    }

    #[test]
    fn the_folder_of_images_is_not_another_recording() {
        let root = tempfile::tempdir().unwrap();
        let at = root.path();
        write(at, &["frames/0.png", "frames/0.mp4", "speed.csv"]);
        assert_eq!(Layout::of(at).unwrap().kind(), DatasetKind::Folder);
        assert_eq!(passed_over(at), None);
    }
}
