use std::collections::HashSet;
use std::hash::{DefaultHasher, Hash, Hasher};

use crate::{Error, Grid, Result};

/// Depth for rows in which no training scan has a point, in metres: the usual cap.
const EMPTY_ROW_M: f64 = 80.0;

/// The mean-depth baseline: the mean depth of each pixel over the training scans. A pixel without any depth gets its row's mean, a row
/// without any depth gets 80 m. An image that is itself among the scans is evaluated without its own scan.
#[derive(Debug, Clone, Default)]
pub struct MeanDepthBaseline {
    size: Option<(usize, usize)>,
    sum_m: Vec<f64>,
    count: Vec<u32>,
    scans: HashSet<u64>,
}

impl MeanDepthBaseline {
    /// A baseline without any scans.
    #[must_use]
    pub fn new() -> Self {
        Self::default()
    }

    /// Adds a scan: depth in metres, 0 = none. A scan of another size than the first one (drives differ by a few pixels) is converted to
    /// that size: each pixel goes to the pixel that contains its centre.
    pub fn add_scan(&mut self, scan: &Grid) {
        let (width, height) = *self.size.get_or_insert((scan.width(), scan.height()));
        if self.count.is_empty() {
            self.sum_m = vec![0.0; width * height];
            self.count = vec![0; width * height];
        }
        if self.scans.insert(fingerprint(scan)) {
            for_each_depth(scan, (width, height), |index, depth_m| {
                self.sum_m[index] += depth_m;
                self.count[index] += 1;
            });
        }
    }

    /// Number of distinct scans.
    #[must_use]
    pub fn scans(&self) -> usize {
        self.scans.len()
    }

    /// The baseline's depth in metres, at the first scan's size, for the image whose ground truth is `own`: if the same scan was added, it
    /// is left out.
    ///
    /// # Errors
    /// [`Error::NothingToEvaluate`] if no scan was added.
    pub fn depth_for(&self, own: Option<&Grid>) -> Result<Grid> {
        let (width, height) = self.size.ok_or(Error::NothingToEvaluate {
            skipped: 0,
            names: "the mean-depth baseline needs scans of the training data".into(),
        })?;
        let (mut sum_m, mut count) = (self.sum_m.clone(), self.count.clone());
        if let Some(scan) = own.filter(|scan| self.scans.contains(&fingerprint(scan))) {
            for_each_depth(scan, (width, height), |index, depth_m| {
                sum_m[index] -= depth_m;
                count[index] -= 1;
            });
        }
        let mut depth_m = Vec::with_capacity(width * height);
        for row in 0..height {
            let pixels = row * width..(row + 1) * width;
            let means: Vec<Option<f64>> = pixels
                .map(|i| (count[i] > 0).then(|| sum_m[i] / f64::from(count[i])))
                .collect();
            let known: Vec<f64> = means.iter().copied().flatten().collect();
            let row_m = crate::statistics::mean(&known).unwrap_or(EMPTY_ROW_M);
            depth_m.extend(means.into_iter().map(|mean| mean.unwrap_or(row_m)));
        }
        Grid::new(width, height, depth_m)
    }
}

/// Calls `f` with the depth of every pixel that has one, and its index in a map of `size` (width, height).
fn for_each_depth(scan: &Grid, (width, height): (usize, usize), mut f: impl FnMut(usize, f64)) {
    // (i + ½)·to/from, rounded down, in integer arithmetic: the pixel that contains the centre.
    let place = |i: usize, from: usize, to: usize| (2 * i + 1) * to / (2 * from);
    for (index, &depth_m) in scan.values().iter().enumerate() {
        if depth_m > 0.0 && depth_m.is_finite() {
            let x = place(index % scan.width(), scan.width(), width);
            let y = place(index / scan.width(), scan.height(), height);
            f(y * width + x, depth_m);
        }
    }
}

/// Identifies scans by their content, so that a scan is recognised whatever its file or frame is called.
fn fingerprint(scan: &Grid) -> u64 {
    let mut hasher = DefaultHasher::new();
    (scan.width(), scan.height()).hash(&mut hasher);
    for (index, value) in scan.values().iter().enumerate().filter(|(_, v)| **v > 0.0) {
        (index, value.to_bits()).hash(&mut hasher);
    }
    hasher.finish()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn grid(values: &[f64]) -> Grid {
        Grid::new(2, values.len() / 2, values.to_vec()).unwrap()
    }

    #[test]
    fn missing_pixels_use_the_row_mean_then_the_cap() {
        let mut baseline = MeanDepthBaseline::new();
        baseline.add_scan(&grid(&[10.0, 0.0, 0.0, 0.0]));
        baseline.add_scan(&grid(&[20.0, 0.0, 0.0, 0.0]));
        let depth = baseline.depth_for(None).unwrap();
        assert_eq!(depth.values(), [15.0, 15.0, 80.0, 80.0]);
    }

    #[test]
    fn an_image_never_sees_its_own_scan() {
        let (a, b) = (grid(&[10.0, 0.0]), grid(&[20.0, 30.0]));
        let mut baseline = MeanDepthBaseline::new();
        baseline.add_scan(&a);
        baseline.add_scan(&b);
        baseline.add_scan(&b);
        assert_eq!(baseline.scans(), 2, "the same scan twice counts once");
        assert_eq!(baseline.depth_for(Some(&a)).unwrap().values(), [20.0, 30.0]);
        assert_eq!(baseline.depth_for(Some(&b)).unwrap().values(), [10.0, 10.0]);
        assert_eq!(
            baseline
                .depth_for(Some(&grid(&[1.0, 2.0])))
                .unwrap()
                .values(),
            [15.0, 30.0]
        );
    }

    #[test]
    fn scans_of_another_size_are_resampled_by_pixel_centre() {
        let mut baseline = MeanDepthBaseline::new();
        baseline.add_scan(&grid(&[0.0, 0.0, 0.0, 7.0]));
        let mut large = vec![0.0; 16];
        (large[0], large[15]) = (5.0, 9.0);
        baseline.add_scan(&Grid::new(4, 4, large).unwrap());
        assert_eq!(
            baseline.depth_for(None).unwrap().values(),
            [5.0, 5.0, 8.0, 8.0]
        );
    }

    #[test]
    fn without_scans_there_is_no_baseline() {
        assert!(MeanDepthBaseline::new().depth_for(None).is_err());
    }
}
