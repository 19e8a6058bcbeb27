//! From a simulated drive to metrics, through the program.

use std::path::Path;

use crate::support::{in_folder, json, ok, run};
use deepfusion_data::{Dataset, GtKind, OpenOptions};
use ndarray::{Array2, Array3};
use ndarray_npy::{NpzReader, NpzWriter, write_npy};

/// Reads an .npz, changes every array, writes it under another name.
fn derive(folder: &Path, from: &str, to: &str, change: impl Fn(&Array2<f32>) -> Array2<f32>) {
    let mut reader = NpzReader::new(std::fs::File::open(folder.join(from)).unwrap()).unwrap();
    let mut writer = NpzWriter::new(std::fs::File::create(folder.join(to)).unwrap());
    for name in reader.names().unwrap() {
        let array: Array2<f32> = reader.by_name(&name).unwrap();
        writer.add_array(name, &change(&array)).unwrap();
    }
    writer.finish().unwrap();
}

#[test]
fn a_simulated_drive_is_inspected_exported_and_scored() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let made = json(
        at,
        "simulate --out sim --frames 4 --seed 3 --size 160x48 --scan-every 2 --json",
    );
    let drive = made["drive"].as_str().unwrap().to_owned();
    assert_eq!(made["frames"], 4);

    let inspection = json(at, "data inspect sim --json");
    assert_eq!(
        (&inspection["frames"], &inspection["kind"]),
        (&4.into(), &"kitti_raw".into())
    );
    assert_eq!(inspection["size"], serde_json::json!([160, 48]));
    assert!(inspection["speed_mps"]["mean"].as_f64().unwrap() > 0.5);
    ok(
        at,
        &format!("data inspect {drive} --overlay --out overlays"),
    );
    let pictures = std::fs::read_dir(at.join("overlays")).unwrap().count();
    assert_eq!(pictures, 2, "frames 0 and 2 have scans");
    assert_eq!(
        ok(at, "data inspect sim").stdout.lines().next().unwrap(),
        "KITTI raw, 4 frames of 160x48"
    );

    ok(at, "data export-gt sim --out gt.npz");
    let dataset = Dataset::open(&at.join("sim"), &OpenOptions::default())
        .unwrap()
        .remove(0);
    let depth = dataset.ground_truth(2, GtKind::Z).unwrap().unwrap();
    let exported: Array2<f32> = NpzReader::new(std::fs::File::open(at.join("gt.npz")).unwrap())
        .unwrap()
        .by_name("0000000002")
        .unwrap();
    assert_eq!(exported.iter().copied().collect::<Vec<_>>(), depth.data);

    // The ground truth, filled where it has none and 10 % too far, has known metrics.
    derive(at, "gt.npz", "far.npz", |a| {
        a.mapv(|d| if d > 0.0 { 1.1 * d } else { 30.0 })
    });
    derive(at, "far.npz", "disparity.npz", |a| a.mapv(|d| 1.0 / d));
    let report = json(
        at,
        "eval --pred far.npz --pred-kind depth --gt gt.npz --cap 70 --trivial gt.npz --json",
    );
    assert_eq!(report["n"], 2);
    assert!((report["unscaled"]["abs_rel"].as_f64().unwrap() - 0.1).abs() < 2e-3);
    assert!((report["scale"]["median"].as_f64().unwrap() - 1.0 / 1.1).abs() < 1e-6);
    assert!(report["median_scaled"]["abs_rel"].as_f64().unwrap() < 1e-6);
    assert!(
        report["trivial"]["unscaled"]["abs_rel"].as_f64().unwrap() > 0.1,
        "never the image's own scan"
    );
    let other = json(
        at,
        "eval --pred disparity.npz --pred-kind disparity --gt gt.npz --cap 70 --json",
    );
    assert!(
        (other["unscaled"]["abs_rel"].as_f64().unwrap()
            - report["unscaled"]["abs_rel"].as_f64().unwrap())
        .abs()
            < 1e-6
    );

    let table = ok(
        at,
        "eval --pred far.npz --pred-kind depth --gt gt.npz --trivial gt.npz --scale fixed=0.9 --points 50",
    );
    for row in [
        "unscaled",
        "median-scaled",
        "scaled by 0.9",
        "mean-depth baseline",
        "50 points drawn",
    ] {
        assert!(table.stdout.contains(row), "{row}: {}", table.stdout);
    }

    write_npy(
        at.join("stack.npy"),
        &Array3::<f32>::from_elem((2, 10, 20), 12.0),
    )
    .unwrap();
    assert_eq!(
        json(
            at,
            "eval --pred stack.npy --pred-kind depth --gt gt.npz --json"
        )["n"],
        2
    );
}

