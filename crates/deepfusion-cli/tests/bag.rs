//! Bags through the program: written, inspected, converted, trained on, evaluated.

use std::path::Path;

use crate::support::{fails, json, ok, run};
use deepfusion_rosbag::msg::{
    Header, Imu, Odometry, Pose, PoseWithCovariance, Quaternion, Twist, TwistWithCovariance,
    Vector3,
};
use deepfusion_rosbag::{BagWriter, Time, WriterOptions};
use serde_json::Value;

#[test]
fn bags_are_trained_on_and_evaluated_by_scenario() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    for (scene, moving) in [("urban", 4), ("garage", 0)] {
        let made = json(
            at,
            &format!(
                "simulate --out {scene} --format bag --scene {scene} --frames 16 --size 96x64 --moving-cars {moving} --json"
            ),
        );
        assert!(made["drive"].as_str().unwrap().ends_with(".bag"));
    }
    let inspection = json(at, "data inspect urban/urban_0001.bag --json");
    assert_eq!(inspection["kind"], "bag");
    assert_eq!(inspection["frames"], 16);
    let streams = inspection["streams"].as_array().unwrap();
    let stream = |name: &str| streams.iter().find(|s| s["name"] == name).unwrap().clone();
    let imu = stream("/imu/data");
    assert_eq!(imu["type"], "imu");
    assert!((imu["rate_hz"].as_f64().unwrap() - 100.0).abs() < 0.1);
    assert!((stream("/vehicle/speed")["rate_hz"].as_f64().unwrap() - 50.0).abs() < 0.1);
    assert!(inspection["distance_m"].as_f64().unwrap() > 1.0);

    ok(
        at,
        "train --data urban garage --preset tiny --size 64x64 --batch 2 --steps 3 --init none --out run",
    );
    let report = json(
        at,
        "eval --model run/last.safetensors --data urban garage --crop none --json",
    );
    let rows = report["scenarios"].as_array().unwrap();
    let names: Vec<&str> = rows.iter().map(|r| r["name"].as_str().unwrap()).collect();
    assert_eq!(names, ["garage", "urban"]);
    let images = |row: &Value| row["n"].as_u64().unwrap();
    assert_eq!(
        images(&rows[0]) + images(&rows[1]),
        report["n"].as_u64().unwrap()
    );
    assert!(rows[0]["scale"]["median"].as_f64().unwrap() > 0.0);
    let odometry = json(
        at,
        "eval-odometry --model run/last.safetensors --data urban --json",
    );
    assert!(odometry["scale"].as_f64().unwrap() > 0.0);
    let text = ok(
        at,
        "eval --model run/last.safetensors --data urban garage --crop none",
    )
    .stdout;
    assert!(text.contains("garage, scale"), "{text}");
}

#[test]
fn an_option_of_another_layout_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    for (args, option, layout) in [
        ("--compression none", "--compression", "--format bag"),
        ("--clock-offset 20", "--clock-offset", "--format bag"),
        (
            "--format bag --scan-every 5",
            "--scan-every",
            "--format kitti",
        ),
    ] {
        let refused = run(folder.path(), &format!("simulate --out new {args}"));
        assert_eq!(refused.code, 2, "{}", refused.stderr);
        for part in [option, "does not apply to this layout", layout] {
            assert!(refused.stderr.contains(part), "{part}: {}", refused.stderr);
        }
        assert!(!folder.path().join("new").exists());
    }
}

