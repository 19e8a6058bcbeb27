/// Bilinear sampling with half-pixel centres, as OpenCV's `INTER_LINEAR`: destination pixel x lies at (x + ½)·source/destination − ½.
/// Border values are repeated beyond the border. No antialiasing.
#[derive(Debug, Clone)]
pub(crate) struct Axis(Vec<Tap>);

/// The two source pixels that contribute to a destination pixel, and the second one's weight.
#[derive(Debug, Clone, Copy)]
struct Tap {
    first: usize,
    second: usize,
    weight: f64,
}

impl Axis {
    /// Maps `destination` pixels to `source` pixels; both sizes are at least 1.
    pub(crate) fn new(source: usize, destination: usize) -> Self {
        let scale = source as f64 / destination as f64;
        let last = source - 1;
        Self(
            (0..destination)
                .map(|x| {
                    let at = ((x as f64 + 0.5) * scale - 0.5).clamp(0.0, last as f64);
                    let first = at.floor() as usize;
                    Tap {
                        first,
                        second: (first + 1).min(last),
                        weight: at - first as f64,
                    }
                })
                .collect(),
        )
    }
}

/// The resized value at (`x`, `y`); `values` is `width` wide. `None` if a contributing pixel is a hole.
pub(crate) fn sample(
    values: &[Option<f64>],
    width: usize,
    columns: &Axis,
    rows: &Axis,
    x: usize,
    y: usize,
) -> Option<f64> {
    let (column, row) = (columns.0[x], rows.0[y]);
    let on_row = |r: usize| {
        blend(
            values[r * width + column.first],
            values[r * width + column.second],
            column.weight,
        )
    };
    if row.weight == 0.0 {
        return on_row(row.first);
    }
    blend(on_row(row.first), on_row(row.second), row.weight)
}

/// a + (b − a)·weight; a value with weight 0 may be a hole.
fn blend(a: Option<f64>, b: Option<f64>, weight: f64) -> Option<f64> {
    if weight == 0.0 {
        return a;
    }
    Some(a? * (1.0 - weight) + b? * weight)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn resize(row: &[Option<f64>], width: usize) -> Vec<Option<f64>> {
        let (columns, rows) = (Axis::new(row.len(), width), Axis::new(1, 1));
        (0..width)
            .map(|x| sample(row, row.len(), &columns, &rows, x, 0))
            .collect()
    }

    #[test]
    fn doubling_weighs_three_to_one_and_repeats_the_border() {
        let out = resize(&[Some(0.0), Some(4.0)], 4);
        assert_eq!(out, vec![Some(0.0), Some(1.0), Some(3.0), Some(4.0)]);
    }

    #[test]
    fn the_same_size_changes_nothing() {
        let row = [Some(0.1), Some(7.0), None, Some(3.3)];
        assert_eq!(resize(&row, 4), row);
    }

    #[test]
    fn a_hole_spreads_only_to_pixels_it_contributes_to() {
        let out = resize(&[Some(1.0), None, Some(1.0), Some(1.0)], 8);
        let holes: Vec<bool> = out.iter().map(Option::is_none).collect();
        assert_eq!(holes, [false, true, true, true, true, false, false, false]);
    }
}
