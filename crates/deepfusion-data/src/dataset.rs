//! A recording as frames, whatever its layout.

use crate::kitti::{self, Calibration, Drive, GtKind, TimeStamps, find_drives, read_oxts};
use crate::snippet::{EgoMotion, NoMotion};
use crate::split::{Split, SplitEntry};
use crate::{Error, Result, VehicleTrack, image_size, load_rgb};
use deepfusion_cloud::PointCloud;
use deepfusion_geometry::{DepthMap, Intrinsics, Se3};
use image::RgbImage;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use std::collections::HashSet;
use std::path::{Path, PathBuf};

/// The layout a recording came in.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum DatasetKind {
    /// KITTI raw.
    KittiRaw,
}

/// One of the car's two colour cameras.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Camera {
    /// KITTI's camera 2.
    Left,
    /// KITTI's camera 3.
    Right,
}

impl Camera {
    /// KITTI's number: 2 or 3.
    #[must_use]
    pub fn number(self) -> u8 {
        match self {
            Self::Left => 2,
            Self::Right => 3,
        }
    }
}

/// Which cameras to open.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
pub enum CameraChoice {
    /// Camera 2, the left one.
    #[default]
    #[serde(rename = "2")]
    Left,
    /// Camera 3, the right one.
    #[serde(rename = "3")]
    Right,
    /// Both, a data set each.
    #[serde(rename = "both")]
    Both,
}

impl CameraChoice {
    /// The cameras chosen.
    #[must_use]
    pub fn cameras(self) -> &'static [Camera] {
        match self {
            Self::Left => &[Camera::Left],
            Self::Right => &[Camera::Right],
            Self::Both => &[Camera::Left, Camera::Right],
        }
    }
}

impl std::str::FromStr for CameraChoice {
    type Err = String;

    fn from_str(text: &str) -> std::result::Result<Self, String> {
        match text {
            "2" => Ok(Self::Left),
            "3" => Ok(Self::Right),
            "both" => Ok(Self::Both),
            _ => Err(format!("'{text}' is no camera: 2, 3 or both")),
        }
    }
}

/// How to open a recording.
#[derive(Debug, Clone, Default)]
pub struct OpenOptions {
    /// Which cameras.
    pub camera: CameraChoice,
    /// Only these frames are selected; their neighbours still serve as sources.
    pub split: Option<Split>,
}

/// One image and its time.
#[derive(Debug, Clone, PartialEq)]
pub struct Frame {
    /// Name of its drive.
    pub drive: String,
    /// Its number in the drive; numbers may be missing.
    pub number: u64,
    /// Seconds from the drive's first time stamp; `None` where the drive has no time stamp of it.
    pub time_s: Option<f64>,
    /// The image's file.
    pub image: PathBuf,
    /// The car's forward speed at that time, in m/s; `None` where it is unknown.
    pub speed_mps: Option<f64>,
}

/// Everything a trainer or an evaluator needs from one camera's recording of one drive.
#[derive(Debug, Clone)]
pub struct Dataset {
    name: String,
    split_name: String,
    kind: DatasetKind,
    camera: Camera,
    drive: Drive,
    frames: Vec<Frame>,
    selected: Vec<usize>,
    calibration: Calibration,
    /// Nanoseconds since 1970 from which seconds are counted: the camera's first time stamp.
    origin_ns: Option<i64>,
    /// Seconds by frame number, also of frames without an image.
    times_s: Vec<Option<f64>>,
    track: Option<VehicleTrack>,
}

