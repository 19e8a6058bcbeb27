//! Compared with OpenCV's corners and calibrations of the same pictures, and with the truth (`reference/boards.py`).

use deepfusion_calibrate::{
    Board, BoardDetection, Calibration, CalibrationWarning, Error, LensModel, View, calibrate,
    find_board,
};
use image::GrayImage;
use nalgebra::Vector2;
use serde_json::Value;
use std::path::PathBuf;

fn folder() -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("tests/reference")
}

fn reference() -> Value {
    serde_json::from_slice(&std::fs::read(folder().join("boards.json")).unwrap()).unwrap()
}

fn numbers(value: &Value) -> Vec<f64> {
    let list = value.as_array().unwrap();
    list.iter().map(|n| n.as_f64().unwrap()).collect()
}

fn points(value: &Value) -> Vec<Vector2<f64>> {
    let list = value.as_array().unwrap().iter().map(numbers);
    list.map(|p| Vector2::new(p[0], p[1])).collect()
}

fn picture(file: &str) -> GrayImage {
    image::open(folder().join(file)).unwrap().into_luma8()
}

fn board() -> Board {
    Board::new(9, 6, 0.025).unwrap()
}

/// Greatest and root mean square distance of corners in the same or the opposite order, in pixels.
fn corner_distances(found: &[Vector2<f64>], expected: &[Vector2<f64>]) -> (f64, f64) {
    assert_eq!(found.len(), expected.len());
    let of = |found: Vec<&Vector2<f64>>| {
        let d: Vec<f64> = found
            .iter()
            .zip(expected)
            .map(|(p, q)| (*p - q).norm())
            .collect();
        let mean = d.iter().map(|d| d * d).sum::<f64>() / d.len() as f64;
        (d.iter().copied().fold(0.0, f64::max), mean.sqrt())
    };
    let (same, turned) = (of(found.iter().collect()), of(found.iter().rev().collect()));
    if same.0 < turned.0 { same } else { turned }
}

fn views(camera: &Value) -> Vec<View> {
    let of = |view: &Value| {
        let name = view["file"].as_str().unwrap();
        match find_board(&picture(name), &board()) {
            BoardDetection::Board(corners) => View {
                name: name.to_owned(),
                corners,
            },
            other => panic!("{name}: {other:?}"),
        }
    };
    camera["views"].as_array().unwrap().iter().map(of).collect()
}

/// Every board is found, also at the border of a fisheye image. OpenCV's own corners are up to 0.18 px from the truth here (noise, blur and
/// JPEG); ours must be as near to both.
#[test]
fn corners_match_opencv() {
    for (name, camera) in reference()["cameras"].as_object().unwrap() {
        let (mut worst, mut worst_truth) = (0.0f64, 0.0f64);
        for (view, found) in camera["views"]
            .as_array()
            .unwrap()
            .iter()
            .zip(views(camera))
        {
            let (most, mean) = corner_distances(&found.corners, &points(&view["corners"]));
            let (most_truth, mean_truth) =
                corner_distances(&found.corners, &points(&view["truth"]));
            let (_, opencvs) = corner_distances(&points(&view["corners"]), &points(&view["truth"]));
            assert!(most < 0.2 && mean < 0.08, "{}: {most} {mean}", found.name);
            assert!(most_truth < 0.2, "{}: {most_truth}", found.name);
            assert!(
                mean_truth < 1.15 * opencvs,
                "{}: {mean_truth} {opencvs}",
                found.name
            );
            (worst, worst_truth) = (worst.max(most), worst_truth.max(most_truth));
        }
        println!("{name}: {worst:.3} px from OpenCV's, {worst_truth:.3} px from the truth");
    }
}

fn size(camera: &Value) -> (u32, u32) {
    let size = numbers(&camera["size"]);
    (size[0] as u32, size[1] as u32)
}

fn model(camera: &Value) -> LensModel {
    match camera["model"].as_str().unwrap() {
        "fisheye" => LensModel::Fisheye,
        _ => LensModel::BrownConrady,
    }
}

fn k(found: &Calibration) -> [f64; 4] {
    let k = &found.intrinsics;
    [k.fx, k.fy, k.cx, k.cy]
}

