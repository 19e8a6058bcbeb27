//! Points followed from one small picture to the next (Lucas and Kanade 1981, coarse to fine as
//! Bouguet 2000; corners after Shi and Tomasi 1994).

use deepfusion_motion::GreyImage;
use nalgebra::{Matrix2, Vector2};

/// One corner is taken from each square of this many pixels.
const CELL: usize = 14;
/// Half the window, in pixels.
const REACH: i32 = 4;
const LEVELS: usize = 4;
const ITERATIONS: usize = 8;
/// Smaller eigenvalue of the mean structure tensor below which there is no corner, squared grey levels.
const LEAST_CORNER: f64 = 4.0;
/// A point followed forth and back has to return within this distance, in pixels.
const RETURN_PX: f64 = 0.3;

/// A point that was followed.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Flow {
    /// Position in the earlier picture, u then v.
    pub(crate) at: [f64; 2],
    /// Displacement, u then v.
    pub(crate) by: [f64; 2],
}

/// The corners of the earlier picture, with their displacement to the later one.
pub(crate) fn flow(earlier: &GreyImage, later: &GreyImage) -> Vec<Flow> {
    let (a, b) = (pyramid(earlier), pyramid(later));
    if a.len() != b.len() {
        return Vec::new();
    }
    let follow = |at: Vector2<f64>| {
        let to = track(&a, &b, at)?;
        let back = track(&b, &a, to)?;
        ((back - at).norm() < RETURN_PX).then(|| Flow {
            at: at.into(),
            by: (to - at).into(),
        })
    };
    corners(earlier).into_iter().filter_map(follow).collect()
}

/// The best corner of each cell that has one.
fn corners(image: &GreyImage) -> Vec<Vector2<f64>> {
    let border = REACH as usize + 2;
    let mut found = Vec::new();
    for top in (border..image.height.saturating_sub(border)).step_by(CELL) {
        for left in (border..image.width.saturating_sub(border)).step_by(CELL) {
            let mut best = (LEAST_CORNER, None);
            for y in (top..(top + CELL).min(image.height - border)).step_by(2) {
                for x in (left..(left + CELL).min(image.width - border)).step_by(2) {
                    let strength = corner_strength(image, x, y);
                    if strength > best.0 {
                        best = (strength, Some(Vector2::new(x as f64, y as f64)));
                    }
                }
            }
            found.extend(best.1);
        }
    }
    found
}

/// The smaller eigenvalue of the mean structure tensor over 5×5 pixels.
fn corner_strength(image: &GreyImage, x: usize, y: usize) -> f64 {
    let (mut xx, mut xy, mut yy) = (0.0_f32, 0.0_f32, 0.0_f32);
    for row in y - 2..=y + 2 {
        for column in x - 2..=x + 2 {
            let i = row * image.width + column;
            let dx = 0.5 * (image.data[i + 1] - image.data[i - 1]);
            let dy = 0.5 * (image.data[i + image.width] - image.data[i - image.width]);
            xx += dx * dx;
            xy += dx * dy;
            yy += dy * dy;
        }
    }
    let half = 0.5 * (xx + yy);
    f64::from(half - (0.25 * (xx - yy).powi(2) + xy * xy).sqrt()) / 25.0
}

/// The picture at full size, then halved repeatedly.
fn pyramid(image: &GreyImage) -> Vec<GreyImage> {
    let mut levels = vec![image.clone()];
    while levels.len() < LEVELS {
        let Some(half) = levels.last().and_then(half) else {
            break;
        };
        levels.push(half);
    }
    levels
}

fn half(image: &GreyImage) -> Option<GreyImage> {
    let (width, height) = (image.width / 2, image.height / 2);
    if width < 24 || height < 16 {
        return None;
    }
    let at = |x: usize, y: usize| image.data[y * image.width + x];
    let mean = |i: usize| {
        let (x, y) = (2 * (i % width), 2 * (i / width));
        0.25 * (at(x, y) + at(x + 1, y) + at(x, y + 1) + at(x + 1, y + 1))
    };
    Some(GreyImage {
        width,
        height,
        data: (0..width * height).map(mean).collect(),
    })
}

/// Where a point of `a` lies in `b`, coarse to fine; `None` if the window leaves the picture or has no
/// corner.
fn track(a: &[GreyImage], b: &[GreyImage], at: Vector2<f64>) -> Option<Vector2<f64>> {
    let mut by = Vector2::zeros();
    for level in (0..a.len()).rev() {
        let scale = 0.5_f64.powi(level as i32);
        // Pixel centres: the first of a half-size picture lies between the first two of the full-size one.
        let here = (at + Vector2::repeat(0.5)) * scale - Vector2::repeat(0.5);
        let found = refine(&a[level], &b[level], here, by * scale);
        match (found, level) {
            (Some(found), _) => by = found / scale,
            (None, 0) => return None,
            // A coarse level may be too small around this point; the finer ones then work without it.
            (None, _) => {}
        }
    }
    Some(at + by)
}

