//! Flying pixels: at an edge between a near and a far surface, a network predicts depths halfway between the two.

use deepfusion_geometry::DepthMap;
use rayon::prelude::*;

/// Smallest number of rows for which another core pays off.
const ROWS: usize = 16;

/// Marks the flying pixels of a depth image (row by row), which hang between two surfaces.
///
/// A flying pixel is farther than the pixel `radius` to one side and nearer than the pixel as far to the other side, by more than `jump` of
/// its own depth (and 0.3 m) each. The depth of a surface seen at a grazing angle changes less than that.
#[must_use]
pub fn flying_pixels(depth: &[f32], width: usize, radius: usize, jump: f32) -> Vec<bool> {
    let mut flying = vec![false; depth.len()];
    mark(depth, width, radius, jump, &mut flying, true);
    flying
}

/// A depth image without its [`flying_pixels`]; `radius` is in pixels of an image 640 wide.
#[must_use]
pub fn without_flying_pixels(depth: &DepthMap, radius: f32, jump: f32) -> DepthMap {
    let radius = (radius * depth.width as f32 / 640.0).round() as usize;
    let mut clean = depth.clone();
    mark(&depth.data, depth.width, radius, jump, &mut clean.data, 0.0);
    clean
}

/// Sets each pixel's entry in `marks` to `flying` if the pixel is a flying one.
fn mark<T: Copy + Send + Sync>(
    depth: &[f32],
    width: usize,
    radius: usize,
    jump: f32,
    marks: &mut [T],
    flying: T,
) {
    // A larger radius than the image's sides has no effect.
    let radius = radius.clamp(1, depth.len().max(1));
    let rows = marks.par_chunks_exact_mut(width.max(1));
    rows.with_min_len(ROWS).enumerate().for_each(|(v, marks)| {
        let row = |v: usize| depth.get(v * width..(v + 1) * width);
        let Some(here) = row(v) else { return };
        if width > 2 * radius {
            let marks = &mut marks[radius..];
            mark_between(
                here,
                &here[radius..],
                &here[2 * radius..],
                jump,
                marks,
                flying,
            );
        }
        if let (Some(above), Some(below)) = (v.checked_sub(radius).and_then(row), row(v + radius)) {
            mark_between(above, here, below, jump, marks, flying);
        }
    });
}

/// Sets `marks` to `flying` where the second of three depths hangs between the other two.
fn mark_between<T: Copy>(
    ones: &[f32],
    depths: &[f32],
    others: &[f32],
    jump: f32,
    marks: &mut [T],
    flying: T,
) {
    let sides = ones.iter().zip(others);
    for (((a, b), z), mark) in sides.zip(depths).zip(marks) {
        let least = 0.3 + jump * z;
        let (up, down) = (b - z, z - a);
        let known = (*a > 0.0) & (*z > 0.0) & (*b > 0.0);
        let flies = known & (up.abs() > least) & (down.abs() > least) & (up * down > 0.0);
        *mark = if flies { flying } else { *mark };
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_ramp_between_two_surfaces_is_flying() {
        // 5 m, a ramp of three pixels, 20 m.
        let row = [5.0, 5.0, 5.0, 8.0, 12.0, 16.0, 20.0, 20.0, 20.0];
        let flying = flying_pixels(&row, 9, 2, 0.08);
        assert_eq!(flying[3..6], [true; 3]);
        assert!(!flying[0] && !flying[1] && !flying[7] && !flying[8]);
    }

    #[test]
    fn sharp_edges_slopes_and_holes_are_not_flying() {
        let sharp = [5.0, 5.0, 5.0, 20.0, 20.0, 20.0];
        assert!(flying_pixels(&sharp, 6, 1, 0.08).iter().all(|f| !f));
        let slope: Vec<f32> = (0..20).map(|i| 10.0 + 0.4 * i as f32).collect();
        assert!(flying_pixels(&slope, 20, 1, 0.08).iter().all(|f| !f));
        let holes = [5.0, 0.0, 10.0, f32::NAN, 20.0];
        assert!(flying_pixels(&holes, 5, 1, 0.08).iter().all(|f| !f));
        assert!(flying_pixels(&[], 0, 1, 0.08).is_empty());
    }
}