#[test]
fn a_bag_is_converted_both_ways() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    ok(
        at,
        "simulate --out sim --format bag --frames 6 --size 64x48 --compression none",
    );
    let written = json(at, "data convert sim/urban_0001.bag kitti --json");
    assert_eq!(written["frames"], 6);
    let inspection = json(at, "data inspect kitti --json");
    assert_eq!(inspection["kind"], "kitti_raw");
    assert_eq!(inspection["size"], serde_json::json!([64, 48]));
    // Only KITTI numbers its cameras.
    let text = ok(at, "data inspect kitti").stdout;
    assert!(text.contains("_sync (camera 2)"), "{text}");
    let text = ok(at, "data inspect sim").stdout;
    assert!(!text.contains("(camera"), "{text}");
    ok(at, "data convert kitti again.bag");
    let again = json(at, "data inspect again.bag --json");
    assert_eq!(again["frames"], 6);
    let refused = run(at, "data convert kitti again.bag");
    assert_eq!(refused.code, 1);
    assert!(
        refused.stderr.contains("again.bag: already exists"),
        "{}",
        refused.stderr
    );
    assert!(refused.stderr.contains("hint:"), "{}", refused.stderr);
}

#[test]
fn a_warning_of_opening_is_printed_once() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    ok(
        at,
        "simulate --out sim --format bag --frames 40 --size 96x64 --moving-cars 0",
    );
    let whole = ok(at, "data convert sim/urban_0001.bag whole");
    assert!(!whole.stderr.contains("damaged"), "{}", whole.stderr);
    let bag = at.join("sim/urban_0001.bag");
    let bytes = std::fs::read(&bag).unwrap();
    std::fs::write(&bag, &bytes[..bytes.len() / 2]).unwrap();
    let warned = |stderr: &str| {
        let about: Vec<&str> = stderr.lines().filter(|l| l.contains("damaged")).collect();
        assert_eq!(about.len(), 1, "{stderr}");
        assert!(about[0].contains("urban_0001.bag: "), "{stderr}");
    };
    let converted = ok(at, "data convert sim/urban_0001.bag kitti --json");
    warned(&converted.stderr);
    let written: Value = serde_json::from_str(&converted.stdout).unwrap();
    let frames = written["frames"].as_u64().unwrap();
    assert!(
        (1..40).contains(&frames),
        "cut in the middle: {frames} frames"
    );
    // The same recording to train on and to validate on counts once.
    let small = "--preset tiny --size 64x64 --batch 2 --steps 1 --init none";
    let refused = run(
        at,
        &format!("train --data sim --val-data sim {small} --out no"),
    );
    assert_eq!(refused.code, 1, "{}", refused.stderr);
    assert!(
        refused
            .stderr
            .contains("validation frames are also training frames"),
        "{}",
        refused.stderr
    );
    warned(&refused.stderr);
    let trained = ok(at, &format!("train --data sim {small} --out run"));
    warned(&trained.stderr);
    let predicted = ok(at, "predict --model run sim/urban_0001.bag --out depth");
    warned(&predicted.stderr);
    // No viewer can open its images, so they are saved unless --save says otherwise.
    let images = |folder: &str| {
        let names = std::fs::read_dir(at.join(folder)).unwrap();
        let names = names.map(|e| e.unwrap().file_name().into_string().unwrap());
        names.filter(|name| name.ends_with("_image.jpg")).count()
    };
    let depths = std::fs::read_dir(at.join("depth")).unwrap();
    let depths = depths.filter(|e| {
        let name = e.as_ref().unwrap().file_name();
        name.to_string_lossy().ends_with("_depth.png")
    });
    let count = depths.count();
    assert!(count > 0);
    assert_eq!(images("depth"), count);
    let sidecar = std::fs::read_dir(at.join("depth")).unwrap().find_map(|e| {
        let path = e.unwrap().path();
        let name = path.file_name().unwrap().to_str().unwrap();
        let is = name.ends_with(".json") && !name.contains("manifest");
        is.then(|| std::fs::read_to_string(&path).unwrap())
    });
    assert!(sidecar.unwrap().contains("_image.jpg"));
    ok(
        at,
        "predict --model run sim/urban_0001.bag --save depth-png --out without",
    );
    assert_eq!(images("without"), 0);
}

