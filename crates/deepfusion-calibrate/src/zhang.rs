//! Starting points of the refinement: a camera without distortion, and each board's pose.

use crate::homography::{homography, pose};
use crate::model::{Camera, LensModel};
use crate::refine::{Fit, Pose};
use nalgebra::{Matrix3, Vector2, Vector3};

/// Rays farther from the axis than this, in radians, are left out of a starting point: their point at z = 1 is too far away.
const WIDEST: f64 = 1.35;
/// Focal lengths to start from if the closed form gives none or a bad one, in widths of the image: 100 to 20 degrees.
const PINHOLE_WIDTHS: [f64; 5] = [0.42, 0.7, 1.0, 1.6, 2.8];
/// Fields of view to start from for a fisheye lens, in radians over the image's width: 70 to 230 degrees.
const FISHEYE_VIEWS: [f64; 6] = [1.2, 1.75, 2.3, 2.8, 3.3, 4.0];

/// Starting points, the best first: cameras with the principal point in the middle of the image, and poses.
pub(crate) fn starting_points(
    views: &[&[Vector2<f64>]],
    board: &[Vector3<f64>],
    size: (u32, u32),
    model: LensModel,
) -> Vec<Fit> {
    let (width, height) = (f64::from(size.0), f64::from(size.1));
    let middle = [(width - 1.0) / 2.0, (height - 1.0) / 2.0];
    let mut focal: Vec<[f64; 2]> = Vec::new();
    match model {
        LensModel::BrownConrady => {
            focal.extend(closed_form(views, board, middle));
            focal.extend(PINHOLE_WIDTHS.map(|share| [share * width.max(height); 2]));
        }
        LensModel::Fisheye => {
            focal.extend(FISHEYE_VIEWS.map(|view| [width.max(height) / view; 2]));
        }
    }
    let camera =
        |f: &[f64; 2]| Camera::without_distortion(model, [f[0], f[1], middle[0], middle[1]]);
    let mut fits: Vec<(f64, Fit)> = focal
        .iter()
        .filter_map(|f| {
            let fit = with_poses(camera(f), views, board)?;
            Some((fit.cost(views, board)?, fit))
        })
        .collect();
    fits.sort_by(|a, b| a.0.total_cmp(&b.0));
    fits.into_iter().map(|(_, fit)| fit).collect()
}

/// Zhang's constraints with a known principal point and no skew: h₁ᵀ B h₂ = 0 and h₁ᵀ B h₁ = h₂ᵀ B h₂ for every homography
/// H = [h₁ h₂ h₃] from the board to the image, with B = diag(1/fx², 1/fy², 1). They are linear in 1/fx² and 1/fy².
fn closed_form(
    views: &[&[Vector2<f64>]],
    board: &[Vector3<f64>],
    middle: [f64; 2],
) -> Option<[f64; 2]> {
    let (mut normal, mut right) = (nalgebra::Matrix2::zeros(), Vector2::zeros());
    let centre = Matrix3::new(1.0, 0.0, -middle[0], 0.0, 1.0, -middle[1], 0.0, 0.0, 1.0);
    for view in views {
        let pairs: Vec<_> = board
            .iter()
            .map(|p| p.xy())
            .zip(view.iter().copied())
            .collect();
        let h = centre * homography(&pairs)?;
        let (a, b) = (h.column(0), h.column(1));
        // Both constraints have the same weight: along the board's diagonals each becomes the other.
        let scale = a.norm() * b.norm();
        let (d1, d2) = ((a + b) / 2.0_f64.sqrt(), (a - b) / 2.0_f64.sqrt());
        for (p, q) in [(a.into_owned(), b.into_owned()), (d1, d2)] {
            let row = Vector2::new(p.x * q.x, p.y * q.y) / scale;
            normal += row * row.transpose();
            right -= row * (p.z * q.z / scale);
        }
    }
    let b = normal.try_inverse()? * right;
    let f = [b.x, b.y].map(|b| (1.0 / b).sqrt());
    f.iter().all(|f| f.is_finite()).then_some(f)
}

/// The pose of every board, given a camera.
fn with_poses(camera: Camera, views: &[&[Vector2<f64>]], board: &[Vector3<f64>]) -> Option<Fit> {
    let poses: Option<Vec<Pose>> = views
        .iter()
        .map(|view| {
            let pairs = board.iter().zip(view.iter());
            let pairs: Vec<_> = pairs
                .filter_map(|(p, seen)| Some((p.xy(), ray(&camera, seen)?)))
                .collect();
            let (turn, shift) = pose(&homography(&pairs)?)?;
            Some(Pose { turn, shift })
        })
        .collect();
    Some(Fit {
        camera,
        poses: poses?,
    })
}

/// The point at z = 1 of a pixel, for a lens without distortion.
fn ray(camera: &Camera, pixel: &Vector2<f64>) -> Option<Vector2<f64>> {
    let [fx, fy, cx, cy, ..] = camera.numbers;
    let seen = Vector2::new((pixel.x - cx) / fx, (pixel.y - cy) / fy);
    match camera.model {
        LensModel::BrownConrady => Some(seen),
        LensModel::Fisheye => {
            let theta = seen.norm();
            if theta < 1e-12 {
                return Some(seen);
            }
            (theta < WIDEST).then(|| seen * (theta.tan() / theta))
        }
    }
}
