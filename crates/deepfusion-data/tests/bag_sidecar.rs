//! Which of a bag's sources is used for speed and steering, and the files beside a bag.

use crate::common::bag::{CAMERA, TinyBag};
use crate::common::text_of;
use deepfusion_data::{Dataset, Error, OpenOptions, convert_to_kitti, inspect, write_bag_config};
use deepfusion_hint::Hint;
use deepfusion_rosbag::msg::Frame;
use std::fs;
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use tempfile::TempDir;

/// Speed in 0.01 km/h on frame 0x158, bytes 0 and 1; angle in 0.1° on frame 0x25.
const DBC: &str = "VERSION \"\"\n\nBU_: ECU\n\n\
    BO_ 344 WHEELS: 8 ECU\n SG_ SPEED : 7|16@0+ (0.01,0) [0|250] \"km/h\" ECU\n\n\
    BO_ 37 STEERING: 8 ECU\n SG_ ANGLE : 7|16@0- (0.1,0) [-500|500] \"deg\" ECU\n";
const BY_DBC: &str = "[can]\ndbc = \"vehicle.dbc\"\nspeed = \"WHEELS.SPEED\"\n";
/// The same signal without a DBC file.
const INLINE: &str = "[can]\nspeed_unit = \"km/h\"\n\
    speed = { id = 0x158, layout = { start_bit = 7, length = 16, byte_order = \"motorola\", scale = 0.01 } }\n";
const INLINE_STEERING: &str = "[vehicle]\nwheelbase_m = 2.5\n[can]\nsteering_rad = 0.0174533\n\
    steering = { id = 0x25, layout = { start_bit = 7, length = 16, byte_order = \"motorola\", number = \"signed\", scale = 0.1 } }\n";

/// A CAN frame with a number in its first two bytes, high byte first.
fn frame(id: u32, raw: i16) -> Frame {
    let [high, low] = raw.to_be_bytes();
    Frame {
        id,
        dlc: 8,
        data: [high, low, 0, 0, 0, 0, 0, 0],
        ..Frame::default()
    }
}

/// 10 m/s on the bus: 3600 steps of 0.01 km/h.
fn ten_mps() -> Frame {
    frame(0x158, 3600)
}

/// A bag `drive.bag` in a folder of its own, with its configuration file.
struct Drive {
    folder: TempDir,
    bag: PathBuf,
}

impl Drive {
    fn new(sidecar: &str, fill: impl FnOnce(&mut TinyBag)) -> Self {
        Self::on("/camera/image", &format!("{CAMERA}{sidecar}"), fill)
    }

    fn on(image: &str, sidecar: &str, fill: impl FnOnce(&mut TinyBag)) -> Self {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("drive.bag");
        let mut bag = TinyBag::new(&path, image);
        fill(&mut bag);
        bag.finish();
        fs::write(folder.path().join("vehicle.dbc"), DBC).unwrap();
        fs::write(folder.path().join("drive.toml"), sidecar).unwrap();
        Self { folder, bag: path }
    }

    fn speed(&self) -> f64 {
        open(&self.bag).unwrap().frames()[12].speed_mps.unwrap()
    }

    /// Mean speed over half a second.
    fn turn_rad(&self) -> f64 {
        let dataset = open(&self.bag).unwrap();
        let track = dataset.track().unwrap();
        track.motion(0.2, 0.7).unwrap().yaw_rad
    }

    fn refusal(&self) -> String {
        let error = open(&self.bag).unwrap_err();
        format!("{error}\nhint: {}", error.hint().unwrap_or_default())
    }
}

fn open(bag: &Path) -> Result<Dataset, Error> {
    Ok(Dataset::open(bag, &OpenOptions::default())?.remove(0))
}

fn near(found: f64, expected: f64) {
    assert!((found - expected).abs() < 1e-3, "{found}, not {expected}");
}

