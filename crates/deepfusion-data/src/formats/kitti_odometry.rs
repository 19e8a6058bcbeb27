//! Reads KITTI's odometry benchmark: `sequences/<nn>/{image_2,image_3,image_0,image_1,velodyne,calib.txt,times.txt}`, and
//! `poses/<nn>.txt` for the first eleven sequences.
//!
//! A pose is that of rectified camera 0, relative to its first pose. Speeds are not included, so they are computed from the poses. The
//! cameras' mounts are not included either, so they are those of KITTI raw, which has the same car.

use super::kitti::{Fields, cam_from_cam0, numbered_files, optional};
use super::shared::files::{by_either_name, folders, name_of};
use super::shared::plain::{PlainParts, open_each};
use super::shared::pose_track::{cam_from_vehicle, speed_log};
use super::shared::poses::read_poses;
use crate::dataset_toml::FolderConfig;
use crate::logs::clock::TimeUnit;
use crate::logs::frame_times::TimedImage;
use crate::truth::measured::{MeasuredDepth, velodyne};
use crate::{
    Camera, CameraCalibration, DataWarning, Dataset, DatasetKind, Error, MissingPart, MountWarning,
    OpenOptions, Result, TimeStampProblem, image_size,
};
use deepfusion_geometry::{Distortion, Intrinsics, Se3};
use nalgebra::Matrix3x4;
use std::path::{Path, PathBuf};

const CALIBRATION: &str = "calib.txt";
const TIMES: &str = "times.txt";
const IMAGES: [&str; 3] = ["jpeg", "jpg", "png"];
/// Position of the unit above the rear axle of KITTI's car in rectified camera 0, in metres: R_rect_00 · (cam0_from_velo · velo_from_imu)
/// with KITTI raw's calibration of 2011_09_26.
const VEHICLE_IN_CAM0: [f64; 3] = [-0.314, 0.719, -1.089];

/// The sequences at a path: the folder itself, those in its folder `sequences`, or those directly in it.
pub(crate) fn find(path: &Path) -> Result<Vec<PathBuf>> {
    by_either_name(path, find_named)
}

fn find_named(folder: PathBuf) -> Result<Vec<PathBuf>> {
    if !folder.is_dir() {
        return Ok(Vec::new());
    }
    if is_sequence(&folder) {
        return Ok(vec![folder]);
    }
    let inner = folder.join("sequences");
    let place = if inner.is_dir() { inner } else { folder };
    let mut found = folders(&place)?;
    found.retain(|folder| is_sequence(folder));
    Ok(found)
}

/// Whether a folder is a sequence. A folder with `dataset.toml` is not: an image folder may also have `times.txt`.
fn is_sequence(folder: &Path) -> bool {
    if folder.join(FolderConfig::NAME).is_file() {
        return false;
    }
    let tables = [CALIBRATION, TIMES].map(|name| folder.join(name).is_file());
    let images = (0..4).any(|n| folder.join(format!("image_{n}")).is_dir());
    tables == [true, true] || (images && tables != [false, false])
}

/// Opens the cameras of the sequences found at `path`, each as a data set.
pub(crate) fn open(
    path: &Path,
    sequences: &[PathBuf],
    options: &OpenOptions,
) -> Result<Vec<Dataset>> {
    let cameras = options.camera.cameras();
    let mut found = Vec::new();
    for folder in sequences {
        for &camera in cameras {
            found.extend(Sequence::of(folder, camera)?);
        }
    }
    if found.is_empty() {
        let camera = cameras[0].number();
        let folder = sequences.first().map_or(path, PathBuf::as_path);
        return Err(Error::NoImages {
            path: folder.join(format!("image_{camera}")),
            camera,
        });
    }
    open_each(path, found, options, |sequence| sequence.open(options))
}

/// One camera of a sequence.
struct Sequence<'a> {
    folder: &'a Path,
    camera: Camera,
    /// The camera's number in KITTI: 2 or 3, or 0 or 1 if there are only grey images.
    number: u8,
    /// Images with their frame numbers; never empty.
    images: Vec<(u64, PathBuf)>,
}

impl<'a> Sequence<'a> {
    /// The sequence with the colour camera's images, otherwise with those of the grey camera on the same side; `None` without either.
    fn of(folder: &'a Path, camera: Camera) -> Result<Option<Self>> {
        let colour = camera.number();
        for number in [colour, colour - 2] {
            let place = folder.join(format!("image_{number}"));
            if !place.is_dir() {
                continue;
            }
            let images = numbered_files(&place, &IMAGES)?;
            if !images.is_empty() {
                return Ok(Some(Self {
                    folder,
                    camera,
                    number,
                    images,
                }));
            }
        }
        Ok(None)
    }

