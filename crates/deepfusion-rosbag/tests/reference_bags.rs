//! Bags that PyPI's `rosbags` wrote, read to exactly the values that it reads (`reference/rosbags_reference.py`).

use crate::common::{lines, number, read_json, real_bags, reference, sha256};
use deepfusion_rosbag::msg::*;
use deepfusion_rosbag::{Bag, BagOptions, Message, Selection, Time};
use serde::Deserialize;
use std::collections::BTreeMap;

#[derive(Deserialize)]
struct EveryType {
    connections: Vec<Connection>,
    first: u64,
    last: u64,
    messages: Vec<Expected>,
    selections: Vec<Selected>,
    types: BTreeMap<String, Type>,
}

#[derive(Deserialize, Debug, PartialEq)]
struct Connection {
    topic: String,
    r#type: String,
    md5: String,
    count: u64,
    caller_id: Option<String>,
    latching: bool,
}

#[derive(Deserialize)]
struct Expected {
    topic: String,
    r#type: String,
    time: u64,
    sha256: String,
    values: Vec<String>,
    columns: Option<BTreeMap<String, Vec<String>>>,
    u16: Option<Vec<u16>>,
    rgb8: Option<String>,
}

#[derive(Deserialize)]
struct Selected {
    topics: Vec<String>,
    from: Option<u64>,
    until: Option<u64>,
    messages: Vec<(String, u64)>,
}

#[derive(Deserialize)]
struct Type {
    md5: String,
    definition: String,
}

fn each_compression(check: impl Fn(&Bag, &EveryType)) {
    let expected: EveryType = read_json("every_type.json");
    for name in ["none", "lz4", "bz2"] {
        for threads in [0, 2] {
            let options = BagOptions {
                threads,
                ..BagOptions::default()
            };
            let path = reference(&format!("every_type_{name}.bag"));
            check(&Bag::open_with(path, options).unwrap(), &expected);
        }
    }
}

fn connections(bag: &Bag) -> Vec<Connection> {
    let described = |c: &deepfusion_rosbag::Connection| Connection {
        topic: c.topic.clone(),
        r#type: c.type_name.clone(),
        md5: c.md5.clone(),
        count: c.count,
        caller_id: c.caller_id.clone(),
        latching: c.latching,
    };
    bag.connections().iter().map(described).collect()
}

fn nanos(bag: &Bag) -> (u64, u64) {
    let (first, last) = bag.time_range().unwrap();
    (first.nanos(), last.nanos())
}

#[test]
fn the_index_equals_that_of_rosbags() {
    each_compression(|bag, expected| {
        assert_eq!(connections(bag), expected.connections);
        assert_eq!(nanos(bag), (expected.first, expected.last));
        assert_eq!(bag.message_count(), expected.messages.len() as u64);
        assert_eq!(bag.damage(), None);
    });
}

