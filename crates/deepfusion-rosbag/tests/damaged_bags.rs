//! Bags that were cut, changed, or never finished: no panic, and everything before the damage is read.

use crate::common::{reference, sha256};
use deepfusion_hint::Hint;
use deepfusion_rosbag::msg::{Header, Imu, PointCloud2, RosMessage};
use deepfusion_rosbag::{
    Bag, BagOptions, BagWriter, Compression, Error, ScanReason, Selection, Time, WriterOptions,
};
use proptest::prelude::*;
use std::io::ErrorKind;
use std::path::Path;
use std::sync::OnceLock;

const COMPRESSIONS: [Compression; 3] = [Compression::None, Compression::Lz4, Compression::Bz2];

/// Decompresses on demand: starting threads for each of thousands of tiny bags would be slow.
const OPTIONS: BagOptions = BagOptions {
    max_chunk_bytes: 1 << 20,
    threads: 0,
    ignore_index: false,
};

fn open(bytes: Vec<u8>) -> Result<Bag, Error> {
    Bag::from_bytes("memory.bag", bytes, OPTIONS)
}

fn header(seq: u32) -> Header {
    Header {
        seq,
        ..Header::default()
    }
}

/// A bag of twenty messages in several chunks.
fn small(compression: Compression) -> Vec<u8> {
    static BAGS: [OnceLock<Vec<u8>>; 3] = [const { OnceLock::new() }; 3];
    let place = COMPRESSIONS.iter().position(|&c| c == compression).unwrap();
    BAGS[place].get_or_init(|| write_small(compression)).clone()
}

fn write_small(compression: Compression) -> Vec<u8> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("small.bag");
    let mut writer = BagWriter::create(
        &path,
        WriterOptions {
            compression,
            chunk_bytes: 600,
        },
    )
    .unwrap();
    let topics = ["/a", "/b"].map(|t| {
        writer
            .add_raw_connection(t, "std_msgs/Header", "*", "uint32 seq\n")
            .unwrap()
    });
    for i in 0..20_u32 {
        // A header as a message: its length in bytes varies.
        let message: Vec<u8> = (0..40 + i % 7).map(|k| (k * i) as u8).collect();
        let time = Time {
            sec: 100 + i,
            nsec: 0,
        };
        writer
            .write_raw(topics[(i % 2) as usize], time, &message)
            .unwrap();
    }
    writer.finish().unwrap();
    std::fs::read(path).unwrap()
}

/// Time and content of every message that can be read, and how many errors there were.
fn read(bag: &Bag) -> (Vec<(Time, String)>, usize) {
    let (mut found, mut errors) = (Vec::new(), 0);
    for message in bag.messages(Selection::all()).unwrap() {
        match message {
            Ok(message) => found.push((message.time(), sha256(message.data()))),
            Err(_) => errors += 1,
        }
    }
    (found, errors)
}

/// How many messages must be found before byte `cut`, and how many can be: those of a compressed chunk must if the
/// whole chunk lies before it, and can if its beginning does.
fn whole_before(bytes: &[u8], cut: usize, compression: Compression) -> (usize, usize) {
    let record = |at: usize| {
        let u32_at = |at: usize| u32::from_le_bytes(bytes[at..at + 4].try_into().unwrap()) as usize;
        let data = at + 4 + u32_at(at);
        // Operation, data, end. Our writer's first field is `op`.
        (bytes[at + 11], data + 4, data + 4 + u32_at(data))
    };
    let (mut at, mut whole, mut some) = (record(13).2, 0, 0);
    let mut chunk = 0..0;
    while at < bytes.len() {
        let (op, data, end) = record(at);
        if op == 5 {
            chunk = data..end;
        }
        if op == 5 && compression == Compression::None {
            let mut inner = data;
            while inner < end {
                let (op, _, inner_end) = record(inner);
                whole += usize::from(op == 2 && inner_end <= cut);
                inner = inner_end;
            }
        } else if op == 4 && compression != Compression::None {
            // Index data of the chunk before: 12 bytes a message.
            let messages = (end - data) / 12;
            whole += if chunk.end <= cut { messages } else { 0 };
            some += if chunk.contains(&cut) { messages } else { 0 };
        }
        at = end;
    }
    (whole, whole + some)
}