    fn open(self, options: &OpenOptions) -> Result<Dataset> {
        let size = image_size(&self.images[0].1)?;
        let path = self.folder.join(CALIBRATION);
        let fields = Fields::read(&path)?.ok_or_else(|| Error::Missing {
            path: path.clone(),
            part: MissingPart::SequenceProjections,
        })?;
        let field = format!("P{}", self.number);
        let projection = Matrix3x4::from_row_slice(&fields.numbers::<12>(&field)?);
        let intrinsics = fields.camera(&field, &projection, size)?;
        let cam_from_cam0 = cam_from_cam0(&intrinsics, &projection);
        let times = optional(read_times(&self.folder.join(TIMES)))?;
        let time = |number: u64| match &times {
            None => Ok(None),
            Some(times) => usize::try_from(number)
                .ok()
                .and_then(|i| times.get(i).copied())
                .map(Some)
                .ok_or_else(|| Error::NoTimeStamp {
                    path: self.folder.join(TIMES),
                    lines: times.len(),
                    frame: number,
                }),
        };
        let poses_file = poses_of(self.folder);
        let poses = match &poses_file {
            Some(file) => read_poses(file, false, 12)?,
            None => Vec::new(),
        };
        let world_from_cam0: Vec<Se3> = poses.iter().map(|(_, pose)| *pose).collect();
        let cam0_from_vehicle = cam_from_vehicle(&world_from_cam0, VEHICLE_IN_CAM0.into());
        let has_poses = poses_file.is_some();
        let mut timed = Vec::with_capacity(poses.len());
        for (number, pose) in &poses {
            let pose = *pose * cam0_from_vehicle;
            timed.extend(time(*number)?.map(|ns| (ns, pose)));
        }
        let truth = self.scans(&fields, &intrinsics, &cam_from_cam0)?;
        let mut images = Vec::with_capacity(self.images.len());
        for (number, path) in self.images {
            let ns = time(number)?;
            images.push(TimedImage { number, path, ns });
        }
        let cam0_from_cam = cam_from_cam0.inverse();
        let speeds = poses_file
            .filter(|_| !timed.is_empty())
            .map(|file| speed_log(&file, &timed));
        PlainParts {
            kind: DatasetKind::KittiOdometry,
            folder: self.folder.to_owned(),
            name: name_of(self.folder),
            images,
            video: None,
            calibration: CameraCalibration {
                intrinsics,
                distortion: Distortion::default(),
                size_in_file: false,
                assumed: false,
                source: path.into(),
            },
            camera_ahead_s: options.camera_ahead_s.unwrap_or(0.0),
            image_size: size,
            warnings: speeds
                .iter()
                .map(|_| DataWarning::from(MountWarning::OfKittiRaw))
                .collect(),
            speeds,
            mount_assumed: false,
            cam_from_vehicle: cam_from_cam0 * cam0_from_vehicle,
            camera: self.camera,
            truth,
            world_from_cam: poses
                .into_iter()
                .map(|(number, pose)| (number, pose * cam0_from_cam))
                .collect(),
            streams: Vec::new(),
            untimed_poses: times.is_none() && has_poses,
        }
        .into_dataset()
    }

    /// The scans of its frames.
    ///
    /// # Errors
    /// [`Error::Calibration`] if there are scans, but the scanner's mount is missing.
    fn scans(
        &self,
        fields: &Fields,
        camera: &Intrinsics,
        cam_from_cam0: &Se3,
    ) -> Result<Option<MeasuredDepth>> {
        let place = self.folder.join("velodyne");
        if !place.is_dir() {
            return Ok(None);
        }
        velodyne("velodyne", &place, &self.images, camera, || {
            Ok(*cam_from_cam0 * fields.motion("Tr")?)
        })
    }
}

/// Path of a sequence's poses, if they are published.
fn poses_of(folder: &Path) -> Option<PathBuf> {
    let root = folder.parent()?.parent()?;
    let file = root.join("poses").join(format!("{}.txt", name_of(folder)));
    file.is_file().then_some(file)
}

/// The times of a sequence's frames in nanoseconds, from a file with one line per frame in seconds.
///
/// # Errors
/// [`Error::Missing`]; [`Error::TimeStamp`] with the number of a line that is not a time, or not after the previous one.
fn read_times(path: &Path) -> Result<Vec<i64>> {
    let bytes = std::fs::read(path).map_err(|e| match e.kind() {
        std::io::ErrorKind::NotFound => Error::Missing {
            path: path.to_owned(),
            part: MissingPart::SequenceTimes,
        },
        _ => Error::file(path, e),
    })?;
    let mut times = Vec::new();
    for (i, line) in String::from_utf8_lossy(&bytes)
        .trim_end()
        .lines()
        .enumerate()
    {
        let text = || line.trim().chars().take(60).collect();
        let bad = |problem: TimeStampProblem| Error::TimeStamp {
            path: path.to_owned(),
            line: i + 1,
            problem,
        };
        let ns = TimeUnit::Seconds.nanoseconds(line);
        let ns = ns.ok_or_else(|| bad(TimeStampProblem::NotSeconds { text: text() }))?;
        if times.last().is_some_and(|last| ns <= *last) {
            return Err(bad(TimeStampProblem::NotAfter { text: text() }));
        }
        times.push(ns);
    }
    Ok(times)
}
