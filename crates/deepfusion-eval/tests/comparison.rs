//! Run folders and files of evaluations, as tables in every format.

use std::collections::HashSet;
use std::path::{Path, PathBuf};

use deepfusion_eval::compare::{
    Error, Evaluation, FrameScore, MeasuredOn, MetricScale, ModelFile, SAVED_VERSION,
    SavedEvaluation, Verdict, published_tables, run_tables, sha256_of_file,
};
use deepfusion_eval::{
    Crop, Evaluator, Grid, GroundTruth, PostProcess, Prediction, Protocol, Report,
};
use deepfusion_hint::Hint;

/// An evaluation of two images with four pixels each; `factor` is how wrong the predictions are, `shift` changes the ground truth.
fn report(factor: f64, shift: f64, protocol: Protocol) -> (Report, Vec<FrameScore>) {
    let mut evaluator = Evaluator::new(protocol).unwrap();
    for (name, more) in [("a", 1.0), ("b", 1.1)] {
        let truth = [5.0, 15.0, 30.0, 60.0].map(|d| d + shift);
        let pred = truth.iter().map(|d| d * factor * more).collect();
        let prediction = Prediction::Depth(Grid::new(2, 2, pred).unwrap());
        let truth = Grid::new(2, 2, truth.to_vec()).unwrap();
        evaluator.add(name, &prediction, &truth).unwrap();
    }
    let mut report = evaluator.report().unwrap();
    let flat = Prediction::Depth(Grid::new(1, 1, vec![20.0]).unwrap());
    let mut baseline = Evaluator::new(Protocol::default()).unwrap();
    let truth = Grid::new(2, 2, vec![5.0, 15.0, 30.0, 60.0]).unwrap();
    baseline.add("a", &flat, &truth).unwrap();
    report = report.with_mean_depth_baseline(&baseline.report().unwrap());
    (
        report,
        evaluator.images().iter().map(FrameScore::from).collect(),
    )
}

/// A run's folder with an evaluation.
fn run(at: &Path, name: &str, data: &str, (report, images): (Report, Vec<FrameScore>)) -> PathBuf {
    let folder = at.join(name);
    std::fs::create_dir_all(&folder).unwrap();
    let checkpoint = folder.join("best.safetensors");
    std::fs::write(&checkpoint, name).unwrap();
    let saved = SavedEvaluation {
        format_version: SAVED_VERSION,
        measured: MeasuredOn {
            data: vec![PathBuf::from(data)],
            camera: "2".into(),
            engine: "fused f32".into(),
            focal_correction: true,
            ..MeasuredOn::default()
        },
        model: ModelFile {
            checkpoint: "best.safetensors".into(),
            sha256: sha256_of_file(&checkpoint).unwrap(),
        },
        report,
        images,
    };
    saved.write(&folder).unwrap();
    folder
}

fn points() -> Protocol {
    Protocol {
        points: 100,
        ..Protocol::default()
    }
}

fn collect(paths: &[PathBuf]) -> Vec<Evaluation> {
    Evaluation::collect(paths).unwrap()
}

#[test]
fn two_runs_with_the_same_ground_truth_in_every_format() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let runs = [
        run(at, "base", "street", report(1.1, 0.0, points())),
        run(at, "better_one", "street", report(0.98, 0.0, points())),
    ];
    let tables = run_tables(&collect(&runs));
    insta::assert_snapshot!("text", tables.to_text());
    insta::assert_snapshot!("csv", tables.to_csv().unwrap());
    insta::assert_snapshot!("latex", tables.to_latex());
}

#[test]
fn published_rows_in_every_format() {
    let tables = published_tables().unwrap();
    insta::assert_snapshot!("published_text", tables.to_text());
    let latex = tables.to_latex();
    assert_eq!(latex.matches("\\begin{table}").count(), tables.tables.len());
    assert_eq!(
        latex.matches("\\toprule").count(),
        latex.matches("\\bottomrule").count()
    );
    let csv = tables.to_csv().unwrap();
    let rows: usize = tables.tables.iter().map(|t| t.rows.len()).sum();
    let mut reader = csv::Reader::from_reader(csv.as_bytes());
    let header = reader.headers().unwrap().clone();
    let of = |name: &str| header.iter().position(|h| h == name).unwrap();
    let records: Vec<_> = reader.records().map(Result::unwrap).collect();
    assert_eq!(records.len(), rows);
    let impossible = records
        .iter()
        .filter(|r| r[of("flags")].starts_with("impossible: δ₁ = 0.977"));
    assert_eq!(impossible.count(), 1);
}