/// A bag of two seconds without a camera: an inertial unit that turns left by 0.3 rad/s, and, if asked for, odometry
/// of a vehicle that stands and turns right by 0.2 rad/s.
fn write_without_camera(path: &Path, odometry: bool) {
    let mut bag = BagWriter::create(path, WriterOptions::default()).unwrap();
    let imu = bag.add_connection::<Imu>("/imu/data").unwrap();
    let odom = odometry.then(|| bag.add_connection::<Odometry>("/odom").unwrap());
    for i in 0..=200 {
        let stamp = Time {
            sec: 1_700_000_000 + i / 100,
            nsec: (i % 100) * 10_000_000,
        };
        let header = Header {
            stamp,
            ..Header::default()
        };
        let up = |z| Vector3 {
            z,
            ..Vector3::default()
        };
        if let Some(odom) = odom {
            let twist = Twist {
                linear: Vector3 {
                    x: -0.0,
                    ..Vector3::default()
                },
                angular: up(-0.2),
            };
            let odometry = Odometry {
                header,
                child_frame_id: "vehicle".into(),
                pose: PoseWithCovariance {
                    pose: Pose::default(),
                    covariance: [0.0; 36],
                },
                twist: TwistWithCovariance {
                    twist,
                    covariance: [0.0; 36],
                },
            };
            bag.write(odom, stamp, &odometry).unwrap();
        } else {
            let sample = Imu {
                header,
                orientation: Quaternion::default(),
                orientation_covariance: [0.0; 9],
                angular_velocity: up(0.3),
                angular_velocity_covariance: [0.0; 9],
                linear_acceleration: up(9.81),
                linear_acceleration_covariance: [0.0; 9],
            };
            bag.write(imu, stamp, &sample).unwrap();
        }
    }
    bag.finish().unwrap();
}

#[test]
fn a_bag_without_a_camera_has_the_vehicles_turns() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    for (name, odometry, turned) in [("imu.bag", false, 0.6), ("odom.bag", true, -0.4)] {
        write_without_camera(&at.join(name), odometry);
        let seen = json(at, &format!("data inspect {name} --json"));
        let turn = seen["drives"][0]["turn_rad"].as_f64().unwrap();
        assert!((turn - turned).abs() < 1e-3, "{name}: {turn}");
        let text = ok(at, &format!("data inspect {name}")).stdout;
        assert!(text.contains("without images"), "{text}");
        assert!(!text.contains("(camera"), "it has none: {text}");
        assert!(!text.contains("-0.0"), "{text}");
    }
}

#[test]
fn bags_of_ros_2_are_not_written() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    ok(at, "simulate --out sim --frames 4 --size 64x48");
    for name in ["foo.mcap", "foo.DB3"] {
        let args = format!("data convert sim {name}");
        fails(at, &args, &[name, "can be read, but not written", ".bag"]);
        assert!(!at.join(name).exists());
    }
}

#[cfg(feature = "ros2")]
#[test]
fn a_bag_of_ros_2_is_read_like_one_of_ros_1() {
    let bags = concat!(
        env!("CARGO_MANIFEST_DIR"),
        "/../deepfusion-data/tests/reference/ros"
    );
    let at = Path::new(bags);
    let [one, two] =
        ["drive.bag", "drive_ros2"].map(|name| json(at, &format!("data inspect {name} --json")));
    // The script that makes it writes fewer images and scans.
    assert_eq!((&one["frames"], &two["frames"]), (&51.into(), &11.into()));
    for key in ["kind", "size", "intrinsics"] {
        assert!(!one[key].is_null(), "{key}");
        assert_eq!(one[key], two[key], "{key}");
    }
}

#[cfg(not(feature = "ros2"))]
#[test]
fn a_build_without_ros_2_says_how_to_build_it_in() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    std::fs::create_dir(at.join("drive")).unwrap();
    std::fs::write(at.join("drive/drive_0.mcap"), b"").unwrap();
    // This only looks like a run: the input's error comes before the network is read.
    std::fs::create_dir(at.join("run")).unwrap();
    std::fs::write(at.join("run/config.toml"), b"").unwrap();
    for place in ["drive", "drive/drive_0.mcap"] {
        let args = format!("data inspect {place}");
        fails(at, &args, &["ROS 2 bag", "--features ros2"]);
        let args = format!("predict --model run {place} --out depth");
        fails(at, &args, &["ROS 2 bag", "--features ros2"]);
    }
}

