//! Reads KITTI-360: `data_2d_raw/<drive>/image_00/{data_rect,timestamps.txt}`, `calibration/{perspective.txt,calib_cam_to_pose.txt,
//! calib_cam_to_velo.txt}`, `data_poses/<drive>/{poses.txt,cam0_to_world.txt}`, `data_3d_raw/<drive>/velodyne_points/data`.
//!
//! A pose is that of the inertial unit (x forward, y right, z down, above the rear axle) in a fixed world frame. Frames in which
//! the vehicle hardly moved have none. Cameras 0 (left) and 1 (right) have rectified images; 2 and 3 are fisheyes.

use super::kitti::{Fields, TimeStamps, numbered_files, optional};
use super::shared::files::{by_either_name, folders, name_of};
use super::shared::plain::{PlainParts, open_each};
use super::shared::pose_track::speed_log;
use super::shared::poses::read_poses;
use crate::logs::frame_times::TimedImage;
use crate::truth::measured::{MeasuredDepth, velodyne};
use crate::{
    Camera, CameraCalibration, Dataset, DatasetKind, Error, MissingPart, OpenOptions, PoseField,
    PoseProblem, Result, image_size,
};
use deepfusion_geometry::{Distortion, Se3};
use nalgebra::{Matrix3x4, Vector3};
use std::f64::consts::PI;
use std::path::{Path, PathBuf};

/// Poses by frame number.
type NumberedPoses = Vec<(u64, Se3)>;

const IMAGES: &str = "data_2d_raw";
const SCANS: &str = "data_3d_raw";
const POSES: &str = "data_poses";
const CALIBRATION: &str = "calibration";
const PERSPECTIVE: &str = "perspective.txt";
const CAM_TO_POSE: &str = "calib_cam_to_pose.txt";
const CAM_TO_VELO: &str = "calib_cam_to_velo.txt";

/// A drive, and the root of the data set.
#[derive(Debug)]
pub(crate) struct Drive {
    root: PathBuf,
    /// Path of the drive's folder in `data_2d_raw`.
    pub(crate) folder: PathBuf,
}

/// The drives at a path: those of a root, of its `data_2d_raw`, or the drive itself.
pub(crate) fn find(path: &Path) -> Result<Vec<Drive>> {
    by_either_name(path, find_named)
}

fn find_named(folder: PathBuf) -> Result<Vec<Drive>> {
    if !folder.is_dir() {
        return Ok(Vec::new());
    }
    let of = |folder: PathBuf| {
        let root = folder.parent()?.parent()?.to_owned();
        Some(Drive { root, folder })
    };
    let in_place = |folder: &Path| {
        let place = folder.parent().map(name_of);
        place.is_some_and(|place| place == IMAGES) && is_drive(folder)
    };
    if in_place(&folder) {
        return Ok(of(folder).into_iter().collect());
    }
    let place = if name_of(&folder) == IMAGES {
        folder
    } else {
        folder.join(IMAGES)
    };
    if !place.is_dir() {
        return Ok(Vec::new());
    }
    let drives = folders(&place)?.into_iter().filter(|f| is_drive(f));
    Ok(drives.filter_map(of).collect())
}

fn is_drive(folder: &Path) -> bool {
    (0..4).any(|camera| folder.join(format!("image_0{camera}")).is_dir())
}

/// Opens the cameras of the drives found at `path`, each as a data set.
pub(crate) fn open(path: &Path, drives: &[Drive], options: &OpenOptions) -> Result<Vec<Dataset>> {
    let mut found = Vec::new();
    for drive in drives {
        for &camera in options.camera.cameras() {
            let place = drive.camera(camera).join("data_rect");
            if !place.is_dir() {
                continue;
            }
            let images = numbered_files(&place, &["jpeg", "jpg", "png"])?;
            if !images.is_empty() {
                found.push((drive, camera, images));
            }
        }
    }
    if found.is_empty() {
        let camera = options.camera.cameras()[0];
        let place = drives.first().map(|drive| drive.camera(camera));
        return Err(Error::NoImages {
            path: place.map_or_else(|| path.to_owned(), |p| p.join("data_rect")),
            camera: camera.number(),
        });
    }
    open_each(path, found, options, |(drive, camera, images)| {
        drive.open(camera, images, options)
    })
}

