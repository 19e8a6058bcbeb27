//! ROS 2 bags by their path; an error where the feature is off.

use deepfusion_data::{Dataset, OpenOptions};
use std::path::{Path, PathBuf};

/// A simulated drive as ROS 1 and ROS 2 bags, from the reader's own tests.
fn drive(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("../deepfusion-ros2bag/tests/reference/drive")
        .join(name)
}

#[cfg(feature = "ros2")]
mod on {
    use super::*;
    use deepfusion_data::{DatasetKind, inspect};

    #[test]
    fn a_folder_and_a_file_are_opened_by_path() {
        for (name, called) in [
            ("sqlite", "sqlite"),
            ("sqlite/sqlite.db3", "sqlite"),
            ("zstd.mcap", "zstd"),
        ] {
            let all = Dataset::open(&drive(name), &OpenOptions::default()).unwrap();
            assert_eq!(all.len(), 1);
            assert_eq!((all[0].name(), all[0].kind()), (called, DatasetKind::Bag));
            assert_eq!(all[0].frames().len(), 10);
            // `bag.toml` of the folder above also applies to the file within the bag's folder, since there is none nearer.
            if name != "sqlite/sqlite.db3" {
                assert_eq!(all[0].scenario(), Some("urban"), "{name}");
            }
        }
        let seen = inspect(&drive("sqlite")).unwrap();
        assert_eq!((seen.frames, seen.size), (10, Some([64, 48])));
    }

    #[test]
    fn all_bags_of_a_folder_are_opened() {
        let all = Dataset::open(&drive(""), &OpenOptions::default()).unwrap();
        let names: Vec<&str> = all.iter().map(Dataset::name).collect();
        assert_eq!(names, ["drive", "sqlite", "zstd"]);
    }

    #[test]
    fn the_nearest_file_beside_a_bag_is_used() {
        let folder = tempfile::tempdir().unwrap();
        let bag = folder.path().join("drive.2024");
        std::fs::create_dir(&bag).unwrap();
        for name in ["metadata.yaml", "sqlite.db3"] {
            std::fs::copy(drive("sqlite").join(name), bag.join(name)).unwrap();
        }
        let scenario = || {
            let all = Dataset::open(&bag, &OpenOptions::default()).unwrap();
            all[0].scenario().map(str::to_owned)
        };
        assert_eq!(scenario(), None);
        for (place, name) in [
            ("bag.toml", "far"),
            ("drive.2024.toml", "beside"),
            ("drive.2024/bag.toml", "within"),
        ] {
            let text = format!("scenario = \"{name}\"\n");
            std::fs::write(folder.path().join(place), text).unwrap();
            assert_eq!(scenario().as_deref(), Some(name));
        }
    }
}

#[cfg(not(feature = "ros2"))]
#[test]
fn without_the_feature_a_bag_is_an_error_that_names_it() {
    for name in ["sqlite", "sqlite/sqlite.db3", "zstd.mcap"] {
        let error = Dataset::open(&drive(name), &OpenOptions::default()).unwrap_err();
        let text = error.to_string();
        assert!(
            text.contains("ROS 2 bag") && text.contains("feature `ros2`"),
            "{text}"
        );
    }
}
