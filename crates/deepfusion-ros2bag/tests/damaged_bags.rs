//! Bags that were cut off, damaged or never finished: undamaged parts are read, damage is reported.

use crate::common::{reference, sha256};
use deepfusion_hint::Hint;
use deepfusion_ros2bag::{BagDamage, FileDamage, Ros2Bag};
use deepfusion_rosbag::{Error, FileError, MessageSource, Selection};
use std::collections::HashSet;
use std::path::Path;

type Read = (u64, String, String);

/// Every message that can be read, and the errors in between.
fn read(bag: &Ros2Bag) -> (Vec<Read>, Vec<String>) {
    let (mut found, mut errors) = (Vec::new(), Vec::new());
    for message in bag.messages(Selection::all()).unwrap().take(10_000) {
        match message {
            Ok(m) => found.push((m.time().nanos(), m.topic().to_owned(), sha256(m.data()))),
            Err(e) => errors.push(e.to_string()),
        }
    }
    // SQLite has no checksums: an index whose bytes changed gives another order, which cannot be detected.
    let mcap = bag.path().extension().is_some_and(|e| e == "mcap");
    assert!(!mcap || found.is_sorted_by_key(|m| m.0), "in time order");
    (found, errors)
}

fn open(folder: &Path, name: &str, bytes: &[u8]) -> deepfusion_rosbag::Result<Ros2Bag> {
    let path = folder.join(name);
    std::fs::write(&path, bytes).unwrap();
    Ros2Bag::open(path)
}

#[test]
fn a_truncated_file_is_read_up_to_the_damage() {
    let folder = tempfile::tempdir().unwrap();
    for name in [
        "none.mcap",
        "lz4.mcap",
        "zstd.mcap",
        "bare.mcap",
        "mcap/mcap.mcap",
    ] {
        let whole = std::fs::read(reference(name)).unwrap();
        let all: HashSet<Read> = read(&Ros2Bag::open(reference(name)).unwrap())
            .0
            .into_iter()
            .collect();
        let mut most = 0;
        for cut in (8..whole.len()).step_by(193).chain([whole.len() - 1]) {
            let bag = open(folder.path(), "cut.mcap", &whole[..cut]).unwrap();
            let (found, errors) = read(&bag);
            assert_eq!(errors, [] as [String; 0], "{name} at {cut}");
            let damage = bag.damage().unwrap().to_string();
            assert!(
                damage.contains("did not finish"),
                "{name} at {cut}: {damage}"
            );
            assert_eq!(bag.message_count(), found.len() as u64);
            assert!(found.iter().all(|m| all.contains(m)), "{name} at {cut}");
            assert!(
                found.len() >= most,
                "a later cut loses nothing: {name} at {cut}"
            );
            most = found.len();
        }
        assert_eq!(most, 48, "{name}: only the last byte is missing");
    }
    assert!(open(folder.path(), "a.mcap", &[]).is_err());
}

#[test]
fn a_damaged_chunk_costs_only_its_own_messages() {
    let folder = tempfile::tempdir().unwrap();
    for name in ["none.mcap", "lz4.mcap", "zstd.mcap"] {
        let mut bytes = std::fs::read(reference(name)).unwrap();
        // Within the first chunk, whose header is 9 + 40 bytes and a name, in a message's own bytes.
        let chunk = bytes
            .windows(9)
            .position(|w| w[0] == 6 && w[3..9] == [0; 6])
            .unwrap();
        bytes[chunk + 900] ^= 0x10;
        let bag = open(folder.path(), "hurt.mcap", &bytes).unwrap();
        assert_eq!(bag.damage(), None, "the summary is undamaged");
        let (found, errors) = read(&bag);
        assert_eq!(errors.len(), 1, "{name}: {errors:?}");
        assert!(errors[0].contains("the chunk at byte"), "{errors:?}");
        assert!(
            found.len() > 30 && found.len() < 48,
            "{name}: {}",
            found.len()
        );
    }
}

#[test]
fn a_damaged_summary_is_replaced_by_a_scan() {
    let folder = tempfile::tempdir().unwrap();
    let mut bytes = std::fs::read(reference("zstd.mcap")).unwrap();
    let footer = bytes.len() - 8 - 20;
    let start = u64::from_le_bytes(*bytes[footer..].first_chunk().unwrap()) as usize;
    // The length of the summary's first record.
    bytes[start + 4] = 0xff;
    let bag = open(folder.path(), "hurt.mcap", &bytes).unwrap();
    let damage = bag.damage().unwrap().to_string();
    assert!(damage.contains("summary is damaged"), "{damage}");
    assert_eq!(read(&bag).0.len(), 48);
}

