//! Turns a scan into an image without holes.

use deepfusion_geometry::{DepthMap, Intrinsics};

/// Average number of points in a cell: enough that hardly any cell is empty.
const POINTS_A_CELL: f64 = 2.0;
/// A cell's height divided by its width: a spinning scanner's lines are farther apart than the points on them.
const ASPECT: f64 = 1.7;

/// Collects a scan's points (at the image's size) in cells large enough to contain some each. Keeps the nearest point of each cell, and
/// returns the camera of that coarser image.
pub(super) fn gathered(scan: &DepthMap, k: &Intrinsics) -> (DepthMap, Intrinsics) {
    let rows = scan.data.chunks_exact(scan.width.max(1));
    let first = rows.clone().position(|row| row.iter().any(|d| *d > 0.0));
    // The sky, which the scanner does not cover, does not count.
    let looked_at = scan.height - first.unwrap_or(0);
    let points = scan.count().max(1) as f64;
    let area = POINTS_A_CELL * (looked_at * scan.width) as f64 / points;
    let cell = [(area / ASPECT).sqrt(), (area * ASPECT).sqrt()];
    let cells = |size: usize, cell: f64| ((size as f64 / cell) as usize).clamp(1, size);
    let (width, height) = (cells(scan.width, cell[0]), cells(scan.height, cell[1]));
    let mut coarse = DepthMap::empty(width, height);
    for (v, row) in rows.enumerate() {
        for (u, depth) in row.iter().enumerate().filter(|(_, d)| **d > 0.0) {
            coarse.set_nearest(u * width / scan.width, v * height / scan.height, *depth);
        }
    }
    let k = k.resized(width as u32, height as u32);
    (coarse, k)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_thin_scan_becomes_a_full_image() {
        let mut scan = DepthMap::empty(300, 100);
        for v in (50..100).step_by(5) {
            for u in (0..300).step_by(2) {
                scan.data[v * 300 + u] = v as f32;
            }
        }
        let k = Intrinsics {
            fx: 200.0,
            fy: 200.0,
            cx: 150.0,
            cy: 50.0,
            width: 300,
            height: 100,
        };
        let (coarse, k) = gathered(&scan, &k);
        assert_eq!(
            (k.width as usize, k.height as usize),
            (coarse.width, coarse.height)
        );
        let lower = &coarse.data[coarse.data.len() / 2 + coarse.width..];
        let full = lower.iter().filter(|d| **d > 0.0).count();
        assert!(
            full as f64 > 0.9 * lower.len() as f64,
            "{full} of {}",
            lower.len()
        );
    }
}
