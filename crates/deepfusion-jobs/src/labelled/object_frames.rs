//! KITTI's object frames: `image_2`, `velodyne`, `calib`, `label_2`, with one number for each frame.

use std::path::{Path, PathBuf};

use deepfusion_data::{Error as DataError, MissingPart, image_size};
use deepfusion_geometry::cloud::PointCloud;
use deepfusion_geometry::{DepthMap, Intrinsics};
use deepfusion_perception::{Label, Target};
use nalgebra::{Matrix3, Matrix3x4, Vector3};

use super::tracklets::pixels_within;
use super::visibility::{VisibilityDepth, counts};
use crate::{Error, Result};

/// A label counts if its box contains at least this many points of the scan.
const LEAST_POINTS: usize = 15;

/// One labelled frame.
pub(super) struct ObjectFrame {
    /// Path of the image.
    pub(super) image: PathBuf,
    /// The image's camera.
    pub(super) camera: Intrinsics,
    /// The scan as a depth map at the image's size, in metres.
    pub(super) scan: DepthMap,
    /// Its labels.
    pub(super) labels: Vec<Label>,
    /// Left, top, right and bottom of the regions without labels, in pixels.
    pub(super) unlabelled: Vec<[f64; 4]>,
}

/// Whether a folder has this layout.
#[must_use]
pub fn is_folder_of(path: &Path) -> bool {
    ["label_2", "velodyne", "calib"]
        .iter()
        .all(|folder| path.join(folder).is_dir())
}

/// The label files, one for each frame, in the order of their numbers.
///
/// # Errors
/// A folder that cannot be read.
pub(super) fn labels_of(folder: &Path) -> Result<Vec<PathBuf>> {
    let labels = folder.join("label_2");
    let entries = std::fs::read_dir(&labels).map_err(|e| DataError::file(&labels, e))?;
    let mut paths: Vec<PathBuf> = entries.filter_map(|e| Some(e.ok()?.path())).collect();
    paths.retain(|path| path.extension().is_some_and(|e| e == "txt"));
    paths.sort();
    Ok(paths)
}

impl ObjectFrame {
    /// Reads the frame of a label file.
    ///
    /// # Errors
    /// A file that is missing or invalid.
    pub(super) fn read(folder: &Path, labels: &Path) -> Result<Self> {
        let name = labels.file_stem().unwrap_or_default().to_string_lossy();
        let image = ["png", "jpg"]
            .map(|ending| folder.join(format!("image_2/{name}.{ending}")))
            .into_iter()
            .find(|path| path.exists())
            .ok_or_else(|| DataError::Missing {
                path: folder.join(format!("image_2/{name}.png")),
                part: MissingPart::LabelledImage,
            })?;
        let calib = Calib::read(&folder.join(format!("calib/{name}.txt")))?;
        let (width, height) = image_size(&image)?;
        let p2 = calib.p2;
        let pinhole = [(0, 0), (1, 1), (0, 2), (1, 2)].map(|place| p2[place]);
        let camera = Intrinsics::from_numbers(pinhole, (width, height));
        // P2 = K·[I | t]: t is the offset of camera 2 from camera 0, which the labels refer to.
        let offset = camera.inverse_matrix() * p2.column(3);
        let cloud = PointCloud::read_kitti_bin(&folder.join(format!("velodyne/{name}.bin")))?;
        let mut scan = DepthMap::empty(width as usize, height as usize);
        for point in cloud.xyz.iter().filter(|p| p[0] >= 0.0) {
            let p = Vector3::from(point.map(f64::from)).push(1.0);
            let in_cam = calib.rectified * (calib.cam_from_velo * p) + offset;
            if let Some(pixel) = camera.project(&in_cam) {
                let (u, v) = (pixel.x.round(), pixel.y.round());
                if u >= 0.0 && v >= 0.0 && u < f64::from(width) && v < f64::from(height) {
                    scan.set_nearest(u as usize, v as usize, in_cam.z as f32);
                }
            }
        }
        let visibility = VisibilityDepth {
            depth: scan,
            dense: false,
        };
        let text = std::fs::read_to_string(labels).map_err(|e| DataError::file(labels, e))?;
        let (mut found, mut unlabelled) = (Vec::new(), Vec::new());
        for (number, line) in text
            .lines()
            .enumerate()
            .filter(|(_, l)| !l.trim().is_empty())
        {
            let (class, mut label) =
                parse(line, number as u64, &offset).ok_or_else(|| Error::ObjectFrame {
                    path: labels.to_owned(),
                    problem: ObjectFrameProblem::Label { line: number + 1 },
                })?;
            if class == "DontCare" {
                unlabelled.extend(rectangle(line));
                continue;
            }
            let seen = pixels_within(&label, &visibility, &camera, LEAST_POINTS);
            label.counts = counts(&label, class, seen, LEAST_POINTS);
            found.push(label);
        }
        Ok(Self {
            image,
            camera,
            scan: visibility.depth,
            labels: found,
            unlabelled,
        })
    }

