//! Fits a camera to views.

use crate::model::Camera;
use crate::refine::{Fit, Pose};
use crate::zhang::starting_points;
use crate::{
    Board, Calibration, Coverage, Error, LensModel, Result, StandardErrors, Undetermined, View,
    ViewFit,
};
use nalgebra::{Vector2, Vector3};

/// Fewest views. Three have as many equations as a camera has parameters; with five, a bad one can be found.
pub const LEAST_VIEWS: usize = 5;
/// Greatest number of starting points, and the steps of each before only the best continues.
const TRIED: usize = 4;
const TRIED_STEPS: usize = 25;
/// A view is left out if its error is above this many times the median view's, and above this many pixels.
const OUTLYING: f64 = 3.0;
const OUTLYING_PX: f64 = 0.3;
/// Rounds of leaving out views; in each at most one in this many views is left out.
const ROUNDS: usize = 4;
const PART: usize = 4;

/// Fits a camera to views of a board. Views whose corners disagree with those of all others are left out.
///
/// # Errors
/// [`Error::Corners`] for a view of another board; [`Error::TooFewViews`] for fewer than [`LEAST_VIEWS`]; [`Error::Undetermined`] if the
/// views do not determine the camera, because the board was parallel to the image in all of them.
pub fn calibrate(
    views: &[View],
    board: &Board,
    image_size: (u32, u32),
    model: LensModel,
) -> Result<Calibration> {
    let points = board.points();
    for view in views {
        if view.corners.len() != points.len() {
            return Err(Error::Corners {
                name: view.name.clone(),
                corners: view.corners.len(),
                expected: points.len(),
            });
        }
    }
    if views.len() < LEAST_VIEWS {
        return Err(Error::TooFewViews {
            board: *board,
            found: views.len(),
            pictures: views.len(),
            needed: LEAST_VIEWS,
            seen: None,
        });
    }
    let mut used: Vec<usize> = (0..views.len()).collect();
    let mut fitted = fit(&corners_of(views, &used), &points, image_size, model)?;
    for _ in 0..ROUNDS {
        let bad = outlying(&fitted, &corners_of(views, &used), &points);
        if bad.is_empty() || used.len() - bad.len() < LEAST_VIEWS {
            break;
        }
        let kept = used.iter().enumerate().filter(|(i, _)| !bad.contains(i));
        used = kept.map(|(_, view)| *view).collect();
        fitted = fit(&corners_of(views, &used), &points, image_size, model)?;
    }
    let mut found = calibration(&fitted, views, &used, &points, image_size)?;
    if board.square_m.is_none() {
        // In squares, since their side was not measured.
        found
            .views
            .iter_mut()
            .for_each(|view| view.distance_m = None);
    }
    Ok(found)
}

fn corners_of<'a>(views: &'a [View], used: &[usize]) -> Vec<&'a [Vector2<f64>]> {
    used.iter().map(|i| views[*i].corners.as_slice()).collect()
}

/// The best least-squares fit reached from the starting points.
fn fit(
    views: &[&[Vector2<f64>]],
    board: &[Vector3<f64>],
    size: (u32, u32),
    model: LensModel,
) -> Result<Fit> {
    let tried = starting_points(views, board, size, model)
        .into_iter()
        .take(TRIED);
    let tried = tried.filter_map(|fit| fit.refined(views, board, Some(TRIED_STEPS)));
    let best = tried
        .filter(|(fit, _)| plausible(&fit.camera, size))
        .min_by(|a, b| a.1.total_cmp(&b.1));
    best.and_then(|(fit, _)| fit.refined(views, board, None))
        .map(|(fit, _)| fit)
        .filter(|fit| plausible(&fit.camera, size))
        .ok_or_else(|| undetermined(Undetermined::NoCamera))
}

/// Whether a camera of this image size can have these parameters; the limits are wide.
fn plausible(camera: &Camera, size: (u32, u32)) -> bool {
    let [fx, fy, cx, cy, ..] = camera.numbers;
    let side = f64::from(size.0.max(size.1));
    let focal = |f: f64| (0.05 * side..100.0 * side).contains(&f);
    let within = |c: f64, side: u32| (-0.5..1.5).contains(&(c / f64::from(side)));
    focal(fx) && focal(fy) && within(cx, size.0) && within(cy, size.1)
}

fn undetermined(problem: Undetermined) -> Error {
    Error::Undetermined { problem }
}