impl Drive {
    /// Path of a camera's folder.
    fn camera(&self, camera: Camera) -> PathBuf {
        self.folder.join(image_name(camera))
    }

    /// Opens one camera; `images` must not be empty.
    fn open(
        &self,
        camera: Camera,
        images: Vec<(u64, PathBuf)>,
        options: &OpenOptions,
    ) -> Result<Dataset> {
        let rig = Rig::read(&self.root.join(CALIBRATION), camera)?;
        let times = optional(TimeStamps::read(
            &self.camera(camera).join("timestamps.txt"),
        ))?;
        let time = |number: u64| match &times {
            None => Ok(None),
            Some(times) => times.nanoseconds(number),
        };
        let (poses_file, world_from_vehicle) = self.poses(&rig)?;
        let mut timed = Vec::with_capacity(world_from_vehicle.len());
        for (number, pose) in &world_from_vehicle {
            timed.extend(time(*number)?.map(|ns| (ns, *pose)));
        }
        let speeds = poses_file
            .filter(|_| !timed.is_empty())
            .map(|file| speed_log(&file, &timed));
        let truth = self.scans(&rig, &images)?;
        let size = image_size(&images[0].1)?;
        let mut frames = Vec::with_capacity(images.len());
        for (number, path) in images {
            let ns = time(number)?;
            frames.push(TimedImage { number, path, ns });
        }
        let vehicle_from_cam = rig.cam_from_vehicle.inverse();
        PlainParts {
            kind: DatasetKind::Kitti360,
            folder: self.folder.clone(),
            name: name_of(&self.folder),
            images: frames,
            video: None,
            calibration: rig.calibration,
            camera_ahead_s: options.camera_ahead_s.unwrap_or(0.0),
            image_size: size,
            speeds,
            mount_assumed: false,
            cam_from_vehicle: rig.cam_from_vehicle,
            camera,
            truth,
            world_from_cam: world_from_vehicle
                .into_iter()
                .map(|(number, pose)| (number, pose * vehicle_from_cam))
                .collect(),
            streams: Vec::new(),
            warnings: Vec::new(),
            untimed_poses: false,
        }
        .into_dataset()
    }

    /// `world_from_vehicle` by frame number, and the path of its file: from the unit's poses, otherwise from the left camera's.
    fn poses(&self, rig: &Rig) -> Result<(Option<PathBuf>, NumberedPoses)> {
        let place = self.root.join(POSES).join(name_of(&self.folder));
        let ways = [
            ("poses.txt", 12, pose_from_vehicle()),
            ("cam0_to_world.txt", 16, rig.cam0_from_vehicle),
        ];
        for (name, columns, file_from_vehicle) in ways {
            let file = place.join(name);
            if file.is_file() {
                let poses = read_poses(&file, true, columns)?.into_iter();
                let poses = poses.map(|(number, pose)| (number, pose * file_from_vehicle));
                return Ok((Some(file), poses.collect()));
            }
        }
        Ok((None, Vec::new()))
    }

    /// The scans of its frames; they have the frames' numbers.
    fn scans(&self, rig: &Rig, images: &[(u64, PathBuf)]) -> Result<Option<MeasuredDepth>> {
        let name = name_of(&self.folder);
        let place = self
            .root
            .join(SCANS)
            .join(name)
            .join("velodyne_points/data");
        if !place.is_dir() {
            return Ok(None);
        }
        velodyne(
            "velodyne_points",
            &place,
            images,
            &rig.calibration.intrinsics,
            || rig.cam_from_velo(&self.root.join(CALIBRATION)),
        )
    }
}