#[test]
fn a_bags_errors_are_reported() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    ok(
        at,
        "simulate --out sim --format bag --frames 6 --size 64x48",
    );
    let bag = at.join("sim/urban_0001.bag");
    let sidecar = bag.with_extension("toml");
    let good = std::fs::read_to_string(&sidecar).unwrap();
    let failing = |text: &str| {
        std::fs::write(&sidecar, text).unwrap();
        let run = run(
            at,
            "train --data sim --preset tiny --size 64x64 --steps 1 --init none --out no",
        );
        assert_eq!(run.code, 1, "{}", run.stderr);
        assert!(run.stderr.contains("hint:"), "{}", run.stderr);
        run.stderr
    };
    let error = failing("[topics]\nspeed = \"/wheels\"\n");
    assert!(error.contains("no topic /wheels"), "{error}");
    assert!(
        error.contains("/vehicle/speed"),
        "the topics that exist: {error}"
    );
    let error = failing("[vehicel]\nwheelbase_m = 2.7\n");
    assert!(error.contains("unknown field `vehicel`"), "{error}");
    let camera =
        "[camera]\nfx = 50.0\nfy = 50.0\ncx = 320.0\ncy = 240.0\nwidth = 640\nheight = 480\n";
    let error = failing(camera);
    assert!(
        error.contains("64x48") && error.contains("640x480"),
        "{error}"
    );
    std::fs::write(&sidecar, good).unwrap();
    // Cut in the middle: the intact part is read, and the inspection reports the damage.
    let bytes = std::fs::read(&bag).unwrap();
    std::fs::write(&bag, &bytes[..bytes.len() / 2]).unwrap();
    let text = ok(at, "data inspect sim").stdout;
    assert!(text.contains("damaged"), "{text}");
    std::fs::write(&bag, b"#ROSBAG V2.0\n").unwrap();
    let text = ok(at, "data inspect sim").stdout;
    assert!(
        text.contains("without images") && text.contains("damaged"),
        "{text}"
    );
    let empty = run(
        at,
        "train --data sim --preset tiny --size 64x64 --steps 1 --init none --out no",
    );
    assert_eq!(empty.code, 1);
    assert!(
        empty.stderr.contains("none of its topics has images"),
        "{}",
        empty.stderr
    );
    std::fs::write(&bag, b"a letter").unwrap();
    let letter = run(at, "data inspect sim");
    assert_eq!(letter.code, 1);
    assert!(
        letter.stderr.contains("not a ROS bag") && letter.stderr.contains("hint:"),
        "{}",
        letter.stderr
    );
}

