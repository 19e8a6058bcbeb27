//! A map resampled to another size: bilinear, half-pixel centres.

/// Resamples from one size to another.
pub(crate) struct Resample {
    columns: Vec<Taps>,
    width: usize,
    height: usize,
    to_height: usize,
}

/// Indices of two neighbours, and the position between them, 0 to 1.
type Taps = (usize, usize, f32);

impl Resample {
    /// From `width` × `height` to another width and height.
    pub(crate) fn new((width, height): (usize, usize), to: (usize, usize)) -> Self {
        Self {
            columns: (0..to.0).map(|x| taps(x, to.0, width)).collect(),
            width,
            height,
            to_height: to.1,
        }
    }

    /// Writes row `y` of the resampled map into `row`, with `of` applied to each value.
    pub(crate) fn row(&self, values: &[f32], y: usize, of: impl Fn(f32) -> f32, row: &mut [f32]) {
        let (top, bottom, fy) = taps(y, self.to_height, self.height);
        let (top, bottom) = (top * self.width, bottom * self.width);
        for (resampled, &(left, right, fx)) in row.iter_mut().zip(&self.columns) {
            let d = values;
            let upper = d[top + left] + (d[top + right] - d[top + left]) * fx;
            let lower = d[bottom + left] + (d[bottom + right] - d[bottom + left]) * fx;
            *resampled = of(upper + (lower - upper) * fy);
        }
    }

    /// The whole resampled map.
    pub(crate) fn map(&self, values: &[f32]) -> Vec<f32> {
        let width = self.columns.len();
        let mut map = vec![0.0; width * self.to_height];
        for (y, row) in map.chunks_exact_mut(width.max(1)).enumerate() {
            self.row(values, y, |value| value, row);
        }
        map
    }
}

fn taps(i: usize, to: usize, from: usize) -> Taps {
    let p = (i as f32 + 0.5) * from as f32 / to as f32 - 0.5;
    let p = p.clamp(0.0, (from - 1) as f32);
    let low = (p as usize).min(from.saturating_sub(2));
    (low, (low + 1).min(from - 1), p - low as f32)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_plane_stays_a_plane_away_from_the_border() {
        let value = |x: f32, y: f32| 2.0 * x - 3.0 * y + 1.0;
        let map = |width: usize, height: usize| -> Vec<f32> {
            let centre = |i: usize, n: usize| (i as f32 + 0.5) / n as f32;
            let rows = (0..height).flat_map(|y| (0..width).map(move |x| (x, y)));
            rows.map(|(x, y)| value(centre(x, width), centre(y, height)))
                .collect()
        };
        let (from, to) = (map(8, 6), map(12, 4));
        let found = Resample::new((8, 6), (12, 4)).map(&from);
        for y in 0..4 {
            for x in 1..11 {
                let i = 12 * y + x;
                assert!((found[i] - to[i]).abs() < 1e-5, "{x} {y}");
            }
        }
        assert_eq!(Resample::new((8, 6), (8, 6)).map(&from), from);
    }
}
