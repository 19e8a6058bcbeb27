//! Cameras of all kinds, from exact corners: the starting points must lead to the same minimum, from a telephoto lens to a fisheye. Corners
//! are projected by `deepfusion-geometry`, not by this crate.

use deepfusion_calibrate::{Board, LensModel, View, calibrate};
use deepfusion_geometry::{Distortion, Intrinsics};
use nalgebra::{Rotation3, Vector2, Vector3};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

const SIZE: (u32, u32) = (800, 600);

/// Views of a board with all corners in the image, tilted by up to 40 degrees. The corners have errors of up to `grain` pixels.
fn views(board: &Board, k: &Intrinsics, lens: &Distortion, seed: u64, grain: f64) -> Vec<View> {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let middle = (board.points()[0] + board.points()[board.corners() - 1]) / 2.0;
    let mut views = Vec::new();
    for _ in 0..100_000 {
        let tilt = Vector3::from_fn(|_, _| random.random_range(-0.5..0.5));
        let turn = Rotation3::new(tilt);
        // Towards a random pixel, at a distance at which the board fills a third to all of the image.
        let pixel = [0.0, 0.0].map(|_: f64| random.random_range(0.15..0.85));
        let seen = k.back_project(pixel[0] * 800.0, pixel[1] * 600.0, 1.0).xy();
        let Some(ray) = lens.undistort(&seen) else {
            continue;
        };
        let fills = random.random_range(0.3..0.9);
        let distance = 0.2 * k.fx / (fills * 800.0);
        let shift = ray.push(1.0).normalize() * distance - turn * middle;
        let corners: Option<Vec<Vector2<f64>>> = board
            .points()
            .iter()
            .map(|p| {
                let p = turn * p + shift;
                let seen = lens.distort(&(p.z > 0.01).then(|| p.xy() / p.z)?);
                let pixel = Vector2::new(k.fx * seen.x + k.cx, k.fy * seen.y + k.cy);
                let inside = (0.0..800.0).contains(&pixel.x) && (0.0..600.0).contains(&pixel.y);
                // Only points that the lens shows once.
                let once = lens.undistort(&seen)? - p.xy() / p.z;
                (inside && once.norm() < 1e-6).then_some(pixel)
            })
            .collect();
        if let Some(corners) = corners {
            let corners = corners
                .into_iter()
                .map(|c| c + Vector2::from_fn(|_, _| grain * random.random_range(-1.0..1.0)));
            views.push(View {
                name: views.len().to_string(),
                corners: corners.collect(),
            });
        }
        if views.len() == 12 {
            return views;
        }
    }
    panic!("only {} views", views.len());
}

fn lenses() -> Vec<([f64; 4], LensModel, Vec<f64>)> {
    let brown = LensModel::BrownConrady;
    vec![
        // Telephoto, normal, wide, wide with strong distortion, and off-centre with pixels that are not square.
        (
            [3000.0, 3000.0, 400.0, 300.0],
            brown,
            vec![0.1, 0.0, 0.0, 0.0, 0.0],
        ),
        (
            [700.0, 705.0, 410.0, 290.0],
            brown,
            vec![-0.2, 0.05, 0.001, -0.001, 0.0],
        ),
        (
            [380.0, 380.0, 395.0, 310.0],
            brown,
            vec![-0.28, 0.09, 0.0, 0.0, -0.012],
        ),
        (
            [420.0, 420.0, 399.5, 299.5],
            brown,
            vec![-0.33, 0.13, 0.0005, 0.0002, -0.025],
        ),
        (
            [600.0, 900.0, 300.0, 380.0],
            brown,
            vec![-0.1, 0.02, 0.0, 0.0, 0.0],
        ),
        // Fisheyes of about 90, 140 and 170 degrees.
        (
            [500.0, 500.0, 400.0, 300.0],
            LensModel::Fisheye,
            vec![0.02, -0.01, 0.0, 0.0],
        ),
        (
            [320.0, 322.0, 405.0, 296.0],
            LensModel::Fisheye,
            vec![-0.01, 0.02, -0.01, 0.002],
        ),
        (
            [265.0, 265.0, 399.5, 299.5],
            LensModel::Fisheye,
            vec![0.03, -0.01, 0.005, -0.001],
        ),
    ]
}

#[test]
fn exact_corners_give_the_exact_camera() {
    let board = Board::new(8, 6, 0.03).unwrap();
    for (i, (pinhole, model, coefficients)) in lenses().into_iter().enumerate() {
        let k = Intrinsics::from_numbers(pinhole, SIZE);
        let lens = match model {
            LensModel::BrownConrady => Distortion::from_opencv(&coefficients),
            LensModel::Fisheye => Distortion::from_fisheye(&coefficients),
        };
        let views = views(&board, &k, &lens.unwrap(), i as u64, 0.0);
        let found = calibrate(&views, &board, SIZE, model).unwrap();
        assert!(found.rms_px < 1e-6, "{i}: {found:?}");
        let numbers = [
            found.intrinsics.fx,
            found.intrinsics.fy,
            found.intrinsics.cx,
            found.intrinsics.cy,
        ];
        for (found, truth) in numbers.iter().zip(pinhole) {
            assert!((found - truth).abs() < 1e-3, "{i}: {numbers:?}");
        }
        for (found, truth) in found.coefficients.iter().zip(&coefficients) {
            assert!((found - truth).abs() < 1e-3, "{i}: {found} {truth}");
        }
    }
}

/// Over many sets of corners with equal errors, results scatter as the reported standard errors predict: for sixty values per parameter,
/// the root mean square of (found − truth) / error is 1 within 30 % (three times 1/√(2·60)).
#[test]
fn standard_errors_match_the_scatter_of_results() {
    let board = Board::new(8, 6, 0.03).unwrap();
    let pinhole = [700.0, 705.0, 410.0, 290.0];
    let k = Intrinsics::from_numbers(pinhole, SIZE);
    let lens = Distortion::from_opencv(&[-0.2, 0.05, 0.001, -0.001, 0.0]).unwrap();
    let runs = 60;
    let mut squares = [0.0; 5];
    for seed in 0..runs {
        let views = views(&board, &k, &lens, 100 + seed, 0.3);
        let found = calibrate(&views, &board, SIZE, LensModel::BrownConrady).unwrap();
        let errors = &found.standard_errors;
        let off = [
            (found.intrinsics.fx - 700.0) / errors.fx,
            (found.intrinsics.fy - 705.0) / errors.fy,
            (found.intrinsics.cx - 410.0) / errors.cx,
            (found.intrinsics.cy - 290.0) / errors.cy,
            (found.coefficients[0] + 0.2) / errors.coefficients[0],
        ];
        for (sum, off) in squares.iter_mut().zip(off) {
            *sum += off * off / runs as f64;
        }
    }
    for square in squares {
        let ratio = square.sqrt();
        assert!((0.7..1.3).contains(&ratio), "{squares:?}");
    }
}
