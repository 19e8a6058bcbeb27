//! The kernels as differentiable operations, against the same composed of Burn's operations: values
//! and gradients. On the CPU, or, with the feature `vulkan`, `wgpu`, `cuda` or `metal`, on a GPU.

#[cfg(any(feature = "vulkan", feature = "wgpu", feature = "metal"))]
use burn::tensor::DeviceKind;
use burn::tensor::{Device, Tensor, TensorData};
use deepfusion_kernels::AdamStep;
use deepfusion_nn::BilinearResize;
use deepfusion_nn::ops::{self, ConvOptions};
use std::cell::Cell;

/// Differences of two ways of summing the same few hundred products in f32.
const TOLERANCE: f32 = 2e-5;

/// The device on which the kernels are checked: of a build for several, `cuda` where `DEEPFUSION_TEST_DEVICE` says so.
fn device() -> Device {
    #[cfg(feature = "cuda")]
    if std::env::var("DEEPFUSION_TEST_DEVICE").is_ok_and(|name| name == "cuda") {
        return Device::cuda(0).autodiff();
    }
    #[cfg(feature = "vulkan")]
    return Device::vulkan(DeviceKind::DefaultDevice).autodiff();
    #[cfg(all(feature = "wgpu", not(feature = "vulkan")))]
    return Device::wgpu(DeviceKind::DefaultDevice).autodiff();
    #[cfg(all(feature = "cuda", not(any(feature = "vulkan", feature = "wgpu"))))]
    return Device::cuda(0).autodiff();
    #[cfg(all(feature = "metal", not(any(feature = "vulkan", feature = "wgpu"))))]
    return Device::metal(DeviceKind::DefaultDevice).autodiff();
    #[cfg(not(any(
        feature = "vulkan",
        feature = "wgpu",
        feature = "cuda",
        feature = "metal"
    )))]
    Device::flex().autodiff()
}

