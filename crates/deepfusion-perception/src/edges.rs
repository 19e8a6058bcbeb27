//! Pixels between a near and a far surface: a network draws them halfway, where nothing is.

use deepfusion_geometry::DepthMap;

/// Tells which pixels of a depth image (row by row) hang between two surfaces.
///
/// Such a pixel is farther than what is `radius` pixels to one side and nearer than what is as far to the other,
/// by more than `jump` of its own depth (and 0.3 m) each: a surface that is seen at a grazing angle rises no
/// faster.
#[must_use]
pub fn flying_pixels(depth: &[f32], width: usize, radius: usize, jump: f32) -> Vec<bool> {
    let height = depth.len().checked_div(width).unwrap_or(0);
    let mut flying = vec![false; depth.len()];
    let radius = radius.max(1);
    let between = |a: f32, z: f32, b: f32| {
        let least = 0.3 + jump * z;
        let (up, down) = (b - z, z - a);
        (a > 0.0) & (b > 0.0) & (up.abs() > least) & (down.abs() > least) & (up * down > 0.0)
    };
    for v in 0..height {
        let row = &depth[v * width..(v + 1) * width];
        for u in 0..width {
            let z = row[u];
            if z <= 0.0 {
                continue;
            }
            let across =
                u >= radius && u + radius < width && between(row[u - radius], z, row[u + radius]);
            let down = v >= radius
                && v + radius < height
                && between(
                    depth[(v - radius) * width + u],
                    z,
                    depth[(v + radius) * width + u],
                );
            flying[v * width + u] = across || down;
        }
    }
    flying
}

/// A depth image without its [`flying_pixels`]; `radius` is in pixels of an image 640 wide.
#[must_use]
pub fn without_flying_pixels(depth: &DepthMap, radius: f32, jump: f32) -> DepthMap {
    let radius = (radius * depth.width as f32 / 640.0).round() as usize;
    let flying = flying_pixels(&depth.data, depth.width, radius, jump);
    let keep = |(z, flies): (&f32, bool)| if flies { 0.0 } else { *z };
    DepthMap {
        width: depth.width,
        height: depth.height,
        data: depth.data.iter().zip(flying).map(keep).collect(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_ramp_between_two_surfaces_flies() {
        // 5 m, a ramp of three pixels, 20 m.
        let row = [5.0, 5.0, 5.0, 8.0, 12.0, 16.0, 20.0, 20.0, 20.0];
        let flying = flying_pixels(&row, 9, 2, 0.08);
        assert_eq!(flying[3..6], [true; 3]);
        assert!(!flying[0] && !flying[1] && !flying[7] && !flying[8]);
    }

    #[test]
    fn a_sharp_edge_a_slope_and_holes_do_not() {
        let sharp = [5.0, 5.0, 5.0, 20.0, 20.0, 20.0];
        assert!(flying_pixels(&sharp, 6, 1, 0.08).iter().all(|f| !f));
        let slope: Vec<f32> = (0..20).map(|i| 10.0 + 0.4 * i as f32).collect();
        assert!(flying_pixels(&slope, 20, 1, 0.08).iter().all(|f| !f));
        let holes = [5.0, 0.0, 10.0, f32::NAN, 20.0];
        assert!(flying_pixels(&holes, 5, 1, 0.08).iter().all(|f| !f));
        assert!(flying_pixels(&[], 0, 1, 0.08).is_empty());
    }
}