fn refine(
    a: &GreyImage,
    b: &GreyImage,
    at: Vector2<f64>,
    mut by: Vector2<f64>,
) -> Option<Vector2<f64>> {
    const SIDE: usize = 2 * REACH as usize + 1;
    let mut patch = [0.0; SIDE * SIDE];
    let mut slopes = [Vector2::zeros(); SIDE * SIDE];
    let mut tensor = Matrix2::zeros();
    inside(a, at)?;
    for (i, (value, slope)) in patch.iter_mut().zip(&mut slopes).enumerate() {
        let p = at + place(i);
        let v = |dx: f64, dy: f64| f64::from(a.sample((p.x + dx) as f32, (p.y + dy) as f32));
        *value = v(0.0, 0.0);
        *slope = 0.5 * Vector2::new(v(1.0, 0.0) - v(-1.0, 0.0), v(0.0, 1.0) - v(0.0, -1.0));
    }
    let mean = mean(&patch);
    let mean_slope = slopes.iter().sum::<Vector2<f64>>() / slopes.len() as f64;
    for slope in &mut slopes {
        // The mean is subtracted, so a change of brightness does not count.
        *slope -= mean_slope;
        tensor += *slope * slope.transpose();
    }
    let inverse = tensor.try_inverse()?;
    for _ in 0..ITERATIONS {
        inside(b, at + by)?;
        let mut seen = [0.0; SIDE * SIDE];
        for (i, value) in seen.iter_mut().enumerate() {
            let p = at + by + place(i);
            *value = f64::from(b.sample(p.x as f32, p.y as f32));
        }
        let seen_mean = self::mean(&seen);
        let mut gradient = Vector2::zeros();
        for i in 0..seen.len() {
            gradient += slopes[i] * ((patch[i] - mean) - (seen[i] - seen_mean));
        }
        let step = inverse * gradient;
        by += step;
        let length = step.norm();
        if length.is_nan() || length >= 2.0 * f64::from(REACH) {
            return None;
        }
        if step.norm() < 0.01 {
            break;
        }
    }
    inside(b, at + by).map(|()| by)
}

/// The `i`-th position of a window, from its centre.
fn place(i: usize) -> Vector2<f64> {
    let side = 2 * REACH as usize + 1;
    Vector2::new(
        (i % side) as f64 - f64::from(REACH),
        (i / side) as f64 - f64::from(REACH),
    )
}

fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len() as f64
}

/// Whether the centre of a window lies in the picture.
fn inside(image: &GreyImage, at: Vector2<f64>) -> Option<()> {
    let within = |v: f64, size: usize| v >= 2.0 && v <= size as f64 - 3.0;
    (within(at.x, image.width) && within(at.y, image.height)).then_some(())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A picture of waves, moved and enlarged about its centre.
    fn picture(right: f64, down: f64, growth: f64) -> GreyImage {
        let (width, height) = (200, 90);
        let value = |i: usize| {
            let x = ((i % width) as f64 - 99.5 - right) / (1.0 + growth);
            let y = ((i / width) as f64 - 44.5 - down) / (1.0 + growth);
            let wave = (0.35 * x + 0.1 * y).sin() + (0.21 * x - 0.4 * y).cos() + (0.5 * y).sin();
            (120.0 + 30.0 * wave) as f32
        };
        GreyImage {
            width,
            height,
            data: (0..width * height).map(value).collect(),
        }
    }

    #[test]
    fn points_are_followed_to_a_tenth_of_a_pixel() {
        let (right, down, growth) = (4.3, -1.7, 0.03);
        let found = flow(&picture(0.0, 0.0, 0.0), &picture(right, down, growth));
        assert!(found.len() > 30, "{}", found.len());
        let mut errors: Vec<f64> = found
            .iter()
            .map(|f| {
                let u = right + growth * (f.at[0] - 99.5);
                let v = down + growth * (f.at[1] - 44.5);
                (f.by[0] - u).hypot(f.by[1] - v)
            })
            .collect();
        errors.sort_by(f64::total_cmp);
        assert!(errors[errors.len() / 2] < 0.05, "{errors:?}");
        assert!(errors[errors.len() * 9 / 10] < 0.2, "{errors:?}");
    }

    #[test]
    fn no_points_are_followed_in_plain_pictures() {
        let plain = GreyImage {
            width: 64,
            height: 48,
            data: vec![80.0; 64 * 48],
        };
        assert!(flow(&plain, &plain).is_empty());
        let tiny = GreyImage {
            width: 5,
            height: 5,
            data: vec![80.0; 25],
        };
        assert!(flow(&tiny, &tiny).is_empty());
        assert!(flow(&plain, &tiny).is_empty());
    }
}
