//! Operations between two views: projection, warping, photometric error, correlation.

use super::common::{assert_close, device, leaf, random, weigh};
use burn::tensor::Tensor;
use deepfusion_nn::ops;

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
    // Coordinates inside and outside the view.
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
    // Every third point lies behind the second camera. None is near the camera's plane, where the projection is so steep that rounding
    // differences exceed the tolerance.
    let behind: Vec<f32> = (0..2 * height * width)
        .map(|i| if i % 3 == 0 { 0.75 } else { 0.05 })
        .collect();
    let behind = Tensor::<1>::from_data(behind.as_slice(), &device).reshape([2, 1, height, width]);
    let depth = random([2, 1, height, width], &device).abs().mul_scalar(0.3) + behind;
    // The same amount of perspective in a large image as in a small one.
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
