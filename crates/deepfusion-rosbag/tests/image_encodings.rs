//! Pixels of Bayer patterns, YUV and 16 bits compared with OpenCV (`reference/opencv_images.py`), in messages as a bag holds them.

use crate::common::read_json;
use deepfusion_rosbag::msg::{Header, Image};
use serde::Deserialize;
use std::borrow::Cow;
use std::collections::BTreeMap;

#[derive(Deserialize)]
struct Case {
    encoding: String,
    is_bigendian: u8,
    width: u32,
    height: u32,
    step: u32,
    data: String,
    rgb: String,
}

fn bytes(hex: &str) -> Vec<u8> {
    let byte = |pair: &[u8; 2]| u8::from_str_radix(std::str::from_utf8(pair).unwrap(), 16);
    hex.as_bytes()
        .as_chunks()
        .0
        .iter()
        .map(|pair| byte(pair).unwrap())
        .collect()
}

/// The formulas are OpenCV's own in integers, so the results must be equal, except at the edge of a Bayer pattern. There OpenCV copies the
/// result from one pixel further in, while here the missing colours are interpolated from the existing ones. On random pixels the two
/// differ freely.
#[test]
fn every_encoding_equals_opencvs_result() {
    let mut seen = BTreeMap::new();
    for case in read_json::<Vec<Case>>("opencv_images.json") {
        let (width, height) = (case.width as usize, case.height as usize);
        let image = Image {
            header: Header::default(),
            height: case.height,
            width: case.width,
            encoding: case.encoding.clone(),
            is_bigendian: case.is_bigendian,
            step: case.step,
            data: Cow::Owned(bytes(&case.data)),
        };
        let (found, expected) = (image.to_rgb8().unwrap(), bytes(&case.rgb));
        assert_eq!(found.len(), width * height * 3, "{}", case.encoding);
        assert_eq!(found.len(), expected.len(), "{}", case.encoding);
        let edge = usize::from(case.encoding.starts_with("bayer"));
        for y in edge..height - edge {
            for x in edge..width - edge {
                let at = (y * width + x) * 3;
                let (ours, theirs) = (&found[at..at + 3], &expected[at..at + 3]);
                assert_eq!(
                    ours, theirs,
                    "{} {width}x{height} at {x}, {y}",
                    case.encoding
                );
            }
        }
        *seen.entry(case.encoding).or_insert(0) += 1;
    }
    assert_eq!(seen.len(), 9, "{seen:?}");
    assert_eq!((seen["mono16"], seen["bayer_grbg8"]), (2, 3), "{seen:?}");
}
