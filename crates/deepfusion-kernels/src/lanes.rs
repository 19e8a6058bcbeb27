//! Sums with one partial sum per vector lane: fast, as the compiler keeps them in registers, and independent of the number of threads.

use num_traits::Float;

const LANES: usize = 16;

/// Σ a.
pub(crate) fn sum<T: Float>(a: &[T]) -> T {
    let mut lanes = [T::zero(); LANES];
    let (chunks, rest) = a.as_chunks::<LANES>();
    for chunk in chunks {
        for (lane, a) in lanes.iter_mut().zip(chunk) {
            *lane = *lane + *a;
        }
    }
    total(lanes.iter().chain(rest).copied())
}

/// Σ a·b.
pub(crate) fn sum_product<T: Float>(a: &[T], b: &[T]) -> T {
    let mut lanes = [T::zero(); LANES];
    let (chunks_a, rest_a) = a.as_chunks::<LANES>();
    let (chunks_b, rest_b) = b.as_chunks::<LANES>();
    for (a, b) in chunks_a.iter().zip(chunks_b) {
        for ((lane, a), b) in lanes.iter_mut().zip(a).zip(b) {
            *lane = *lane + *a * *b;
        }
    }
    let rest = rest_a.iter().zip(rest_b).map(|(a, b)| *a * *b);
    total(lanes.into_iter().chain(rest))
}

fn total<T: Float>(values: impl Iterator<Item = T>) -> T {
    values.fold(T::zero(), |sum, v| sum + v)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::noise::noise;

    #[test]
    fn sums_in_lanes_equal_plain_sums() {
        let (a, b) = (noise(1001, 3), noise(1001, 4));
        let exact: f64 = a.iter().sum();
        assert!((sum(&a) - exact).abs() < 1e-10);
        let exact: f64 = a.iter().zip(&b).map(|(a, b)| a * b).sum();
        assert!((sum_product(&a, &b) - exact).abs() < 1e-10);
    }
}