fn assert_contains(text: &str, parts: &[&str]) {
    for part in parts {
        assert!(text.contains(part), "`{part}` is not in: {text}");
    }
}

#[test]
fn a_speed_on_the_bus_is_not_mixed_with_a_topics() {
    for sidecar in [BY_DBC, INLINE] {
        let drive = Drive::new(sidecar, |bag| {
            bag.can("/can", &ten_mps()).twist("/twist", 5.0);
            bag.odometry("/odom", 5.0).ackermann("/drive", 5.0, 0.0);
        });
        near(drive.speed(), 10.0);
    }
}

/// A bag with a topic of speeds that is not to be read, according to its file, and the speed on the CAN bus. The setting is kept if the
/// file is written again.
#[test]
fn no_topic_and_a_signal_do_not_contradict_each_other() {
    let drive = Drive::new(&format!("{INLINE}[topics]\nspeed = \"none\"\n"), |bag| {
        bag.can("/can", &ten_mps()).twist("/twist", 5.0);
    });
    near(drive.speed(), 10.0);
    write_bag_config(&drive.bag, &OpenOptions::default(), true).unwrap();
    let written = fs::read_to_string(drive.bag.with_extension("toml")).unwrap();
    assert_contains(&written, &["speed = \"none\"", "[can]"]);
    near(drive.speed(), 10.0);
    // The caller can leave out the signal too.
    let options = OpenOptions {
        topics: vec!["speed=none".parse().unwrap()],
        ..OpenOptions::default()
    };
    let without = Dataset::open(&drive.bag, &options).unwrap().remove(0);
    assert_eq!(without.frames()[12].speed_mps, None);
}

/// All bits set means a missing value in J1939: here 655.35 km/h.
#[test]
fn values_outside_a_signals_range_are_left_out() {
    let drive = Drive::new(BY_DBC, |bag| {
        bag.can("/can", &ten_mps()).can("/can", &frame(0x158, -1));
        bag.can("/can", &ten_mps());
    });
    near(drive.speed(), 10.0);
    let warnings = text_of(open(&drive.bag).unwrap().warnings());
    assert_contains(
        &warnings,
        &["can.speed: 25 values outside the signal's range left out"],
    );
}

#[test]
fn requests_and_error_frames_carry_no_speed() {
    let drive = Drive::new(INLINE, |bag| {
        let zero = frame(0x158, 0);
        let rtr = Frame {
            is_rtr: true,
            ..zero.clone()
        };
        let error = Frame {
            is_error: true,
            ..zero.clone()
        };
        // With 29 bits, it is another frame with the same number.
        let extended = Frame {
            is_extended: true,
            ..zero
        };
        bag.can("/can", &ten_mps());
        bag.can("/can", &rtr)
            .can("/can", &error)
            .can("/can", &extended);
    });
    near(drive.speed(), 10.0);
}

#[test]
fn an_extended_frame_is_recognised_by_its_own_identifier() {
    let sidecar = INLINE.replace("id = 0x158", "id = { extended = 0x18fef100 }");
    let drive = Drive::new(&sidecar, |bag| {
        let extended = Frame {
            is_extended: true,
            ..frame(0x18fe_f100, 3600)
        };
        bag.can("/can", &extended).can("/can", &frame(0x158, 720));
    });
    near(drive.speed(), 10.0);
}

#[test]
fn a_topic_and_a_signal_of_one_quantity_are_refused() {
    for (key, sidecar) in [("speed", INLINE), ("steering", INLINE_STEERING)] {
        let named = format!("{sidecar}[topics]\n{key} = \"/drive\"\n");
        let drive = Drive::new(&named, |bag| {
            bag.can("/can", &ten_mps()).ackermann("/drive", 5.0, 0.1);
        });
        let (topic, signal) = (format!("topics.{key}"), format!("can.{key}"));
        assert_contains(
            &drive.refusal(),
            &["drive.toml", "/drive", &topic, &signal, "keep one of them"],
        );
    }
}