/// Riders and pedestrians have KITTI's class names in the labels; without the option there are none.
#[test]
fn people_ride_and_walk_if_asked_for() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let labels = |options: &str| {
        let made = json(
            at,
            &format!("simulate --frames 2 --seed 3 --size 64x48 --scan-every 0 --json {options}"),
        );
        let drive = Path::new(made["drive"].as_str().unwrap()).to_owned();
        std::fs::read_to_string(at.join(drive).join("tracklet_labels.xml")).unwrap()
    };
    let is_named = |labels: &str| {
        let names = ["Pedestrian", "Cyclist"].map(|name| format!("<objectType>{name}<"));
        names.iter().any(|name| labels.contains(name))
    };
    assert!(is_named(&labels("--out with --riders 12")));
    assert!(!is_named(&labels("--out without")));
}

/// A varied drive records what was drawn, in its folder and as JSON; options cannot set what is drawn.
#[test]
fn a_varied_drive_records_what_was_drawn() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let small = "simulate --frames 1 --size 64x48 --scan-every 0 --scene country --json";
    let made = json(at, &format!("{small} --varied --seed 5 --out five"));
    let drive = at.join(made["drive"].as_str().unwrap());
    let text = std::fs::read_to_string(drive.join("varied.json")).unwrap();
    let recorded: serde_json::Value = serde_json::from_str(&text).unwrap();
    assert_eq!(recorded, made["varied"]);
    let inspected = json(at, "data inspect five --json");
    assert_eq!(inspected["size"], serde_json::json!([64, 48]));
    let other = json(at, &format!("{small} --varied --seed 6 --out six"));
    let camera = |made: &serde_json::Value| made["varied"]["camera"].clone();
    assert_ne!(camera(&made), camera(&other));
    assert_eq!(made["moving_cars"], 0);
    let plain = json(
        at,
        "simulate --frames 1 --size 64x48 --scan-every 0 --json --out plain",
    );
    assert!(plain.get("varied").is_none());

    for (options, problem, expected) in [
        (
            "--varied --camera-height 1.65",
            "--camera-height 1.65: a varied drive draws the height of its camera",
            "leave out --camera-height or --varied",
        ),
        (
            "--varied --stereo 0.5",
            "--stereo 0.5: a varied drive has one camera",
            "leave out --stereo or --varied",
        ),
        (
            "--scene motorway",
            "--scene motorway: only varied drives have this scene",
            "add --varied, or choose another --scene",
        ),
    ] {
        let run = run(at, &format!("simulate --out new {options}"));
        assert_eq!((run.code, run.stdout.as_str()), (2, ""), "{options}");
        let hint = format!("hint: {expected}");
        let says = |text: &str| run.stderr.contains(text);
        assert!(says(problem) && says(&hint), "{options}: {}", run.stderr);
        assert!(!at.join("new").exists(), "{options}");
    }
}

