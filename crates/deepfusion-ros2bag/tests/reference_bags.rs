//! Bags that PyPI's `rosbags` and `mcap` wrote, read to exactly the values that `rosbags` reads
//! (`reference/ros2_reference.py`).

use crate::common::{lines, read_json, real_bags, reference, sha256};
use deepfusion_ros2bag::{Ros2Bag, is_ros2_bag};
use deepfusion_rosbag::{Message, MessageSource, Selection, Serialization, Time};
use serde::Deserialize;
use std::collections::BTreeMap;

/// A folder of each kind, one of its files, and files without a folder.
const SAME: [&str; 12] = [
    "sqlite",
    "sqlite/sqlite.db3",
    "sqlite_packed",
    "sqlite_packed/sqlite_packed.db3",
    "mcap",
    "mcap/mcap.mcap",
    "mcap_packed",
    "mcap_packed/mcap_packed.mcap",
    "none.mcap",
    "lz4.mcap",
    "zstd.mcap",
    "bare.mcap",
];

#[derive(Deserialize)]
struct EveryType {
    messages: Vec<Expected>,
}

#[derive(Deserialize)]
struct Expected {
    topic: String,
    r#type: String,
    time: u64,
    sha256: String,
    values: Vec<String>,
}

/// ROS 2 has no sequence numbers: they are 0 here, and missing in `rosbags`.
fn values(message: &Message<'_>) -> Vec<String> {
    let mut lines = lines(message);
    lines.retain(|line| line != "header.seq = 0");
    lines
}

