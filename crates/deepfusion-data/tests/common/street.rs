//! A small simulated drive with known motion, camera and depth, for tests that write it in another layout.

use deepfusion_data::{Dataset, Error, GtKind, OpenOptions};
use deepfusion_geometry::Se3;
use deepfusion_sim::{SimConfig, Simulation};
use nalgebra::Vector3;
use std::fs;
use std::path::Path;

/// A street with this many frames of 320×96.
pub(crate) fn street(frames: usize, fps: f64) -> Simulation {
    let config = SimConfig {
        seed: 12,
        frames,
        width: 320,
        height: 96,
        moving_cars: 0,
        scan_step_deg: 0.5,
        fps,
        ..SimConfig::default()
    };
    Simulation::new(&config).unwrap()
}

/// The data sets at a path, opened with default options.
pub(crate) fn open(path: &Path) -> Result<Vec<Dataset>, Error> {
    Dataset::open(path, &OpenOptions::default())
}

/// Writes a file, and creates its folders.
pub(crate) fn write(path: &Path, bytes: impl AsRef<[u8]>) {
    fs::create_dir_all(path.parent().unwrap()).unwrap();
    fs::write(path, bytes).unwrap();
}

/// Writes a frame's image as a PNG.
pub(crate) fn write_picture(street: &Simulation, frame: usize, path: &Path) {
    fs::create_dir_all(path.parent().unwrap()).unwrap();
    street.frame(frame).rgb.save(path).unwrap();
}

/// Writes a scan in KITTI's format.
pub(crate) fn write_scan(street: &Simulation, frame: usize, path: &Path) {
    fs::create_dir_all(path.parent().unwrap()).unwrap();
    let cloud = street.velodyne(frame);
    cloud
        .write_kitti_bin(fs::File::create(path).unwrap())
        .unwrap();
}

/// Numbers in KITTI's format.
pub(crate) fn numbers(values: impl IntoIterator<Item = f64>) -> String {
    let words: Vec<String> = values.into_iter().map(|v| format!("{v:.12e}")).collect();
    words.join(" ")
}

/// The upper three rows of a transform's matrix.
pub(crate) fn rows(pose: &Se3) -> Vec<f64> {
    let matrix = pose.matrix();
    (0..12).map(|i| matrix[(i / 4, i % 4)]).collect()
}

/// Compares the camera with the simulator's, to the precision of the files.
pub(crate) fn check_intrinsics(dataset: &Dataset, street: &Simulation) {
    let (read, exact) = (dataset.intrinsics(0).matrix(), street.intrinsics().matrix());
    assert!((read - exact).amax() < 1e-9, "{read} not {exact}");
}

/// Compares the camera's mount on the unit with the simulator's.
pub(crate) fn check_mount(dataset: &Dataset, street: &Simulation) {
    let off = dataset.cam_from_vehicle().unwrap().inverse() * street.rig().cam_from_imu();
    assert!(
        off.angle() < 1e-9 && off.translation().norm() < 1e-9,
        "{off:?}"
    );
}