#[test]
fn a_bag_truncated_at_any_byte_gives_the_messages_before() {
    for compression in COMPRESSIONS {
        let bytes = small(compression);
        let (all, errors) = read(&open(bytes.clone()).unwrap());
        assert_eq!((all.len(), errors), (20, 0));
        // A bzip2 decoder takes megabytes to set up: every 11th byte is tried there, every one otherwise.
        let step = if compression == Compression::Bz2 {
            11
        } else {
            1
        };
        for cut in (0..bytes.len()).step_by(step) {
            let bag = match open(bytes[..cut].to_vec()) {
                Ok(bag) => bag,
                Err(error) => {
                    assert!(
                        cut < 13 && matches!(error, Error::NotABag { .. }),
                        "cut at {cut}: {error}"
                    );
                    continue;
                }
            };
            let damage = bag
                .damage()
                .unwrap_or_else(|| panic!("cut at {cut}: no damage"));
            assert!(damage.offset <= cut as u64, "cut at {cut}: {damage}");
            let (found, errors) = read(&bag);
            assert_eq!(errors, 0, "cut at {cut}");
            assert!(all.starts_with(&found), "cut at {cut}");
            let (least, most) = whole_before(&bytes, cut, compression);
            assert!(
                (least..=most).contains(&found.len()),
                "cut at {cut}: {}, not {least}..={most}",
                found.len()
            );
            assert_eq!(bag.message_count(), found.len() as u64);
            if cut % 16 == 0 {
                bag.topics().unwrap();
            }
        }
    }
}

#[test]
fn an_unfinished_bag_is_read_and_its_damage_reported() {
    for compression in COMPRESSIONS {
        let mut bytes = small(compression);
        let whole = read(&open(bytes.clone()).unwrap()).0;
        let index_pos = find(&bytes, b"index_pos=") + 10;
        bytes[index_pos..index_pos + 8].fill(0);
        let bag = open(bytes.clone()).unwrap();
        assert_eq!(read(&bag), (whole.clone(), 0));
        let damage = bag.damage().unwrap();
        assert_eq!(damage.reason, ScanReason::NoIndex, "{damage}");
        assert!(damage.to_string().contains("no index"), "{damage}");
        assert_eq!(
            (damage.chunks_lost, damage.offset),
            (None, bytes.len() as u64)
        );
        assert_eq!(bag.connections().len(), 2);
    }
}

#[test]
fn a_chunk_whose_length_was_never_filled_in_is_read_to_the_end() {
    // The recorder writes a chunk's header with zeros, then its content, then returns to fill in the lengths.
    let mut bytes = small(Compression::None);
    let index_pos = find(&bytes, b"index_pos=") + 10;
    bytes[index_pos..index_pos + 8].fill(0);
    let whole = read(&open(bytes.clone()).unwrap()).0;
    let last = rfind(&bytes, b"compression=none");
    let content = last + b"compression=none".len() + 4 + 9 + 4;
    let length = u32::from_le_bytes(bytes[content - 4..content].try_into().unwrap()) as usize;
    bytes.truncate(content + length - 10);
    bytes[content - 4..content].fill(0);
    bytes[content - 8..content - 4].fill(0);
    let bag = open(bytes).unwrap();
    let (found, errors) = read(&bag);
    assert_eq!(
        (found.len(), errors),
        (19, 0),
        "all but the message that was cut: {:?}",
        bag.damage()
    );
    assert!(whole.starts_with(&found));
    let damage = bag.damage().unwrap();
    assert_eq!(damage.reason, ScanReason::NoIndex, "{damage}");
    assert!(
        damage.to_string().contains("recorder did not finish"),
        "{damage}"
    );
}

