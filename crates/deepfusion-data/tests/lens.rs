//! Lens correction, compared with OpenCV and SciPy (`reference/lens_opencv.py`).

use deepfusion_data::{Lens, load_rgb};
use deepfusion_geometry::{Distortion, Intrinsics};
use std::path::Path;

fn intrinsics(numbers: &[f64]) -> Intrinsics {
    Intrinsics {
        fx: numbers[0],
        fy: numbers[1],
        cx: numbers[2],
        cy: numbers[3],
        width: 96,
        height: 64,
    }
}

#[test]
fn corrected_images_equal_opencvs() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/reference");
    let text = std::fs::read_to_string(folder.join("lens_opencv.txt")).unwrap();
    let source = load_rgb(&folder.join("lens_source.png")).unwrap();
    let numbers = |line: &str, skip| -> Vec<f64> {
        let words = line.split_whitespace().skip(skip);
        words.map(|w| w.parse().unwrap()).collect()
    };
    let lines: Vec<&str> = text.lines().collect();
    let camera = intrinsics(&numbers(lines[0], 1));
    for block in lines[1..].chunks(3) {
        let name = block[0].split_whitespace().nth(1).unwrap();
        let bent = Distortion::from_opencv(&numbers(block[0], 2)).unwrap();
        let lens = Lens::new(camera, &bent).unwrap();
        let k = lens.intrinsics();
        let found = [k.fx, k.fy, k.cx, k.cy];
        // The same rule over the same points; only the iterations stop at different points.
        for (a, b) in found.iter().zip(numbers(block[1], 1)) {
            assert!((a - b).abs() < 1e-5, "{name}: {found:?} {b}");
        }
        // OpenCV's function samples fewer points of the border, which is curved between them.
        for (a, b) in found.iter().zip(numbers(block[2], 1)) {
            assert!((a - b).abs() < 0.05, "{name}: {found:?} {b}");
        }
        assert_looks_like(&lens, &source, &folder, name);
    }
}

/// The same for fisheye lenses, one of which has a wider view than a pinhole image can.
#[test]
fn corrected_fisheye_images_equal_opencvs() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/reference");
    let text = std::fs::read_to_string(folder.join("lens_fisheye_opencv.txt")).unwrap();
    let source = load_rgb(&folder.join("lens_source.png")).unwrap();
    let lines: Vec<&str> = text.lines().collect();
    assert_eq!(lines.len(), 4);
    for block in lines.chunks(2) {
        let words: Vec<&str> = block[0].split_whitespace().skip(1).collect();
        let numbers =
            |words: &[&str]| -> Vec<f64> { words.iter().map(|w| w.parse().unwrap()).collect() };
        let (name, given) = (words[0], numbers(&words[1..]));
        let bent = Distortion::from_fisheye(&given[4..]).unwrap();
        let lens = Lens::new(intrinsics(&given[..4]), &bent).unwrap();
        let k = lens.intrinsics();
        let found = [k.fx, k.fy, k.cx, k.cy];
        let expected = numbers(&block[1].split_whitespace().skip(1).collect::<Vec<_>>());
        // OpenCV's iteration stops at 1e-8 of the angle, times a focal length of some tens and the slope 4 of tan at 60 degrees.
        for (a, b) in found.iter().zip(expected) {
            assert!((a - b).abs() < 1e-4, "{name}: {found:?} {b}");
        }
        assert_looks_like(&lens, &source, &folder, name);
    }
}

/// Checks that the corrected image is `lens_<name>.png`.
fn assert_looks_like(lens: &Lens, source: &image::RgbImage, folder: &Path, name: &str) {
    let corrected = lens.correct(source.clone()).unwrap();
    let expected = load_rgb(&folder.join(format!("lens_{name}.png"))).unwrap();
    let differences = corrected
        .iter()
        .zip(expected.iter())
        .map(|(a, b)| a.abs_diff(*b));
    // Single-precision coordinates may round a value in the other direction.
    assert!(differences.clone().max().unwrap() <= 1, "{name}");
    let other = differences.filter(|d| *d > 0).count();
    assert!(
        other < corrected.len() / 200,
        "{name}: {other} values differ"
    );
}
