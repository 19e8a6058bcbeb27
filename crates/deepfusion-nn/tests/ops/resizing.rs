//! Max pooling and enlargement.

use super::common::{assert_close, device, device_of, leaf, on, random, weigh};
use deepfusion_nn::BilinearResize;
use deepfusion_nn::ops;

/// Odd sizes, a single row, and many equal values, as after a ReLU, of which the first gets the gradient.
#[test]
fn max_pool() {
    for size in [[2, 3, 12, 16], [1, 2, 7, 9], [1, 1, 1, 5], [1, 1, 2, 1]] {
        let x = random(size, &device()).mul_scalar(3.0).round();
        let run = |ours: bool| {
            let x = leaf(&on(&device_of(ours), &x));
            let f = if ours {
                ops::max_pool_3x3_stride_2
            } else {
                ops::composed_max_pool_3x3_stride_2
            };
            let y = f(x.clone());
            let gradients = weigh(y.clone()).backward();
            (y.inner(), x.grad(&gradients).unwrap())
        };
        let (a, b) = (run(true), run(false));
        assert_close(&format!("{size:?}"), a.0, b.0);
        assert_close(&format!("{size:?} x"), a.1, b.1);
    }
}

/// A GPU's kernel against the processor's matrix products.
#[test]
fn bilinear_enlargement() {
    for (from, to) in [
        ([6, 20], [48, 160]),
        ([5, 7], [11, 29]),
        ([1, 3], [4, 3]),
        ([8, 8], [9, 8]),
    ] {
        let x = random([2, 3, from[0], from[1]], &device());
        let run = |ours: bool| {
            let device = device_of(ours);
            let x = leaf(&on(&device, &x));
            let y = BilinearResize::new(from, to, &device).apply(x.clone());
            let gradients = weigh(y.clone()).backward();
            (y.inner(), x.grad(&gradients).unwrap())
        };
        let (a, b) = (run(true), run(false));
        assert_close(&format!("{from:?} {to:?}"), a.0, b.0);
        assert_close(&format!("{from:?} {to:?} x"), a.1, b.1);
    }
}