fn find(bytes: &[u8], what: &[u8]) -> usize {
    bytes.windows(what.len()).position(|w| w == what).unwrap()
}

fn rfind(bytes: &[u8], what: &[u8]) -> usize {
    bytes.windows(what.len()).rposition(|w| w == what).unwrap()
}

#[test]
fn a_damaged_chunk_is_an_error_and_the_others_are_read() {
    for compression in [Compression::Lz4, Compression::Bz2] {
        let mut bytes = small(compression);
        let second = find(&bytes, b"compression=") + 1;
        let second = second + find(&bytes[second..], b"compression=");
        bytes[second + 40..second + 60].fill(0x55);
        for threads in [0, 2] {
            let bag =
                Bag::from_bytes("m.bag", bytes.clone(), BagOptions { threads, ..OPTIONS }).unwrap();
            assert_eq!(bag.damage(), None);
            let results: Vec<_> = bag.messages(Selection::all()).unwrap().collect();
            let errors: Vec<_> = results.iter().filter_map(|r| r.as_ref().err()).collect();
            let [error @ Error::Chunk { messages, .. }] = errors[..] else {
                panic!("{errors:?}")
            };
            assert!(error.to_string().contains(compression.name()), "{error}");
            assert_eq!(results.len() - 1 + *messages as usize, 20);
            assert!((1..10).contains(messages));
        }
        let scanned = Bag::from_bytes(
            "m.bag",
            bytes,
            BagOptions {
                ignore_index: true,
                ..OPTIONS
            },
        )
        .unwrap();
        assert!(read(&scanned).0.len() > 10);
        assert!(scanned.damage().is_some());
    }
}

#[test]
fn wrong_lengths_take_no_memory() {
    // A chunk of a few bytes that claims 2 GiB; a bag header that counts 2³² connections and chunks.
    for compression in [Compression::Lz4, Compression::Bz2] {
        let mut bytes = small(compression);
        let size = find(&bytes, b"size=") + 5;
        bytes[size..size + 4].copy_from_slice(&(1_u32 << 31).to_le_bytes());
        let bag = open(bytes.clone()).unwrap();
        let error = bag
            .messages(Selection::all())
            .unwrap()
            .find_map(Result::err)
            .unwrap();
        assert!(error.to_string().contains("max_chunk_bytes"), "{error}");
        let unlimited = BagOptions {
            max_chunk_bytes: u64::MAX,
            ..OPTIONS
        };
        let bag = Bag::from_bytes("m.bag", bytes, unlimited).unwrap();
        let error = bag
            .messages(Selection::all())
            .unwrap()
            .find_map(Result::err)
            .unwrap();
        assert!(
            error.to_string().contains("its header says 2147483648"),
            "{error}"
        );
    }
    let mut bytes = small(Compression::None);
    for count in [&b"conn_count="[..], b"chunk_count="] {
        let at = find(&bytes, count) + count.len();
        bytes[at..at + 4].fill(0xff);
    }
    let bag = open(bytes).unwrap();
    let damage = bag.damage().unwrap();
    assert!(matches!(damage.reason, ScanReason::Index(_)), "{damage}");
    assert!(
        damage.to_string().contains("index cannot be read"),
        "{damage}"
    );
    assert_eq!(read(&bag).0.len(), 20);
}