#[test]
fn every_message_has_the_same_bytes_and_values() {
    each_compression(|bag, expected| {
        let mut messages = bag.messages(Selection::all()).unwrap();
        for expected in &expected.messages {
            let message = messages.next().unwrap().unwrap();
            assert_eq!(message.topic(), expected.topic);
            assert_eq!(message.connection().type_name, expected.r#type);
            assert_eq!(message.time().nanos(), expected.time);
            assert_eq!(sha256(message.data()), expected.sha256, "{message:?}");
            assert_eq!(lines(&message), expected.values, "{message:?}");
        }
        assert!(messages.next().is_none());
    });
}

#[test]
fn columns_of_clouds_equal_numpys() {
    let clouds = check_each(|expected, message| {
        let columns = expected.columns.as_ref()?;
        let cloud: PointCloud2 = message.decode().unwrap();
        for (name, numbers) in columns {
            let column = match name.split_once('/') {
                Some((name, element)) => cloud.column_at(name, element.parse().unwrap()),
                None => cloud.column(name),
            };
            let found: Vec<String> = column.unwrap().f64s().map(number).collect();
            assert_eq!(found, *numbers, "{name} of {message:?}");
        }
        Some(())
    });
    assert_eq!(clouds, 4, "two of them big-endian");
}

#[test]
fn pixels_equal_numpys() {
    let pictures = check_each(|expected, message| {
        let (wide, rgb) = (expected.u16.as_ref(), expected.rgb8.as_ref());
        wide.is_some().then_some(()).or(rgb.map(|_| ()))?;
        let image: Image = message.decode().unwrap();
        if let Some(wide) = wide {
            assert_eq!(image.u16s().unwrap().collect::<Vec<_>>(), *wide);
        }
        if let Some(rgb) = rgb {
            assert_eq!(sha256(image.to_rgb8().unwrap()), *rgb, "{}", image.encoding);
        }
        Some(())
    });
    assert_eq!(
        pictures, 3,
        "bgr8, rgba8 and 16UC1; Bayer patterns: image_encodings.rs"
    );
}

/// Runs `check` on every message of the uncompressed bag, and returns for how many it was `Some`.
fn check_each(check: impl Fn(&Expected, &Message<'_>) -> Option<()>) -> usize {
    let expected: EveryType = read_json("every_type.json");
    let bag = Bag::open(reference("every_type_none.bag")).unwrap();
    let messages = bag.messages(Selection::all()).unwrap();
    let pairs = expected.messages.iter().zip(messages);
    pairs
        .filter_map(|(expected, message)| check(expected, &message.unwrap()))
        .count()
}

#[test]
fn selections_hold_the_same_messages() {
    each_compression(|bag, expected| {
        for expected in &expected.selections {
            let mut selection = Selection::topics(expected.topics.clone());
            if let Some(from) = expected.from {
                selection = selection.from(Time::from_nanos(from));
            }
            if let Some(until) = expected.until {
                selection = selection.until(Time::from_nanos(until));
            }
            let messages = bag.messages(selection).unwrap().map(Result::unwrap);
            let found: Vec<_> = messages
                .map(|m| (m.topic().to_owned(), m.time().nanos()))
                .collect();
            assert_eq!(found, expected.messages);
        }
    });
}

#[test]
fn topics_have_count_range_and_rate() {
    each_compression(|bag, expected| {
        let topics = bag.topics().unwrap();
        assert_eq!(topics.len(), 12);
        for topic in topics {
            let times = expected
                .messages
                .iter()
                .filter(|m| m.topic == topic.name)
                .map(|m| m.time);
            let times: Vec<u64> = times.collect();
            let range = topic
                .range
                .map(|(first, last)| (first.nanos(), last.nanos()));
            assert_eq!(range, times.first().copied().zip(times.last().copied()));
            assert_eq!(topic.count, times.len() as u64);
            assert_eq!(
                topic.connections,
                if topic.name == "/topic/imu" { 2 } else { 1 }
            );
            // Four messages 1.5 s apart.
            assert!((topic.rate_hz().unwrap() - 1.0 / 1.5).abs() < 1e-9);
        }
    });
}

fn check_type<'a, T: RosMessage<'a>>(types: &mut BTreeMap<String, Type>) {
    let expected = types
        .remove(T::TYPE)
        .unwrap_or_else(|| panic!("{} is not a type of rosbags", T::TYPE));
    assert_eq!(T::MD5, expected.md5, "{}", T::TYPE);
    assert_eq!(T::DEFINITION, expected.definition, "{}", T::TYPE);
}

#[test]
fn definitions_and_their_md5_are_those_of_rosbags() {
    let mut types = read_json::<EveryType>("every_type.json").types;
    check_type::<Float32>(&mut types);
    check_type::<Float64>(&mut types);
    check_type::<Image>(&mut types);
    check_type::<CompressedImage>(&mut types);
    check_type::<CameraInfo>(&mut types);
    check_type::<PointCloud2>(&mut types);
    check_type::<Imu>(&mut types);
    check_type::<NavSatFix>(&mut types);
    check_type::<TwistStamped>(&mut types);
    check_type::<Odometry>(&mut types);
    check_type::<AckermannDriveStamped>(&mut types);
    check_type::<Frame>(&mut types);
    assert!(types.is_empty());
}

#[test]
fn lz4_blocks_may_refer_to_the_one_before() {
    #[derive(Deserialize)]
    struct Picture {
        bytes: usize,
        sha256: String,
    }
    let expected: Picture = read_json("linked_lz4.json");
    let bag = Bag::open(reference("linked_lz4.bag")).unwrap();
    let message = bag
        .messages(Selection::all())
        .unwrap()
        .next()
        .unwrap()
        .unwrap();
    let picture: CompressedImage = message.decode().unwrap();
    assert_eq!(
        (picture.data.len(), sha256(&picture.data)),
        (expected.bytes, expected.sha256)
    );
}

#[derive(Deserialize)]
struct RealBag {
    connections: Vec<Connection>,
    first: u64,
    last: u64,
    topics: BTreeMap<String, RealTopic>,
    digest: String,
}

#[derive(Deserialize)]
struct RealTopic {
    r#type: String,
    count: u64,
    first: Values,
    last: Values,
}

#[derive(Deserialize)]
struct Values {
    time: u64,
    values: Vec<String>,
}

#[test]
fn real_bags_equal_what_rosbags_reads() {
    let Some(folder) = real_bags() else { return };
    let bags: BTreeMap<String, RealBag> = read_json("real_bags.json");
    assert_eq!(bags.len(), 3);
    for (name, expected) in bags {
        let bag = Bag::open(folder.join(&name)).unwrap();
        assert_eq!(connections(&bag), expected.connections, "{name}");
        assert_eq!(nanos(&bag), (expected.first, expected.last), "{name}");
        for topic in bag.topics().unwrap() {
            let expected = &expected.topics[&topic.name];
            assert_eq!(
                (&topic.type_name, topic.count),
                (&expected.r#type, expected.count),
                "{name}"
            );
            let range = topic
                .range
                .map(|(first, last)| (first.nanos(), last.nanos()));
            assert_eq!(
                range,
                Some((expected.first.time, expected.last.time)),
                "{name} {}",
                topic.name
            );
            let messages = bag.messages(Selection::topics([&topic.name])).unwrap();
            let messages: Vec<_> = messages.map(Result::unwrap).collect();
            for (message, expected) in [
                (messages.first(), &expected.first),
                (messages.last(), &expected.last),
            ] {
                assert_eq!(
                    lines(message.unwrap()),
                    expected.values,
                    "{name} {}",
                    topic.name
                );
            }
        }
        assert_eq!(digest(&bag), expected.digest, "{name}");
    }
}

/// A checksum of every message's time, topic and bytes. Messages with equal times have no order of their own, so they are sorted.
fn digest(bag: &Bag) -> String {
    let mut last = Time::ZERO;
    let mut all = Vec::new();
    for message in bag.messages(Selection::all()).unwrap() {
        let message = message.unwrap();
        assert!(message.time() >= last);
        last = message.time();
        lines(&message);
        all.push(format!(
            "{} {} {}\n",
            last.nanos(),
            message.topic(),
            sha256(message.data())
        ));
    }
    all.sort_unstable();
    sha256(all.concat())
}
