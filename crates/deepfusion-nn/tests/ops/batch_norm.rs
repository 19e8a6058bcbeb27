//! Batch normalisation and its running statistics.

use super::common::{assert_close, device, leaf, random, weigh};
use burn::tensor::Tensor;
use deepfusion_nn::ops;

#[test]
fn batch_normalisation() {
    let device = device();
    // The second size has more pixels than a GPU's group has threads.
    for (size, relu) in [
        ([3, 4, 5, 6], false),
        ([3, 4, 5, 6], true),
        ([2, 3, 24, 31], true),
        // More planes than groups along an axis.
        ([2, 40_000, 1, 2], false),
    ] {
        let x = random(size, &device);
        let [gamma, beta] = [(); 2].map(|()| random([size[1]], &device));
        let run = |ours: bool| {
            let (x, g, b) = (leaf(&x), leaf(&gamma), leaf(&beta));
            let f = if ours {
                ops::batch_norm
            } else {
                ops::composed_batch_norm
            };
            let out = f(x.clone(), g.clone(), b.clone(), 1e-5, relu);
            let gradients = weigh(out.output.clone()).backward();
            let grad = x.grad(&gradients).unwrap();
            let (gg, gb) = (g.grad(&gradients).unwrap(), b.grad(&gradients).unwrap());
            (
                out.output.inner(),
                grad,
                gg,
                gb,
                out.mean.inner(),
                out.variance.inner(),
            )
        };
        let (a, b) = (run(true), run(false));
        assert_close("output", a.0, b.0);
        assert_close("x", a.1, b.1);
        assert_close("gamma", a.2, b.2);
        assert_close("beta", a.3, b.3);
        assert_close("mean", a.4, b.4);
        assert_close("variance", a.5, b.5);
    }
}

#[test]
fn running_statistics() {
    let device = device();
    let [mean, variance, batch_mean, batch_variance] =
        [(); 4].map(|()| random([300], &device).abs());
    let run = |f: fn([Tensor<1>; 2], [Tensor<1>; 2], f64, f64) -> [Tensor<1>; 2]| {
        let batch = [batch_mean.clone(), leaf(&batch_variance)];
        f([mean.clone(), variance.clone()], batch, 0.1, 1.5)
    };
    let ours = run(ops::running_statistics);
    let [mean, variance] = run(ops::composed_running_statistics);
    let [our_mean, our_variance] = ours;
    assert_close("mean", our_mean, mean);
    assert_close("variance", our_variance, variance);
}
