//! A simulated drive as a ROS 1 bag and, by `reference/drive_to_ros2.py`, as ROS 2 bags: the same data set.

use deepfusion_data::{Dataset, DatasetKind, Error, GtKind, OpenOptions, Split};
use deepfusion_ros2bag::Ros2Bag;
use std::path::{Path, PathBuf};
use std::sync::Arc;

fn drive(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("tests/reference/drive")
        .join(name)
}

fn ros2(name: &str) -> Dataset {
    let bag = Ros2Bag::open(drive(name)).unwrap();
    Dataset::from_messages(Arc::new(bag), &OpenOptions::default()).unwrap()
}

#[test]
fn the_data_set_equals_that_of_the_ros1_bag() {
    let mut all = Dataset::open(&drive("drive.bag"), &OpenOptions::default()).unwrap();
    let expected = all.remove(0);
    assert_eq!(expected.frames().len(), 10);
    assert!(expected.yaw_known());
    let track = expected.track().unwrap();
    for name in ["sqlite", "zstd.mcap"] {
        let found = ros2(name);
        assert_eq!(found.kind(), DatasetKind::Bag);
        assert_eq!(found.scenario(), Some("urban"));
        assert_eq!(found.frames().len(), 10, "{name}");
        assert_eq!(found.intrinsics(0), expected.intrinsics(0));
        assert_eq!(found.cam_from_vehicle(), expected.cam_from_vehicle());
        assert_eq!(found.origin_ns(), expected.origin_ns());
        assert_eq!(found.warnings(), expected.warnings());
        assert_eq!(found.streams().unwrap(), expected.streams().unwrap());
        let (labels, expected_labels) = (found.moving_labels(), expected.moving_labels());
        assert!(labels.unwrap().is_some() && expected_labels.unwrap().is_some());
        let mut depths = 0;
        for (i, (a, b)) in found.frames().iter().zip(expected.frames()).enumerate() {
            assert_eq!(
                (a.time_s, a.speed_mps),
                (b.time_s, b.speed_mps),
                "{name} {i}"
            );
            assert_eq!(
                found.load_image(i).unwrap(),
                expected.load_image(i).unwrap(),
                "{name} {i}"
            );
            let depth = |dataset: &Dataset| dataset.ground_truth(i, GtKind::Z).unwrap();
            let (depth, expected) = (depth(&found), depth(&expected));
            assert_eq!(depth, expected, "{name} {i}");
            depths += usize::from(depth.is_some_and(|d| d.data.iter().any(|z| *z > 0.0)));
        }
        assert_eq!(depths, 6, "frames with a scan near enough");
        let (from_s, to_s) = (0.04, 0.32);
        let motion = found.track().unwrap().motion(from_s, to_s).unwrap();
        assert_eq!(Some(motion), track.motion(from_s, to_s), "{name}");
        assert!(motion.distance_m > 0.5, "{motion:?}");
        let paths = |dataset: &Dataset| dataset.camera_paths().unwrap().len();
        assert_eq!(paths(&found), paths(&expected));
    }
}

#[test]
fn a_split_selects_drives_by_scenario() {
    let file = tempfile::NamedTempFile::new().unwrap();
    let open = |text: &str| {
        std::fs::write(file.path(), text).unwrap();
        let options = OpenOptions {
            split: Some(Split::read(file.path()).unwrap()),
            ..OpenOptions::default()
        };
        Dataset::open(&drive("drive.bag"), &options)
    };
    assert_eq!(open("scenario = urban\n").unwrap()[0].selected().len(), 10);
    let both = open("drive 3 l\nscenario = garage\n").unwrap();
    assert_eq!(both[0].selected(), [3]);
    let error = open("scenario = garage\n").unwrap_err();
    assert!(
        matches!(error, Error::SplitSelectsNothing { .. }),
        "{error}"
    );
    assert!(error.to_string().contains("scenario = garage"), "{error}");
}