#[test]
fn steering_on_the_bus_is_not_mixed_with_a_topics() {
    // 5.73° to the left on the bus, to the right in the topic.
    let drive = Drive::new(INLINE_STEERING, |bag| {
        bag.can("/can", &frame(0x25, 57)).twist("/twist", 10.0);
        bag.ackermann("/drive", 5.0, -0.2);
    });
    let yaw_rate = 10.0 * (57.0 * 0.1 * 0.0174533_f64).tan() / 2.5;
    near(drive.turn_rad(), 0.5 * yaw_rate);
    // The other quantity of the same message is still read from it.
    near(drive.speed(), 10.0);
}

#[test]
fn the_speeds_topic_is_chosen_by_its_type() {
    let drive = Drive::new("", |bag| {
        bag.ackermann("/drive", 3.0, 0.0).odometry("/odom", 4.0);
        bag.twist("/twist", 5.0);
    });
    near(drive.speed(), 5.0);
    let drive = Drive::new("", |bag| {
        bag.ackermann("/drive", 3.0, 0.0).odometry("/odom", 4.0);
    });
    near(drive.speed(), 4.0);
    let drive = Drive::new("", |bag| {
        bag.twist("/a", 5.0).twist("/b", 10.0);
    });
    assert_contains(&drive.refusal(), &["/a, /b", "[topics] speed ="]);
}

#[test]
fn steering_from_plain_numbers_is_read_if_named() {
    let fill = |bag: &mut TinyBag| {
        bag.twist("/twist", 10.0).float("/wheel", 0.1);
    };
    let vehicle = "[vehicle]\nwheelbase_m = 2.5\n";
    let named = format!("{vehicle}[topics]\nsteering = \"/wheel\"\n");
    near(
        Drive::new(&named, fill).turn_rad(),
        0.5 * 10.0 * 0.1_f64.tan() / 2.5,
    );
    near(Drive::new(vehicle, fill).turn_rad(), 0.0);
}

#[test]
fn the_documented_signals_are_read() {
    let page = include_str!("../../../docs/reference/bag-toml.md");
    let (_, section) = page.split_once("## Signals without a DBC file").unwrap();
    let example = section.split("```toml").nth(1).unwrap();
    let (example, _) = example.split_once("```").unwrap();
    let drive = Drive::new(
        &format!("{example}\n[vehicle]\nwheelbase_m = 2.5\n"),
        |bag| {
            // 4 steps of 1.5°, in 12 bits starting with the lowest.
            bag.can("/can", &ten_mps())
                .can("/can", &frame(0x25, 0x0400));
        },
    );
    near(drive.speed(), 10.0);
    near(
        drive.turn_rad(),
        0.5 * 10.0 * (4.0 * 1.5 * 0.0174533_f64).tan() / 2.5,
    );
}

#[test]
fn errors_name_the_field_of_an_invalid_signal() {
    let by_name = BY_DBC.replace("dbc = \"vehicle.dbc\"\n", "");
    let steering = INLINE_STEERING.replace("steering_rad = 0.0174533\n", "");
    for (sidecar, parts) in [
        (by_name, ["can.speed is the name WHEELS.SPEED", "can.dbc"]),
        (
            BY_DBC.replace("WHEELS.SPEED", "WHEELS.SPED"),
            ["SPED", "`WHEELS`, which has SPEED"],
        ),
        (
            BY_DBC.replace("vehicle.dbc", "gone.dbc"),
            ["can:", "gone.dbc"],
        ),
        (
            INLINE.replace("speed_unit = \"km/h\"\n", ""),
            ["can.speed_unit", "km/h"],
        ),
        (steering, ["can.steering_rad is missing", "0.0174533"]),
        (
            INLINE.replace("0x158", "0x18fe"),
            ["can.speed: id is 0x18fe", "extended"],
        ),
        (
            INLINE.replace("0x158", "-1"),
            ["speed", "id must be a number"],
        ),
        (
            INLINE.replace("length = 16", "length = 65"),
            ["can.speed", "length is 65"],
        ),
        (
            INLINE.replace("length = 16", "len = 16"),
            ["speed", "unknown field `len`"],
        ),
        (
            INLINE.replace("0.01", "0"),
            ["can.speed: scale is 0", "every value"],
        ),
    ] {
        let drive = Drive::new(&sidecar, |bag| {
            bag.can("/can", &ten_mps());
        });
        let refusal = drive.refusal();
        assert_contains(&refusal, &["drive.toml"]);
        assert_contains(&refusal, &parts);
    }
}