#[test]
fn other_files_are_refused_by_name() {
    let refuse = |bytes: &[u8]| open(bytes.to_vec()).err().unwrap();
    assert!(matches!(refuse(b""), Error::NotABag { .. }));
    assert!(matches!(
        refuse(b"\x89MCAP0\r\n rest of the file"),
        Error::NotABag { .. }
    ));
    let old = refuse(b"#ROSBAG V1.2\n123456");
    assert!(
        matches!(&old, Error::Version { version, .. } if version == "1.2"),
        "{old}"
    );
    assert!(old.hint().is_some());
    let missing = Bag::open("no/such.bag").err().unwrap();
    assert!(missing.to_string().contains("no/such.bag"));
    assert!(
        Bag::open(Path::new(env!("CARGO_MANIFEST_DIR")))
            .err()
            .unwrap()
            .hint()
            .is_some()
    );
    let folder = Error::file(Path::new("drives"), ErrorKind::IsADirectory.into());
    assert_eq!(folder.hint().as_deref(), Some("give the .bag file itself"));
    let bag = Bag::open(reference("every_type_none.bag")).unwrap();
    let topic = bag
        .messages(Selection::topics(["/imu"]))
        .err()
        .unwrap()
        .to_string();
    assert!(
        topic.contains("/imu") && topic.contains("/topic/imu, /topic/navsatfix"),
        "{topic}"
    );
}

#[test]
fn the_error_of_a_truncated_message_names_its_field() {
    let mut bytes = Vec::new();
    let points = [1.0_f32, 2.0];
    PointCloud2::from_columns(header(3), &[("x", &points)])
        .unwrap()
        .encode(&mut bytes);
    PointCloud2::decode(&bytes).unwrap();
    for cut in 0..bytes.len() {
        let error = PointCloud2::decode(&bytes[..cut]).unwrap_err().to_string();
        assert!(error.starts_with("field "), "{error}");
    }
    assert!(
        PointCloud2::decode(&bytes[..10])
            .unwrap_err()
            .to_string()
            .contains("header.stamp")
    );
    bytes.push(0);
    assert!(
        PointCloud2::decode(&bytes)
            .unwrap_err()
            .to_string()
            .contains("1 byte left")
    );
    assert!(
        Imu::decode(&[0; 20])
            .unwrap_err()
            .to_string()
            .contains("orientation.x")
    );
}

fn touch_everything(bag: &Bag) {
    let _ = bag.topics();
    for message in bag.messages(Selection::all()).unwrap().flatten() {
        if let Ok(cloud) = PointCloud2::decode(message.data()) {
            for field in &cloud.fields {
                let _ = cloud
                    .column(&field.name)
                    .map(|column| column.f64s().count());
            }
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 400, ..ProptestConfig::default() })]

    #[test]
    fn changed_bytes_never_panic(
        which in 0..3_usize,
        changes in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..12),
        ignore_index: bool,
    ) {
        let mut bytes = small(COMPRESSIONS[which]);
        // Not in the 4 KiB of padding, where most changes would land.
        let body = bytes.len() - 4109;
        for (index, byte) in changes {
            let place = index.index(body + 80);
            let place = if place < 80 { place } else { place - 80 + 4109 };
            bytes[place] = byte;
        }
        if let Ok(bag) = Bag::from_bytes("m.bag", bytes, BagOptions { ignore_index, ..OPTIONS }) {
            touch_everything(&bag);
        }
    }

    #[test]
    fn any_bytes_behind_a_bag_header_never_panic(tail in prop::collection::vec(any::<u8>(), 0..300)) {
        let mut bytes = small(Compression::None)[..4109].to_vec();
        bytes.extend(tail);
        touch_everything(&open(bytes).unwrap());
    }

    #[test]
    fn changed_clouds_never_panic(changes in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..8)) {
        let mut bytes = Vec::new();
        let columns: [(&str, &[f32]); 2] = [("x", &[1.0; 5]), ("velocity", &[2.0; 5])];
        PointCloud2::from_columns(header(1), &columns).unwrap().encode(&mut bytes);
        for (index, byte) in changes {
            let at = index.index(bytes.len());
            bytes[at] = byte;
        }
        if let Ok(cloud) = PointCloud2::decode(&bytes) {
            for field in &cloud.fields {
                let _ = cloud.column(&field.name).map(|column| column.f64s().count());
            }
        }
    }
}