/// For OpenCV's corners the least-squares fit is OpenCV's: same cost, same minimum. The corners are stored to 0.001 px, and OpenCV computed
/// in single precision; 1e-4 of the focal length is 0.03 px.
#[test]
fn the_fit_matches_opencv() {
    for (name, camera) in reference()["cameras"].as_object().unwrap() {
        let of = |view: &Value| View {
            name: view["file"].as_str().unwrap().to_owned(),
            corners: points(&view["corners"]),
        };
        let views: Vec<View> = camera["views"].as_array().unwrap().iter().map(of).collect();
        let found = calibrate(&views, &board(), size(camera), model(camera)).unwrap();
        let theirs = &camera["opencv"];
        let rms = theirs["rms"].as_f64().unwrap();
        assert!(
            (found.rms_px - rms).abs() < 1e-3,
            "{name}: {} {rms}",
            found.rms_px
        );
        for (ours, theirs) in k(&found).iter().zip(numbers(&theirs["k"])) {
            assert!((ours - theirs).abs() < 0.03, "{name}: {ours} {theirs}");
        }
        let mut ours = vec![
            found.standard_errors.fx,
            found.standard_errors.fy,
            found.standard_errors.cx,
            found.standard_errors.cy,
        ];
        ours.extend(&found.standard_errors.coefficients);
        for (i, c) in numbers(&theirs["distortion"]).iter().enumerate() {
            // A twentieth of its standard error.
            let close = 0.05 * ours[4 + i];
            assert!(
                (found.coefficients[i] - c).abs() < close,
                "{name}: {:?} {c}",
                found.coefficients
            );
        }
        if let Some(errors) = theirs["standard_errors"].as_array() {
            for (ours, theirs) in ours.iter().zip(errors) {
                let theirs = theirs.as_f64().unwrap();
                assert!(
                    (ours / theirs - 1.0).abs() < 0.02,
                    "{name}: {ours} {theirs}"
                );
            }
        }
    }
}

/// From the pictures alone: near to OpenCV, and as near to the truth as the standard errors say (within four of them).
#[test]
fn the_camera_matches_the_truth() {
    for (name, camera) in reference()["cameras"].as_object().unwrap() {
        let found = calibrate(&views(camera), &board(), size(camera), model(camera)).unwrap();
        println!(
            "{name}: {:?} {:?} rms {:.4}",
            found.intrinsics, found.standard_errors, found.rms_px
        );
        let (truth, theirs) = (numbers(&camera["k"]), numbers(&camera["opencv"]["k"]));
        let errors = &found.standard_errors;
        let errors = [errors.fx, errors.fy, errors.cx, errors.cy];
        for i in 0..4 {
            let ours = k(&found)[i];
            assert!(
                (ours - theirs[i]).abs() < 0.002 * theirs[0],
                "{name}: {ours} {}",
                theirs[i]
            );
            assert!(
                (ours - truth[i]).abs() < 4.0 * errors[i],
                "{name}: {ours} {}",
                truth[i]
            );
            assert!(
                (ours - truth[i]).abs() < 0.004 * truth[0],
                "{name}: {ours} {}",
                truth[i]
            );
        }
        for (i, truth) in numbers(&camera["distortion"]).iter().enumerate() {
            let (ours, error) = (found.coefficients[i], found.standard_errors.coefficients[i]);
            assert!(
                (ours - truth).abs() < 4.0 * error,
                "{name}: {ours} {truth} {error}"
            );
        }
        assert_eq!(found.used(), found.views.len(), "{name}");
        assert!(found.rms_px < 0.1, "{name}: {}", found.rms_px);
        let distances = found.views.iter().map(|v| v.distance_m.unwrap());
        assert!(
            distances.clone().all(|d| (0.05..0.6).contains(&d)),
            "{name}: {distances:?}"
        );
    }
}

/// A view whose corners do not fit the board is left out and does not change the result.
#[test]
fn a_bad_view_is_left_out() {
    let reference = reference();
    let camera = &reference["cameras"]["brown"];
    let mut views = views(camera);
    let good = calibrate(&views, &board(), size(camera), LensModel::BrownConrady).unwrap();
    let mut bad = views[3].clone();
    bad.name = "bad.jpg".into();
    for (i, corner) in bad.corners.iter_mut().enumerate() {
        corner.x += 8.0 * ((i * 7 % 11) as f64 / 11.0 - 0.5);
        corner.y += 8.0 * ((i * 5 % 13) as f64 / 13.0 - 0.5);
    }
    views.insert(2, bad);
    let found = calibrate(&views, &board(), size(camera), LensModel::BrownConrady).unwrap();
    let left_out: Vec<_> = found.views.iter().filter(|v| !v.used).collect();
    assert_eq!(left_out.len(), 1);
    assert_eq!(left_out[0].name, "bad.jpg");
    assert!(left_out[0].rms_px.unwrap() > 1.0, "{left_out:?}");
    assert!((found.intrinsics.fx - good.intrinsics.fx).abs() < 1e-6);
}