#[test]
fn a_bus_that_was_not_recorded_is_an_error() {
    let drive = Drive::new(INLINE, |bag| {
        bag.twist("/twist", 5.0);
    });
    assert_contains(&drive.refusal(), &["can_msgs/Frame", "[can]", "drive.toml"]);
}

#[test]
fn a_signal_without_a_frame_is_an_error() {
    let drive = Drive::new(INLINE, |bag| {
        bag.can("/can", &frame(0x159, 3600)).twist("/twist", 5.0);
    });
    let dataset = open(&drive.bag).unwrap();
    assert_eq!(dataset.frames()[12].speed_mps, None);
    assert_contains(&text_of(dataset.warnings()), &["can.speed", "0x158"]);
}

const CALIBRATION: &str = "%YAML:1.0\n---\n\
    camera_matrix: !!opencv-matrix\n   rows: 3\n   cols: 3\n   dt: d\n   data: [ 70., 0., 31., 0., 71., 23., 0., 0., 1. ]\n\
    distortion_coefficients: !!opencv-matrix\n   rows: 4\n   cols: 1\n   dt: d\n   data: [ -0.1, 0., 0., 0. ]\n";

#[test]
fn a_calibration_file_gives_the_camera() {
    let file = "calibration = \"sensors/camera.yaml\"\n";
    let drive = |image, sidecar: &str| {
        let drive = Drive::on(image, sidecar, |_| {});
        let sensors = drive.folder.path().join("sensors");
        fs::create_dir(&sensors).unwrap();
        fs::write(sensors.join("camera.yaml"), CALIBRATION).unwrap();
        drive
    };
    let dataset = open(&drive("/camera/image", file).bag).unwrap();
    let k = dataset.intrinsics(0);
    assert_eq!((k.width, k.height), (64, 48));
    // The lens correction keeps the matrix, or nearly so.
    let plain = CALIBRATION.replace("-0.1", "0.");
    let straight = drive("/camera/image", file);
    fs::write(straight.folder.path().join("sensors/camera.yaml"), plain).unwrap();
    let straight = open(&straight.bag).unwrap();
    let found = straight.intrinsics(0);
    assert_eq!(
        (found.fx, found.fy, found.cx, found.cy),
        (70.0, 71.0, 31.0, 23.0)
    );
    // The distortion is corrected in the images, not only read.
    let [bent, flat] = [&dataset, &straight].map(|d| d.load_image(0).unwrap());
    assert_ne!(bent, flat);

    let rectified = drive("/camera/image_rect", file).refusal();
    assert_contains(&rectified, &["camera.yaml", "`rect`", "topics.image"]);
    let both = drive("/camera/image", &format!("{CAMERA}{file}")).refusal();
    assert_contains(&both, &["drive.toml", "[camera] and calibration"]);
    let gone = drive("/camera/image", "calibration = \"gone.yaml\"\n").refusal();
    assert_contains(&gone, &["drive.toml", "calibration", "gone.yaml"]);
}