impl Dataset {
    /// Opens a drive folder, a date folder or a KITTI root: one data set for each drive and camera, in
    /// order of names. Drives without images of the camera, or without a selected frame, are left out.
    ///
    /// The sizes of all images are checked against the calibration. Time stamps and oxts may be
    /// absent (evaluation needs neither); where they are there, they must be readable.
    ///
    /// # Errors
    /// [`Error::NoSuchPath`], [`Error::NotKitti`], [`Error::Missing`] (calibration), [`Error::NoImages`],
    /// [`Error::Calibration`], [`Error::FrameSize`], [`Error::Image`], [`Error::TimeStamp`],
    /// [`Error::NoTimeStamp`], [`Error::Oxts`], [`Error::SplitSelectsNothing`].
    pub fn open(path: &Path, options: &OpenOptions) -> Result<Vec<Self>> {
        let drives = find_drives(path)?;
        let wanted: Option<HashSet<&SplitEntry>> =
            options.split.as_ref().map(|s| s.entries.iter().collect());
        let (mut datasets, mut images) = (Vec::new(), 0);
        for drive in &drives {
            for &camera in options.camera.cameras() {
                let files = drive.images(camera.number())?;
                images += files.len();
                let split_name = drive.split_name();
                let is_selected = |number: u64| {
                    wanted.as_ref().is_none_or(|wanted| {
                        wanted.contains(&SplitEntry {
                            folder: split_name.clone(),
                            frame: number,
                            camera,
                        })
                    })
                };
                let selected: Vec<usize> = (0..files.len())
                    .filter(|i| is_selected(files[*i].0))
                    .collect();
                if !selected.is_empty() {
                    datasets.push(Self::open_drive(drive, camera, &files, selected)?);
                }
            }
        }
        if !datasets.is_empty() {
            return Ok(datasets);
        }
        match &options.split {
            Some(split) if images > 0 => Err(Error::SplitSelectsNothing {
                split: split.path.clone(),
                path: path.to_owned(),
                entries: split.entries.len(),
                first: split
                    .entries
                    .first()
                    .map(SplitEntry::to_string)
                    .unwrap_or_default(),
            }),
            _ => {
                let camera = options.camera.cameras()[0].number();
                let folder = drives.first().map_or(path, |d| d.folder.as_path());
                Err(Error::NoImages {
                    path: folder.join(format!("image_0{camera}/data")),
                    camera,
                })
            }
        }
    }

    fn open_drive(
        drive: &Drive,
        camera: Camera,
        files: &[(u64, PathBuf)],
        selected: Vec<usize>,
    ) -> Result<Self> {
        let calibration = Calibration::read(&drive.date_folder, camera)?;
        let folder = drive.folder.join(format!("image_0{}", camera.number()));
        let times = optional(TimeStamps::read(&folder.join("timestamps.txt")))?;
        // Both clocks count from the camera's first line, so that seconds keep their nanoseconds.
        let origin_ns = times.as_ref().and_then(TimeStamps::origin_ns);
        let track = match origin_ns {
            Some(origin) => optional(read_oxts(&drive.folder.join("oxts"), origin))?,
            None => None,
        };
        let mut frames = Vec::with_capacity(files.len());
        for (number, image) in files {
            let time_s = match (&times, origin_ns) {
                (Some(times), Some(origin)) => times.seconds(*number, origin)?,
                _ => None,
            };
            frames.push(Frame {
                drive: drive.name.clone(),
                number: *number,
                time_s,
                image: image.clone(),
                speed_mps: time_s.and_then(|t| track.as_ref()?.speed_at(t)),
            });
        }
        let dataset = Self {
            name: drive.name.clone(),
            split_name: drive.split_name(),
            kind: DatasetKind::KittiRaw,
            camera,
            drive: drive.clone(),
            frames,
            selected,
            calibration,
            origin_ns,
            times_s: match (&times, origin_ns) {
                (Some(times), Some(origin)) => times.all_seconds(origin),
                _ => Vec::new(),
            },
            track,
        };
        // Reading a header takes some microseconds, and a wrong size found now is not found at night.
        (0..dataset.frames.len())
            .into_par_iter()
            .try_for_each(|i| dataset.check_size(i, image_size(&dataset.frames[i].image)?))?;
        Ok(dataset)
    }

    /// The drive's name.
    #[must_use]
    pub fn name(&self) -> &str {
        &self.name
    }

    /// `<date>/<drive>`, as split files name it.
    #[must_use]
    pub fn split_name(&self) -> &str {
        &self.split_name
    }

    /// The layout it came in.
    #[must_use]
    pub fn kind(&self) -> DatasetKind {
        self.kind
    }

    /// The camera whose images these are.
    #[must_use]
    pub fn camera(&self) -> Camera {
        self.camera
    }

    /// Where its files are.
    #[must_use]
    pub fn drive(&self) -> &Drive {
        &self.drive
    }

    /// All frames, by number. Not all need be selected.
    #[must_use]
    pub fn frames(&self) -> &[Frame] {
        &self.frames
    }

    /// Indices of the frames that the split selects, all without one. Never empty.
    #[must_use]
    pub fn selected(&self) -> &[usize] {
        &self.selected
    }

    /// The calibration of its camera.
    #[must_use]
    pub fn calibration(&self) -> &Calibration {
        &self.calibration
    }

    /// The car's speed and yaw rate, where the drive has them.
    #[must_use]
    pub fn track(&self) -> Option<&VehicleTrack> {
        self.track.as_ref()
    }

    /// Nanoseconds since 1970 from which its seconds are counted, where it has time stamps.
    #[must_use]
    pub fn origin_ns(&self) -> Option<i64> {
        self.origin_ns
    }

