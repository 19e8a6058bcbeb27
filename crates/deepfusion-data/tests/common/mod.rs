//! Drives for the tests: tiny ones written here, and real ones if available.

pub(crate) mod bag;
pub(crate) mod folder;
pub(crate) mod street;

use deepfusion_data::DataWarning;
use deepfusion_geometry::cloud::PointCloud;
use image::{Rgb, RgbImage};
use std::fs;
use std::path::{Path, PathBuf};

/// A calibration similar to KITTI's of 2011_09_26, with rounder numbers, a smaller image, and cameras 2 and 3 half a
/// metre apart (t = P₄ / f: 0.06 m and -0.47 m).
pub(crate) const CAM_TO_CAM: &str = "calib_time: 09-Jan-2012 13:57:47\n\
S_rect_02: 6.200000e+01 1.900000e+01\n\
R_rect_00: 9.999239e-01 9.837760e-03 -7.445048e-03 -9.869795e-03 9.999421e-01 -4.278459e-03 7.402527e-03 4.351614e-03 9.999631e-01\n\
P_rect_02: 3.600000e+01 0.0 3.050000e+01 2.160000e+00 0.0 3.600000e+01 8.600000e+00 0.0 0.0 0.0 1.0 0.0\n\
S_rect_03: 6.200000e+01 1.900000e+01\n\
P_rect_03: 3.600000e+01 0.0 3.050000e+01 -1.692000e+01 0.0 3.600000e+01 8.600000e+00 0.0 0.0 0.0 1.0 0.0\n";

pub(crate) const VELO_TO_CAM: &str = "calib_time: 15-Mar-2012 11:37:16\n\
R: 7.533745e-03 -9.999714e-01 -6.166020e-04 1.480249e-02 7.280733e-04 -9.998902e-01 9.998621e-01 7.523790e-03 1.480755e-02\n\
T: -4.069766e-03 -7.631618e-02 -2.717806e-01\n";

pub(crate) const IMU_TO_VELO: &str = "calib_time: 25-May-2012 16:47:16\n\
R: 9.999976e-01 7.553071e-04 -2.035826e-03 -7.854027e-04 9.998898e-01 -1.482298e-02 2.024406e-03 1.482454e-02 9.998881e-01\n\
T: -8.086759e-01 3.195559e-01 -7.997231e-01\n";

/// A drive to write. All frames have the same speed and yaw rate, unless changed afterwards.
pub(crate) struct TinyDrive {
    pub frames: Vec<u64>,
    pub lines: usize,
    pub speed_mps: f64,
    pub yaw_rate_radps: f64,
    pub scans: Vec<u64>,
    pub cameras: Vec<u8>,
}

impl Default for TinyDrive {
    fn default() -> Self {
        Self {
            frames: (0..8).collect(),
            lines: 8,
            speed_mps: 10.0,
            yaw_rate_radps: 0.0,
            scans: vec![],
            cameras: vec![2],
        }
    }
}

pub(crate) const DRIVE: &str = "2030_01_02/2030_01_02_drive_0007_sync";

impl TinyDrive {
    /// Writes calibration and drive below `root`; returns the drive's folder.
    pub(crate) fn write(&self, root: &Path) -> PathBuf {
        self.write_as(root, DRIVE)
    }

    pub(crate) fn write_as(&self, root: &Path, name: &str) -> PathBuf {
        let drive = root.join(name);
        let date = drive.parent().unwrap();
        for camera in &self.cameras {
            let folder = drive.join(format!("image_0{camera}"));
            fs::create_dir_all(folder.join("data")).unwrap();
            for n in &self.frames {
                let image = RgbImage::from_fn(62, 19, |x, y| {
                    Rgb([(x * 4) as u8, (y * 13) as u8, (n * 30) as u8])
                });
                let path = folder.join(format!("data/{n:010}.png"));
                image.save(path).unwrap();
            }
            fs::write(folder.join("timestamps.txt"), stamps(self.lines, 0.345)).unwrap();
        }
        let oxts = drive.join("oxts");
        fs::create_dir_all(oxts.join("data")).unwrap();
        fs::write(oxts.join("timestamps.txt"), stamps(self.lines, 0.349)).unwrap();
        for n in 0..self.lines {
            let path = oxts.join(format!("data/{n:010}.txt"));
            fs::write(path, packet(self.speed_mps, self.yaw_rate_radps)).unwrap();
        }
        let velodyne = drive.join("velodyne_points/data");
        fs::create_dir_all(&velodyne).unwrap();
        for n in &self.scans {
            let file = fs::File::create(velodyne.join(format!("{n:010}.bin"))).unwrap();
            wall().write_kitti_bin(file).unwrap();
        }
        fs::write(date.join("calib_cam_to_cam.txt"), CAM_TO_CAM).unwrap();
        fs::write(date.join("calib_velo_to_cam.txt"), VELO_TO_CAM).unwrap();
        fs::write(date.join("calib_imu_to_velo.txt"), IMU_TO_VELO).unwrap();
        drive
    }
}