/// A rectified camera and its mount.
struct Rig {
    calibration: CameraCalibration,
    /// The transform from the vehicle (origin at the unit; x forward, y left, z up) to the rectified camera.
    cam_from_vehicle: Se3,
    /// The transform from the vehicle to rectified camera 0.
    cam0_from_vehicle: Se3,
    /// The transform from unrectified camera 0, to which the velodyne's calibration refers, to the rectified camera.
    cam_from_raw0: Se3,
}

impl Rig {
    /// Reads `perspective.txt` and `calib_cam_to_pose.txt` for a camera.
    ///
    /// # Errors
    /// [`Error::Missing`], [`Error::Calibration`].
    fn read(folder: &Path, camera: Camera) -> Result<Self> {
        let fields = |name: &str, part| {
            let path = folder.join(name);
            Fields::read(&path)?.ok_or(Error::Missing { path, part })
        };
        let cameras = fields(PERSPECTIVE, MissingPart::Kitti360Intrinsics)?;
        let mounts = fields(CAM_TO_POSE, MissingPart::Kitti360Cameras)?;
        // The file has the transform from the unrectified camera to the unit; rectification only rotates the camera.
        let cam_from_pose = |camera: Camera| -> Result<Se3> {
            let rect = format!("R_rect_0{}", camera.number() - 2);
            let rect = cameras.rotation(&rect)?;
            let pose_from_raw = mounts.motion(&image_name(camera))?;
            Ok(Se3::from_parts(&rect, Vector3::zeros()) * pose_from_raw.inverse())
        };
        let number = camera.number() - 2;
        let (size_field, p_field) = (format!("S_rect_0{number}"), format!("P_rect_0{number}"));
        let [width, height] = cameras.numbers::<2>(&size_field)?;
        let size = (
            cameras.size(&size_field, width)?,
            cameras.size(&size_field, height)?,
        );
        let projection = Matrix3x4::from_row_slice(&cameras.numbers::<12>(&p_field)?);
        let intrinsics = cameras.camera(&p_field, &projection, size)?;
        let cam_from_pose_here = cam_from_pose(camera)?;
        Ok(Self {
            calibration: CameraCalibration {
                intrinsics,
                distortion: Distortion::default(),
                size_in_file: true,
                assumed: false,
                source: folder.join(PERSPECTIVE).into(),
            },
            cam_from_vehicle: cam_from_pose_here * pose_from_vehicle(),
            cam0_from_vehicle: cam_from_pose(Camera::Left)? * pose_from_vehicle(),
            cam_from_raw0: cam_from_pose_here * mounts.motion(&image_name(Camera::Left))?,
        })
    }

    /// The transform from the velodyne to the rectified camera.
    ///
    /// # Errors
    /// [`Error::Missing`], [`Error::Pose`] if the file is not a rigid transform.
    fn cam_from_velo(&self, folder: &Path) -> Result<Se3> {
        let path = folder.join(CAM_TO_VELO);
        if !path.is_file() {
            return Err(Error::Missing {
                path,
                part: MissingPart::Kitti360Velodyne,
            });
        }
        let velo_from_raw0 = read_poses(&path, false, 12)?.into_iter().next();
        let (_, velo_from_raw0) = velo_from_raw0.ok_or_else(|| Error::Pose {
            path,
            line: 1,
            field: PoseField::Pose,
            problem: PoseProblem::NoPose,
        })?;
        Ok(self.cam_from_raw0 * velo_from_raw0.inverse())
    }
}

/// The transform from the vehicle's axes (x forward, y left, z up) to the unit's (x forward, y right, z down): half a turn about x.
fn pose_from_vehicle() -> Se3 {
    Se3::from_axis_angle(Vector3::x() * PI, Vector3::zeros())
}

/// The name of a camera's folder, which is also the name of its line in the files.
fn image_name(camera: Camera) -> String {
    format!("image_0{}", camera.number() - 2)
}
