//! Bags through the program alone: written, looked into, converted, trained on, measured.

mod support;

use serde_json::Value;
use support::{json, ok, run};

#[test]
fn bags_are_trained_on_and_measured_by_scenario() {
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
        "train --data urban garage --preset tiny --size 64x64 --batch 2 --steps 3 --out run",
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
    ok(at, "data convert kitti again.bag");
    let again = json(at, "data inspect again.bag --json");
    assert_eq!(again["frames"], 6);
    let refused = run(at, "data convert kitti again.bag");
    assert_eq!(refused.code, 1);
    assert!(
        refused.stderr.contains("again.bag: is there already"),
        "{}",
        refused.stderr
    );
    assert!(refused.stderr.contains("hint:"), "{}", refused.stderr);
}

#[test]
fn what_is_wrong_with_a_bag_is_said() {
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
            "train --data sim --preset tiny --size 64x64 --steps 1 --out no",
        );
        assert_eq!(run.code, 1, "{}", run.stderr);
        assert!(run.stderr.contains("hint:"), "{}", run.stderr);
        run.stderr
    };
    let error = failing("[topics]\nspeed = \"/wheels\"\n");
    assert!(error.contains("has no topic /wheels"), "{error}");
    assert!(error.contains("/vehicle/speed"), "what there is: {error}");
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
    // Cut in the middle: what is whole is read, and the inspection says what is not.
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
        "train --data sim --preset tiny --size 64x64 --steps 1 --out no",
    );
    assert_eq!(empty.code, 1);
    assert!(
        empty.stderr.contains("none of its topics holds images"),
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