/// The file beside a link takes precedence; otherwise the one beside its target is read.
#[cfg(unix)]
#[test]
fn the_file_beside_a_link_is_used() {
    use std::os::unix::fs::symlink;
    let drive = Drive::new("scenario = \"target\"\n", |bag| {
        bag.twist("/twist", 5.0);
    });
    let scenario = |dataset: &Dataset| dataset.scenario().map(str::to_owned);
    let links = tempfile::tempdir().unwrap();
    let link = links.path().join("monday.bag");
    symlink(&drive.bag, &link).unwrap();
    assert_eq!(scenario(&open(&link).unwrap()).as_deref(), Some("target"));

    fs::write(
        links.path().join("monday.toml"),
        format!("{CAMERA}scenario = \"link\"\n"),
    )
    .unwrap();
    // Given directly, or found in its folder.
    for path in [link.as_path(), links.path()] {
        let dataset = open(path).unwrap();
        assert_eq!(scenario(&dataset).as_deref(), Some("link"));
        assert_eq!(dataset.name(), "monday");
    }
    assert_eq!(inspect(&link).unwrap().drives[0].name, "monday");
    // The target's name has no extension.
    let stored = links.path().join("9f86d081");
    fs::rename(&drive.bag, &stored).unwrap();
    fs::remove_file(&link).unwrap();
    symlink(&stored, &link).unwrap();
    assert_eq!(scenario(&open(&link).unwrap()).as_deref(), Some("link"));
    // Down a folder and up again.
    let around = links
        .path()
        .join("../")
        .join(links.path().file_name().unwrap());
    assert_eq!(open(&around).unwrap().name(), "monday");
}

#[test]
fn a_bag_without_a_camera_is_left_out_of_a_folder_and_named() {
    let drive = Drive::new("", |bag| {
        bag.twist("/vehicle/twist", 10.0);
    });
    let other = drive.folder.path().join("lidar.bag");
    let options = deepfusion_rosbag::WriterOptions::default();
    let mut bag = deepfusion_rosbag::BagWriter::create(&other, options).unwrap();
    let topic = bag.add_connection::<Frame>("/can").unwrap();
    let time = deepfusion_rosbag::Time::from_nanos(1_000_000_000);
    bag.write(topic, time, &ten_mps()).unwrap();
    bag.finish().unwrap();
    let all = Dataset::open(drive.folder.path(), &OpenOptions::default()).unwrap();
    assert_eq!(all.len(), 1);
    let warnings = text_of(all[0].warnings());
    assert!(
        warnings.contains("left out") && warnings.contains("lidar"),
        "{warnings}"
    );
    let seen = inspect(drive.folder.path()).unwrap();
    assert_eq!((seen.frames, seen.drives.len()), (all[0].frames().len(), 1));
    assert!(seen.unreadable.is_empty(), "{:?}", seen.unreadable);
    let noted = text_of(&seen.drives[0].warnings);
    assert!(noted.contains("lack of images: lidar.bag"), "{noted}");
    // Given alone, it is an error.
    let error = open(&other).unwrap_err().to_string();
    assert!(error.contains("has images"), "{error}");
}