/// A wall 12 m ahead of the velodyne.
pub(crate) fn wall() -> PointCloud {
    let mut cloud = PointCloud::default();
    for i in -20..=20 {
        for j in -4..=1 {
            let point = [12.0, i as f32 * 0.5, j as f32 * 0.4];
            cloud.xyz.push(point);
        }
    }
    cloud
}

/// Time stamps 0.103 s apart, beginning `first` seconds into a minute.
fn stamps(lines: usize, first: f64) -> String {
    let line = |i: usize| {
        let s = first + 0.103 * i as f64;
        format!("2030-01-02 13:04:{s:012.9}\n")
    };
    (0..lines).map(line).collect()
}

pub(crate) fn packet(speed_mps: f64, yaw_rate_radps: f64) -> String {
    let mut values = [0.0; 30];
    values[8] = speed_mps;
    values[19] = yaw_rate_radps;
    let words: Vec<String> = values.iter().map(f64::to_string).collect();
    words.join(" ")
}

/// The warnings, one per line.
pub(crate) fn text_of(warnings: &[DataWarning]) -> String {
    let lines: Vec<String> = warnings.iter().map(ToString::to_string).collect();
    lines.join("\n")
}

/// A folder of real recordings below `DEEPFUSION_DATA`, or `../shared/data` beside the workspace. If it is
/// missing, prints that and returns `None`.
pub(crate) fn real_data(inner: &str) -> Option<PathBuf> {
    let workspace = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let root = std::env::var_os("DEEPFUSION_DATA")
        .map_or_else(|| workspace.join("../shared/data"), PathBuf::from);
    let path = root.join(inner);
    if path.exists() {
        return Some(path);
    }
    eprintln!(
        "skipped: {} does not exist (set DEEPFUSION_DATA)",
        path.display()
    );
    None
}

/// A copy of a real drive with its forward speeds multiplied by a factor, and links to its images.
#[cfg(unix)]
pub(crate) fn copy_with_speeds(drive: &Path, to: &Path, factor: f64) -> PathBuf {
    let link = |from: PathBuf, to: PathBuf| std::os::unix::fs::symlink(from, to).unwrap();
    let date = drive.parent().unwrap().canonicalize().unwrap();
    let drive = drive.canonicalize().unwrap();
    for entry in fs::read_dir(&date).unwrap() {
        let path = entry.unwrap().path();
        if path.is_file() {
            link(path.clone(), to.join(path.file_name().unwrap()));
        }
    }
    let copy = to.join(drive.file_name().unwrap());
    fs::create_dir_all(copy.join("oxts/data")).unwrap();
    link(drive.join("image_02"), copy.join("image_02"));
    link(
        drive.join("oxts/timestamps.txt"),
        copy.join("oxts/timestamps.txt"),
    );
    for entry in fs::read_dir(drive.join("oxts/data")).unwrap() {
        let path = entry.unwrap().path();
        let text = fs::read_to_string(&path).unwrap();
        let mut words: Vec<String> = text.split_whitespace().map(String::from).collect();
        words[8] = (words[8].parse::<f64>().unwrap() * factor).to_string();
        fs::write(
            copy.join("oxts/data").join(path.file_name().unwrap()),
            words.join(" "),
        )
        .unwrap();
    }
    copy
}