/// Root mean square error of a view in pixels.
fn rms(fit: &Fit, view: &[Vector2<f64>], pose: &Pose, board: &[Vector3<f64>]) -> Option<f64> {
    let cost = fit.cost_of(view, pose, board)?;
    Some((cost / view.len() as f64).sqrt())
}

/// The views whose errors are far above those of the others, the worst first, at most a quarter of all.
fn outlying(fit: &Fit, views: &[&[Vector2<f64>]], board: &[Vector3<f64>]) -> Vec<usize> {
    let of = |(view, pose): (&&[Vector2<f64>], &Pose)| {
        rms(fit, view, pose, board).unwrap_or(f64::INFINITY)
    };
    let errors: Vec<f64> = views.iter().zip(&fit.poses).map(of).collect();
    let mut sorted = errors.clone();
    sorted.sort_by(f64::total_cmp);
    let limit = (OUTLYING * sorted[sorted.len() / 2]).max(OUTLYING_PX);
    let mut bad: Vec<usize> = (0..errors.len()).filter(|i| errors[*i] > limit).collect();
    bad.sort_by(|a, b| errors[*b].total_cmp(&errors[*a]));
    bad.truncate((views.len() / PART).max(1));
    bad
}

fn calibration(
    fit: &Fit,
    views: &[View],
    used: &[usize],
    board: &[Vector3<f64>],
    size: (u32, u32),
) -> Result<Calibration> {
    let seen = corners_of(views, used);
    let model = fit.camera.model;
    let cost = fit
        .cost(&seen, board)
        .ok_or_else(|| undetermined(Undetermined::Behind))?;
    let corners = (seen.len() * board.len()) as f64;
    let free = 2.0 * corners - (model.numbers() + 6 * seen.len()) as f64;
    let covariance = fit
        .camera_covariance(&seen, board)
        .ok_or_else(|| undetermined(Undetermined::Distance))?;
    let error = |i: usize| (covariance[(i, i)] * cost / free).sqrt();
    let standard_errors = StandardErrors {
        fx: error(0),
        fy: error(1),
        cx: error(2),
        cy: error(3),
        coefficients: (4..model.numbers()).map(error).collect(),
    };
    let fits = view_fits(fit, views, used, board);
    Ok(Calibration {
        intrinsics: fit.camera.intrinsics(size),
        model,
        coefficients: fit.camera.coefficients().to_vec(),
        rms_px: (cost / corners).sqrt(),
        standard_errors,
        hfov_deg: fit.camera.hfov_deg(size.0),
        coverage: Coverage::of(seen.iter().copied().flatten(), size),
        views: fits,
    })
}

/// Every view, also those left out, with the camera fitted to the views used.
fn view_fits(fit: &Fit, views: &[View], used: &[usize], board: &[Vector3<f64>]) -> Vec<ViewFit> {
    let mut all = Vec::with_capacity(views.len());
    for (i, view) in views.iter().enumerate() {
        let place = used.iter().position(|u| *u == i);
        let pose = match place {
            Some(place) => Some(fit.poses[place]),
            None => pose_of(fit, &view.corners, board),
        };
        let middle = board[board.len() - 1] / 2.0;
        all.push(ViewFit {
            name: view.name.clone(),
            used: place.is_some(),
            rms_px: pose.and_then(|pose| rms(fit, &view.corners, &pose, board)),
            distance_m: pose.map(|pose| (pose.turn * middle + pose.shift).norm()),
            tilt_deg: pose.map(|pose| {
                let normal = pose.turn * Vector3::z();
                normal.z.abs().min(1.0).acos().to_degrees()
            }),
        });
    }
    all
}

/// The pose of a view that the camera was not fitted to, from its undistorted corners.
fn pose_of(fit: &Fit, view: &[Vector2<f64>], board: &[Vector3<f64>]) -> Option<Pose> {
    use crate::homography::{homography, pose};
    let [fx, fy, cx, cy, ..] = fit.camera.numbers;
    let lens = fit.camera.distortion()?;
    let pairs = board.iter().zip(view).filter_map(|(p, seen)| {
        let seen = Vector2::new((seen.x - cx) / fx, (seen.y - cy) / fy);
        Some((p.xy(), lens.undistort(&seen)?))
    });
    let (turn, shift) = pose(&homography(&pairs.collect::<Vec<_>>())?)?;
    Some(Pose { turn, shift })
}