/// If all boards are parallel to the image, the focal length is undetermined, and an error or a warning says so.
#[test]
fn boards_parallel_to_the_image_do_not_determine_the_focal_length() {
    let board = board();
    let seen = |x: f64, y: f64, z: f64, turn: f64| {
        let turned = nalgebra::Rotation3::from_euler_angles(0.0, 0.0, turn);
        let points = board.points();
        let corners = points.iter().enumerate().map(|(i, p)| {
            let p = turned * p + nalgebra::Vector3::new(x, y, z);
            // Noise of a twentieth of a pixel.
            let grain = 0.05 * ((i as f64 * 12.9898 + x * 78.233).sin() * 43758.5).fract();
            Vector2::new(
                500.0 * p.x / p.z + 320.0 + grain,
                500.0 * p.y / p.z + 240.0 - grain,
            )
        });
        corners.collect::<Vec<_>>()
    };
    let views: Vec<View> = (0..8)
        .map(|i| {
            let i = f64::from(i);
            View {
                name: format!("{i}.png"),
                corners: seen(-0.15 + 0.02 * i, -0.1 + 0.01 * i, 0.4 + 0.05 * i, 0.1 * i),
            }
        })
        .collect();
    match calibrate(&views, &board, (640, 480), LensModel::BrownConrady) {
        Err(Error::Undetermined { .. }) => (),
        Err(other) => panic!("{other}"),
        Ok(found) => {
            let is_it = |w: &CalibrationWarning| matches!(w, CalibrationWarning::NotTilted { .. });
            assert!(found.warnings().iter().any(is_it), "{found:?}");
        }
    }
}

#[test]
fn another_board_is_an_error() {
    let image = picture("brown/00.jpg");
    // A part of the board is not accepted as the board.
    for (columns, rows) in [(8, 6), (9, 7), (7, 5)] {
        let asked = Board::new(columns, rows, 0.025).unwrap();
        let detection = find_board(&image, &asked);
        let expected = BoardDetection::Other {
            columns: 9,
            rows: 6,
            corners: 54,
        };
        assert_eq!(detection, expected, "{columns}x{rows}");
    }
    // Rows and columns may be swapped.
    let BoardDetection::Board(turned) = find_board(&image, &Board::new(6, 9, 0.025).unwrap())
    else {
        panic!("not found");
    };
    let along = turned[5] - turned[0];
    let down = turned[48] - turned[0];
    assert!(along.perp(&down) > 0.0 && down.norm() > along.norm());
    assert_eq!(
        find_board(&GrayImage::new(300, 200), &board()),
        BoardDetection::Nothing
    );
    assert_eq!(
        find_board(&GrayImage::new(3, 2), &board()),
        BoardDetection::Nothing
    );
}

/// Large pictures are searched at reduced size and refined at full size. A board may also lie on its side.
#[test]
fn boards_are_found_in_large_and_turned_pictures() {
    use image::imageops::{FilterType, resize, rotate90};
    let image = picture("brown/01.jpg");
    let BoardDetection::Board(small) = find_board(&image, &board()) else {
        panic!("not found");
    };
    let large = resize(&image, 2000, 1500, FilterType::CatmullRom);
    let BoardDetection::Board(found) = find_board(&large, &board()) else {
        panic!("not found");
    };
    let back: Vec<_> = found
        .iter()
        .map(|p| p.map(|n| (n + 0.5) / 5.0 - 0.5))
        .collect();
    let (most, _) = corner_distances(&back, &small);
    assert!(most < 0.2, "{most}");
    let BoardDetection::Board(turned) = find_board(&rotate90(&image), &board()) else {
        panic!("not found");
    };
    let last = f64::from(image.height() - 1);
    let back: Vec<_> = turned
        .iter()
        .map(|p| Vector2::new(p.y, last - p.x))
        .collect();
    let (most, _) = corner_distances(&back, &small);
    assert!(most < 0.02, "{most}");
}

#[test]
fn invalid_input_is_rejected() {
    for (columns, rows, square) in [
        (2, 6, 0.025),
        (9, 101, 0.025),
        (9, 6, 0.0),
        (9, 6, f64::NAN),
    ] {
        assert!(matches!(
            Board::new(columns, rows, square),
            Err(Error::Board { .. })
        ));
    }
    let view = View {
        name: "a.png".into(),
        corners: vec![Vector2::zeros(); 54],
    };
    let four = vec![view.clone(); 4];
    let error = calibrate(&four, &board(), (640, 480), LensModel::default()).unwrap_err();
    assert!(matches!(
        error,
        Error::TooFewViews {
            found: 4,
            needed: 5,
            ..
        }
    ));
    // Corners in a single point do not form a board.
    let five = vec![view; 5];
    let error = calibrate(&five, &board(), (640, 480), LensModel::default()).unwrap_err();
    assert!(matches!(error, Error::Undetermined { .. }), "{error}");
    let short = View {
        name: "b.png".into(),
        corners: vec![Vector2::zeros(); 53],
    };
    let error = calibrate(&[short], &board(), (640, 480), LensModel::default()).unwrap_err();
    assert!(error.to_string().contains("53 corners"), "{error}");
}