/// Files with a bag's name that are not bags, before and after a good one, and the remains of another bag, without images.
#[test]
fn unreadable_bags_of_a_folder_are_listed_with_the_others() {
    let drive = Drive::new("", |bag| {
        bag.twist("/vehicle/twist", 10.0);
    });
    let at = drive.folder.path();
    let letter = "a letter";
    for (name, text) in [
        ("a.bag", letter),
        ("m.bag", "#ROSBAG V2.0\n"),
        ("z.bag", letter),
    ] {
        fs::write(at.join(name), text).unwrap();
    }
    let seen = inspect(at).unwrap();
    assert_eq!((seen.drives.len(), seen.frames), (1, 25));
    let files = seen.unreadable.iter().map(|one| one.path.file_name());
    let files: Vec<_> = files.flatten().collect();
    assert_eq!(files, ["a.bag", "z.bag"]);
    let noted = text_of(&seen.drives[0].warnings);
    assert!(noted.contains("lack of images: m.bag"), "{noted}");
    let error = &seen.unreadable[0].error;
    assert!(matches!(**error, Error::Bag(_)), "{error}");
    let text = seen.to_string();
    for part in ["25 frames", "z.bag", "not a ROS bag"] {
        assert!(text.contains(part), "{part}: {text}");
    }
    let json = serde_json::to_value(&seen).unwrap();
    let message = json["unreadable"][1]["error"].as_str().unwrap();
    assert!(message.contains("z.bag: not a ROS bag"), "{message}");

    fs::remove_file(&drive.bag).unwrap();
    let none = inspect(at).unwrap();
    assert_eq!((none.drives.len(), none.unreadable.len()), (0, 3));
    assert!(none.to_string().contains("unreadable"), "{none}");
    // The same reason for all is an error, as is a single bag.
    for name in ["m.bag", "a.bag"] {
        fs::remove_file(at.join(name)).unwrap();
        let error = inspect(at).unwrap_err();
        assert!(matches!(error, Error::Bag(_)), "{error}");
    }
    // Also for several bags without images.
    fs::remove_file(at.join("z.bag")).unwrap();
    for name in ["m.bag", "n.bag"] {
        fs::write(at.join(name), "#ROSBAG V2.0\n").unwrap();
    }
    let error = inspect(at).unwrap_err();
    assert!(matches!(error, Error::NoFrames { .. }), "{error}");
}

#[test]
fn a_twists_speed_is_scaled_like_any_other() {
    let sidecar = "[vehicle]\nspeed_scale = 0.9\n";
    // From a twist with a yaw rate, which is used as it is, and from one whose motion is fused.
    for yaw_rate in [0.2, 0.0] {
        let drive = Drive::new(sidecar, |bag| {
            bag.turning_twist("/twist", |_| (10.0, yaw_rate));
        });
        near(drive.speed(), 9.0);
        near(drive.turn_rad(), 0.5 * yaw_rate);
    }
    let wrong = Drive::new("[vehicle]\nspeed_scale = 3.6\n", |bag| {
        bag.twist("/twist", 10.0);
    });
    assert_contains(
        &wrong.refusal(),
        &["drive.toml", "vehicle.speed_scale is 3.6", "0.5 to 2"],
    );
}

/// Publishers without a yaw rate write NaN: always, or sometimes.
#[test]
fn a_twist_without_a_yaw_rate_has_a_speed() {
    let never = Drive::new("", |bag| {
        bag.turning_twist("/twist", |_| (10.0, f64::NAN));
    });
    near(never.speed(), 10.0);
    assert!(!open(&never.bag).unwrap().yaw_known());
    let sometimes = Drive::new("", |bag| {
        let gap = |t: f64| (t / 0.04).round() as i64 % 3 == 0;
        bag.turning_twist("/twist", move |t| {
            (10.0, if gap(t) { f64::NAN } else { 0.2 })
        });
    });
    near(sometimes.speed(), 10.0);
    near(sometimes.turn_rad(), 0.5 * 0.2);
    assert!(open(&sometimes.bag).unwrap().yaw_known());
}

/// Rates give the rotation between two images, not the attitude: the integral since the bag's beginning, which grows with a bias or on a
/// ramp, must not add roll in bends.
#[test]
fn roll_and_pitch_rates_are_integrated_only_within_a_pair() {
    let drive = Drive::new("", |bag| {
        bag.tumbling_twist("/twist", 10.0, [0.0, 1.5, 1.0]);
    });
    let dataset = open(&drive.bag).unwrap();
    let track = dataset.track().unwrap();
    for from_s in [0.1, 0.7] {
        let moved = track.motion(from_s, from_s + 0.1).unwrap();
        near(moved.yaw_rad, 0.1);
        near(moved.tilt_rad[0], 0.0);
        near(moved.tilt_rad[1], 0.15);
    }
    // The same in a copy in KITTI's layout.
    let out = drive.folder.path().join("copy");
    let source = std::slice::from_ref(&dataset);
    convert_to_kitti(source, &out, &mut |_, _| ControlFlow::Continue(())).unwrap();
    let copy = Dataset::open(&out, &OpenOptions::default())
        .unwrap()
        .remove(0);
    let moved = copy.track().unwrap().motion(0.7, 0.8).unwrap();
    near(moved.tilt_rad[0], 0.0);
    near(moved.tilt_rad[1], 0.15);
}

