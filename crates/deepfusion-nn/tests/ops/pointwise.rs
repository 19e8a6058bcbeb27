//! Pointwise operations: activations, sums, joined maps.

use super::common::{assert_close, device, device_of, leaf, on, random, weigh};
use deepfusion_nn::ops;

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
    // NaN must be preserved.
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
