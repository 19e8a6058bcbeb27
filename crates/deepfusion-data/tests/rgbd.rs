//! Folders of colour, depth and pose files.

use crate::common;
use deepfusion_data::{Dataset, DatasetKind, GtKind, OpenOptions, inspect};
use deepfusion_hint::Hint;
use image::{ImageBuffer, Luma, RgbImage};
use std::fs;
use std::path::Path;

fn write_frame(folder: &Path, n: u32) {
    let at = |ending: &str| folder.join(format!("frame-{n:06}.{ending}"));
    fs::create_dir_all(folder).unwrap();
    RgbImage::new(8, 6).save(at("color.png")).unwrap();
    let depth: ImageBuffer<Luma<u16>, _> =
        ImageBuffer::from_fn(8, 6, |x, _| Luma([[0, 65_535, 1500][x.min(2) as usize]]));
    depth.save(at("depth.png")).unwrap();
    let pose = match n {
        2 => "nan 0 0 0 0 1 0 0 0 0 1 0 0 0 0 1".to_owned(),
        _ => format!(
            "1 0 0 {}\n0 1 0 0\n0 0 1 0.5\n0 0 0 1\n",
            f64::from(n) * 0.1
        ),
    };
    fs::write(at("pose.txt"), pose).unwrap();
}

fn open(path: &Path) -> Result<Vec<Dataset>, String> {
    let opened = Dataset::open(path, &OpenOptions::default());
    opened.map_err(|e| format!("{e}\nhint: {}", e.hint().unwrap_or_default()))
}

#[test]
fn the_hint_has_the_published_camera_but_it_is_not_used() {
    let root = tempfile::tempdir().unwrap();
    write_frame(root.path(), 0);
    let text = open(root.path()).unwrap_err();
    assert!(text.contains("intrinsics = [585, 585, 320, 240]"), "{text}");
}

#[test]
fn depth_and_poses_are_read_and_lost_poses_are_left_out() {
    let root = tempfile::tempdir().unwrap();
    let sequence = root.path().join("chess/seq-01");
    for n in 0..5 {
        write_frame(&sequence, n);
    }
    // The calibration file may be in the folder above the sequences.
    fs::write(
        root.path().join("chess/camera-intrinsics.txt"),
        "7 0 3.5\n0 7 2.5\n0 0 1\n",
    )
    .unwrap();
    let datasets = open(&root.path().join("chess")).unwrap();
    let dataset = &datasets[0];
    assert_eq!(
        (dataset.kind(), dataset.name()),
        (DatasetKind::RgbD, "seq-01")
    );
    let map = dataset.ground_truth(3, GtKind::Z).unwrap().unwrap();
    assert_eq!(map.data[..3], [0.0, 0.0, 1.5]);
    // Frame 2 has no pose, so two segments remain.
    let paths = dataset.camera_paths().unwrap();
    assert_eq!(
        paths.iter().map(|p| p.frames.clone()).collect::<Vec<_>>(),
        [[0, 1], [3, 4]]
    );
    assert!((paths[1].world_from_cam[1].translation().x - 0.4).abs() < 1e-12);
    let error = dataset.snippets(&[1], 0.5).unwrap_err();
    assert!(error.to_string().contains(": no speeds"), "{error}");
    assert!(
        error.hint().unwrap().contains("evaluate and predict"),
        "{error}"
    );
    fs::write(sequence.join("frame-000001.pose.txt"), "1 2 3").unwrap();
    assert!(
        open(&sequence)
            .unwrap_err()
            .contains("3 numbers, expected 16")
    );
}

#[test]
fn the_real_sequences_open() {
    let Some(folder) = common::real_data("indoor") else {
        return;
    };
    let scenes = open(&folder.join("7scenes_like")).unwrap();
    assert_eq!(
        (scenes[0].frames().len(), scenes[0].intrinsics(0).fx),
        (25, 585.0)
    );
    let map = scenes[0].ground_truth(0, GtKind::Z).unwrap().unwrap();
    let known: Vec<f32> = map.data.iter().copied().filter(|d| *d > 0.0).collect();
    // By NumPy: frame 0 without the values 0 and 65535.
    let mean = known.iter().map(|d| f64::from(*d)).sum::<f64>() / known.len() as f64;
    assert_eq!(known.len(), 273_943);
    assert!((mean - 1.923_109).abs() < 1e-5, "{mean}");
    let paths = scenes[0].camera_paths().unwrap();
    assert_eq!(paths[0].world_from_cam.len(), 25);
    let seen = inspect(&folder.join("7scenes_like")).unwrap();
    assert_eq!((seen.drives[0].scans, seen.size), (25, Some([640, 480])));

    let nyu = open(&folder.join("deepv2d_nyu_0")).unwrap();
    assert_eq!(
        (nyu[0].kind(), nyu[0].frames().len()),
        (DatasetKind::Folder, 4)
    );
    assert!((nyu[0].intrinsics(0).cy - 253.736).abs() < 1e-3);
    assert_eq!(nyu[0].load_image(3).unwrap().dimensions(), (640, 480));
}