    /// The time of a frame number, whether or not there is an image of it, in seconds from the drive's
    /// first time stamp.
    #[must_use]
    pub fn time_of(&self, number: u64) -> Option<f64> {
        *self.times_s.get(usize::try_from(number).ok()?)?
    }

    /// The camera of a frame's full-size image.
    #[must_use]
    pub fn intrinsics(&self, _frame: usize) -> Intrinsics {
        self.calibration.intrinsics
    }

    /// A frame's image at full size.
    ///
    /// # Errors
    /// As [`load_rgb`], and [`Error::FrameSize`].
    ///
    /// # Panics
    /// If there is no frame of that index.
    pub fn load_image(&self, frame: usize) -> Result<RgbImage> {
        let image = load_rgb(&self.frames[frame].image)?;
        self.check_size(frame, image.dimensions())?;
        Ok(image)
    }

    fn check_size(&self, frame: usize, found: (u32, u32)) -> Result<()> {
        let k = &self.calibration.intrinsics;
        if found == (k.width, k.height) {
            return Ok(());
        }
        Err(Error::FrameSize {
            path: self.frames[frame].image.clone(),
            drive: self.name.clone(),
            frame: self.frames[frame].number,
            found,
            expected: (k.width, k.height),
            calibration: self.calibration.folder.join(Calibration::CAM_TO_CAM),
        })
    }

    /// Sparse depth of a frame from its velodyne scan, at the image's full size, in metres; `None`
    /// where there is no scan.
    ///
    /// # Errors
    /// [`Error::Cloud`] where the scan cannot be read, [`Error::Missing`] without the velodyne's
    /// calibration.
    ///
    /// # Panics
    /// If there is no frame of that index.
    pub fn ground_truth(&self, frame: usize, kind: GtKind) -> Result<Option<DepthMap>> {
        let Some(path) = self.drive.scan(self.frames[frame].number) else {
            return Ok(None);
        };
        let scan = PointCloud::read_kitti_bin(&path)?;
        let k = self.calibration.intrinsics;
        Ok(Some(kitti::depth_map(
            &scan,
            &self.calibration.require_pixels_from_velo()?,
            (k.width as usize, k.height as usize),
            kind,
        )))
    }

    /// What ego-motion is made from, or what is missing for it.
    pub(crate) fn ego(&self) -> Result<Ego<'_>> {
        let folder = &self.drive.folder;
        if self.frames.iter().all(|f| f.time_s.is_none()) {
            // Reading again gives the error that names the file.
            let image_folder = folder.join(format!("image_0{}", self.camera.number()));
            TimeStamps::read(&image_folder.join("timestamps.txt"))?;
        }
        let track = match &self.track {
            Some(track) => track,
            None => {
                return Err(read_oxts(&folder.join("oxts"), 0)
                    .err()
                    .unwrap_or(Error::Missing {
                        path: folder.join("oxts"),
                        what: "the car's speed and yaw rate",
                        remedy: "open the recording again: it changed meanwhile",
                    }));
            }
        };
        Ok(Ego {
            track,
            cam_from_imu: self.calibration.require_cam_from_imu()?,
        })
    }
}

/// The car's track and the camera's place on the car.
pub(crate) struct Ego<'a> {
    pub(crate) track: &'a VehicleTrack,
    cam_from_imu: Se3,
}

impl Ego<'_> {
    /// The camera's motion between two frames given by index, in either order of time.
    pub(crate) fn between(
        &self,
        frames: &[Frame],
        target: usize,
        source: usize,
    ) -> std::result::Result<EgoMotion, NoMotion> {
        let (earlier, later) = (target.min(source), target.max(source));
        let (Some(from_s), Some(to_s)) = (frames[earlier].time_s, frames[later].time_s) else {
            return Err(NoMotion::Time);
        };
        if to_s <= from_s {
            return Err(NoMotion::Time);
        }
        let vehicle = self.track.motion(from_s, to_s).ok_or(NoMotion::Speed)?;
        let earlier_from_later = vehicle.camera0_from_camera1(&self.cam_from_imu);
        let dt_s = to_s - from_s;
        Ok(EgoMotion {
            dt_s,
            distance_m: earlier_from_later.translation().norm(),
            speed_mps: vehicle.distance_m.abs() / dt_s,
            source_from_target: if source == earlier {
                earlier_from_later
            } else {
                earlier_from_later.inverse()
            },
        })
    }
}

/// A part that may be absent, but not broken.
fn optional<T>(part: Result<T>) -> Result<Option<T>> {
    match part {
        Ok(part) => Ok(Some(part)),
        Err(Error::Missing { .. }) => Ok(None),
        Err(other) => Err(other),
    }
}
