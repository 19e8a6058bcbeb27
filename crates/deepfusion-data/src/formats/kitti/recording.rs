//! KITTI raw as a [`Recording`].

use super::calibration::Calibration;
use super::config::DriveConfig;
use super::layout::{Drive, numbered_files};
use super::moving::{self, MASKS};
use super::oxts::read_oxts;
use super::oxts_path::oxts_paths;
use super::timestamps::TimeStamps;
use super::velodyne::depth_map;
use crate::dataset::selection::Selection;
use crate::logs::clock::on_the_vehicles_clock;
use crate::{
    CalibrationPlace, Camera, CameraPath, DataWarning, Dataset, DatasetKind, DatasetParts, Error,
    Frame, FrameImage, GtKind, MissingPart, MotionWarning, MountWarning, MovingLabels, OpenOptions,
    Recording, Result, Stream, load_rgb, read_depth_png,
};
use deepfusion_geometry::DepthMap;
use deepfusion_geometry::cloud::PointCloud;
use image::RgbImage;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Folder of the exact depth of simulated drives and of KITTI's annotated depth, one 16-bit PNG per frame and camera.
const DEPTHS: &str = "proj_depth/groundtruth";

/// One camera of one drive.
#[derive(Debug)]
struct KittiRecording {
    drive: Drive,
    calibration: Calibration,
    camera: Camera,
    /// True speed / speed in the oxts; already applied to the track.
    speed_scale: f64,
    /// Times in seconds by frame number, also for frames without an image.
    times_s: Vec<Option<f64>>,
    warnings: Vec<DataWarning>,
}

/// Opens the cameras of the drives found at `path`.
pub(crate) fn open(path: &Path, drives: &[Drive], options: &OpenOptions) -> Result<Vec<Dataset>> {
    let selection = Selection::new(options);
    let (mut datasets, mut images) = (Vec::new(), 0);
    for drive in drives {
        for &camera in options.camera.cameras() {
            let files = drive.images(camera.number())?;
            images += files.len();
            let numbers = files.iter().map(|f| f.0);
            let selected = selection.of(&drive.split_name(), None, camera, numbers);
            if !selected.is_empty() {
                let dataset = open_drive(drive, camera, &files, options)?;
                datasets.push(dataset.with_selected(selected));
            }
        }
    }
    if !datasets.is_empty() {
        return Ok(datasets);
    }
    Err(match selection.nothing_selected(path) {
        Some(error) if images > 0 => error,
        _ => {
            let camera = options.camera.cameras()[0].number();
            let folder = drives.first().map_or(path, |d| d.folder.as_path());
            Error::NoImages {
                path: folder.join(format!("image_0{camera}/data")),
                camera,
            }
        }
    })
}

fn open_drive(
    drive: &Drive,
    camera: Camera,
    files: &[(u64, PathBuf)],
    options: &OpenOptions,
) -> Result<Dataset> {
    let config = DriveConfig::of(&drive.folder, options)?;
    let calibration = Calibration::read(&drive.date_folder, camera)?;
    let folder = drive.folder.join(format!("image_0{}", camera.number()));
    let times = optional(TimeStamps::read(&folder.join("timestamps.txt")))?;
    // Both clocks count from the camera's first time stamp, so that seconds keep nanosecond precision: the camera's from that
    // stamp, the oxts' from the same moment on their clock.
    let camera_origin_ns = times.as_ref().and_then(TimeStamps::origin_ns);
    let origin_ns = camera_origin_ns.map(|ns| on_the_vehicles_clock(ns, config.camera_ahead_s));
    let track = match origin_ns {
        Some(origin) => optional(read_oxts(&drive.folder.join("oxts"), origin))?,
        None => None,
    };
    let track = track.map(|track| {
        let track = track.with_speed_scale(config.speed_scale);
        if config.tilt_known {
            track
        } else {
            track.without_tilt()
        }
    });
    let mut frames = Vec::with_capacity(files.len());
    for (number, image) in files {
        let time_s = match (&times, camera_origin_ns) {
            (Some(times), Some(origin)) => times.seconds(*number, origin)?,
            _ => None,
        };
        frames.push(Frame {
            drive: drive.name.clone(),
            number: *number,
            time_s,
            image: FrameImage::File(image.clone()),
            speed_mps: time_s.and_then(|t| track.as_ref()?.speed_at(t)),
        });
    }
    let times_s = match (&times, camera_origin_ns) {
        (Some(times), Some(origin)) => times.all_seconds(origin),
        _ => Vec::new(),
    };
    let parts = DatasetParts {
        name: drive.name.clone(),
        split_name: drive.split_name(),
        camera,
        frames,
        intrinsics: calibration.intrinsics,
        cam_from_vehicle: calibration.cam_from_imu,
        track: track.map(Into::into),
        yaw_known: config.yaw_known,
        origin_ns,
        camera_ahead_s: config.camera_ahead_s,
        scenario: None,
    };
    let mut warnings = Vec::new();
    if !config.yaw_known {
        warnings.push(MotionWarning::YawNotMeasured.into());
    }
    if !config.mount_known {
        warnings.push(MountWarning::NotGiven.into());
    }
    let recording = KittiRecording {
        drive: drive.clone(),
        calibration,
        camera,
        speed_scale: config.speed_scale,
        times_s,
        warnings,
    };
    let dataset = Dataset::new(parts, Arc::new(recording))
        .with_simulated(drive.is_simulated())
        .with_mount_assumed(!config.mount_known);
    dataset.check_sizes()?;
    Ok(dataset)
}

impl KittiRecording {
    /// Path of a frame's depth image, if it exists.
    fn depth_image(&self, frame: &Frame) -> Option<PathBuf> {
        let name = format!(
            "{DEPTHS}/image_0{}/{:010}.png",
            self.camera.number(),
            frame.number
        );
        let path = self.drive.folder.join(name);
        path.is_file().then_some(path)
    }

