//! Images: resized as PIL does, truncated ones refused.

#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    reason = "a test's panic is its message"
)]

use deepfusion_hint::Hint;
use deepfusion_images::{
    Error, FileError, ImageProblem, image_size, load_rgb, resize_rgb, to_chw, to_network_input,
};
use image::{Rgb, RgbImage};
use proptest::prelude::*;
use std::path::{Path, PathBuf};

fn reference(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("tests/reference")
        .join(name)
}

/// `tests/reference/resize_pil.py` made the expected images. Both programs filter in fixed point and
/// round to 8 bits after each of the two passes, with coefficients of 22 bits (PIL) and at most 15, so
/// a few values differ by one level (measured: 1.6 % of them at worst). A filter without antialiasing,
/// a shift by half a pixel or the passes in the other order differs by tens.
#[test]
fn resizing_is_pils_lanczos_to_one_grey_level() {
    let source = load_rgb(&reference("resize_source.png")).unwrap();
    for (width, height) in [(32, 24), (41, 13), (150, 70), (96, 20)] {
        let expected = load_rgb(&reference(&format!("resize_{width}x{height}.png"))).unwrap();
        let resized = resize_rgb(&source, width, height);
        assert_eq!(resized.dimensions(), (width, height));
        let differences = expected.as_raw().iter().zip(resized.as_raw());
        let differences: Vec<u8> = differences.map(|(a, b)| a.abs_diff(*b)).collect();
        let largest = differences.iter().max().copied().unwrap();
        let sum: f64 = differences.iter().map(|d| f64::from(*d)).sum();
        let mean = sum / differences.len() as f64;
        assert!(
            largest <= 1 && mean < 0.1,
            "{width}x{height}: {largest} {mean}"
        );
    }
}

#[test]
fn the_same_size_changes_nothing_and_no_size_gives_nothing() {
    let source = load_rgb(&reference("resize_source.png")).unwrap();
    assert_eq!(resize_rgb(&source, 96, 64), source);
    assert_eq!(resize_rgb(&source, 0, 10).dimensions(), (0, 10));
    assert_eq!(resize_rgb(&RgbImage::new(0, 0), 2, 1).as_raw(), &[0; 6]);
}

#[test]
fn channels_come_one_after_another() {
    let image = RgbImage::from_fn(2, 1, |x, _| Rgb([51 * x as u8, 102, 255]));
    assert_eq!(to_chw(&image), [0.0, 0.2, 0.4, 0.4, 1.0, 1.0]);
}

/// A PNG and a JPEG of noise, with an early end marker, as an EXIF thumbnail adds to real files.
fn encoded() -> Vec<(&'static str, Vec<u8>)> {
    let image = RgbImage::from_fn(40, 30, |x, y| {
        let h = (x * 7919 + y * 104_729).wrapping_mul(2_654_435_761);
        Rgb([(h >> 8) as u8, (h >> 16) as u8, (h >> 24) as u8])
    });
    let encode = |format| {
        let mut bytes = std::io::Cursor::new(Vec::new());
        image.write_to(&mut bytes, format).unwrap();
        bytes.into_inner()
    };
    let mut jpeg = encode(image::ImageFormat::Jpeg);
    let comment = [0xFF, 0xFE, 0x00, 0x06, 0xFF, 0xD8, 0xFF, 0xD9];
    jpeg.splice(2..2, comment);
    vec![("png", encode(image::ImageFormat::Png)), ("jpg", jpeg)]
}

#[test]
fn whole_images_are_read_by_content() {
    let dir = tempfile::tempdir().unwrap();
    // The file's ending is wrong on purpose.
    for (ending, (_, bytes)) in ["jpg", "png"].iter().zip(encoded()) {
        let path = dir.path().join(format!("a.{ending}"));
        std::fs::write(&path, &bytes).unwrap();
        assert_eq!(load_rgb(&path).unwrap().dimensions(), (40, 30));
        assert_eq!(image_size(&path).unwrap(), (40, 30));
        for length in [3, 20] {
            std::fs::write(&path, &bytes[..length]).unwrap();
            image_size(&path).expect_err("the file ends before its size is known");
        }
    }
}

/// A file cut at any place is refused by name, so that no grey filling by a decoder is accepted.
#[test]
fn every_truncation_is_refused() {
    let dir = tempfile::tempdir().unwrap();
    for (ending, bytes) in encoded() {
        let path = dir.path().join(format!("0000000003.{ending}"));
        // A PNG is complete before its empty IEND chunk (12 bytes) ends; a JPEG needs its last byte.
        let whole = bytes.len() - if ending == "png" { 12 } else { 0 };
        for length in (0..whole).step_by(7).chain([whole - 1]) {
            std::fs::write(&path, &bytes[..length]).unwrap();
            let error = load_rgb(&path).expect_err(&format!("{ending} cut to {length}"));
            let text = error.to_string();
            assert!(text.contains("0000000003"), "{text}");
            assert!(error.hint().is_some());
            if length > 64 {
                assert!(
                    matches!(
                        error,
                        Error::Image {
                            problem: ImageProblem::Truncated,
                            ..
                        }
                    ),
                    "{ending} cut to {length}: {text}"
                );
            }
        }
    }
}

#[test]
fn other_files_are_refused_with_what_is_expected() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("notes.png");
    std::fs::write(&path, "not an image at all, but a text").unwrap();
    let error = load_rgb(&path).unwrap_err();
    assert!(
        error.to_string().contains("neither a PNG nor a JPEG"),
        "{error}"
    );
    let missing = load_rgb(&dir.path().join("none.png")).unwrap_err();
    assert!(matches!(missing, Error::File(FileError::NoSuchPath { .. })));
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 128, failure_persistence: None, ..ProptestConfig::default() })]
    /// Damaged files give errors or pictures, never a panic.
    #[test]
    fn damage_never_panics(which in 0usize..2, at in 0usize..3000, value in any::<u8>()) {
        let (_, mut bytes) = encoded().remove(which);
        let at = at % bytes.len();
        bytes[at] = value;
        let file = tempfile::NamedTempFile::new().unwrap();
        std::fs::write(file.path(), bytes).unwrap();
        let _ = (load_rgb(file.path()), image_size(file.path()));
    }
}

/// Pixels outside the part must not bleed in through the filter's margin.
#[test]
fn a_part_gives_the_same_input_as_the_cropped_image() {
    let source = load_rgb(&reference("resize_source.png")).unwrap();
    for [x, y, w, h] in [
        [0, 0, 96, 64],
        [10, 7, 60, 40],
        [0, 30, 96, 34],
        [95, 63, 1, 1],
    ] {
        let alone = RgbImage::from_fn(w, h, |i, j| *source.get_pixel(x + i, y + j));
        for (width, height) in [(41, 13), (w, h), (w, 9), (120, h)] {
            assert_eq!(
                to_network_input(&source, [x, y, w, h], width, height),
                to_chw(&resize_rgb(&alone, width, height)),
                "{x},{y} {w}x{h} to {width}x{height}"
            );
        }
    }
}
