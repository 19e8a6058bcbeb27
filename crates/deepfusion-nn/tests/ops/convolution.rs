//! Convolutions, depthwise convolutions, and convolutions in bf16.

use super::common::{assert_close, device, device_of, leaf, on, random, weigh};
use burn::tensor::{Device, Tensor};
use deepfusion_nn::ops::{self, ConvOptions};

#[test]
fn convolution() {
    let device = device();
    let cases = [
        (3, 1, 1, true, [2, 5, 7, 9]),
        (3, 2, 1, false, [3, 4, 8, 11]),
        (7, 2, 3, false, [1, 3, 12, 10]),
        (1, 1, 0, false, [2, 6, 5, 5]),
        (1, 2, 0, false, [2, 6, 6, 7]),
        // More channels and pixels than a tile of a GPU's kernels has.
        (3, 1, 1, true, [2, 70, 9, 11]),
        (3, 2, 1, false, [3, 40, 24, 31]),
        // Enough for the largest tiles, and a sum that is divided into parts.
        (1, 1, 0, false, [1, 66, 128, 260]),
        (1, 1, 0, false, [1, 48, 256, 260]),
        // A number of channels for which the terms run tap by tap.
        (3, 1, 1, true, [2, 64, 9, 11]),
        (3, 2, 1, false, [1, 128, 14, 19]),
        (1, 1, 0, false, [1, 80, 128, 260]),
        (3, 1, 1, false, [1, 16, 40, 50]),
        (3, 1, 1, true, [1, 130, 4, 5]),
        (3, 1, 2, true, [1, 2, 6, 8]),
    ];
    for (kernel, stride, padding, reflect, size) in cases {
        for dilation in [1, 2] {
            if kernel == 1 && dilation == 2 {
                continue;
            }
            let padding = if dilation == 2 {
                padding.max(2)
            } else {
                padding
            };
            let options = ConvOptions {
                stride,
                padding,
                dilation,
                reflect,
                ..ConvOptions::default()
            };
            let out = if size[1] > 32 { size[1] } else { 4 };
            let (x, w) = (
                random(size, &device),
                random([out, size[1], kernel, kernel], &device),
            );
            let bias = random([out], &device);
            let run = |ours: bool| {
                let device = device_of(ours);
                let x = leaf(&on(&device, &x));
                let w = leaf(&on(&device, &w));
                let b = leaf(&on(&device, &bias));
                let f = if ours {
                    ops::conv2d
                } else {
                    ops::composed_conv2d
                };
                let y = f(x.clone(), w.clone(), Some(b.clone()), options);
                let gradients = weigh(y.clone()).backward();
                (
                    y.inner(),
                    x.grad(&gradients).unwrap(),
                    w.grad(&gradients).unwrap(),
                    b.grad(&gradients).unwrap(),
                )
            };
            let (a, b) = (run(true), run(false));
            let name = format!("{kernel}x{kernel} {options:?}");
            assert_close(&name, a.0, b.0);
            assert_close(&format!("{name} x"), a.1, b.1);
            assert_close(&format!("{name} weight"), a.2, b.2);
            assert_close(&format!("{name} bias"), a.3, b.3);
        }
    }
}

/// Each gradient without the other, for tensors that are views.
#[test]
fn one_gradient_of_a_convolution_alone() {
    let device = device();
    let (x, w) = (
        random([20, 8, 9, 2], &device),
        random([8, 16, 3, 3], &device),
    );
    let options = ConvOptions {
        padding: 1,
        reflect: true,
        ..ConvOptions::default()
    };
    let run = |ours: bool, of_input: bool| {
        let device = device_of(ours);
        let (x, w) = (on(&device, &x), on(&device, &w));
        let (x, w) = if of_input {
            (leaf(&x), w)
        } else {
            (x, leaf(&w))
        };
        let (image, kernels) = (x.clone().swap_dims(0, 3), w.clone().swap_dims(0, 1));
        let f = if ours {
            ops::conv2d
        } else {
            ops::composed_conv2d
        };
        let y = f(image, kernels, None, options);
        let gradients = weigh(y).backward();
        if of_input {
            x.grad(&gradients).unwrap()
        } else {
            w.grad(&gradients).unwrap()
        }
    };
    assert_close("x", run(true, true), run(false, true));
    assert_close("weight", run(true, false), run(false, false));
}

