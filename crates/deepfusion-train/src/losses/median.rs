//! Medians of images' pixels.

use burn::tensor::{Int, Tensor};
use deepfusion_nn::ops::is_cpu;

/// How often [`by_counting`] halves the range in which a median lies.
const HALVINGS: usize = 40;

/// The median of each row's values inside; of an even number of values the upper one of the middle two. A row without values inside gives
/// its first value.
///
/// # Shapes
/// - `values`, `inside`: `[N, H·W]`, images of width `width`; `inside` is 1 or 0
/// - output: `[N, 1]`
pub(super) fn medians(values: &Tensor<2>, inside: &Tensor<2>, width: usize) -> Tensor<2> {
    if is_cpu(&values.device()) {
        by_selection(values, inside)
    } else {
        by_counting(values, inside, width)
    }
}

/// By selection in main memory, for values on the processor.
fn by_selection(values: &Tensor<2>, inside: &Tensor<2>) -> Tensor<2> {
    let [n, pixels] = values.dims();
    let device = values.device().inner();
    let read = |t: &Tensor<2>| -> Vec<f32> { t.clone().into_data().iter::<f32>().collect() };
    let (plain, inside) = (read(values), read(inside));
    let rows = plain.chunks_exact(pixels).zip(inside.chunks_exact(pixels));
    let places: Vec<i64> = rows
        .map(|(row, inside)| {
            let mut kept: Vec<usize> = (0..pixels).filter(|i| inside[*i] > 0.5).collect();
            if kept.is_empty() {
                return 0;
            }
            let middle = kept.len() / 2;
            let by_value = |a: &usize, b: &usize| row[*a].total_cmp(&row[*b]);
            *kept.select_nth_unstable_by(middle, by_value).1 as i64
        })
        .collect();
    let places = Tensor::<1, Int>::from_data(places.as_slice(), &device);
    values.clone().gather(1, places.reshape([n, 1]))
}

/// By tensor operations, so that nothing leaves a GPU. Burn's own sort would read a GPU's values and sort them on the processor.
///
/// The range of the values is halved repeatedly: the number of values up to its middle decides which half contains the median. If the
/// median is at least 2⁻¹⁴ of the largest value, the last range contains the median alone, in single precision. If it is smaller, the
/// result may be another value inside, less than 2⁻³⁸ of the largest value away. Values inside must be finite and fewer than 2²⁴.
fn by_counting(values: &Tensor<2>, inside: &Tensor<2>, width: usize) -> Tensor<2> {
    let [n, pixels] = values.dims();
    let images = |t: &Tensor<2>| t.clone().reshape([n, pixels / width, width]);
    // Along the images' rows first: a GPU has a thread for each of them, so there are many threads.
    let sum = |t: Tensor<3>| t.sum_dim(2).sum_dim(1);
    let least = |t: Tensor<3>| t.min_dim(2).min_dim(1);
    let most = |t: Tensor<3>| t.max_dim(2).max_dim(1);

    let count = sum(images(inside));
    let outside = images(inside).lower_elem(0.5);
    // More than half of the values are at most the median: floor(count / 2) + 1 or more.
    let half = count.clone().mul_scalar(0.5);
    let kept = images(values).mask_fill(outside.clone(), f32::MAX);
    let lowest = least(kept.clone());
    // Below all values, so that the median is above `low` and at most `high` from the start.
    let below = lowest.clone().abs().mul_scalar(0.5);
    let mut low = lowest - below.add_scalar(f32::MIN_POSITIVE);
    let mut high = most(images(values).mask_fill(outside, f32::MIN));
    for _ in 0..HALVINGS {
        let middle = (low.clone() + high.clone()).mul_scalar(0.5);
        let up_to_it = sum(kept.clone().lower_equal(middle.clone()).float());
        let reached = up_to_it.greater(half.clone());
        high = high.mask_where(reached.clone(), middle.clone());
        low = middle.mask_where(reached, low);
    }
    let lower = kept.clone().lower_equal(low);
    let median = least(kept.mask_fill(lower, f32::MAX)).reshape([n, 1]);
    let empty = count.reshape([n, 1]).lower_elem(0.5);
    median.mask_where(empty, values.clone().narrow(1, 0, 1))
}

#[cfg(test)]
mod tests {
    use super::*;
    use burn::tensor::{Device, TensorData};

    const WIDTH: usize = 6;
    const PIXELS: usize = 24;

    /// Depths, and which of these pixels count.
    type Row = (Vec<f32>, Vec<f32>);

    fn rows() -> Vec<Row> {
        let depths = |seed: usize| -> Vec<f32> {
            let number = |i: usize| (i * 7919 + seed * 104_729) % 1013;
            (0..PIXELS).map(|i| 0.5 + 0.1 * number(i) as f32).collect()
        };
        let first = |count: usize| -> Vec<f32> {
            (0..PIXELS)
                .map(|i| if i < count { 1.0 } else { 0.0 })
                .collect()
        };
        let every_third = (0..PIXELS).map(|i| if i % 3 == 1 { 1.0 } else { 0.0 });
        let repeated = (0..PIXELS).map(|i| [3.0, 3.0, 9.0, 1.0][i % 4]);
        let scattered = depths(7).into_iter().enumerate();
        // Values outside may be any finite number.
        let wild = scattered.map(|(i, d)| if i < 11 { d } else { 1e30 });
        let around_zero = depths(5).into_iter().map(|d| d - 50.0);
        let mut rows = vec![
            (depths(0), first(0)),
            (vec![0.0; PIXELS], first(0)),
            (depths(3), every_third.collect()),
            (repeated.clone().collect(), first(PIXELS)),
            (repeated.collect(), first(PIXELS - 1)),
            (vec![0.0; PIXELS], first(PIXELS)),
            (vec![20.0; PIXELS], first(9)),
            (wild.collect(), first(11)),
            (around_zero.collect(), first(17)),
            (
                (0..PIXELS).map(|i| 1.5_f32.powi(i as i32 - 8)).collect(),
                first(PIXELS),
            ),
        ];
        rows.extend((1..=PIXELS).map(|count| (depths(count), first(count))));
        rows
    }

    /// Counting finds the same median as selection, for even and odd numbers of values, equal values, one value and none.
    #[test]
    fn counting_and_selection_find_the_same_median() {
        let rows = rows();
        for device in [Device::flex(), Device::flex().autodiff()] {
            let tensor = |part: &dyn Fn(&Row) -> Vec<f32>| {
                let values: Vec<f32> = rows.iter().flat_map(part).collect();
                Tensor::<2>::from_data(TensorData::new(values, [rows.len(), PIXELS]), &device)
            };
            let (values, inside) = (tensor(&|row| row.0.clone()), tensor(&|row| row.1.clone()));
            let read = |t: Tensor<2>| -> Vec<f32> { t.into_data().iter().collect() };
            let selected = read(by_selection(&values, &inside));
            let counted = read(by_counting(&values, &inside, WIDTH));
            assert_eq!(selected, counted);
            assert_eq!(selected, read(medians(&values, &inside, WIDTH)));
            // The upper one of the middle two; the first value where no pixel is inside.
            for ((values, inside), found) in rows.iter().zip(counted) {
                let pixels = values.iter().zip(inside);
                let mut kept: Vec<f32> =
                    pixels.filter(|(_, i)| **i > 0.0).map(|(v, _)| *v).collect();
                kept.sort_by(f32::total_cmp);
                let expected = kept.get(kept.len() / 2).unwrap_or(&values[0]);
                assert_eq!(found, *expected, "{kept:?}");
            }
        }
    }
}
