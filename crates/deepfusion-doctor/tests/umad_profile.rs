//! UMAD's camera as printed in its paper: used and reported if a bag gives no other.

#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    reason = "a test's panic is its message"
)]

use deepfusion_data::{Dataset, OpenOptions};
use deepfusion_doctor::{Severity, doctor};
use deepfusion_rosbag::msg::{Header, Image, TwistStamped};
use deepfusion_rosbag::{BagWriter, Time, WriterOptions};
use std::borrow::Cow;
use std::path::Path;

/// Ten grey pictures of UMAD's size and a speed.
fn write_bag(path: &Path) {
    let mut bag = BagWriter::create(path, WriterOptions::default()).unwrap();
    let camera = bag.add_connection::<Image<'_>>("/camera/image").unwrap();
    let speed = bag
        .add_connection::<TwistStamped>("/vehicle/speed")
        .unwrap();
    for i in 0..10 {
        let stamp = Time {
            sec: 1_700_000_000,
            nsec: i * 40_000_000,
        };
        let header = Header {
            stamp,
            ..Header::default()
        };
        let pixel = |at: usize| (at * 7 + i as usize * 13) as u8;
        let image = Image {
            header: header.clone(),
            height: 480,
            width: 640,
            encoding: "mono8".into(),
            is_bigendian: 0,
            step: 640,
            data: Cow::Owned((0..640 * 480).map(pixel).collect()),
        };
        bag.write(camera, stamp, &image).unwrap();
        let mut twist = TwistStamped {
            header,
            ..TwistStamped::default()
        };
        twist.twist.linear.x = 8.0;
        bag.write(speed, stamp, &twist).unwrap();
    }
    bag.finish().unwrap();
}

#[test]
fn the_printed_principal_point_is_used_and_flagged() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("umad.bag");
    write_bag(&path);
    std::fs::write(folder.path().join("umad.toml"), "profile = \"umad\"\n").unwrap();
    let all = Dataset::open(&path, &OpenOptions::default()).unwrap();
    let k = all[0].intrinsics(0);
    assert_eq!((k.fx, k.cy, k.height), (703.64, 117.60, 480));

    let diagnosis = doctor(&path, None);
    let findings = diagnosis.findings();
    let flagged = findings.iter().find(|(_, finding)| {
        let what = finding.what.to_string();
        what.contains("cy") && what.contains("117.6")
    });
    let (_, finding) = flagged.unwrap_or_else(|| panic!("{findings:#?}"));
    assert!(finding.severity >= Severity::Warning, "{finding:?}");
}
