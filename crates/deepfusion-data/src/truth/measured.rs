//! Where a recording's measured depth is: images of it, or scans.

use super::depth_images::DepthImages;
use super::scan::GtKind;
use crate::kitti::{depth_map, numbered_files};
use crate::{Error, Lens, Result, Stream};
use deepfusion_geometry::cloud::PointCloud;
use deepfusion_geometry::{DepthMap, Intrinsics, Se3};
use nalgebra::Matrix3x4;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// The measured depth of a recording whose frames are files.
#[derive(Debug, Clone)]
pub(crate) enum MeasuredDepth {
    Images(DepthImages),
    Scans(Scans),
}

/// A LiDAR's scans by frame number.
#[derive(Debug, Clone)]
pub(crate) struct Scans {
    /// The sensor's or its folder's name.
    pub(crate) name: &'static str,
    /// Reads a file as points in metres: x forward, y left, z up.
    pub(crate) read: fn(&Path) -> deepfusion_geometry::cloud::Result<PointCloud>,
    pub(crate) files: BTreeMap<u64, PlacedScan>,
    /// When they were taken, in seconds; empty where that is not known.
    pub(crate) times_s: Vec<f64>,
}

/// A scan, and where it was when the frame was taken.
#[derive(Debug, Clone)]
pub(crate) struct PlacedScan {
    pub(crate) file: PathBuf,
    /// Homogeneous pixels and camera z from a point.
    pub(crate) pixels_from_scan: Matrix3x4<f64>,
}

impl PlacedScan {
    /// A scan of a frame whose camera has these intrinsics and sees a point of the scan there.
    pub(crate) fn new(file: PathBuf, camera: &Intrinsics, cam_from_scan: &Se3) -> Self {
        let motion = cam_from_scan.matrix();
        Self {
            file,
            pixels_from_scan: camera.matrix() * motion.fixed_rows::<3>(0),
        }
    }
}

/// The scans of a velodyne in a folder, `0000000000.bin` and so on, of the frames that have images; `None` without one. `cam_from_velo`
/// is asked only where there are some.
///
/// # Errors
/// [`Error::File`], and those of `cam_from_velo`.
pub(crate) fn velodyne(
    name: &'static str,
    folder: &Path,
    images: &[(u64, PathBuf)],
    camera: &Intrinsics,
    cam_from_velo: impl FnOnce() -> Result<Se3>,
) -> Result<Option<MeasuredDepth>> {
    let mut files = numbered_files(folder, &["bin"])?;
    files.retain(|(number, _)| images.binary_search_by_key(number, |i| i.0).is_ok());
    if files.is_empty() {
        return Ok(None);
    }
    let cam_from_velo = cam_from_velo()?;
    let placed = |(number, file)| (number, PlacedScan::new(file, camera, &cam_from_velo));
    Ok(Some(MeasuredDepth::Scans(Scans {
        name,
        read: PointCloud::read_kitti_bin,
        files: files.into_iter().map(placed).collect(),
        times_s: Vec::new(),
    })))
}

impl MeasuredDepth {
    /// What was recorded.
    pub(crate) fn stream(&self) -> Stream {
        match self {
            Self::Images(images) => Stream::new("depth", "depth", images.files.len(), &[]),
            Self::Scans(scans) => {
                Stream::new(scans.name, "point_cloud", scans.files.len(), &scans.times_s)
            }
        }
    }

    /// Whether a frame has depth.
    pub(crate) fn has(&self, frame: u64) -> bool {
        match self {
            Self::Images(images) => images.files.contains_key(&frame),
            Self::Scans(scans) => scans.files.contains_key(&frame),
        }
    }

    /// The depth of a frame at the size of its images; `drive` is named in errors.
    pub(crate) fn of(
        &self,
        frame: u64,
        kind: GtKind,
        lens: &Lens,
        drive: &str,
    ) -> Result<Option<DepthMap>> {
        match self {
            Self::Images(images) => {
                let Some(path) = images.files.get(&frame) else {
                    return Ok(None);
                };
                if kind != GtKind::Z {
                    let drive = drive.to_owned();
                    return Err(Error::DepthKind { drive, kind });
                }
                Ok(Some(lens.correct_depth(images.read(path)?)?))
            }
            Self::Scans(scans) => {
                let Some(scan) = scans.files.get(&frame) else {
                    return Ok(None);
                };
                if kind == GtKind::Annotated {
                    let drive = drive.to_owned();
                    return Err(Error::DepthKind { drive, kind });
                }
                let points = (scans.read)(&scan.file)?;
                let k = lens.intrinsics();
                let size = (k.width as usize, k.height as usize);
                Ok(Some(depth_map(&points, &scan.pixels_from_scan, size, kind)))
            }
        }
    }
}