/// The JSON has the number of cars that drive, and a warning says if they are fewer than asked for.
#[test]
fn a_varied_street_that_blocks_cars_gives_a_warning() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    for (seed, varied) in [(1, ""), (1, "--varied"), (2, "--varied")] {
        let run = ok(
            at,
            &format!(
                "simulate --frames 1 --seed {seed} --size 32x32 --scan-every 0 --scene commercial --moving-cars 30 {varied} --json --out {seed}{varied}"
            ),
        );
        let made: serde_json::Value = serde_json::from_str(&run.stdout).unwrap();
        let driving = made["moving_cars"].as_u64().unwrap();
        assert!(driving == 30 || (driving < 30 && !varied.is_empty()));
        let is_warned_of = run.stderr.contains("--moving-cars 30: only");
        assert_eq!(is_warned_of, driving < 30, "{seed}: {}", run.stderr);
    }
}

/// Velocities are exported beside depths and never mistaken for them.
#[test]
fn a_bags_velocities_are_exported_beside_its_depths() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    ok(
        at,
        "simulate --out sim --format bag --frames 11 --size 96x72 --moving-cars 6",
    );
    ok(at, "data export-gt sim --out gt.npz");
    let dataset = Dataset::open(&at.join("sim"), &OpenOptions::default())
        .unwrap()
        .remove(0);
    let truth = dataset.scan_truth(5, GtKind::Z).unwrap().unwrap();
    let mut npz = NpzReader::new(std::fs::File::open(at.join("gt.npz")).unwrap()).unwrap();
    let depth: Array2<f32> = npz.by_name("0000000005").unwrap();
    let velocity: Array2<f32> = npz.by_name("velocity_mps/0000000005").unwrap();
    assert_eq!((depth.dim(), velocity.dim()), ((72, 96), (72, 96)));
    assert!(depth.iter().eq(&truth.depth.data));
    let expected = truth.velocity_mps.unwrap();
    let bits = |v: &f32| v.to_bits();
    assert!(velocity.iter().map(bits).eq(expected.iter().map(bits)));
    assert!(
        depth
            .iter()
            .zip(&velocity)
            .all(|(d, v)| (*d == 0.0) == v.is_nan())
    );
    let names = npz.names().unwrap();
    let depths = names.iter().filter(|n| !n.contains('/')).count();
    assert!(depths > 2 && names.len() == 2 * depths, "{names:?}");

    // Reading the file back as depths leaves the velocities out.
    let mut writer = NpzWriter::new(std::fs::File::create(at.join("pred.npz")).unwrap());
    for name in names.iter().filter(|n| !n.contains('/')) {
        let everywhere = Array2::<f32>::from_elem((72, 96), 10.0);
        writer.add_array(name.as_str(), &everywhere).unwrap();
    }
    writer.finish().unwrap();
    let report = json(
        at,
        "eval --pred pred.npz --pred-kind depth --gt gt.npz --trivial gt.npz --crop none --json",
    );
    assert_eq!(report["n"], depths);
}

#[test]
fn bad_arrays_end_in_an_error_with_the_array_and_a_hint() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let mut writer = NpzWriter::new(std::fs::File::create(at.join("gt.npz")).unwrap());
    writer
        .add_array("0000000005", &Array2::<f32>::from_elem((4, 6), 10.0))
        .unwrap();
    writer.finish().unwrap();
    derive(at, "gt.npz", "nan.npz", |a| a.mapv(|_| f32::NAN));
    derive(at, "gt.npz", "none.npz", |a| a.mapv(|_| 0.0));
    for (args, expected) in [
        (
            "eval --pred gt.npz --pred-kind depth --gt gt.npz --cap 1 --min 2",
            "--cap is 1 m, expected more than --min",
        ),
        (
            "eval --pred nan.npz --pred-kind depth --gt gt.npz",
            "`0000000005`",
        ),
        (
            "eval --pred gt.npz --pred-kind depth --gt none.npz",
            "0000000005",
        ),
    ] {
        let run = in_folder(at, &args.split_whitespace().collect::<Vec<_>>());
        assert_eq!((run.code, run.stdout.as_str()), (1, ""));
        assert!(
            run.stderr.contains(expected) && run.stderr.contains("hint: "),
            "{}",
            run.stderr
        );
    }
}