    /// The depth image of a frame; errors call it `what`.
    fn read_depth(&self, frame: &Frame, what: &'static str) -> Result<Option<DepthMap>> {
        let Some(path) = self.depth_image(frame) else {
            return Ok(None);
        };
        let depth = read_depth_png(&path)?;
        let k = self.calibration.intrinsics;
        let found = (depth.width as u32, depth.height as u32);
        if found != (k.width, k.height) {
            let image = (k.width, k.height);
            return Err(Error::Size { what, found, image });
        }
        Ok(Some(depth))
    }
}

impl Recording for KittiRecording {
    fn kind(&self) -> DatasetKind {
        DatasetKind::KittiRaw
    }

    fn folder(&self) -> &Path {
        &self.drive.folder
    }

    fn load_image(&self, frame: &Frame) -> Result<RgbImage> {
        Ok(load_rgb(frame.image.path())?)
    }

    fn warnings(&self) -> &[DataWarning] {
        &self.warnings
    }

    fn calibration(&self) -> CalibrationPlace {
        CalibrationPlace {
            source: self.calibration.folder.join(Calibration::CAM_TO_CAM).into(),
            field: "S_rect",
        }
    }

    fn streams(&self) -> Result<Vec<Stream>> {
        const SENSORS: [(&str, &str, &[&str]); 6] = [
            ("image_00", "image", &["jpeg", "jpg", "png"]),
            ("image_01", "image", &["jpeg", "jpg", "png"]),
            ("image_02", "image", &["jpeg", "jpg", "png"]),
            ("image_03", "image", &["jpeg", "jpg", "png"]),
            ("velodyne_points", "point_cloud", &["bin"]),
            ("oxts", "oxts", &["txt"]),
        ];
        let mut streams = Vec::new();
        for (name, kind, extensions) in SENSORS {
            let folder = self.drive.folder.join(name);
            if !folder.join("data").is_dir() {
                continue;
            }
            let files = numbered_files(&folder.join("data"), extensions)?;
            let times = optional(TimeStamps::read(&folder.join("timestamps.txt")))?;
            let mut seconds = Vec::new();
            if let Some(times) = times {
                let origin = times.origin_ns().unwrap_or(0);
                for (number, _) in &files {
                    seconds.extend(times.seconds(*number, origin)?);
                }
            }
            streams.push(Stream::new(name, kind, files.len(), &seconds));
        }
        Ok(streams)
    }

    /// Reads the files again to get the error that names the missing one.
    fn no_motion(&self) -> Error {
        let folder = &self.drive.folder;
        if self.times_s.iter().all(Option::is_none) {
            let images = folder.join(format!("image_0{}", self.camera.number()));
            if let Err(error) = TimeStamps::read(&images.join("timestamps.txt")) {
                return error;
            }
        }
        let again = read_oxts(&folder.join("oxts"), 0).map(|_| ());
        let again = again.and_then(|()| self.calibration.require_cam_from_imu().map(|_| ()));
        again.err().unwrap_or(Error::Missing {
            path: folder.join("oxts"),
            part: MissingPart::OxtsGone,
        })
    }

    fn has_ground_truth(&self, frame: &Frame, kind: GtKind) -> bool {
        match kind {
            GtKind::Annotated => self.depth_image(frame).is_some(),
            GtKind::Z | GtKind::Velodyne => self.drive.scan(frame.number).is_some(),
        }
    }

    fn ground_truth(&self, frame: &Frame, kind: GtKind) -> Result<Option<DepthMap>> {
        if kind == GtKind::Annotated {
            return self.read_depth(frame, "the annotated depth");
        }
        let Some(path) = self.drive.scan(frame.number) else {
            return Ok(None);
        };
        let scan = PointCloud::read_kitti_bin(&path)?;
        let k = self.calibration.intrinsics;
        Ok(Some(depth_map(
            &scan,
            &self.calibration.require_pixels_from_velo()?,
            (k.width as usize, k.height as usize),
            kind,
        )))
    }

    fn has_dense_depth(&self, frame: &Frame) -> bool {
        // KITTI's annotated depth may be in the same folder, and only the simulator's masks distinguish the two: in KITTI's, 0 is a
        // pixel without a measurement, in the simulator's it is the sky.
        self.camera.number() == 2
            && self.drive.folder.join(MASKS).is_dir()
            && self.depth_image(frame).is_some()
    }

    fn dense_depth(&self, frame: &Frame) -> Result<Option<DepthMap>> {
        if !self.has_dense_depth(frame) {
            return Ok(None);
        }
        let Some(mut depth) = self.read_depth(frame, "the exact depth")? else {
            return Ok(None);
        };
        let sky = depth.data.iter_mut().filter(|d| **d == 0.0);
        sky.for_each(|d| *d = f32::INFINITY);
        Ok(Some(depth))
    }

    fn moving_labels(&self, dataset: &Dataset) -> Result<Option<MovingLabels>> {
        moving::labels(&self.calibration, dataset)
    }

    fn time_of(&self, number: u64) -> Option<f64> {
        *self.times_s.get(usize::try_from(number).ok()?)?
    }

    fn camera_paths(&self, dataset: &Dataset) -> Result<Vec<CameraPath>> {
        oxts_paths(dataset, &self.calibration, self.speed_scale)
    }
}

/// An optional part: `None` if it is missing, but an error if it is invalid.
pub(crate) fn optional<T>(part: Result<T>) -> Result<Option<T>> {
    match part {
        Ok(part) => Ok(Some(part)),
        Err(Error::Missing { .. }) => Ok(None),
        Err(other) => Err(other),
    }
}