/// Compares the frames' motion in a data set with the simulator's; `frame_of` gives the simulator's frame number for an index. Speeds
/// are those of the unit above the rear axle.
///
/// With a jerk of up to a few m/s³, a central difference at 10 Hz is off by jerk · (0.1 s)² / 6, below 1 cm/s, and by as much again for
/// the vehicle's bounce, which the speed does not include. The arc includes neither bounce (1.5 cm within about a second, 1 cm per frame)
/// nor slip.
pub(crate) fn check_motion(
    dataset: &Dataset,
    street: &Simulation,
    frame_of: impl Fn(usize) -> usize,
) {
    let frames = dataset.frames();
    let inner = 1..frames.len() - 1;
    for i in inner.clone() {
        let exact = street.oxts(frame_of(i)).forward_speed();
        let speed = frames[i].speed_mps.unwrap();
        assert!(
            (speed - exact).abs() < 0.03,
            "frame {i}: {speed} not {exact} m/s"
        );
        let yaw_rate = heading_rate(street, frame_of(i));
        let motion = dataset.track().unwrap();
        let (t0, t1) = (frames[i - 1].time_s.unwrap(), frames[i + 1].time_s.unwrap());
        let turned = motion.motion(t0, t1).unwrap().yaw_rad / (t1 - t0);
        assert!(
            (turned - yaw_rate).abs() < 0.01,
            "frame {i}: {turned} not {yaw_rate} rad/s"
        );
    }
    let snippets = dataset.snippets(&[1], 0.5).unwrap();
    assert_eq!(snippets.len(), frames.len() - 1);
    let (mut way, mut exact_way) = (0.0, 0.0);
    for snippet in &snippets {
        let i = snippet.target;
        let at = |i: usize| street.world_from_cam(frame_of(i));
        let exact = at(i + 1).inverse() * at(i);
        let source = &snippet.sources[0];
        way += source.motion.distance_m;
        exact_way += exact.translation().norm();
        let found = source.motion.source_from_target.unwrap();
        let off = found.inverse() * exact;
        let (moved, turned) = (off.translation().norm(), off.angle());
        assert!(
            moved < 0.03 && turned < 0.003,
            "pair {i}: {moved} m, {turned} rad"
        );
    }
    assert!(
        (way / exact_way - 1.0).abs() < 2e-3,
        "{way} not {exact_way} m"
    );
}

/// The unit's yaw rate about the vertical between the frames before and after one.
fn heading_rate(street: &Simulation, frame: usize) -> f64 {
    let heading = |frame: usize| {
        let ahead = street.world_from_imu(frame).rotate(&Vector3::x());
        ahead.y.atan2(ahead.x)
    };
    let (before, after) = (frame - 1, frame + 1);
    (heading(after) - heading(before)) / (street.time_s(after) - street.time_s(before))
}

/// Compares a frame's ground truth from the scan with the simulator's exact depth. The scanner has another viewpoint, so at silhouettes a
/// pixel may have the depth of the background, and its ranges have a noise of 2 cm. So most pixels agree to 2 %, but not all.
pub(crate) fn check_truth(dataset: &Dataset, index: usize, exact: &deepfusion_geometry::DepthMap) {
    let truth = dataset.ground_truth(index, GtKind::Z).unwrap().unwrap();
    assert_eq!((truth.width, truth.height), (exact.width, exact.height));
    let pairs = truth.data.iter().zip(&exact.data);
    let known: Vec<f32> = pairs
        .filter(|(scan, exact)| **scan > 0.0 && **exact > 0.0)
        .map(|(scan, exact)| (scan / exact - 1.0).abs())
        .collect();
    let close = known.iter().filter(|off| **off < 0.02).count();
    assert!(known.len() > 1000, "{} pixels", known.len());
    let share = close as f64 / known.len() as f64;
    assert!(share > 0.85, "{share} of {} pixels", known.len());
}

/// Compares the path with the simulator's, relative to the first frame.
pub(crate) fn check_path(
    dataset: &Dataset,
    street: &Simulation,
    frame_of: impl Fn(usize) -> usize,
) {
    let paths = dataset.camera_paths().unwrap();
    assert_eq!(paths.len(), 1);
    let path = &paths[0];
    assert_eq!(path.frames.len(), dataset.frames().len());
    assert_eq!(path.times_s.len(), path.frames.len());
    let first = path.world_from_cam[0].inverse();
    let exact_first = street.world_from_cam(frame_of(0)).inverse();
    for (i, pose) in path.world_from_cam.iter().enumerate() {
        let exact = exact_first * street.world_from_cam(frame_of(i));
        let off = (first * *pose).inverse() * exact;
        // The files have twelve digits, for positions of some hundred metres.
        assert!(
            off.translation().norm() < 1e-6 && off.angle() < 1e-6,
            "{i}: {off:?}"
        );
    }
}
