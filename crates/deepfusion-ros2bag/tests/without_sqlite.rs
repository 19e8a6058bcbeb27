//! What a build without SQLite reads, and its error for a bag that needs SQLite.

#![cfg(not(feature = "ros2-sqlite"))]

use deepfusion_hint::Hint;
use deepfusion_ros2bag::{Ros2Bag, is_ros2_bag};
use deepfusion_rosbag::{Error, MessageSource, Selection};
use std::path::{Path, PathBuf};

fn reference(name: &str) -> PathBuf {
    let tests = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/reference");
    tests.join(name)
}

#[test]
fn the_error_for_a_database_names_the_feature() {
    for name in ["sqlite", "sqlite/sqlite.db3"] {
        assert!(is_ros2_bag(&reference(name)), "{name}");
        let error = Ros2Bag::open(reference(name)).unwrap_err();
        assert!(matches!(error, Error::Feature { .. }), "{error}");
        let (text, hint) = (error.to_string(), error.hint().unwrap());
        for part in ["sqlite.db3", "a ROS 2 bag in SQLite", "`ros2-sqlite`"] {
            assert!(text.contains(part), "{text}");
        }
        assert!(hint.contains("`ros2-sqlite`"), "{hint}");
    }
}

#[test]
fn every_kind_of_mcap_is_read_without_sqlite() {
    for name in ["mcap", "none.mcap", "lz4.mcap", "zstd.mcap", "bare.mcap"] {
        let bag = Ros2Bag::open(reference(name)).unwrap();
        let messages = bag.messages(Selection::all()).unwrap();
        assert_eq!(messages.filter(Result::is_ok).count(), 48, "{name}");
    }
}