/// Values from -1 to 1 (SplitMix64), the same in every run: each test has a thread of its own, and Burn's generator is one for all threads.
fn random<const D: usize>(shape: [usize; D], device: &Device) -> Tensor<D> {
    thread_local! {
        static STATE: Cell<u64> = const { Cell::new(2026) };
    }
    let next = |_| {
        STATE.set(STATE.get().wrapping_add(0x9e37_79b9_7f4a_7c15));
        let mixed = STATE.get();
        let mixed = (mixed ^ (mixed >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let mixed = (mixed ^ (mixed >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((mixed ^ (mixed >> 31)) >> 40) as f32 / (1 << 23) as f32 - 1.0
    };
    let values: Vec<f32> = (0..shape.iter().product::<usize>()).map(next).collect();
    Tensor::from_data(TensorData::new(values, shape), device)
}

/// A copy on another device. What composed operations give is computed on the CPU, as Burn's own operations on a GPU are checked by nobody
/// here: its gradient of a convolution's weights was wrong above 32,768 pixels (WGSL, lavapipe).
fn on<const D: usize>(device: &Device, tensor: &Tensor<D>) -> Tensor<D> {
    Tensor::from_data(tensor.to_data(), device)
}

/// Where the kernels run, or, for what they are compared with, the CPU.
fn device_of(ours: bool) -> Device {
    if ours {
        device()
    } else {
        Device::flex().autodiff()
    }
}

fn assert_close<const D: usize>(what: &str, a: Tensor<D>, b: Tensor<D>) {
    let plain = Device::flex();
    let (a, b) = (on(&plain, &a), on(&plain, &b));
    assert_eq!(a.dims(), b.dims(), "{what}");
    let scale = b.clone().abs().max().into_scalar::<f32>().max(1.0);
    let difference = a.sub(b).abs().max().into_scalar::<f32>();
    assert!(
        difference < TOLERANCE * scale,
        "{what}: {difference} of {scale}"
    );
}

/// A weighted sum, so that every output has a gradient of its own.
fn weigh(output: Tensor<4>) -> Tensor<1> {
    let shape = output.dims();
    let count: usize = shape.iter().product();
    let weights: Vec<f32> = (0..count).map(|i| (i as f32 * 0.7).sin()).collect();
    let weights = Tensor::<1>::from_data(weights.as_slice(), &output.device());
    output.mul(weights.reshape(shape)).sum()
}

fn leaf<const D: usize>(tensor: &Tensor<D>) -> Tensor<D> {
    tensor.clone().require_grad()
}

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
        // Enough for the largest tiles, and a sum that is shared out.
        (1, 1, 0, false, [1, 66, 128, 260]),
        (1, 1, 0, false, [1, 48, 256, 260]),
        // As many channels as lie together where weights are taken tap by tap.
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

/// Each gradient where the other is not asked for, of tensors that are views.
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

/// Within `autocast` a convolution and its gradients see their numbers rounded to bf16, and nothing else changes; after it,
/// and on a processor without bf16, or a GPU without tensor cores for it, they do not.
#[test]
fn convolutions_within_autocast() {
    // Of a GPU's tensor cores: less than a tile; each size of tile, partly filled; sums in parts; the gradient of the weights tap by tap.
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
        // The gradients are asked for outside.
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
    assert_eq!(inner, before, "the inner one counts");
    assert_eq!(outside(&x), before, "nothing is left of it");
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

#[test]
fn gelu() {
    let x = random([2, 3, 40, 50], &device()).mul_scalar(6.0);
    let run = |ours: bool| {
        let x = leaf(&on(&device_of(ours), &x));
        let f = if ours { ops::gelu } else { ops::composed_gelu };
        let y = f(x.clone());
        let gradients = weigh(y.clone()).backward();
        (y.inner(), x.grad(&gradients).unwrap())
    };
    let (a, b) = (run(true), run(false));
    assert_close("gelu", a.0, b.0);
    assert_close("gelu x", a.1, b.1);
}

#[test]
fn end_of_a_residual_block() {
    let size = [2, 3, 40, 50];
    let (x, y) = (random(size, &device()), random(size, &device()));
    let run = |ours: bool| {
        let device = device_of(ours);
        let (x, y) = (leaf(&on(&device, &x)), leaf(&on(&device, &y)));
        let f = if ours {
            ops::add_relu
        } else {
            ops::composed_add_relu
        };
        let out = f(x.clone(), y.clone());
        let gradients = weigh(out.clone()).backward();
        let (gx, gy) = (x.grad(&gradients).unwrap(), y.grad(&gradients).unwrap());
        (out.inner(), gx, gy)
    };
    let (a, b) = (run(true), run(false));
    assert_close("sum", a.0, b.0);
    assert_close("of the first", a.1, b.1);
    assert_close("of the second", a.2, b.2);
    // NaN must come through.
    let none = x.clone().mul_scalar(f32::NAN);
    for sum in [
        ops::add_relu(none.clone(), y.clone()),
        ops::add_relu(y, none),
    ] {
        assert!(sum.into_data().iter::<f32>().all(f32::is_nan));
    }
}

#[test]
fn sigmoid() {
    let x = random([2, 1, 40, 50], &device()).mul_scalar(90.0);
    let run = |ours: bool| {
        let x = leaf(&on(&device_of(ours), &x));
        let f = if ours {
            ops::sigmoid
        } else {
            ops::composed_sigmoid
        };
        let y = f(x.clone());
        let gradients = weigh(y.clone()).backward();
        (y.inner(), x.grad(&gradients).unwrap())
    };
    let (a, b) = (run(true), run(false));
    assert_close("sigmoid", a.0, b.0);
    assert_close("sigmoid x", a.1, b.1);
}

/// Odd sizes, a single row, and many equal values, as behind a ReLU, of which the first has the gradient.
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

/// By the kernel of a GPU, against the matrix products of the processor.
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

#[test]
fn batch_normalisation() {
    let device = device();
    // The second has more pixels than a GPU's group has threads.
    for (size, relu) in [
        ([3, 4, 5, 6], false),
        ([3, 4, 5, 6], true),
        ([2, 3, 24, 31], true),
        // And more planes than groups along an axis.
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

/// Two steps of a parameter, and the norm that clips its gradient.
#[test]
fn adam_and_the_sum_of_squares() {
    let plain = device().inner();
    let (values, gradient) = (random([70_001], &plain), random([70_001], &plain));
    let mut tensors = vec![gradient.clone()];
    for count in 1..=14_usize {
        let sum = ops::sum_of_squares(&tensors).into_scalar::<f32>();
        let squares = tensors.iter().map(|tensor| {
            let squares = tensor.to_data();
            let squares = squares.iter::<f32>().map(|v| f64::from(v).powi(2));
            squares.sum::<f64>()
        });
        let exact: f64 = squares.sum();
        assert!(
            (f64::from(sum) / exact - 1.0).abs() < 1e-5,
            "{count} tensors: {sum} {exact}"
        );
        tensors.push(random([31 * count], &plain));
    }

    let run = |f: fn(&AdamStep, Tensor<1>, Tensor<1>, [Tensor<1>; 2]) -> _| {
        let moments = [values.zeros_like(), values.zeros_like()];
        let (mut values, mut moments): (Tensor<1>, [Tensor<1>; 2]) = (values.clone(), moments);
        for count in 1..=2 {
            let step = AdamStep {
                learning_rate: 0.01,
                beta1: 0.9,
                beta2: 0.999,
                epsilon: 1e-8,
                correction1: 1.0 - 0.9_f32.powi(count),
                correction2: 1.0 - 0.999_f32.powi(count),
                gradient_scale: 0.5,
                weight_decay: 0.1,
            };
            (values, moments) = f(&step, values, gradient.clone(), moments);
        }
        (values, moments)
    };
    let (values, [first, second]) = run(ops::adam);
    let (expected, [expected_first, expected_second]) = run(ops::composed_adam);
    assert_close("values", values, expected);
    assert_close("first moment", first, expected_first);
    assert_close("second moment", second, expected_second);
}

#[test]
fn pointwise_and_upsampling() {
    let device = device();
    let (x, skip) = (
        random([2, 3, 4, 5], &device),
        random([2, 2, 8, 10], &device),
    );
    let run = |ours: bool, with_skip: bool| {
        let (x, s) = (leaf(&x), leaf(&skip));
        let elu = if ours { ops::elu } else { ops::composed_elu };
        let join = if ours {
            ops::upsample_concat
        } else {
            ops::composed_upsample_concat
        };
        let y = join(elu(x.clone()), with_skip.then(|| s.clone()));
        let gradients = weigh(y.clone()).backward();
        (y.inner(), x.grad(&gradients).unwrap(), s.grad(&gradients))
    };
    for with_skip in [true, false] {
        let (a, b) = (run(true, with_skip), run(false, with_skip));
        assert_close("output", a.0, b.0);
        assert_close("x", a.1, b.1);
        assert_eq!(a.2.is_some(), with_skip);
        if let (Some(a), Some(b)) = (a.2, b.2) {
            assert_close("skip", a, b);
        }
    }
}

#[test]
fn warp_and_photometric_error() {
    for [height, width] in [[5, 7], [2, 2], [23, 33]] {
        warp_and_photometric_error_of(height, width);
    }
}

fn warp_and_photometric_error_of(height: usize, width: usize) {
    let device = device();
    let image = random([2, 3, 6, 8], &device).abs();
    let target = random([2, 3, height, width], &device).abs();
    // In view and out of it.
    let coords = random([2, 2, height, width], &device)
        .mul_scalar(5.0)
        .add_scalar(3.0);
    let run = |ours: bool| {
        let (i, c) = (leaf(&image), leaf(&coords));
        let warp = if ours { ops::warp } else { ops::composed_warp };
        let error = if ours {
            ops::photometric_error
        } else {
            ops::composed_photometric_error
        };
        let y = warp(i.clone(), c.clone());
        let e = error(y.clone(), target.clone(), 0.85);
        let gradients = weigh(e.clone()).backward();
        (
            y.inner(),
            e.inner(),
            i.grad(&gradients).unwrap(),
            c.grad(&gradients).unwrap(),
        )
    };
    let (a, b) = (run(true), run(false));
    assert_close("warp", a.0, b.0);
    assert_close("error", a.1, b.1);
    assert_close("image", a.2, b.2);
    assert_close("coords", a.3, b.3);
}

#[test]
fn local_correlation() {
    let device = device();
    // Smaller than the radius, and larger.
    for (size, radius) in [([2, 3, 2, 3], 4), ([2, 5, 9, 21], 2), ([1, 4, 6, 5], 0)] {
        let (first, second) = (random(size, &device), random(size, &device));
        let run = |ours: bool| {
            let (a, b) = (leaf(&first), leaf(&second));
            let f = if ours {
                ops::local_correlation
            } else {
                ops::composed_local_correlation
            };
            let y = f(a.clone(), b.clone(), radius);
            let gradients = weigh(y.clone()).backward();
            let (ga, gb) = (a.grad(&gradients), b.grad(&gradients));
            (y.inner(), ga.unwrap(), gb.unwrap())
        };
        let (a, b) = (run(true), run(false));
        assert_close("output", a.0, b.0);
        assert_close("first", a.1, b.1);
        assert_close("second", a.2, b.2);
    }
}

#[test]
fn projection_and_smoothness() {
    for [height, width] in [[5, 7], [24, 41]] {
        projection_and_smoothness_of(height, width);
    }
}

fn projection_and_smoothness_of(height: usize, width: usize) {
    let device = device();
    // Every third point lies behind the second camera. None is near its plane, where the projection is so steep
    // that two ways of rounding differ by more than the tolerance.
    let behind: Vec<f32> = (0..2 * height * width)
        .map(|i| if i % 3 == 0 { 0.75 } else { 0.05 })
        .collect();
    let behind = Tensor::<1>::from_data(behind.as_slice(), &device).reshape([2, 1, height, width]);
    let depth = random([2, 1, height, width], &device).abs().mul_scalar(0.3) + behind;
    // As much perspective in a large image as in a small one.
    let p = 5.0 / height as f32;
    let turn = Tensor::<3>::from_data(
        [
            [
                [1.0, 0.02, 0.5],
                [-0.01, 0.98, 0.3],
                [0.002 * p, -0.001 * p, 1.0],
            ],
            [
                [0.9, -0.03, 0.1],
                [0.02, 1.1, -0.4],
                [-0.01 * p, 0.03 * p, 1.0],
            ],
        ],
        &device,
    );
    let shift = Tensor::<2>::from_data([[3.0, -1.0, -0.5], [-2.0, 1.5, -2.0]], &device);
    let image = random([2, 3, height, width], &device);
    let run = |ours: bool| {
        let (d, h, s) = (leaf(&depth), leaf(&turn), leaf(&shift));
        let (coords, smooth) = if ours {
            (
                ops::project(d.clone(), h.clone(), s.clone()),
                ops::smoothness(d.clone(), image.clone()),
            )
        } else {
            (
                ops::composed_project(d.clone(), h.clone(), s.clone()),
                ops::composed_smoothness(d.clone(), image.clone()),
            )
        };
        let gradients = (weigh(coords.clone()) + smooth.clone()).backward();
        let view = ops::in_view(coords.clone(), [height, width])
            .float()
            .inner();
        (
            coords.inner(),
            smooth.inner(),
            view,
            d.grad(&gradients).unwrap(),
            h.grad(&gradients).unwrap(),
            s.grad(&gradients).unwrap(),
        )
    };
    let (a, b) = (run(true), run(false));
    assert_close("coords", a.0, b.0);
    assert_close("smoothness", a.1, b.1);
    assert_close("in view", a.2, b.2);
    assert_close("disparity", a.3, b.3);
    assert_close("homography", a.4, b.4);
    assert_close("shift", a.5, b.5);
}

/// Without autodiff the same operations run plainly.
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