/// The field crops raw ground truth, but not improved ground truth.
#[test]
fn each_kind_of_truth_has_its_own_published_protocol() {
    let folder = tempfile::tempdir().unwrap();
    let notes_of = |name: &str, protocol: Protocol| {
        let run = run(folder.path(), name, "kitti", report(1.1, 0.0, protocol));
        run_tables(&collect(&[run])).tables[0].notes.join("\n")
    };
    let of = |gt, crop| Protocol {
        gt,
        crop,
        ..Protocol::default()
    };
    let benchmark = "improved ground truth: 2 images instead of 652";
    let whole = notes_of("whole", of(GroundTruth::Annotated, Crop::None));
    assert!(whole.contains(&format!("{benchmark}.")), "{whole}");
    let cropped = notes_of("cropped", of(GroundTruth::Annotated, Crop::Garg));
    assert!(
        cropped.contains(&format!("{benchmark}, Garg's crop instead")),
        "{cropped}"
    );
    let recorded = notes_of("recorded", of(GroundTruth::Velodyne, Crop::Garg));
    assert!(
        recorded.contains("Eigen tables: 2 images instead of 697."),
        "{recorded}"
    );
}

/// Rows of other protocols or other ground truth never share a table.
#[test]
fn evaluations_with_different_ground_truth_are_kept_apart() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let cap = Protocol {
        cap_m: 50.0,
        ..Protocol::default()
    };
    let garg = Protocol {
        crop: Crop::Garg,
        ..Protocol::default()
    };
    let default = Protocol::default;
    let runs = [
        run(at, "a", "street", report(1.1, 0.0, default())),
        run(at, "b", "street", report(1.2, 0.0, default())),
        run(at, "other_truth", "street", report(1.1, 0.5, default())),
        run(at, "other_cap", "street", report(1.1, 0.0, cap)),
        run(at, "other_crop", "street", report(1.1, 0.0, garg)),
    ];
    let tables = run_tables(&collect(&runs));
    assert!(
        tables.notes[0].contains("4 groups that differ"),
        "{:?}",
        tables.notes
    );
    let names = |prefix: &str| -> Vec<Vec<String>> {
        let of = tables.tables.iter().filter(|t| t.title.contains(prefix));
        of.map(|t| {
            let ranked = t.rows.iter().filter(|r| r.ranked);
            ranked.map(|r| r.cells[0].print(0)).collect()
        })
        .collect()
    };
    for kind in ["Unscaled", "Median-scaled", "Abs Rel by range"] {
        assert_eq!(
            names(kind),
            [
                vec!["a", "b"],
                vec!["other_truth"],
                vec!["other_cap"],
                vec!["other_crop"]
            ],
            "{kind}"
        );
    }
}

#[test]
fn plain_reports_are_read_and_marked_as_plain() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let (mut report, images) = report(1.1, 0.0, Protocol::default());
    let run = run(at, "run", "street", (report.clone(), images));
    let plain = at.join("printed.json");
    std::fs::write(&plain, serde_json::to_string(&report).unwrap()).unwrap();
    report.truth_sha256 = None;
    let old = at.join("old.json");
    std::fs::write(&old, serde_json::to_string(&report).unwrap()).unwrap();
    let evaluations = collect(&[run.clone(), plain, old]);
    let names: Vec<_> = evaluations.iter().map(|e| e.name.as_str()).collect();
    assert_eq!(names, ["run", "printed", "old"]);
    let text = run_tables(&evaluations).to_text();
    // The same ground truth, so one table; the file that does not record it has its own.
    assert!(text.contains("2 groups that differ"), "{text}");
    assert!(text.contains("do not record their ground truth"), "{text}");
    // Two names for the same result.
    assert!(
        text.contains("every figure equals those of `printed`"),
        "{text}"
    );

    // Two evaluations of one run, or the same name twice, get different names.
    let again = collect(&[run.clone(), run]);
    assert_ne!(again[0].name, "");
    assert_eq!(again.len(), 2);
}

