//! Reads nuScenes: JSON tables in `v1.0-mini` (`-trainval`, `-test`), files in `samples` and `sweeps` beside it.
//!
//! A scene is a data set of the front camera's images, keyframes and sweeps ordered by time. Every image and scan has the vehicle's pose
//! at its time. These poses move a scan to the time of an image, and speed and yaw rate are computed from those of the camera and the
//! LiDAR.

mod rows;
mod tables;

use self::tables::{
    CALIBRATED_SENSOR, CAMERA, LIDAR, SAMPLE_DATA, Scene, SensorFrame, read_scenes,
};
use super::shared::files::{folders, name_of};
use super::shared::plain::{PlainParts, open_each};
use super::shared::pose_track::speed_log;
use crate::logs::frame_times::{TimedImage, numbers_by_time};
use crate::truth::measured::{MeasuredDepth, PlacedScan, Scans};
use crate::{
    Camera, CameraCalibration, CameraProblem, Dataset, DatasetKind, Error, IncompleteWarning,
    NoFramesReason, OpenOptions, Result, image_size,
};
use deepfusion_geometry::cloud::PointCloud;
use deepfusion_geometry::{Intrinsics, Se3};
use nalgebra::Vector3;
use std::collections::BTreeMap;
use std::f64::consts::FRAC_PI_2;
use std::path::{Path, PathBuf};

/// Longest time from an image to its scan: an image is taken when the scanner passes it, and the scan's time is that of its end, up to one
/// turn (50 ms) plus jitter later.
const SCAN_WITHIN_NS: i64 = 60_000_000;

/// A folder of tables, and the root of the files they name.
#[derive(Debug)]
pub(crate) struct TableFolder {
    root: PathBuf,
    tables: PathBuf,
}

/// Finds the data set at a path, which is its root or the folder of its tables.
///
/// # Errors
/// [`Error::File`]; [`Error::SeveralVersions`] for a root with several folders of tables.
pub(crate) fn find(path: &Path) -> Result<Option<TableFolder>> {
    let folder = path.canonicalize().map_err(|e| Error::file(path, e))?;
    if !folder.is_dir() {
        return Ok(None);
    }
    if has_tables(&folder) {
        let root = folder.parent().unwrap_or(&folder).to_owned();
        return Ok(Some(TableFolder {
            root,
            tables: folder,
        }));
    }
    let mut versions = folders(&folder)?;
    versions.retain(|version| name_of(version).starts_with("v1.") && has_tables(version));
    if versions.len() > 1 {
        return Err(Error::SeveralVersions {
            path: path.to_owned(),
            versions: versions.iter().map(|v| name_of(v)).collect(),
        });
    }
    Ok(versions.pop().map(|tables| TableFolder {
        root: folder,
        tables,
    }))
}

fn has_tables(folder: &Path) -> bool {
    folder.join(SAMPLE_DATA).is_file()
}

/// Opens each scene that has images as a data set.
pub(crate) fn open(
    path: &Path,
    place: &TableFolder,
    options: &OpenOptions,
) -> Result<Vec<Dataset>> {
    let scenes = read_scenes(&place.tables)?;
    let all = scenes.len();
    let mut first = None;
    let mut found = Vec::new();
    for scene in scenes {
        first = first.or_else(|| scene.images.first().map(|image| image.file.clone()));
        let files = scene
            .images
            .iter()
            .map(|image| place.root.join(&image.file));
        let exist: Vec<bool> = files.map(|file| file.is_file()).collect();
        if exist.contains(&true) {
            found.push((scene, exist));
        }
    }
    if found.is_empty() {
        let named = first.unwrap_or_else(|| format!("samples/{CAMERA}"));
        return Err(Error::NoFrames {
            path: place.root.join(named),
            reason: NoFramesReason::NotUnpacked {
                camera: CAMERA,
                table: SAMPLE_DATA,
                scenes: all,
            },
        });
    }
    open_each(path, found, options, |(scene, exist)| {
        place.open(scene, &exist, options)
    })
}

