//! The 3×3 mean with a mirrored border, and its adjoint.

use num_traits::Float;

fn third<T: Float>() -> T {
    T::one() / (T::one() + T::one() + T::one())
}

/// One row of the 3-tap mean along x, mirrored at its ends (index −1 is 1).
fn mean_row<T: Float>(from: &[T], to: &mut [T]) {
    let (n, third) = (from.len(), third::<T>());
    to[0] = (from[0] + from[1] + from[1]) * third;
    to[n - 1] = (from[n - 2] + from[n - 2] + from[n - 1]) * third;
    for (to, w) in to[1..n - 1].iter_mut().zip(from.windows(3)) {
        *to = (w[0] + w[1] + w[2]) * third;
    }
}

/// The adjoint of [`mean_row`].
fn adjoint_row<T: Float>(from: &[T], to: &mut [T]) {
    let (n, third) = (from.len(), third::<T>());
    to[0] = (from[0] + from[1]) * third;
    to[n - 1] = (from[n - 2] + from[n - 1]) * third;
    for (to, w) in to[1..n - 1].iter_mut().zip(from.windows(3)) {
        *to = (w[0] + w[1] + w[2]) * third;
    }
    to[1] = to[1] + from[0] * third;
    to[n - 2] = to[n - 2] + from[n - 1] * third;
}

/// The 3×3 mean of a plane of the given width, with a mirrored border. Planes are at least 2×2.
pub(crate) fn mean3x3<T: Float>(from: &[T], width: usize, rows: &mut [T], to: &mut [T]) {
    for (from, to) in from.chunks_exact(width).zip(rows.chunks_exact_mut(width)) {
        mean_row(from, to);
    }
    let (height, third) = (from.len() / width, third::<T>());
    for y in 0..height {
        let above = if y == 0 { 1 } else { y - 1 } * width;
        let below = if y + 1 == height { height - 2 } else { y + 1 } * width;
        let middle = &rows[y * width..][..width];
        let (above, below) = (&rows[above..][..width], &rows[below..][..width]);
        let to = &mut to[y * width..][..width];
        for (((to, a), m), b) in to.iter_mut().zip(above).zip(middle).zip(below) {
            *to = (*a + *m + *b) * third;
        }
    }
}

/// The adjoint of [`mean3x3`].
pub(crate) fn adjoint3x3<T: Float>(from: &[T], width: usize, rows: &mut [T], to: &mut [T]) {
    for (from, to) in from.chunks_exact(width).zip(rows.chunks_exact_mut(width)) {
        adjoint_row(from, to);
    }
    let (height, third) = (from.len() / width, third::<T>());
    for y in 0..height {
        // Row 1 was also read as the mirror of row −1, and row H−2 as the mirror of row H.
        let twice_above = if y == 1 { T::one() } else { T::zero() };
        let twice_below = if y + 2 == height { T::one() } else { T::zero() };
        let zero = T::zero();
        for x in 0..width {
            let above = if y > 0 {
                rows[(y - 1) * width + x]
            } else {
                zero
            };
            let below = if y + 1 < height {
                rows[(y + 1) * width + x]
            } else {
                zero
            };
            to[y * width + x] = (above * (T::one() + twice_above)
                + rows[y * width + x]
                + below * (T::one() + twice_below))
                * third;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// ⟨A·x, y⟩ = ⟨x, Aᵀ·y⟩ for every pair of unit vectors, on planes down to 2×2.
    #[test]
    fn the_adjoint_is_the_transpose() {
        for (w, h) in [(2, 2), (3, 2), (2, 5), (5, 4)] {
            let mut rows = vec![0.0f64; w * h];
            for i in 0..w * h {
                let mut unit = vec![0.0f64; w * h];
                unit[i] = 1.0;
                let mut column = vec![0.0; w * h];
                mean3x3(&unit, w, &mut rows, &mut column);
                for (j, value) in column.iter().enumerate() {
                    let mut unit = vec![0.0f64; w * h];
                    unit[j] = 1.0;
                    let mut row = vec![0.0; w * h];
                    adjoint3x3(&unit, w, &mut rows, &mut row);
                    assert!((value - row[i]).abs() < 1e-15, "{w}x{h} ({j}, {i})");
                }
                assert!((column.iter().sum::<f64>() - 1.0).abs() < 1.3);
            }
            let mut mean = vec![0.0; w * h];
            mean3x3(&vec![2.5; w * h], w, &mut rows, &mut mean);
            assert!(mean.iter().all(|v| (v - 2.5).abs() < 1e-12));
        }
    }
}