#[test]
fn a_truncated_database_is_read_up_to_the_damage() {
    let folder = tempfile::tempdir().unwrap();
    let whole = std::fs::read(reference("sqlite/sqlite.db3")).unwrap();
    let all: HashSet<Read> = read(&Ros2Bag::open(reference("sqlite")).unwrap())
        .0
        .into_iter()
        .collect();
    let mut most = 0;
    for cut in (0..whole.len()).step_by(1024) {
        match open(folder.path(), "cut.db3", &whole[..cut]) {
            Ok(bag) => {
                let (found, errors) = read(&bag);
                let damage = bag.damage().unwrap().to_string();
                assert!(damage.contains("database is damaged"), "{cut}: {damage}");
                assert!(found.iter().all(|m| all.contains(m)), "{cut}");
                assert!(errors.len() <= 48, "{cut}: {errors:?}");
                most = most.max(found.len());
            }
            Err(e) => {
                let text = e.to_string();
                let known = ["damaged", "not an SQLite", "not a recorder's"];
                assert!(known.iter().any(|k| text.contains(k)), "{cut}: {text}");
                assert!(e.hint().is_some(), "{text}");
            }
        }
    }
    assert!(
        most > 24,
        "{most} messages of a database without its last pages"
    );
}

#[test]
fn no_changed_byte_panics() {
    let folder = tempfile::tempdir().unwrap();
    for (name, step) in [
        ("zstd.mcap", 61),
        ("bare.mcap", 53),
        ("sqlite/sqlite.db3", 331),
    ] {
        let whole = std::fs::read(reference(name)).unwrap();
        let file = Path::new(name).file_name().unwrap().to_str().unwrap();
        for at in (0..whole.len()).step_by(step) {
            let mut bytes = whole.clone();
            bytes[at] ^= 0xff;
            if let Ok(bag) = open(folder.path(), file, &bytes) {
                let _ = read(&bag);
                let _ = bag.topics();
            }
        }
    }
}

#[test]
fn unsupported_files_have_a_hint() {
    let folder = tempfile::tempdir().unwrap();
    let failed = |name: &str, bytes: &[u8]| {
        let error = open(folder.path(), name, bytes).unwrap_err();
        (error.to_string(), error.hint().unwrap_or_default())
    };
    let (error, hint) = failed("a.db3.zstd", b"x");
    assert!(
        error.contains("compressed") && hint.contains("zstd -d"),
        "{error} {hint}"
    );
    let (error, _) = failed("a.mcap", b"#ROSBAG V2.0\n");
    assert!(error.contains("not an MCAP file"), "{error}");
    let (error, _) = failed("a.db3", &[7; 4096]);
    assert!(error.contains("not an SQLite database"), "{error}");
    let missing = Ros2Bag::open(folder.path().join("none.mcap")).unwrap_err();
    assert!(
        matches!(missing, Error::File(FileError::NoSuchPath { .. })),
        "{missing}"
    );

    let bag = folder.path().join("bag");
    std::fs::create_dir(&bag).unwrap();
    let metadata =
        "rosbag2_bagfile_information:\n  relative_file_paths:\n  - bag/bag_0.db3\n  - bag_1.db3\n";
    std::fs::write(bag.join("metadata.yaml"), metadata).unwrap();
    let error = Ros2Bag::open(&bag).unwrap_err().to_string();
    assert!(error.contains("bag_0.db3"), "{error}");
    // The first file, as old recorders name it, with the folder before it; the second is missing.
    std::fs::copy(reference("sqlite/sqlite.db3"), bag.join("bag_0.db3")).unwrap();
    let opened = Ros2Bag::open(&bag).unwrap();
    assert_eq!(read(&opened).0.len(), 48);
    let damage = opened.damage().unwrap();
    let Some(BagDamage { files }) = damage.downcast_ref::<BagDamage>() else {
        panic!("{damage}");
    };
    assert_eq!(files, &[FileDamage::NotThere(bag.join("bag_1.db3"))]);
    let message = damage.to_string();
    assert!(
        message.ends_with("bag_1.db3: no such file or folder"),
        "{message}"
    );
    std::fs::write(
        bag.join("metadata.yaml"),
        "rosbag2_bagfile_information: 3\n",
    )
    .unwrap();
    let error = Ros2Bag::open(&bag).unwrap_err();
    assert!(error.hint().unwrap().contains("reindex"), "{error}");
}

#[test]
fn several_files_are_one_stream_in_time_order() {
    let folder = tempfile::tempdir().unwrap();
    let files = ["lz4.mcap", "none.mcap", "sqlite/sqlite.db3"];
    let mut metadata = "rosbag2_bagfile_information:\n  relative_file_paths:\n".to_owned();
    for (i, file) in files.iter().enumerate() {
        let name = format!(
            "{i}_{}",
            Path::new(file).file_name().unwrap().to_str().unwrap()
        );
        std::fs::copy(reference(file), folder.path().join(&name)).unwrap();
        metadata += &format!("  - {name}\n");
    }
    std::fs::write(folder.path().join("metadata.yaml"), metadata).unwrap();
    let bag = Ros2Bag::open(folder.path()).unwrap();
    let once = read(&Ros2Bag::open(reference("lz4.mcap")).unwrap()).0;
    let thrice: Vec<Read> = once
        .into_iter()
        .flat_map(|m| [m.clone(), m.clone(), m])
        .collect();
    assert_eq!(read(&bag).0, thrice);
    let imu = bag
        .topics()
        .unwrap()
        .into_iter()
        .find(|t| t.name == "/topic/imu");
    assert_eq!(imu.unwrap().count, 12);
}
