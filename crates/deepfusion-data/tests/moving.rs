//! Dynamic pixels: from KITTI's tracklets with the vehicle's own motion, and from the simulator's masks.

use crate::common::{TinyDrive, real_data, wall};
use deepfusion_data::kitti::{Calibration, depth_map};
use deepfusion_data::{Camera, Dataset, Error, GtKind, MovingSource, OpenOptions};
use deepfusion_geometry::cloud::PointCloud;
use deepfusion_hint::Hint;
use std::fs;
use std::path::Path;

const FRAMES: u64 = 12;
/// Distance that the vehicle drives between frames, in metres: 10 m/s for 0.103 s.
const STEP_M: f64 = 1.03;

/// A tracklet in KITTI's format, 4 m × 2.3 m × 1.5 m; `at` gives x and y in the velodyne's axes for a frame.
fn tracklet(object: &str, at: impl Fn(f64) -> (f64, f64)) -> String {
    let pose = |frame: u64| {
        let (x, y) = at(frame as f64);
        format!(
            "<item><tx>{x}</tx><ty>{y}</ty><tz>-1.4</tz><rx>0</rx><ry>0</ry><rz>0</rz><state>1</state>\
             <occlusion>0</occlusion><truncation>0</truncation></item>\n"
        )
    };
    let poses: String = (0..FRAMES).map(pose).collect();
    format!(
        "<item class_id=\"1\" tracking_level=\"0\" version=\"1\">\n<objectType>{object}</objectType>\n\
         <h>1.5</h><w>2.3</w><l>4</l><first_frame>0</first_frame>\n<poses class_id=\"2\">\n\
         <count>{FRAMES}</count><item_version>2</item_version>\n{poses}</poses>\n<finished>1</finished>\n</item>\n"
    )
}

fn write_tracklets(drive: &Path, tracklets: &[String]) {
    let text = format!(
        "<?xml version=\"1.0\" encoding=\"UTF-8\" standalone=\"yes\" ?>\n<!DOCTYPE boost_serialization>\n\
         <boost_serialization signature=\"serialization::archive\" version=\"9\">\n\
         <tracklets class_id=\"0\" tracking_level=\"0\" version=\"0\">\n<count>{}</count>\n\
         <item_version>1</item_version>\n{}</tracklets>\n</boost_serialization>\n",
        tracklets.len(),
        tracklets.concat()
    );
    fs::write(drive.join("tracklet_labels.xml"), text).unwrap();
}

/// A car on the right at a constant distance, and one on the left that approaches like the road.
fn two_cars(drive: &Path) {
    write_tracklets(
        drive,
        &[
            tracklet("Car", |_| (12.0, -5.0)),
            tracklet("Van", |frame| (12.0 + (5.0 - frame) * STEP_M, 5.0)),
        ],
    );
}

fn drive_at(root: &Path, speed_mps: f64) -> std::path::PathBuf {
    TinyDrive {
        frames: (0..FRAMES).collect(),
        lines: FRAMES as usize,
        speed_mps,
        scans: vec![5],
        ..TinyDrive::default()
    }
    .write(root)
}

fn open(path: &Path) -> Dataset {
    Dataset::open(path, &OpenOptions::default())
        .unwrap()
        .remove(0)
}

/// The pixels of the wall's points within 1.2 m of `y`, from 1.3 m below the velodyne up to its height.
fn pixels_of_box(date: &Path, y: f32, kind: GtKind) -> Vec<bool> {
    let calibration = Calibration::read(date, Camera::Left).unwrap();
    let inside = |p: &[f32; 3]| (p[1] - y).abs() < 1.2 && (-1.3..0.1).contains(&p[2]);
    let points = PointCloud {
        xyz: wall().xyz.into_iter().filter(inside).collect(),
        ..PointCloud::default()
    };
    assert!(points.xyz.len() > 10);
    let pixels_from_velo = calibration.require_pixels_from_velo().unwrap();
    let map = depth_map(&points, &pixels_from_velo, (62, 19), kind);
    map.data.iter().map(|d| *d > 0.0).collect()
}

/// Boxes move relative to the road, not to the observing vehicle: with the same boxes and a vehicle at standstill,
/// the other one is moving.
#[test]
fn boxes_that_move_over_ground_are_dynamic() {
    for (speed_mps, moving_y) in [(10.0, -5.0), (0.0, 5.0)] {
        let folder = tempfile::tempdir().unwrap();
        let drive = drive_at(folder.path(), speed_mps);
        two_cars(&drive);
        let dataset = open(&drive);
        let labels = dataset.moving_labels().unwrap().unwrap();
        assert_eq!(labels.source(), MovingSource::Tracklets);
        for kind in [GtKind::Z, GtKind::Velodyne] {
            let truth = dataset.ground_truth(5, kind).unwrap().unwrap();
            let moving = labels.pixels(5, &truth, kind).unwrap().unwrap();
            let expected = pixels_of_box(drive.parent().unwrap(), moving_y, kind);
            assert_eq!(moving, expected, "{speed_mps} m/s, {kind:?}");
        }
    }
}

