//! Messages of frames, and of a velocity with a covariance, compared exactly with what PyPI's `rosbags` writes
//! (`reference/frames_reference.py`), in each serialisation.

use crate::common::{Lines, lines_of, read_json};
use deepfusion_rosbag::RosMessage;
use deepfusion_rosbag::msg::{OldTFMessage, TFMessage, TwistWithCovarianceStamped};
use serde::Deserialize;
use std::collections::BTreeMap;

#[derive(Deserialize)]
struct Type {
    md5: String,
    definition: String,
    ros1: String,
    cdr: String,
    cdr_big: String,
    values: Vec<String>,
    values_ros2: Vec<String>,
}

fn bytes(hex: &str) -> Vec<u8> {
    let pairs = hex.as_bytes().chunks(2);
    pairs
        .map(|pair| u8::from_str_radix(std::str::from_utf8(pair).unwrap(), 16).unwrap())
        .collect()
}

/// The lines without the sequence numbers, which ROS 2 does not have.
fn unnumbered(lines: Vec<String>) -> Vec<String> {
    let numbered = |line: &String| !line.contains("header.seq = ");
    lines.into_iter().filter(numbered).collect()
}

fn check<T>(types: &BTreeMap<String, Type>)
where
    T: for<'a> RosMessage<'a> + Lines + PartialEq + std::fmt::Debug,
{
    let expected = &types[T::TYPE];
    assert_eq!(T::MD5, expected.md5, "{}", T::TYPE);
    assert_eq!(T::DEFINITION, expected.definition, "{}", T::TYPE);

    let written = bytes(&expected.ros1);
    let message = T::decode(&written).unwrap();
    assert_eq!(lines_of(&message), expected.values, "{}", T::TYPE);
    let mut again = Vec::new();
    message.encode(&mut again);
    assert_eq!(again, written, "{}", T::TYPE);
    // One byte short is an error, wherever it is missing.
    for end in 0..written.len() {
        T::decode(&written[..end]).unwrap_err();
    }

    for hex in [&expected.cdr, &expected.cdr_big] {
        let message = T::decode_cdr(&bytes(hex)).unwrap();
        let found = unnumbered(lines_of(&message));
        assert_eq!(found, expected.values_ros2, "{}", T::TYPE);
    }
}

#[test]
fn frames_equal_those_of_rosbags() {
    let types = read_json("frames.json");
    check::<TFMessage>(&types);
    check::<OldTFMessage>(&types);
    check::<TwistWithCovarianceStamped>(&types);
    assert_eq!(types.len(), 3);
}
