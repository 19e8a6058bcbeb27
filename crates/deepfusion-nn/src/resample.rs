use crate::ops;
use burn::tensor::{Device, Tensor, TensorData};

/// Differentiable bilinear resizing with half-pixel centres: a kernel of its own on a GPU, elsewhere two matrix products, out = A·X·Bᵀ.
///
/// The two matrices are the weights of the bilinear filter. For maps of one or two channels their products are cheaper than gathering four
/// neighbours.
#[derive(Debug, Clone)]
pub struct BilinearResize {
    from: [usize; 2],
    size: [usize; 2],
    /// A and Bᵀ; none on a GPU.
    matrices: Option<[Tensor<3>; 2]>,
}

impl BilinearResize {
    /// Resizes from `from` = [height, width] to `to`.
    #[must_use]
    pub fn new(from: [usize; 2], to: [usize; 2], device: &Device) -> Self {
        Self {
            from,
            size: to,
            matrices: (!ops::is_gpu(device)).then(|| matrices_of(from, to, device)),
        }
    }

    /// # Shapes
    /// - `x`: `[N, C, h, w]`, of the size `from`
    /// - output: `[N, C, H, W]`
    #[must_use]
    pub fn apply(&self, x: Tensor<4>) -> Tensor<4> {
        let [batch, channels, h, w] = x.dims();
        let n = batch * channels;
        let [height, width] = self.size;
        if [h, w] == self.size {
            return x;
        }
        if let Some(enlarged) = ops::enlarged_on_gpu(&x, self.size) {
            return enlarged;
        }
        let matrices = self.matrices.clone();
        let [rows, columns] =
            matrices.unwrap_or_else(|| matrices_of(self.from, self.size, &x.device()));
        let rows = rows.expand([n, height, h]);
        let columns = columns.expand([n, w, width]);
        rows.matmul(x.reshape([n, h, w]).matmul(columns))
            .reshape([batch, channels, height, width])
    }
}

/// A and Bᵀ.
fn matrices_of(from: [usize; 2], to: [usize; 2], device: &Device) -> [Tensor<3>; 2] {
    let along = |axis: usize| {
        let values = weights(from[axis], to[axis]);
        Tensor::from_data(TensorData::new(values, [1, to[axis], from[axis]]), device)
    };
    let columns: Tensor<3> = along(1);
    [along(0), columns.swap_dims(1, 2)]
}

/// Bilinear ×2 with half-pixel centres: each pixel becomes two along each axis, three quarters itself and a quarter its neighbour on that
/// side. A pixel at the border is its own neighbour. For many channels, for which [`BilinearResize`] is slower.
///
/// # Shapes
/// - `x`: `[N, C, h, w]`
/// - output: `[N, C, 2·h, 2·w]`
#[must_use]
pub fn doubled(x: Tensor<4>) -> Tensor<4> {
    doubled_along(doubled_along(x, 2), 3)
}

fn doubled_along(x: Tensor<4>, axis: usize) -> Tensor<4> {
    let sizes = x.dims();
    let n = sizes[axis];
    let (mut apart, mut joined) = ([1; 5], sizes);
    apart[..=axis].copy_from_slice(&sizes[..=axis]);
    apart[axis + 2..].copy_from_slice(&sizes[axis + 1..]);
    joined[axis] = 2 * n;
    // The outermost pixel repeated beyond both ends.
    let edge = |at: usize| x.clone().narrow(axis, at, 1);
    let wide = Tensor::cat(vec![edge(0), x.clone(), edge(n - 1)], axis);
    let own = x.clone().mul_scalar(0.75);
    let half = |at: usize| {
        let neighbour = wide.clone().narrow(axis, at, n).mul_scalar(0.25);
        own.clone().add(neighbour).reshape(apart)
    };
    Tensor::cat(vec![half(0), half(2)], axis + 1).reshape(joined)
}

/// The `to`×`from` matrix of the filter: source position (i + ½)·from/to − ½, clamped to the border.
fn weights(from: usize, to: usize) -> Vec<f32> {
    let mut matrix = vec![0.0; to * from];
    for (i, row) in matrix.chunks_exact_mut(from).enumerate() {
        let position = (i as f64 + 0.5) * from as f64 / to as f64 - 0.5;
        let position = position.clamp(0.0, (from - 1) as f64);
        let low = (position.floor() as usize).min(from - 1);
        let fraction = (position - low as f64) as f32;
        row[low] += 1.0 - fraction;
        row[(low + 1).min(from - 1)] += fraction;
    }
    matrix
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Computed by hand: 2 → 4 puts the centres at −¼, ¼, ¾, 1¼.
    #[test]
    fn centres_are_half_pixels() {
        let device = Device::flex();
        let resize = BilinearResize::new([1, 2], [1, 4], &device);
        let x = Tensor::<1>::from_data([0.0, 1.0], &device).reshape([1, 1, 1, 2]);
        let y: Vec<f32> = resize.apply(x).into_data().try_into_vec().unwrap();
        assert_eq!(y, [0.0, 0.25, 0.75, 1.0]);
    }

    #[test]
    fn doubling_is_the_bilinear_filter() {
        let device = Device::flex();
        for (height, width) in [(3, 5), (1, 4), (6, 2)] {
            let values: Vec<f32> = (0..6 * height * width)
                .map(|i| ((i * i) % 17) as f32)
                .collect();
            let x = Tensor::<1>::from_data(values.as_slice(), &device);
            let x = x.reshape([2, 3, height, width]);
            let resize = BilinearResize::new([height, width], [2 * height, 2 * width], &device);
            let apart = doubled(x.clone()).sub(resize.apply(x)).abs().max();
            assert!(apart.into_scalar::<f32>() < 1e-5);
        }
    }

    #[test]
    fn channels_and_images_stay_apart() {
        let device = Device::flex();
        let resize = BilinearResize::new([2, 1], [4, 2], &device);
        let values: Vec<f32> = (0..12).map(|i| (i * i) as f32).collect();
        let x = Tensor::<1>::from_data(values.as_slice(), &device).reshape([2, 3, 2, 1]);
        let y = resize.apply(x.clone());
        assert_eq!(y.dims(), [2, 3, 4, 2]);
        for (n, c) in [(0, 0), (0, 2), (1, 1)] {
            let one = |t: Tensor<4>| t.narrow(0, n, 1).narrow(1, c, 1);
            let alone = resize.apply(one(x.clone())).into_data();
            assert_eq!(one(y.clone()).into_data(), alone);
        }
    }
}
