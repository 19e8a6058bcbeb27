//! Several bags as one stream.

use crate::common::{self, sha256};
use deepfusion_rosbag::msg::{Float32, Float64};
use deepfusion_rosbag::{
    Bag, BagSet, BagWriter, Compression, Error, Selection, Time, WriterOptions,
};
use std::path::Path;

/// Every third message goes to each bag, so that the bags' times interleave; the topics' numbers differ from bag to bag.
fn part(path: &Path, k: u32, compression: Compression) {
    let mut bag = BagWriter::create(
        path,
        WriterOptions {
            compression,
            chunk_bytes: 300,
        },
    )
    .unwrap();
    let other = bag
        .add_connection::<Float64>(&format!("/only/{k}"))
        .unwrap();
    let shared = bag.add_connection::<Float32>("/shared").unwrap();
    for i in (k..60).step_by(3) {
        let time = Time { sec: i, nsec: 0 };
        bag.write(shared, time, &Float32 { data: i as f32 })
            .unwrap();
        bag.write(other, time, &Float64 { data: f64::from(i) })
            .unwrap();
    }
    bag.finish().unwrap();
}

fn parts(folder: &Path) -> Vec<std::path::PathBuf> {
    let compressions = [Compression::Bz2, Compression::None, Compression::Lz4];
    let write = |(k, compression)| {
        let path = folder.join(format!("{k}.bag"));
        part(&path, k, compression);
        path
    };
    // Not in the order of their times.
    (0..3).rev().zip(compressions).map(write).collect()
}

#[test]
fn messages_of_all_bags_come_in_time_order() {
    let folder = tempfile::tempdir().unwrap();
    let set = BagSet::open(parts(folder.path())).unwrap();
    assert_eq!(set.bags().len(), 3);
    assert_eq!(set.message_count(), 120);
    assert_eq!(
        set.time_range(),
        Some((Time::ZERO, Time { sec: 59, nsec: 0 }))
    );
    let times: Vec<u32> = set
        .messages(Selection::all())
        .unwrap()
        .map(|m| m.unwrap().time().sec)
        .collect();
    assert_eq!(times, (0..60).flat_map(|i| [i, i]).collect::<Vec<_>>());
    let values = set
        .messages(Selection::topics(["/shared"]))
        .unwrap()
        .map(|message| {
            let message = message.unwrap();
            assert_eq!(message.connection().count, 60, "the merged connection");
            message.decode::<Float32>().unwrap().data
        });
    assert_eq!(
        values.collect::<Vec<_>>(),
        (0..60).map(|i| i as f32).collect::<Vec<_>>()
    );
}

#[test]
fn connections_are_merged_by_topic_and_md5() {
    let folder = tempfile::tempdir().unwrap();
    let set = BagSet::open(parts(folder.path())).unwrap();
    let found: Vec<_> = set
        .connections()
        .iter()
        .map(|c| (c.id, c.topic.as_str(), c.count))
        .collect();
    assert_eq!(
        found,
        [
            (0, "/only/2", 20),
            (1, "/shared", 60),
            (2, "/only/1", 20),
            (3, "/only/0", 20)
        ]
    );
    let topics = set.topics().unwrap();
    assert_eq!(topics.len(), 4);
    let shared = topics.iter().find(|t| t.name == "/shared").unwrap();
    assert_eq!(shared.rate_hz(), Some(1.0));
    // A topic in only one of the bags.
    let selection = Selection::topics(["/only/1"])
        .from(Time { sec: 10, nsec: 0 })
        .until(Time { sec: 19, nsec: 0 });
    let times: Vec<u32> = set
        .messages(selection)
        .unwrap()
        .map(|m| m.unwrap().time().sec)
        .collect();
    assert_eq!(times, [10, 13, 16]);
    let missing = set.messages(Selection::topics(["/only/3"])).err().unwrap();
    assert!(
        missing
            .to_string()
            .contains("/only/0, /only/1, /only/2, /shared"),
        "{missing}"
    );
    assert!(matches!(BagSet::new(Vec::new()), Err(Error::EmptySet)));
}

#[test]
fn a_set_of_one_bag_is_that_bag() {
    let path = common::reference("every_type_lz4.bag");
    let read = |messages: &mut dyn Iterator<
        Item = deepfusion_rosbag::Result<deepfusion_rosbag::Message<'_>>,
    >| {
        messages
            .map(Result::unwrap)
            .map(|m| (m.time(), m.topic().to_owned(), sha256(m.data())))
            .collect::<Vec<_>>()
    };
    let bag = Bag::open(&path).unwrap();
    let set = BagSet::open([&path]).unwrap();
    let alone = read(&mut bag.messages(Selection::all()).unwrap());
    assert_eq!(read(&mut set.messages(Selection::all()).unwrap()), alone);
    assert_eq!(alone.len(), 48);
}