#[test]
fn without_labels_or_own_motion_dynamic_pixels_are_unknown() {
    let folder = tempfile::tempdir().unwrap();
    let drive = drive_at(folder.path(), 10.0);
    assert!(open(&drive).moving_labels().unwrap().is_none());
    // Without the vehicle's own motion, the boxes' motion over ground is unknown.
    two_cars(&drive);
    fs::remove_dir_all(drive.join("oxts")).unwrap();
    assert!(open(&drive).moving_labels().unwrap().is_none());
}

#[test]
fn errors_name_a_broken_file() {
    let folder = tempfile::tempdir().unwrap();
    let drive = drive_at(folder.path(), 10.0);
    two_cars(&drive);
    let path = drive.join("tracklet_labels.xml");
    let text = fs::read_to_string(&path).unwrap();
    fs::write(&path, text.replacen("<ty>-5</ty>", "<ty>left</ty>", 1)).unwrap();
    let error = open(&drive).moving_labels().unwrap_err();
    assert!(matches!(error, Error::Tracklets { .. }));
    let message = error.to_string();
    assert!(message.contains("tracklet_labels.xml"), "{message}");
    assert!(message.contains("tracklet 0, pose 0, ty"), "{message}");
    assert!(error.hint().is_some());
}

#[test]
fn masks_are_read_and_must_fit() {
    let folder = tempfile::tempdir().unwrap();
    let drive = drive_at(folder.path(), 10.0);
    let masks = drive.join("moving_02");
    fs::create_dir_all(&masks).unwrap();
    let mask = image::GrayImage::from_fn(62, 19, |x, _| image::Luma([if x < 3 { 255 } else { 0 }]));
    mask.save(masks.join("0000000005.png")).unwrap();
    image::GrayImage::new(60, 19)
        .save(masks.join("0000000006.png"))
        .unwrap();
    let dataset = open(&drive);
    let labels = dataset.moving_labels().unwrap().unwrap();
    assert_eq!(labels.source(), MovingSource::Masks);
    let truth = dataset.ground_truth(5, GtKind::Z).unwrap().unwrap();
    let moving = labels.pixels(5, &truth, GtKind::Z).unwrap().unwrap();
    assert!((0..62 * 19).all(|i| moving[i] == (i % 62 < 3)));
    assert!(labels.pixels(4, &truth, GtKind::Z).unwrap().is_none());
    let error = labels.pixels(6, &truth, GtKind::Z).unwrap_err();
    assert!(error.to_string().contains("60x19"), "{error}");
}

#[test]
fn exact_depth_is_only_that_of_the_simulator_and_its_sky_is_infinite() {
    let folder = tempfile::tempdir().unwrap();
    let drive = drive_at(folder.path(), 10.0);
    let depths = drive.join("proj_depth/groundtruth/image_02");
    fs::create_dir_all(&depths).unwrap();
    let gray = |width, height| {
        let depth = |x: u32, y: u32| if y < 4 { 0 } else { 256 * (x + 1) as u16 };
        image::ImageBuffer::from_fn(width, height, |x, y| image::Luma([depth(x, y)]))
    };
    gray(62, 19).save(depths.join("0000000005.png")).unwrap();
    gray(60, 19).save(depths.join("0000000006.png")).unwrap();
    // Without the simulator's masks, it may be KITTI's annotated depth, in which 0 means unknown.
    assert!(open(&drive).dense_depth(5).unwrap().is_none());
    fs::create_dir_all(drive.join("moving_02")).unwrap();
    let dataset = open(&drive);
    let depth = dataset.dense_depth(5).unwrap().unwrap();
    assert_eq!((depth.width, depth.height), (62, 19));
    assert_eq!(depth.data[3 * 62 + 7], f32::INFINITY);
    assert_eq!(depth.data[4 * 62 + 7], 8.0);
    assert!(dataset.dense_depth(4).unwrap().is_none());
    let error = dataset.dense_depth(6).unwrap_err().to_string();
    assert!(
        error.contains("the exact depth is 60x19, but the image is 62x19"),
        "{error}"
    );
}

/// KITTI's drive 0005: a van and a cyclist ahead throughout, parked cars in the second half.
#[test]
fn traffic_of_a_real_drive() {
    let Some(drive) = real_data("kitti_raw/2011_09_26/2011_09_26_drive_0005_sync") else {
        return;
    };
    let dataset = open(&drive);
    let labels = dataset.moving_labels().unwrap().unwrap();
    for frame in [20, 60, 100, 140] {
        let truth = dataset.ground_truth(frame, GtKind::Z).unwrap().unwrap();
        let moving = labels.pixels(frame as u64, &truth, GtKind::Z).unwrap();
        let count = moving.unwrap().iter().filter(|m| **m).count();
        let all = truth.data.iter().filter(|d| **d > 0.0).count();
        eprintln!("frame {frame}: {count} of {all} pixels move");
        assert!((100..all / 5).contains(&count), "{count} of {all}");
    }
}
