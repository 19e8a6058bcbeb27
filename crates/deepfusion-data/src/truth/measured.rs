//! A recording's measured depth: depth images or scans.

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
    /// Name of the sensor or its folder.
    pub(crate) name: &'static str,
    /// Reads a file as points in metres: x forward, y left, z up.
    pub(crate) read: fn(&Path) -> deepfusion_geometry::cloud::Result<PointCloud>,
    pub(crate) files: BTreeMap<u64, PlacedScan>,
    /// Times of the scans, in seconds; empty if unknown.
    pub(crate) times_s: Vec<f64>,
}

/// A scan, with its projection into its frame.
#[derive(Debug, Clone)]
pub(crate) struct PlacedScan {
    pub(crate) file: PathBuf,
    /// Projection from a point to homogeneous pixels and camera z.
    pub(crate) pixels_from_scan: Matrix3x4<f64>,
}

impl PlacedScan {
    /// The scan of a frame with these intrinsics, at `cam_from_scan`.
    pub(crate) fn new(file: PathBuf, camera: &Intrinsics, cam_from_scan: &Se3) -> Self {
        let motion = cam_from_scan.matrix();
        Self {
            file,
            pixels_from_scan: camera.matrix() * motion.fixed_rows::<3>(0),
        }
    }
}

/// The velodyne scans in a folder (`0000000000.bin` and so on) for frames that have images; `None` without scans, in which case
/// `cam_from_velo` is not called.
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
    /// The stream of depth images or scans.
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

    /// The depth of a frame at the size of its images; errors name `drive`.
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