/// Within `autocast`, the inputs of a convolution and of its gradients are rounded to bf16, and nothing else changes. They are not rounded
/// afterwards, nor on a processor without bf16 or a GPU without tensor cores for it.
#[test]
fn convolutions_within_autocast() {
    // For a GPU's tensor cores: less than a tile; each size of tile, partly filled; sums in parts; the gradient of the weights tap by tap.
    for (size, out, stride, kernel) in [
        ([2, 32, 6, 9], 48, 1, 3),
        ([1, 32, 128, 260], 64, 1, 3),
        ([1, 48, 256, 260], 64, 1, 3),
        ([1, 16, 256, 260], 80, 1, 1),
        ([2, 48, 40, 66], 16, 1, 3),
        ([1, 32, 34, 70], 32, 2, 3),
        ([1, 144, 34, 70], 144, 2, 3),
        ([2, 64, 20, 30], 64, 1, 3),
        ([1, 128, 14, 19], 128, 1, 3),
    ] {
        convolutions_within_autocast_of(size, out, stride, kernel);
    }
}

fn convolutions_within_autocast_of(size: [usize; 4], out: usize, stride: usize, kernel: usize) {
    let device = device();
    let options = ConvOptions {
        padding: kernel / 2,
        stride,
        reflect: stride == 1,
        ..ConvOptions::default()
    };
    let rounded = |t: &Tensor<4>| {
        let data = t.clone().into_data();
        let values = data.iter::<f32>().map(|v| {
            let bits = v.to_bits();
            f32::from_bits((bits + 0x7fff + ((bits >> 16) & 1)) & 0xffff_0000)
        });
        let values: Vec<f32> = values.collect();
        Tensor::<1>::from_data(values.as_slice(), &device).reshape(t.dims())
    };
    let x = random(size, &device);
    let w = random([out, size[1], kernel, kernel], &device);
    let bias = random([out], &device);
    let [height, width] = [size[2], size[3]].map(|side| (side - 1) / stride + 1);
    let weights = random([size[0], out, height, width], &device);
    let run = |x: &Tensor<4>, w: &Tensor<4>, weights: &Tensor<4>, precision| {
        let (x, w) = (leaf(x), leaf(w));
        let y = ops::autocast(precision, || {
            ops::conv2d(x.clone(), w.clone(), Some(bias.clone()), options)
        });
        // The gradients are computed outside of `autocast`.
        let gradients = y.clone().mul(weights.clone()).sum().backward();
        let (gx, gw) = (x.grad(&gradients).unwrap(), w.grad(&gradients).unwrap());
        (y.inner(), gx, gw)
    };
    let (bf16, f32) = (ops::Precision::Bf16, ops::Precision::F32);
    let a = run(&x, &w, &weights, bf16);
    let b = if ops::supports(&device, bf16) {
        run(&rounded(&x), &rounded(&w), &rounded(&weights), f32)
    } else {
        run(&x, &w, &weights, f32)
    };
    assert_close("output", a.0, b.0);
    assert_close("x", a.1, b.1);
    assert_close("weight", a.2, b.2);

    let outside = |x: &Tensor<4>| ops::conv2d(x.clone(), w.clone(), None, options).into_data();
    let before = outside(&x);
    let inner = ops::autocast(bf16, || ops::autocast(f32, || outside(&x)));
    assert_eq!(inner, before, "the inner precision applies");
    assert_eq!(outside(&x), before, "the precision is restored");
}

#[test]
fn depthwise_convolution() {
    let device = device();
    for (size, kernel, dilation) in [
        ([2, 5, 7, 9], 3, 1),
        ([1, 3, 12, 10], 3, 3),
        ([2, 4, 4, 6], 3, 6),
        ([1, 2, 9, 5], 5, 2),
        ([2, 3, 130, 260], 3, 2),
    ] {
        let (x, w) = (
            random(size, &device),
            random([size[1], 1, kernel, kernel], &device),
        );
        let run = |ours: bool| {
            let device = device_of(ours);
            let (x, w) = (leaf(&on(&device, &x)), leaf(&on(&device, &w)));
            let f = if ours {
                ops::depthwise
            } else {
                ops::composed_depthwise
            };
            let y = f(x.clone(), w.clone(), dilation);
            let gradients = weigh(y.clone()).backward();
            let (gx, gw) = (x.grad(&gradients).unwrap(), w.grad(&gradients).unwrap());
            (y.inner(), gx, gw)
        };
        let (a, b) = (run(true), run(false));
        let name = format!("{size:?} {kernel} {dilation}");
        assert_close(&name, a.0, b.0);
        assert_close(&format!("{name} x"), a.1, b.1);
        assert_close(&format!("{name} weight"), a.2, b.2);
    }
}

/// Without autodiff the same kernels run.
#[test]
fn inference_runs_the_same_kernels() {
    let plain = Device::flex();
    let x = random([1, 3, 6, 6], &plain);
    let w = random([2, 3, 3, 3], &plain);
    let options = ConvOptions {
        padding: 1,
        ..ConvOptions::default()
    };
    let a = ops::conv2d(x.clone(), w.clone(), None, options);
    let b = ops::composed_conv2d(x, w, None, options);
    assert_close("conv", a, b);
}