    /// Whether a target's centre is in a region without labels.
    pub(super) fn is_unlabelled(&self, target: &Target) -> bool {
        let pixel = self.camera.project(&Vector3::from(target.center_m));
        pixel.is_some_and(|p| {
            let mut regions = self.unlabelled.iter();
            regions.any(|[left, top, right, bottom]| {
                (*left..=*right).contains(&p.x) && (*top..=*bottom).contains(&p.y)
            })
        })
    }
}

/// Left, top, right and bottom of a label's rectangle.
fn rectangle(line: &str) -> Option<[f64; 4]> {
    let numbers = line.split_whitespace().skip(4).take(4);
    let numbers: Vec<f64> = numbers.map(str::parse).collect::<Result<_, _>>().ok()?;
    numbers.try_into().ok()
}

/// Parses a label: type, truncated, occluded, alpha, the rectangle's four sides, height, width, length, x, y, z of the bottom in camera 0,
/// rotation_y.
fn parse<'a>(line: &'a str, object: u64, offset: &Vector3<f64>) -> Option<(&'a str, Label)> {
    let mut words = line.split_whitespace();
    let class = words.next()?;
    let numbers: Vec<f64> = words.map(str::parse).collect::<Result<_, _>>().ok()?;
    let [height, width, length, x, y, z, yaw_rad] = *numbers.get(7..14)?.first_chunk::<7>()?;
    let bottom = Vector3::new(x, y, z) + offset;
    Some((
        class,
        Label {
            object,
            center_m: [bottom.x, bottom.y - 0.5 * height, bottom.z],
            size_m: [length, width, height],
            yaw_rad,
            velocity_mps: None,
            counts: true,
        },
    ))
}

/// What is wrong with a file of KITTI's object frames.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum ObjectFrameProblem {
    /// A line that is not a label.
    #[error("line {line}: not a label of 15 fields")]
    Label {
        /// Number of the line, counted from 1.
        line: usize,
    },
    /// A calibration's field with a wrong number of values.
    #[error("{field}: expected {count} numbers")]
    Calibration {
        /// Name of the field, such as `P2`.
        field: &'static str,
        /// Expected number of values.
        count: usize,
    },
}

/// A frame's calibration.
struct Calib {
    p2: Matrix3x4<f64>,
    rectified: Matrix3<f64>,
    cam_from_velo: Matrix3x4<f64>,
}

impl Calib {
    fn read(path: &Path) -> Result<Self> {
        let text = std::fs::read_to_string(path).map_err(|e| DataError::file(path, e))?;
        let field = |name: &'static str, count: usize| -> Result<Vec<f64>> {
            let line = text.lines().find_map(|line| line.strip_prefix(name));
            let numbers = line.map(|line| {
                line.trim_start_matches(':')
                    .split_whitespace()
                    .filter_map(|word| word.parse().ok())
                    .collect::<Vec<f64>>()
            });
            numbers
                .filter(|numbers| numbers.len() == count)
                .ok_or_else(|| Error::ObjectFrame {
                    path: path.to_owned(),
                    problem: ObjectFrameProblem::Calibration { field: name, count },
                })
        };
        Ok(Self {
            p2: Matrix3x4::from_row_slice(&field("P2", 12)?),
            rectified: Matrix3::from_row_slice(&field("R0_rect", 9)?),
            cam_from_velo: Matrix3x4::from_row_slice(&field("Tr_velo_to_cam", 12)?),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_label_is_parsed_and_a_short_one_rejected() {
        let line =
            "Car 0.00 1 -1.57 599.41 156.40 629.75 189.25 2.85 2.63 12.34 0.47 1.49 69.44 -1.56";
        let (class, label) = parse(line, 3, &Vector3::new(0.06, 0.0, 0.0)).unwrap();
        assert_eq!((class, label.object), ("Car", 3));
        assert_eq!(label.size_m, [12.34, 2.63, 2.85]);
        assert!((label.center_m[0] - 0.53).abs() < 1e-9);
        assert!((label.center_m[1] - (1.49 - 1.425)).abs() < 1e-9);
        assert_eq!(label.yaw_rad, -1.56);
        assert_eq!(rectangle(line), Some([599.41, 156.4, 629.75, 189.25]));
        assert!(parse("Car 0 1 2", 0, &Vector3::zeros()).is_none());
        assert!(parse("Car a b c d e f g h i j k l m n", 0, &Vector3::zeros()).is_none());
    }
}