impl TableFolder {
    /// Opens a scene; `exist` says for each of its images whether the file exists (at least one does).
    fn open(&self, scene: Scene, exist: &[bool], options: &OpenOptions) -> Result<Dataset> {
        let Scene {
            name,
            images,
            scans,
        } = scene;
        let times: Vec<i64> = images.iter().map(|image| image.ns).collect();
        let numbered = numbers_by_time(&times).into_iter().zip(&images);
        let found = numbered.zip(exist).filter(|(_, exist)| **exist);
        let found: Vec<(u64, &SensorFrame)> = found.map(|(image, _)| image).collect();
        let mut warnings = Vec::new();
        if let Some((first_missing, _)) = images.iter().zip(exist).find(|(_, exist)| !**exist) {
            let missing = IncompleteWarning::ImagesMissing {
                missing: images.len() - found.len(),
                of: images.len(),
                such_as: first_missing.file.clone(),
            };
            warnings.push(missing.into());
        }
        let calibrations = self.tables.join(CALIBRATED_SENSOR);
        let one_camera = images.iter().all(|image| image.sensor == images[0].sensor);
        let (true, Some((_, first))) = (one_camera, found.first()) else {
            return Err(Error::CameraFile {
                by: calibrations.into(),
                problem: CameraProblem::Several {
                    scene: name,
                    camera: CAMERA,
                },
            });
        };
        let size = image_size(&self.root.join(&first.file))?;
        let pinhole = first.sensor.pinhole.unwrap_or([f64::NAN; 4]);
        let calibration = CameraCalibration::given(pinhole, size, calibrations.into())?;
        let vehicle_from_cam = first.sensor.vehicle_from_sensor;
        let poses = images.iter().chain(&scans);
        let mut poses: Vec<(i64, Se3)> = poses.map(|t| (t.ns, t.world_from_vehicle)).collect();
        poses.sort_by_key(|(ns, _)| *ns);
        let speeds = speed_log(&self.tables.join("ego_pose.json"), &poses);
        let truth = self.truth(&found, &scans, &calibration.intrinsics);
        let image = |(number, frame): &(u64, &SensorFrame)| TimedImage {
            number: *number,
            path: self.root.join(&frame.file),
            ns: Some(frame.ns),
        };
        PlainParts {
            kind: DatasetKind::NuScenes,
            folder: self.root.clone(),
            name,
            images: found.iter().map(image).collect(),
            video: None,
            calibration,
            camera_ahead_s: options.camera_ahead_s.unwrap_or(0.0),
            image_size: size,
            speeds: Some(speeds),
            mount_assumed: false,
            cam_from_vehicle: vehicle_from_cam.inverse(),
            camera: Camera::Left,
            truth,
            world_from_cam: found
                .iter()
                .map(|(number, frame)| (*number, frame.world_from_vehicle * vehicle_from_cam))
                .collect(),
            streams: Vec::new(),
            warnings,
            untimed_poses: false,
        }
        .into_dataset()
    }

    /// The scan of each image: the first that ended after it, moved to the vehicle's pose at the image's time.
    fn truth(
        &self,
        images: &[(u64, &SensorFrame)],
        scans: &[SensorFrame],
        camera: &Intrinsics,
    ) -> Option<MeasuredDepth> {
        // From the reader's axes (x forward, y left) to the LiDAR's (x right, y forward).
        let lidar_from_scan =
            Se3::from_axis_angle(Vector3::new(0.0, 0.0, FRAC_PI_2), Vector3::zeros());
        let mut files = BTreeMap::new();
        let mut times_s = Vec::new();
        for (number, image) in images {
            let scan = scans.get(scans.partition_point(|scan| scan.ns < image.ns));
            let scan = scan.filter(|scan| scan.ns.saturating_sub(image.ns) <= SCAN_WITHIN_NS);
            let Some((scan, file)) = scan.map(|scan| (scan, self.root.join(&scan.file))) else {
                continue;
            };
            if !file.is_file() {
                continue;
            }
            let world_from_cam = image.world_from_vehicle * image.sensor.vehicle_from_sensor;
            let world_from_lidar = scan.world_from_vehicle * scan.sensor.vehicle_from_sensor;
            let cam_from_scan = world_from_cam.inverse() * world_from_lidar * lidar_from_scan;
            files.insert(*number, PlacedScan::new(file, camera, &cam_from_scan));
            times_s.push(scan.ns as f64 * 1e-9);
        }
        (!files.is_empty()).then_some(MeasuredDepth::Scans(Scans {
            name: LIDAR,
            read: PointCloud::read_nuscenes_bin,
            files,
            times_s,
        }))
    }
}