#[test]
fn an_evaluation_of_other_weights_is_reported() {
    let folder = tempfile::tempdir().unwrap();
    let run = run(
        folder.path(),
        "run",
        "street",
        report(1.1, 0.0, Protocol::default()),
    );
    let text = |run: &PathBuf| run_tables(&collect(std::slice::from_ref(run))).to_text();
    assert!(!text(&run).contains("has changed since"));
    std::fs::write(run.join("best.safetensors"), "trained on").unwrap();
    assert!(text(&run).contains("best.safetensors has changed since"));
    // A run without its weights still has its figures.
    std::fs::remove_file(run.join("best.safetensors")).unwrap();
    assert!(!text(&run).contains("has changed since"));
}

#[test]
fn the_same_evaluation_is_replaced_and_another_is_added() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let files = || std::fs::read_dir(at.join("run/eval")).unwrap().count();
    run(at, "run", "street", report(1.1, 0.0, Protocol::default()));
    run(at, "run", "street", report(1.2, 0.0, Protocol::default()));
    assert_eq!(files(), 1);
    let cap = Protocol {
        cap_m: 50.0,
        ..Protocol::default()
    };
    run(at, "run", "street", report(1.2, 0.0, cap));
    run(at, "run", "other", report(1.2, 0.0, Protocol::default()));
    assert_eq!(files(), 3);
}

#[test]
fn files_that_are_not_evaluations_are_errors() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let fails = |path: PathBuf| Evaluation::collect(&[path]).unwrap_err();
    let write = |name: &str, text: &str| {
        let path = at.join(name);
        std::fs::write(&path, text).unwrap();
        path
    };
    for (name, text, expected) in [
        ("broken.json", "{\"n\": 3", "EOF"),
        ("list.json", "[1, 2]", "invalid"),
        ("other.json", "{\"n\": 3}", "missing field"),
        ("negative.json", "{\"n\": -3}", "invalid value"),
        (
            "word.json",
            "{\"format_version\": \"new\"}",
            "format_version",
        ),
        ("half.json", "{\"format_version\": 1}", "missing field"),
    ] {
        let error = fails(write(name, text));
        assert!(matches!(error, Error::NotAnEvaluation { .. }), "{error}");
        let message = error.to_string();
        assert!(
            message.contains(name) && message.contains(expected),
            "{message}"
        );
        assert!(error.hint().is_some());
    }
    let error = fails(write("new.json", "{\"format_version\": 99}"));
    assert!(error.to_string().contains("99"), "{error}");
    let error = fails(at.join("none.json"));
    assert!(error.to_string().contains("none.json"), "{error}");
    std::fs::create_dir(at.join("run")).unwrap();
    let error = fails(at.join("run"));
    assert!(
        error.hint().unwrap().contains("evaluate it first"),
        "{error}"
    );
}

/// Everything that affects the result is in the file's name. Options that were not given are neither there nor in the file.
#[test]
fn evaluations_with_other_options_replace_no_other() {
    type Change = fn(&mut MeasuredOn);
    let folder = tempfile::tempdir().unwrap();
    let kept = |change: Change| {
        let mut measured = MeasuredOn {
            data: vec![PathBuf::from("street")],
            ..MeasuredOn::default()
        };
        change(&mut measured);
        let saved = SavedEvaluation {
            format_version: SAVED_VERSION,
            measured,
            model: ModelFile::default(),
            report: report(1.0, 0.0, points()).0,
            images: Vec::new(),
        };
        saved.write(folder.path()).unwrap()
    };
    let changes: [Change; 9] = [
        |_| {},
        |m| m.intrinsics = Some([500.0, 500.0, 320.0, 240.0]),
        |m| m.hfov_deg = Some(60.0),
        |m| m.hfov_deg = Some(90.0),
        |m| m.camera_ahead_s = Some(-0.06),
        |m| m.topics = vec!["image=/front".into()],
        |m| m.topics = vec!["image=/rear".into()],
        |m| m.allow_holes = true,
        |m| m.trivial = Some("scans.npz".into()),
    ];
    let files: HashSet<PathBuf> = changes.iter().map(|change| kept(*change)).collect();
    assert_eq!(files.len(), changes.len(), "{files:?}");
    let plain = std::fs::read_to_string(kept(changes[0])).unwrap();
    for key in ["intrinsics", "hfov", "ahead", "topics", "allow_holes"] {
        assert!(!plain.contains(key), "{key}: {plain}");
    }
    // Files of older versions, which did not record these options, keep their names.
    let read: SavedEvaluation = serde_json::from_str(&plain).unwrap();
    assert_eq!(
        folder.path().join("eval").join(read.file_name()),
        kept(changes[0])
    );
}

