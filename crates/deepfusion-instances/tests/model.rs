//! Whole models in an ONNX Runtime library, if this machine has one.

use std::path::PathBuf;

use deepfusion_hint::Hint;
use deepfusion_instances::{Error, InstanceModel, Kind, Limits};
use deepfusion_onnx::runtime::find;
use image::{Rgb, RgbImage};

fn fixture(name: &str) -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR")).join(format!("tests/reference/{name}.onnx"))
}

/// Without a library no model can be run; shapes and masks have tests that need none.
fn has_library() -> bool {
    let found = find(None).is_ok();
    if !found {
        eprintln!("no ONNX Runtime library on this machine: not tested");
    }
    found
}

/// Grey, with a red rectangle to the left and one to the right.
fn picture() -> RgbImage {
    RgbImage::from_fn(320, 160, |x, y| {
        let red = (40..120).contains(&x) && (40..120).contains(&y)
            || (200..280).contains(&x) && (60..100).contains(&y);
        Rgb(if red { [230, 20, 20] } else { [110, 110, 110] })
    })
}

#[test]
fn red_rectangles_are_found_with_their_pixels() {
    if !has_library() {
        return;
    }
    let load = |limits| InstanceModel::load(&fixture("red_things"), None, 1, limits);
    let mut model = load(Limits::default()).unwrap();
    assert_eq!(model.layout().kind, Kind::Columns);
    for size in [[320, 160], [160, 80]] {
        let found = model.find(&picture(), size).unwrap();
        let names: Vec<&str> = found.iter().map(|f| f.class.as_str()).collect();
        assert_eq!(names, ["left", "right"]);
        let shrunk = 320 / size[0] as u32;
        for (thing, [l, t, r, b]) in found.iter().zip([[40, 40, 120, 120], [200, 60, 280, 100]]) {
            assert!(thing.drawn);
            let [l, t, r, b] = [l, t, r, b].map(|p| p / shrunk);
            let area = ((r - l) * (b - t)) as f32;
            let inside: u32 = thing
                .mask
                .runs
                .iter()
                .filter(|[v, ..]| (t..b).contains(v))
                .map(|[_, from, to]| (*to).min(r).saturating_sub((*from).max(l)))
                .sum();
            let all = thing.mask.pixels() as f32 + area - inside as f32;
            assert!(
                inside as f32 / all > 0.8,
                "{}: {inside} of {all}",
                thing.class
            );
        }
    }
    let only = Limits {
        classes: vec!["right".into()],
        ..Limits::default()
    };
    let found = load(only).unwrap().find(&picture(), [320, 160]).unwrap();
    assert_eq!(found.len(), 1);
    assert_eq!(found[0].class, "right");
    let unknown = Limits {
        classes: vec!["cat".into()],
        ..Limits::default()
    };
    let error = load(unknown).unwrap_err();
    assert!(error.to_string().contains("no class `cat`"), "{error}");
    assert!(error.hint().unwrap().contains("left, right"));
}

#[test]
fn unusable_models_and_files_are_named() {
    let load = |path: PathBuf| InstanceModel::load(&path, None, 1, Limits::default()).unwrap_err();
    let missing = load(fixture("missing")).to_string();
    assert!(
        missing.ends_with("missing.onnx: no such file or folder"),
        "{missing}"
    );
    if !has_library() {
        return;
    }
    let depth = load(fixture("no_detector"));
    assert!(matches!(depth, Error::Shape { .. }), "{depth}");
    assert!(
        depth.to_string().contains("1x1x64x64") && depth.hint().is_some(),
        "{depth}"
    );
    let text = load(fixture("generate").with_extension("py"));
    assert!(matches!(text, Error::Runtime { .. }), "{text}");
}
