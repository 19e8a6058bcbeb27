//! Points where four squares meet: found by the ChESS response (Bennett and Lasenby, CVIU 118, 2014), then refined to fractions of a pixel.

use chess_corners::{Detector, DetectorConfig, UpscaleConfig};
use image::GrayImage;
use nalgebra::{Matrix2, Vector2};
use std::f64::consts::PI;

/// Least response of a corner. Grain and leaves also respond; the grid leaves them out.
const LEAST_RESPONSE: f32 = 15.0;
/// Border around the image for the detector, in pixels.
const BORDER_PX: u32 = 24;
/// Greatest number of steps of a refinement, and the step in pixels that ends it.
const MAX_STEPS: usize = 40;
const TOLERANCE_PX: f64 = 1e-3;

/// A corner where two dark and two bright squares meet.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Corner {
    /// Position, in pixels.
    pub(crate) at: Vector2<f64>,
    /// Directions of the two edges, in radians; from the first to the second, turning from x to y, the square is dark.
    pub(crate) edges: [f64; 2],
    /// Response of the detector.
    pub(crate) response: f64,
}

/// The corners of an image, strongest first. `doubled` enlarges the image twice, for squares of less than some ten pixels.
pub(crate) fn find(image: &GrayImage, doubled: bool) -> Vec<Corner> {
    let mut config = DetectorConfig::chess_multiscale().with_threshold(LEAST_RESPONSE);
    if doubled {
        config = config.with_upscale(UpscaleConfig::Fixed(2));
    }
    // The detector leaves out the border of an image, so add a border.
    let image = bordered(image);
    let (width, height) = image.dimensions();
    // The settings are constants that the detector accepts, and the buffer fits the image: this cannot fail.
    let found = Detector::new(config)
        .and_then(|mut detector| detector.detect_u8(image.as_raw(), width, height))
        .unwrap_or_default();
    let border = f64::from(BORDER_PX);
    let mut corners: Vec<Corner> = found
        .iter()
        .filter_map(|corner| {
            let [first, second] = corner.axes?;
            Some(Corner {
                at: Vector2::new(corner.x.into(), corner.y.into()).add_scalar(-border),
                edges: [first.angle.into(), second.angle.into()],
                response: corner.response.into(),
            })
        })
        .collect();
    corners.sort_by(|a, b| b.response.total_cmp(&a.response));
    corners
}

/// The image with its outermost pixels repeated around it.
fn bordered(image: &GrayImage) -> GrayImage {
    let (width, height) = image.dimensions();
    GrayImage::from_fn(width + 2 * BORDER_PX, height + 2 * BORDER_PX, |x, y| {
        let x = x.saturating_sub(BORDER_PX).min(width - 1);
        let y = y.saturating_sub(BORDER_PX).min(height - 1);
        *image.get_pixel(x, y)
    })
}

/// The angle between two lines, 0 to π/2.
pub(crate) fn between(a: f64, b: f64) -> f64 {
    let turned = (a - b).rem_euclid(PI);
    turned.min(PI - turned)
}

/// Refines a corner: the point q for which all image gradients g around it are perpendicular to the lines towards it, in a window of `half`
/// pixels to each side. It solves Σ w g gᵀ (p − q) = 0 over the pixels p (Förstner and Gülch, 1987; as OpenCV's `cornerSubPix`). `None` if
/// q moves out of the window.
pub(crate) fn refine_corner(
    image: &GrayImage,
    start: Vector2<f64>,
    half: i32,
) -> Option<Vector2<f64>> {
    let mut at = start;
    let reach = f64::from(half);
    for _ in 0..MAX_STEPS {
        let (mut normal, mut right) = (Matrix2::zeros(), Vector2::zeros());
        for dy in -half..=half {
            for dx in -half..=half {
                let offset = Vector2::new(f64::from(dx), f64::from(dy));
                let p = at + offset;
                let g = Vector2::new(
                    grey(image, p.x + 1.0, p.y) - grey(image, p.x - 1.0, p.y),
                    grey(image, p.x, p.y + 1.0) - grey(image, p.x, p.y - 1.0),
                );
                let weighted = g * g.transpose() * (-offset.norm_squared() / (reach * reach)).exp();
                normal += weighted;
                right += weighted * offset;
            }
        }
        let step = normal.try_inverse()? * right;
        at += step;
        if !at.iter().all(|n| n.is_finite()) || (at - start).amax() > reach {
            return None;
        }
        if step.norm() < TOLERANCE_PX {
            break;
        }
    }
    Some(at)
}

/// The grey value between pixels, bilinear; beyond the image that of its border.
pub(crate) fn grey(image: &GrayImage, x: f64, y: f64) -> f64 {
    let (width, height) = image.dimensions();
    let x = x.clamp(0.0, f64::from(width - 1));
    let y = y.clamp(0.0, f64::from(height - 1));
    let (x0, y0) = (x as u32, y as u32);
    let (x1, y1) = ((x0 + 1).min(width - 1), (y0 + 1).min(height - 1));
    let (ax, ay) = (x - f64::from(x0), y - f64::from(y0));
    let at = |x, y| f64::from(image.get_pixel(x, y).0[0]);
    let top = at(x0, y0) * (1.0 - ax) + at(x1, y0) * ax;
    let bottom = at(x0, y1) * (1.0 - ax) + at(x1, y1) * ax;
    top * (1.0 - ay) + bottom * ay
}

#[cfg(test)]
mod tests {
    use super::*;
    use image::Luma;

    #[test]
    fn the_angle_between_lines_ignores_their_direction() {
        assert!(between(0.1, PI + 0.1) < 1e-12);
        assert!((between(0.1, PI - 0.1) - 0.2).abs() < 1e-12);
    }

    /// Four squares with a soft edge, whose corner is between pixels.
    #[test]
    fn a_corner_is_refined_between_pixels() {
        let (cx, cy) = (20.3, 17.8);
        let image = GrayImage::from_fn(40, 36, |x, y| {
            let soft = |d: f64| (d / 1.5).tanh();
            let (u, v) = (f64::from(x) - cx, f64::from(y) - cy);
            Luma([(125.0 + 80.0 * soft(u) * soft(v)).round() as u8])
        });
        let start = Vector2::new(21.0, 17.0);
        let at = refine_corner(&image, start, 5).unwrap();
        assert!((at - Vector2::new(cx, cy)).norm() < 0.02, "{at}");
        // A plain image has no corner, and a refinement finds none.
        let plain = GrayImage::from_pixel(40, 36, Luma([90]));
        assert!(find(&plain, false).is_empty());
        assert_eq!(refine_corner(&plain, start, 5), None);
    }

    #[test]
    fn corners_have_edge_directions_and_dark_squares() {
        // Squares of 16 pixels along the axes, with corners at 24 + 16 i; dark where both indices are even.
        let image = GrayImage::from_fn(128, 96, |x, y| {
            let dark = (x + 8) / 16 % 2 == (y + 8) / 16 % 2;
            Luma([if dark { 40 } else { 210 }])
        });
        let found = find(&image, false);
        let near = |x: f64, y: f64| {
            let at = Vector2::new(x, y);
            found.iter().find(|c| (c.at - at).norm() < 1.0).unwrap()
        };
        let (here, next) = (near(39.5, 39.5), near(55.5, 39.5));
        // The square to the lower right of the first corner is dark, that of the next one bright.
        assert!(between(here.edges[0], 0.0) < 0.1, "{here:?}");
        assert!(between(here.edges[1], PI / 2.0) < 0.1, "{here:?}");
        assert!(between(next.edges[0], PI / 2.0) < 0.1, "{next:?}");
    }
}