/// Only evaluations of exactly this checkpoint, on frames known to be unseen, decide how far its metres are trusted.
#[test]
fn metres_are_trusted_only_where_they_were_measured() {
    type Change = fn(&mut SavedEvaluation);
    let folder = tempfile::tempdir().unwrap();
    let verdict = |name: &str, changes: &[Change]| {
        let at = folder.path().join(name);
        for (i, change) in changes.iter().enumerate() {
            let mut saved = SavedEvaluation {
                format_version: SAVED_VERSION,
                measured: MeasuredOn {
                    data: vec![PathBuf::from(format!("street-{i}"))],
                    focal_correction: true,
                    held_out: Some(true),
                    ..MeasuredOn::default()
                },
                model: ModelFile {
                    checkpoint: "best.safetensors".into(),
                    sha256: "abc".into(),
                },
                report: report(1.0, 0.0, points()).0,
                images: Vec::new(),
            };
            (saved.report.n, saved.report.scale.bias) = (20, 0.01);
            saved.report.scale.bias_ci95 = Some([-0.03, 0.05]);
            change(&mut saved);
            saved.write(&at).unwrap();
        }
        MetricScale::measured(&at, "abc", None, true, None, 2000)
    };
    let good: Change = |_| {};
    let found = verdict("good", &[good]);
    assert_eq!(found.verdict, Verdict::Trusted);
    assert_eq!((found.bias, found.ci95), (Some(0.01), Some([-0.03, 0.05])));
    let nothing: [Change; 9] = [
        |s| s.report.protocol.gt = GroundTruth::Velodyne,
        |s| s.measured.held_out = None,
        |s| s.measured.held_out = Some(false),
        |s| s.model.sha256 = "another".into(),
        |s| s.measured.set = Some("garage".into()),
        |s| s.measured.focal_correction = false,
        |s| s.measured.post_process = Some(PostProcess::Flip),
        |s| s.report.n = 3,
        |s| s.report.scale.bias_ci95 = None,
    ];
    for (i, change) in nothing.into_iter().enumerate() {
        let found = verdict(&format!("nothing-{i}"), &[change]);
        assert_eq!(found, MetricScale::default(), "{i}");
    }
    assert_eq!(verdict("none", &[]), MetricScale::default());
    // Right in one street and wrong in another: the mean applies to neither.
    let far: Change = |s| {
        (s.report.n, s.report.scale.bias) = (60, 0.31);
        s.report.scale.bias_ci95 = Some([0.25, 0.4]);
    };
    assert_eq!(verdict("far", &[far]).verdict, Verdict::Wrong);
    let both = verdict("both", &[good, far]);
    assert_eq!(both.verdict, Verdict::Open);
    assert_eq!(both.ci95, Some([-0.03, 0.4]));
    assert!((both.bias.unwrap() - (20.0 * 0.01 + 60.0 * 0.31) / 80.0).abs() < 1e-12);
    // A damaged file is ignored.
    let at = folder.path().join("good/eval");
    for entry in std::fs::read_dir(&at).unwrap() {
        std::fs::write(entry.unwrap().path(), [0_u8; 99]).unwrap();
    }
    let found = MetricScale::measured(&folder.path().join("good"), "abc", None, true, None, 2000);
    assert_eq!(found, MetricScale::default());
}
