//! Array files, their errors, and a report as JSON and as text.

use std::path::Path;

use deepfusion_eval::{
    ArraySet, Error, Evaluator, Grid, Prediction, Protocol, Report, match_names,
};
use deepfusion_hint::Hint;
use ndarray::{Array2, Array3, array};
use ndarray_npy::{NpzWriter, write_npy};

fn npz(path: &Path, names: &[&str]) {
    let mut writer = NpzWriter::new(std::fs::File::create(path).unwrap());
    for name in names {
        writer
            .add_array(*name, &Array2::<f32>::ones((3, 4)))
            .unwrap();
    }
    writer.finish().unwrap();
}

fn report() -> Report {
    let truth = Grid::new(4, 1, vec![5.0, 15.0, 30.0, 0.0]).unwrap();
    let mut evaluator = Evaluator::new(Protocol::default()).unwrap();
    for (name, factor) in [("a", 1.1), ("b", 0.9)] {
        let pred = [5.0, 15.0, 30.0, 50.0].map(|d| d * factor).to_vec();
        let prediction = Prediction::Depth(Grid::new(4, 1, pred).unwrap());
        evaluator.add(name, &prediction, &truth).unwrap();
    }
    let flat = Prediction::Depth(Grid::new(1, 1, vec![15.0]).unwrap());
    let mut baseline = Evaluator::new(Protocol::default()).unwrap();
    baseline.add("a", &flat, &truth).unwrap();
    evaluator
        .report()
        .unwrap()
        .with_mean_depth_baseline(&baseline.report().unwrap())
}

#[test]
fn json_has_the_promised_fields_and_survives_a_round_trip() {
    let report = report();
    let json = serde_json::to_value(&report).unwrap();
    let keys = |v: &serde_json::Value| {
        v.as_object()
            .unwrap()
            .keys()
            .cloned()
            .collect::<Vec<_>>()
            .join(" ")
    };
    assert_eq!(
        keys(&json),
        "hole_rate median_scaled n protocol ranges scale trivial truth_sha256 unscaled"
    );
    assert_eq!(keys(&json["protocol"]), "cap_m crop gt min_m");
    assert_eq!(
        keys(&json["unscaled"]),
        "a1 a2 a3 abs_rel rmse rmse_log sq_rel"
    );
    assert_eq!(keys(&json["scale"]), "bias bias_ci95 median std_rel");
    assert_eq!(keys(&json["ranges"][0]), "abs_rel from_m n rmse to_m");
    assert_eq!(json["protocol"]["crop"], "none");
    assert_eq!(json["protocol"]["gt"], "z");
    assert!(
        json["ranges"][3]["abs_rel"].is_null(),
        "no pixel beyond 40 m: null, not NaN"
    );
    assert_eq!(serde_json::from_value::<Report>(json).unwrap(), report);
}

#[test]
fn the_table_for_people() {
    insta::assert_snapshot!(report().to_string());
}

#[test]
fn missing_and_extra_names_are_errors() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    npz(&at("gt.npz"), &["0000000000", "0000000016", "0000000032"]);
    npz(&at("few.npz"), &["0000000000"]);
    npz(
        &at("drive.npz"),
        &["d/0000000000", "d/0000000016", "d/0000000032"],
    );
    npz(
        &at("reversed.npz"),
        &["0000000032", "0000000016", "0000000000"],
    );
    let open = |name: &str| ArraySet::open(&at(name)).unwrap();
    let error = match_names(&open("few.npz"), &open("gt.npz")).unwrap_err();
    let text = error.to_string();
    assert!(
        text.contains("few.npz: no array for 2 of the 3")
            && text.contains("0000000016, 0000000032"),
        "{text}"
    );
    let error = match_names(&open("drive.npz"), &open("gt.npz")).unwrap_err();
    assert!(
        error.hint().unwrap().contains("`d/0000000000`"),
        "{error:?}"
    );
    assert!(
        match_names(&open("gt.npz"), &open("few.npz")).is_err(),
        "extra predictions are reported too"
    );
    let pairs = match_names(&open("reversed.npz"), &open("gt.npz")).unwrap();
    assert_eq!(pairs[0], ("0000000000".to_owned(), 2, 0));

    write_npy(at("two.npy"), &Array3::<f64>::ones((2, 3, 4))).unwrap();
    assert!(matches!(
        match_names(&open("two.npy"), &open("gt.npz")),
        Err(Error::Count {
            count: 2,
            expected: 3,
            ..
        })
    ));
    write_npy(at("three.npy"), &Array3::<f64>::ones((3, 3, 4))).unwrap();
    assert_eq!(
        match_names(&open("three.npy"), &open("gt.npz")).unwrap()[1],
        ("0000000016".to_owned(), 1, 1)
    );
}