#[test]
fn every_message_has_the_same_bytes_and_values() {
    let expected = read_json::<EveryType>("every_type.json").messages;
    assert_eq!(expected.len(), 48);
    for name in SAME {
        let bag = Ros2Bag::open(reference(name)).unwrap();
        assert_eq!(bag.damage(), None, "{name}");
        assert_eq!(bag.message_count(), 48, "{name}");
        let mut big = 0;
        let mut messages = bag.messages(Selection::all()).unwrap();
        for expected in &expected {
            let message = messages.next().unwrap().unwrap();
            assert_eq!(message.topic(), expected.topic, "{name}");
            assert_eq!(message.connection().type_name, expected.r#type);
            assert_eq!(message.time().nanos(), expected.time);
            assert_eq!(message.serialization(), Serialization::Cdr);
            assert_eq!(sha256(message.data()), expected.sha256, "{message:?}");
            assert_eq!(values(&message), expected.values, "{name} {message:?}");
            big += usize::from(message.data()[1] == 0);
        }
        assert!(messages.next().is_none(), "{name}");
        assert_eq!(big, 24, "half of them are big-endian");
    }
}

#[test]
fn a_header_s_stamp_is_read_without_the_rest() {
    let bag = Ros2Bag::open(reference("lz4.mcap")).unwrap();
    let selection = Selection::topics(["/topic/imu", "/topic/image"]);
    let mut seen = 0;
    for message in bag.messages(selection).unwrap() {
        let message = message.unwrap();
        let stamp = lines(&message)
            .into_iter()
            .find_map(|line| line.strip_prefix("header.stamp = ").map(str::to_owned));
        assert_eq!(
            message.header_stamp().map(|t| t.to_string()),
            stamp,
            "{message:?}"
        );
        seen += 1;
    }
    assert_eq!(seen, 8);
}

#[test]
fn selections_have_the_messages_of_their_topics_and_times() {
    let all = read_json::<EveryType>("every_type.json").messages;
    let (first, last) = (all[0].time, all[47].time);
    let middle = (first + last) / 2;
    let topics = ["/topic/imu", "/topic/frame", "/topic/pointcloud2"];
    for name in SAME {
        let bag = Ros2Bag::open(reference(name)).unwrap();
        for (topics, from, until) in [
            (&topics[..], first, u64::MAX),
            (&topics[..1], middle, last),
            (&topics[1..], first + 1, middle),
            // A single message, as when one picture is requested.
            (&topics[..1], middle, middle + 1),
        ] {
            let selection = Selection::topics(topics.iter().copied())
                .from(Time::from_nanos(from))
                .until(Time::from_nanos(until));
            let found = bag.messages_on_demand(selection).unwrap();
            let found: Vec<(String, u64)> = found
                .map(Result::unwrap)
                .map(|m| (m.topic().to_owned(), m.time().nanos()))
                .collect();
            let within = |m: &&Expected| {
                topics.contains(&m.topic.as_str()) && (from..until).contains(&m.time)
            };
            let expected = all.iter().filter(within);
            let expected: Vec<_> = expected.map(|m| (m.topic.clone(), m.time)).collect();
            assert_eq!(found, expected, "{name}");
        }
        let missing = bag.messages(Selection::topics(["/imu"])).err().unwrap();
        assert!(missing.to_string().contains("/topic/imu"), "{missing}");
    }
}

#[test]
fn topics_have_type_count_range_and_rate() {
    let all = read_json::<EveryType>("every_type.json").messages;
    for name in SAME {
        let bag = Ros2Bag::open(reference(name)).unwrap();
        let topics = bag.topics().unwrap();
        assert_eq!(topics.len(), 12, "{name}");
        for topic in topics {
            let of_topic: Vec<&Expected> = all.iter().filter(|m| m.topic == topic.name).collect();
            let range = topic.range.map(|(a, b)| (a.nanos(), b.nanos()));
            assert_eq!(
                range,
                Some((of_topic[0].time, of_topic[3].time)),
                "{name} {}",
                topic.name
            );
            assert_eq!((topic.count, &topic.type_name), (4, &of_topic[0].r#type));
            // Four messages 1.5 s apart.
            assert!((topic.rate_hz().unwrap() - 1.0 / 1.5).abs() < 1e-9);
        }
        let (first, last) = bag.time_range().unwrap();
        assert_eq!((first.nanos(), last.nanos()), (all[0].time, all[47].time));
    }
}

#[test]
fn bags_are_recognised_by_name_and_metadata() {
    for name in SAME {
        assert!(is_ros2_bag(&reference(name)), "{name}");
    }
    for name in ["", "every_type.json", "sqlite/metadata.yaml"] {
        assert!(!is_ros2_bag(&reference(name)), "{name}");
    }
}

#[derive(Deserialize)]
struct RealTopic {
    r#type: String,
    count: u64,
    digest: String,
    values: Vec<String>,
}

#[test]
fn real_bags_equal_what_rosbags_reads() {
    let Some(folder) = real_bags() else { return };
    let folder = folder.join("rosbags_rs_ros2_all_msgs");
    if !folder.is_dir() {
        return eprintln!("skipped: {} is not there", folder.display());
    }
    let bags: BTreeMap<String, BTreeMap<String, RealTopic>> = read_json("real_bags.json");
    assert_eq!(bags.len(), 2);
    let mut known = 0;
    for (name, expected) in bags {
        let bag = Ros2Bag::open(folder.join(&name)).unwrap();
        assert_eq!(bag.damage(), None);
        let topics = bag.topics().unwrap();
        let filled = topics.iter().filter(|t| t.count > 0);
        assert_eq!(filled.count(), expected.len(), "{name}");
        for (topic, expected) in expected {
            let messages = bag.messages(Selection::topics([&topic])).unwrap();
            let messages: Vec<_> = messages.map(Result::unwrap).collect();
            assert_eq!(messages.len() as u64, expected.count, "{name} {topic}");
            let all = messages.iter().map(|m| {
                assert_eq!(m.connection().type_name, expected.r#type);
                format!("{} {}\n", m.time().nanos(), sha256(m.data()))
            });
            assert_eq!(
                sha256(all.collect::<String>()),
                expected.digest,
                "{name} {topic}"
            );
            let found: Vec<String> = messages.iter().flat_map(values).collect();
            known += usize::from(!found.is_empty());
            assert_eq!(found, expected.values, "{name} {topic}");
        }
    }
    assert!(known > 10, "{known} topics of known types");
}