#[test]
fn a_steering_angle_without_a_wheelbase_does_not_replace_a_yaw_rate() {
    let fill = |bag: &mut TinyBag| {
        bag.turning_twist("/twist", |_| (10.0, 0.2));
        bag.ackermann("/drive", 10.0, 0.1);
    };
    let drive = Drive::new("", fill);
    assert!(open(&drive.bag).unwrap().yaw_known());
    near(drive.turn_rad(), 0.5 * 0.2);
    // With a wheelbase it gives turns.
    let steered = Drive::new("[vehicle]\nwheelbase_m = 2.5\n", fill);
    near(steered.turn_rad(), 0.5 * 10.0 * 0.1_f64.tan() / 2.5);
}

/// If drivers leave the header's time at 0, all their messages would be at the same time, decades before the images.
#[test]
fn messages_without_a_time_get_their_time_of_recording() {
    let sidecar = "[vehicle]\nwheelbase_m = 2.5\n";
    let drive = Drive::new(sidecar, |bag| {
        bag.without_stamps();
        bag.turning_twist("/twist", |t| (10.0 + t, 0.0));
        bag.imu("/imu", 0.4).ackermann("/drive", 0.0, 0.1);
    });
    let dataset = open(&drive.bag).unwrap();
    // The twelfth image is at 0.48 s.
    near(dataset.frames()[12].speed_mps.unwrap(), 10.48);
    // Gyro and steering agree.
    assert!(
        (drive.turn_rad() - 0.5 * 0.4).abs() < 0.02,
        "{}",
        drive.turn_rad()
    );
    let warnings = text_of(dataset.warnings());
    for topic in ["/twist", "/imu", "/drive"] {
        assert_contains(
            &warnings,
            &[&format!(
                "{topic}: 25 messages have no time in their header"
            )],
        );
    }
    assert!(!warnings.contains("/camera"), "{warnings}");
    let stamped = Drive::new(sidecar, |bag| {
        bag.twist("/twist", 10.0).float("/bare", 1.0);
    });
    let warnings = text_of(open(&stamped.bag).unwrap().warnings());
    assert!(!warnings.contains("no time"), "{warnings}");
}

/// The same for CAN frames.
#[test]
fn can_frames_without_a_time_get_their_time_of_recording() {
    let drive = Drive::new(INLINE, |bag| {
        bag.without_stamps().can("/can", &ten_mps());
    });
    near(drive.speed(), 10.0);
    assert_contains(
        &text_of(open(&drive.bag).unwrap().warnings()),
        &["/can: 25 messages"],
    );
}

/// Unreadable parts are distinguished from oddities.
#[test]
fn damage_is_a_separate_list_among_the_warnings() {
    let drive = Drive::new("", |bag| {
        bag.without_stamps().twist("/twist", 10.0);
    });
    let odd = open(&drive.bag).unwrap();
    assert!(odd.damage().is_empty(), "{:?}", odd.damage());
    assert!(!odd.warnings().is_empty());

    let bytes = fs::read(&drive.bag).unwrap();
    fs::write(&drive.bag, &bytes[..bytes.len() - 1]).unwrap();
    let cut = open(&drive.bag).unwrap();
    let [damage] = cut.damage() else {
        panic!("{:?}", cut.damage());
    };
    let message = damage.to_string();
    assert!(message.starts_with("the bag is damaged: "), "{message}");
    assert!(cut.warnings().contains(damage), "{:?}", cut.warnings());
}
