//! Charts as self-contained inline SVG.

mod axis;
mod bars;
mod line;
mod scatter;

pub use axis::Svg;
pub use bars::BarChart;
pub use line::{LineChart, Series};
pub use scatter::ScatterChart;

/// Shares of `values` per bin of equal width from 0 to `to`, as the outline of a histogram; values beyond `to` are not
/// drawn but count in the shares.
#[must_use]
pub fn histogram(values: &[f64], to: f64, bins: usize) -> Vec<(f64, f64)> {
    if bins == 0 || !(to.is_finite() && to > 0.0) {
        return Vec::new();
    }
    let mut counts = vec![0usize; bins];
    for value in values.iter().filter(|v| **v >= 0.0 && **v < to) {
        let bin = (value / to * bins as f64) as usize;
        counts[bin.min(bins - 1)] += 1;
    }
    let total = values.len().max(1) as f64;
    let width = to / bins as f64;
    let corner = |(bin, count): (usize, &usize)| {
        let share = *count as f64 / total;
        let left = bin as f64 * width;
        [(left, share), (left + width, share)]
    };
    counts.iter().enumerate().flat_map(corner).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_histogram_counts_all_values_and_shows_those_inside() {
        let outline = histogram(&[0.1, 0.2, 1.5, 9.0], 2.0, 2);
        assert_eq!(outline, [(0.0, 0.5), (1.0, 0.5), (1.0, 0.25), (2.0, 0.25)]);
        assert!(histogram(&[1.0], f64::NAN, 4).is_empty() && histogram(&[1.0], 1.0, 0).is_empty());
        assert!(histogram(&[f64::NAN], 1.0, 2).iter().all(|p| p.1 == 0.0));
    }
}
