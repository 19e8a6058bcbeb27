use deepfusion_geometry::DepthMap;

/// A map with a smaller share of pixels with depth is treated as sparse (a scan): of the points that fall into a pixel the
/// nearest is taken.
const DENSE: f64 = 0.3;

/// Depth at another size, row by row, 0 = none. A dense map is read at each pixel's centre, never averaged across an edge;
/// of a sparse one every point is kept, unless a nearer one falls into its pixel. With `sky` the holes are sky, and the
/// map counts as dense.
pub(crate) fn fit_depth(depth: &DepthMap, width: usize, height: usize, sky: bool) -> Vec<f32> {
    if (depth.width, depth.height) == (width, height) {
        return depth.data.clone();
    }
    let usable = |d: f32| d.is_finite() && d > 0.0;
    let count = depth.data.iter().filter(|d| usable(**d)).count();
    let (sx, sy) = (
        depth.width as f64 / width as f64,
        depth.height as f64 / height as f64,
    );
    if sky || count as f64 >= DENSE * depth.data.len() as f64 {
        let at =
            |i: usize, scale: f64, size: usize| (((i as f64 + 0.5) * scale) as usize).min(size - 1);
        let pixels = (0..height).flat_map(|v| (0..width).map(move |u| (u, v)));
        return pixels
            .map(|(u, v)| {
                let (x, y) = (at(u, sx, depth.width), at(v, sy, depth.height));
                let d = depth.data[y * depth.width + x];
                if usable(d) { d } else { 0.0 }
            })
            .collect();
    }
    let mut fitted = vec![0.0_f32; width * height];
    for (i, d) in depth.data.iter().enumerate().filter(|(_, d)| usable(**d)) {
        let to =
            |i: usize, scale: f64, size: usize| (((i as f64 + 0.5) / scale) as usize).min(size - 1);
        let (u, v) = (
            to(i % depth.width, sx, width),
            to(i / depth.width, sy, height),
        );
        let place = &mut fitted[v * width + u];
        if *place == 0.0 || *d < *place {
            *place = *d;
        }
    }
    fitted
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_dense_map_keeps_its_edges_and_a_scan_its_points() {
        let row = [2.0, 2.0, 2.0, 9.0, 9.0, 9.0, 9.0, 0.0];
        let dense = DepthMap {
            width: 8,
            height: 2,
            data: row.repeat(2),
        };
        let half = fit_depth(&dense, 4, 1, false);
        assert_eq!(half, [2.0, 9.0, 9.0, 0.0], "read, not mixed");
        let mut scan = DepthMap::empty(8, 4);
        scan.data[3] = 7.0;
        scan.data[10] = 5.0;
        scan.data[31] = f32::NAN;
        let half = fit_depth(&scan, 4, 2, false);
        assert_eq!(half, [0.0, 5.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]);
    }
}