#[test]
fn a_damaged_bag_does_not_hide_the_others() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    ok(
        at,
        "simulate --out sim --format bag --frames 6 --size 64x48",
    );
    std::fs::write(at.join("sim/damaged.bag"), b"a letter").unwrap();
    let listed = run(at, "data inspect sim");
    assert_eq!(listed.code, 1, "{}", listed.stderr);
    for part in ["urban_0001", "damaged.bag", "not a ROS bag"] {
        assert!(listed.stdout.contains(part), "{part}: {}", listed.stdout);
    }
    for part in [
        "sim: 1 of 2 recordings cannot be read",
        "hint: each is listed with its reason",
        "name ROS 2 recordings .mcap or .db3",
        "or give only the others",
    ] {
        assert!(listed.stderr.contains(part), "{part}: {}", listed.stderr);
    }
    let listed = run(at, "data inspect sim --json");
    assert_eq!(listed.code, 1, "{}", listed.stderr);
    let seen: Value = serde_json::from_str(&listed.stdout).unwrap();
    assert_eq!((&seen["frames"], &seen["kind"]), (&6.into(), &"bag".into()));
    let damaged = seen["unreadable"][0]["path"].as_str().unwrap();
    assert!(damaged.ends_with("damaged.bag"), "{damaged}");
    // If one bag is damaged, no file is written, not even beside the two good ones.
    std::fs::remove_file(at.join("sim/damaged.bag")).unwrap();
    let (bag, other) = (at.join("sim/urban_0001.bag"), at.join("sim/other.bag"));
    std::fs::copy(&bag, &other).unwrap();
    let camera =
        "[camera]\nfx = 50.0\nfy = 50.0\ncx = 320.0\ncy = 240.0\nwidth = 640\nheight = 480\n";
    std::fs::write(other.with_extension("toml"), camera).unwrap();
    std::fs::remove_file(bag.with_extension("toml")).unwrap();
    let written = run(at, "data inspect sim --write-config --overwrite");
    assert_eq!(written.code, 1, "{}", written.stderr);
    let expected = "sim: 1 of 2 recordings cannot be read";
    assert!(written.stderr.contains(expected), "{}", written.stderr);
    assert!(!bag.with_extension("toml").exists());
    let kept = std::fs::read_to_string(other.with_extension("toml")).unwrap();
    assert_eq!(kept, camera);
    // Without the damaged one, both are written.
    std::fs::remove_file(other.with_extension("toml")).unwrap();
    ok(at, "data inspect sim --write-config");
    for bag in [bag, other] {
        assert!(bag.with_extension("toml").exists(), "{}", bag.display());
    }
}

/// If no bag can be read, the hint does not suggest giving the others, and a common reason is reported as if of one recording.
#[test]
fn the_reasons_why_bags_cannot_be_read_are_reported() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    std::fs::create_dir(at.join("sim")).unwrap();
    for (name, text) in [
        ("a", "a letter"),
        ("b", "a letter"),
        ("c", "#ROSBAG V2.0\n"),
    ] {
        std::fs::write(at.join("sim").join(name).with_extension("bag"), text).unwrap();
    }
    let listed = run(at, "data inspect sim");
    assert_eq!(listed.code, 1, "{}", listed.stderr);
    let expected = "sim: 3 of 3 recordings cannot be read";
    assert!(listed.stderr.contains(expected), "{}", listed.stderr);
    let others = listed.stderr.contains("the others");
    assert!(!others, "{}", listed.stderr);
    std::fs::remove_file(at.join("sim/c.bag")).unwrap();
    fails(
        at,
        "data inspect sim",
        &[
            "a.bag: not a ROS bag",
            "name ROS 2 recordings .mcap or .db3",
        ],
    );
}

/// Frames on /tf_static, CameraInfo and satellite positions at 1 Hz (`deepfusion-data/tests/reference/ros_drive.py`).
#[test]
fn a_bag_as_ros_records_it_is_trained_on_without_a_file_beside_it() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let reference = Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("../deepfusion-data/tests/reference/ros/drive.bag");
    std::fs::copy(reference, at.join("drive.bag")).unwrap();
    let seen = json(at, "data inspect drive.bag --json");
    let drive = &seen["drives"][0];
    let mounts = drive["mounts"].as_array().unwrap();
    let names: Vec<&str> = mounts.iter().map(|m| m["name"].as_str().unwrap()).collect();
    assert_eq!(
        names,
        ["cam_from_vehicle", "cam_from_lidar", "vehicle_from_imu"]
    );
    assert!(drive["usable_pairs"].as_u64().unwrap() > 40, "{drive}");
    assert!(seen["speed_mps"]["mean"].as_f64().unwrap() > 3.0);

    ok(
        at,
        "train --data drive.bag --preset tiny --size 64x64 --batch 2 --steps 2 --init none --view-motion vehicle --out run",
    );
    assert_eq!(std::fs::read_dir(at).unwrap().count(), 2, "drive.bag, run");
    let config = std::fs::read_to_string(at.join("run/config.toml")).unwrap();
    assert!(!config.contains("topics"), "{config}");

    // A file beside the bag with the same content changes nothing.
    let wrote = ok(at, "data inspect drive.bag --write-config");
    assert!(
        wrote.stderr.contains("drive.toml written"),
        "{}",
        wrote.stderr
    );
    fails(
        at,
        "data inspect drive.bag --write-config",
        &["drive.toml: already exists", "--overwrite"],
    );
    let again = json(at, "data inspect drive.bag --json");
    assert_eq!(again["speed_mps"], seen["speed_mps"]);
    let place = |seen: &Value| {
        seen["drives"][0]["mounts"][0]["translation"][2]
            .as_f64()
            .unwrap()
    };
    assert!((place(&again) - place(&seen)).abs() < 1e-12);
    assert!((place(&seen) + 1.6).abs() < 1e-9, "1.6 m ahead of the axle");
    ok(at, "data inspect drive.bag --write-config --overwrite");
}

