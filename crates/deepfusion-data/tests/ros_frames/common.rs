//! Small bags, and checks of their recordings.

use crate::common::bag::TinyBag;
use deepfusion_data::{Dataset, Error, NamedTopic, OpenOptions};
use deepfusion_hint::Hint;
use nalgebra::Vector3;
use std::fs;
use std::path::{Path, PathBuf};
use tempfile::TempDir;

pub(super) fn reference(name: &str) -> PathBuf {
    let tests = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/reference/ros");
    tests.join(name)
}

pub(super) fn open(bag: &Path) -> Result<Dataset, Error> {
    open_with(bag, &[])
}

pub(super) fn open_with(bag: &Path, topics: &[&str]) -> Result<Dataset, Error> {
    let topics: Vec<NamedTopic> = topics.iter().map(|t| t.parse().unwrap()).collect();
    let options = OpenOptions {
        topics,
        ..OpenOptions::default()
    };
    Ok(Dataset::open(bag, &options)?.remove(0))
}

pub(super) fn assert_contains(text: &str, parts: &[&str]) {
    for part in parts {
        assert!(text.contains(part), "`{part}` is not in: {text}");
    }
}

/// The rotation from a camera's axes (right, down, forward) to a body's (forward, left, up), as an axis-angle vector: 120° about (-1, 1,
/// -1)/√3.
pub(super) const OPTICAL: [f64; 3] = [
    -1.209_199_576_156_145,
    1.209_199_576_156_145,
    -1.209_199_576_156_145,
];
pub(super) const STILL: [f64; 3] = [0.0; 3];

/// A bag `drive.bag` in a folder of its own, with a file beside it unless its text is empty.
pub(super) struct Drive {
    _folder: TempDir,
    pub(super) bag: PathBuf,
}

impl Drive {
    /// A bag with images of the frame `camera`, and a speed.
    pub(super) fn new(sidecar: &str, fill: impl FnOnce(&mut TinyBag)) -> Self {
        Self::bare(sidecar, |bag| {
            bag.within("camera").images("/camera/image");
            bag.camera_info("/camera/camera_info", 60.0);
            bag.within("base_link").twist("/speed", 10.0);
            fill(bag);
        })
    }

    pub(super) fn bare(sidecar: &str, fill: impl FnOnce(&mut TinyBag)) -> Self {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("drive.bag");
        let mut bag = TinyBag::empty(&path);
        fill(&mut bag);
        bag.finish();
        if !sidecar.is_empty() {
            fs::write(path.with_extension("toml"), sidecar).unwrap();
        }
        Self {
            _folder: folder,
            bag: path,
        }
    }

    pub(super) fn opened(&self) -> Dataset {
        open(&self.bag).unwrap()
    }

    pub(super) fn refusal(&self) -> String {
        refusal(open(&self.bag))
    }
}

pub(super) fn refusal(opened: Result<Dataset, Error>) -> String {
    let error = opened.unwrap_err();
    format!("{error}\nhint: {}", error.hint().unwrap_or_default())
}

/// The camera's position and viewing direction in the vehicle's axes.
pub(super) fn camera(dataset: &Dataset) -> (Vector3<f64>, Vector3<f64>) {
    let vehicle_from_cam = dataset.cam_from_vehicle().unwrap().inverse();
    (
        vehicle_from_cam.translation(),
        vehicle_from_cam.rotate(&Vector3::z()),
    )
}

pub(super) fn is_near(found: &Vector3<f64>, expected: [f64; 3]) {
    let apart = (found - Vector3::from(expected)).norm();
    assert!(apart < 1e-9, "{found}, not {expected:?}");
}
