//! The range of some values, without outliers.

/// The smallest and the largest value after dropping one in `stray` at both ends; `None` without values. Changes the order of the values.
pub(crate) fn ends(values: &mut [f32], stray: usize) -> Option<[f32; 2]> {
    let stray = values.len() / stray;
    let last = values.len().checked_sub(1 + stray)?;
    Some([stray, last].map(|place| *values.select_nth_unstable_by(place, f32::total_cmp).1))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn outliers_at_both_ends_are_dropped() {
        let mut values: Vec<f32> = (0..40).rev().map(|x| x as f32).collect();
        assert_eq!(ends(&mut values, 20), Some([2.0, 37.0]));
        assert_eq!(ends(&mut values, 100), Some([0.0, 39.0]));
        assert_eq!(ends(&mut [3.0], 20), Some([3.0, 3.0]));
        assert_eq!(ends(&mut [], 20), None);
    }
}