#[test]
fn a_topic_is_named_by_an_option() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let reference = Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("../deepfusion-data/tests/reference/ros/drive.bag");
    std::fs::copy(reference, at.join("drive.bag")).unwrap();
    let small = "--preset tiny --size 64x64 --batch 2 --steps 1 --init none";
    let image = "image=/camera/front/image_raw/compressed";
    for command in [
        "data inspect drive.bag".to_owned(),
        "doctor drive.bag".into(),
        "data convert drive.bag kitti".into(),
        "data export-gt drive.bag --out gt.npz".into(),
        "predict --model tiny drive.bag --out depth".into(),
        "perceive --model tiny drive.bag --out targets".into(),
        "eval --model tiny --data drive.bag".into(),
        format!("train --data drive.bag {small} --out run"),
    ] {
        let wrong = run(at, &format!("{command} --topic image=/gnss/fix"));
        let text = format!("{}{}", wrong.stdout, wrong.stderr);
        assert_eq!(wrong.code, 1, "{command}: {text}");
        assert!(
            text.contains("/gnss/fix has messages of the wrong type sensor_msgs/NavSatFix"),
            "{command}: {text}"
        );
    }
    ok(
        at,
        &format!("train --data drive.bag {small} --out run --topic {image}"),
    );
    let config = std::fs::read_to_string(at.join("run/config.toml")).unwrap();
    assert!(
        config.contains(&format!("topics = [\"{image}\"]")),
        "{config}"
    );
    fails(
        at,
        "eval-odometry --model run --data drive.bag --topic image=/gnss/fix",
        &["/gnss/fix has messages of the wrong type"],
    );
    let resume = "train --out run --resume --steps 2";
    fails(
        at,
        &format!("{resume} --topic image=/other"),
        &["--topic", "image=/other", image],
    );
    ok(at, &format!("{resume} --topic {image}"));
    let wrong = run(at, "data inspect drive.bag --topic picture=/a");
    assert_eq!(wrong.code, 2);
    assert!(
        wrong.stderr.contains("unknown role `picture`"),
        "{}",
        wrong.stderr
    );
    // The option is refused for a recording without topics, not ignored.
    ok(at, "simulate --out street --frames 4 --size 64x48");
    fails(
        at,
        "data inspect street --topic speed=/gnss/fix",
        &["speed=/gnss/fix", "KITTI raw", "--topic"],
    );
    // Nor for images and live sources.
    let photo = at.join("photo.png");
    image::RgbImage::new(64, 48).save(&photo).unwrap();
    for input in ["predict photo.png", "perceive photo.png", "predict -"] {
        fails(
            at,
            &format!("{input} --topic image=/front --model run --out depth"),
            &["not a bag", "`--topic image=/front`", "give a bag"],
        );
    }
    fails(
        at,
        "data inspect street --write-config",
        &["KITTI raw", "dataset.toml"],
    );
}