#[test]
fn errors_of_broken_files_name_the_problem() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    let message = |error: Error| {
        assert!(error.hint().is_some(), "{error}");
        error.to_string()
    };
    assert!(message(ArraySet::open(&at("absent.npz")).unwrap_err()).contains("absent.npz"));
    std::fs::write(at("text.npz"), "not an archive").unwrap();
    assert!(message(ArraySet::open(&at("text.npz")).unwrap_err()).contains("neither"));
    write_npy(at("numbers.npy"), &array![[1i32, 2], [3, 4]]).unwrap();
    assert!(
        message(ArraySet::open(&at("numbers.npy")).unwrap_err())
            .contains("expected float32 or float64")
    );
    write_npy(at("row.npy"), &array![1.0f32, 2.0]).unwrap();
    assert!(
        message(ArraySet::open(&at("row.npy")).unwrap_err()).contains("shape [2], expected N×H×W")
    );

    npz(&at("whole.npz"), &["a"]);
    let bytes = std::fs::read(at("whole.npz")).unwrap();
    for cut in [8, bytes.len() / 2, bytes.len() - 3] {
        std::fs::write(at("cut.npz"), &bytes[..cut]).unwrap();
        assert!(ArraySet::open(&at("cut.npz")).is_err(), "cut at {cut}");
    }
    write_npy(at("whole.npy"), &Array3::<f32>::ones((2, 3, 4))).unwrap();
    let bytes = std::fs::read(at("whole.npy")).unwrap();
    for cut in [3, 40, bytes.len() - 3] {
        std::fs::write(at("cut.npy"), &bytes[..cut]).unwrap();
        assert!(ArraySet::open(&at("cut.npy")).is_err(), "cut at {cut}");
    }
}

/// A reader that allocates what the header claims, 8 TiB here, would be killed by the system.
#[test]
fn an_array_that_claims_too_much_is_an_error() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    let text = "{'descr': '<f8', 'fortran_order': False, 'shape': (1048576, 1048576), }\n";
    let mut bytes = b"\x93NUMPY\x01\x00".to_vec();
    bytes.extend((text.len() as u16).to_le_bytes());
    bytes.extend(text.bytes());
    std::fs::write(at("claims.npy"), &bytes).unwrap();
    let message = ArraySet::open(&at("claims.npy")).unwrap_err().to_string();
    assert!(
        message.contains("fewer numbers than its header says"),
        "{message}"
    );
    let mut archive = zip::ZipWriter::new(std::fs::File::create(at("claims.npz")).unwrap());
    archive
        .start_file("a.npy", zip::write::SimpleFileOptions::default())
        .unwrap();
    std::io::Write::write_all(&mut archive, &bytes).unwrap();
    archive.finish().unwrap();
    let message = ArraySet::open(&at("claims.npz"))
        .unwrap()
        .read(0)
        .unwrap_err()
        .to_string();
    assert!(message.contains("`a` has fewer numbers"), "{message}");
}

#[test]
fn a_file_without_arrays_is_an_error_with_a_hint() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("none.npz");
    npz(&path, &[]);
    let error = ArraySet::open(&path).unwrap_err();
    assert!(error.to_string().ends_with("has no arrays"), "{error}");
    assert!(error.hint().unwrap().contains("numpy.savez"), "{error}");
}

#[test]
fn axes_of_length_one_are_dropped() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("batch.npz");
    let mut writer = NpzWriter::new(std::fs::File::create(&path).unwrap());
    writer
        .add_array("a", &ndarray::Array4::<f32>::ones((1, 1, 3, 4)))
        .unwrap();
    writer
        .add_array("b", &Array3::<f32>::ones((2, 3, 4)))
        .unwrap();
    writer.finish().unwrap();
    let mut set = ArraySet::open(&path).unwrap();
    let grid = set.read(0).unwrap();
    assert_eq!((grid.width(), grid.height()), (4, 3));
    assert!(
        set.read(1)
            .unwrap_err()
            .to_string()
            .contains("`b` has shape [2, 3, 4]")
    );
    assert!(set.read(2).is_err());
}

#[test]
fn the_table_with_drawn_points() {
    let truth = Grid::new(4, 1, vec![5.0, 15.0, 30.0, 0.0]).unwrap();
    let mut evaluator = Evaluator::new(Protocol {
        points: 100,
        ..Protocol::default()
    })
    .unwrap();
    let pred = Prediction::Depth(Grid::new(4, 1, vec![6.0, 12.0, 30.0, 50.0]).unwrap());
    evaluator.add("a", &pred, &truth).unwrap();
    let text = evaluator.report().unwrap().to_string();
    let table = text.find("3 points drawn").unwrap();
    insta::assert_snapshot!(&text[table..]);
}

#[test]
fn images_without_ground_truth_are_distinguished_from_masked_ones() {
    let evaluator = Evaluator::new(Protocol::default()).unwrap();
    let error = evaluator.report().unwrap_err().to_string();
    assert_eq!(error, "nothing to compare with: no image has ground truth");
}
