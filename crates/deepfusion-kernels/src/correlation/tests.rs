use super::*;
use crate::noise::noise32;
use pulp::{Simd, WithSimd};

const fn shape(channels: usize, height: usize, width: usize, radius: usize) -> CorrelationShape {
    CorrelationShape {
        channels,
        height,
        width,
        radius,
    }
}

/// Shapes for blocks of every size; images smaller than the radius, narrower and wider than a vector.
const SHAPES: [CorrelationShape; 8] = [
    shape(1, 1, 1, 4),
    shape(3, 4, 4, 4),
    shape(5, 2, 37, 1),
    shape(31, 6, 20, 4),
    shape(2, 7, 16, 3),
    shape(8, 3, 10, 0),
    shape(16, 9, 33, 2),
    shape(1, 5, 50, 6),
];
const BATCH: usize = 2;

impl CorrelationShape {
    fn len(&self) -> usize {
        BATCH * self.channels * self.area()
    }

    fn out_len(&self) -> usize {
        BATCH * self.displacements() * self.area()
    }

    /// Calls `visit(output, pixel of the first image, pixel of the second)` for every product of the definition.
    fn for_products(&self, mut visit: impl FnMut(usize, usize, usize)) {
        let (h, w) = (self.height as isize, self.width as isize);
        let r = self.radius as isize;
        let mut out = 0;
        for n in 0..BATCH {
            for dy in -r..=r {
                for dx in -r..=r {
                    for p in 0..h * w {
                        let (y, x) = (p / w + dy, p % w + dx);
                        if (0..h).contains(&y) && (0..w).contains(&x) {
                            for c in 0..self.channels {
                                let plane = (n * self.channels + c) * self.area();
                                let other = plane + (y * w + x) as usize;
                                visit(out, plane + p as usize, other);
                            }
                        }
                        out += 1;
                    }
                }
            }
        }
    }
}

fn assert_close(what: &str, shape: CorrelationShape, ours: &[f32], exact: &[f64]) {
    assert_eq!(ours.len(), exact.len());
    for (i, (ours, exact)) in ours.iter().zip(exact).enumerate() {
        // Some hundred products below 1/4 in f32.
        let close = (f64::from(*ours) - exact).abs() < 2e-6;
        assert!(close, "{what} {i} of {shape:?}: {ours} for {exact}");
    }
}

/// Outputs and gradients overwrite garbage and are compared with loops in f64.
#[test]
fn values_and_gradients_equal_the_definition() {
    for shape in SHAPES {
        let (a, b) = (noise32(shape.len(), 1), noise32(shape.len(), 2));
        let grad = noise32(shape.out_len(), 3);
        let (mut out, mut grad_a) = (vec![0.0; shape.out_len()], vec![0.0; shape.len()]);
        let mut grad_b = grad_a.clone();
        shape.for_products(|o, p, q| {
            let of = |v: &[f32], i: usize| f64::from(v[i]) / shape.channels as f64;
            out[o] += of(&a, p) * f64::from(b[q]);
            grad_a[p] += of(&grad, o) * f64::from(b[q]);
            grad_b[q] += of(&grad, o) * f64::from(a[p]);
        });
        let mut ours = vec![f32::NAN; shape.out_len()];
        local_correlation(&shape, &a, &b, &mut ours);
        assert_close("output", shape, &ours, &out);
        let mut ours = vec![f32::NAN; shape.len()];
        local_correlation_backward_first(&shape, &b, &grad, &mut ours);
        assert_close("first gradient", shape, &ours, &grad_a);
        ours.fill(f32::NAN);
        local_correlation_backward_second(&shape, &a, &grad, &mut ours);
        assert_close("second gradient", shape, &ours, &grad_b);
    }
}

/// The correlation is linear in each image, so differences over a large step equal the gradient, there are no kinks, and f32 is precise
/// enough.
#[test]
fn gradients_equal_finite_differences() {
    for shape in [shape(3, 4, 5, 2), shape(2, 3, 18, 4)] {
        let (a, b) = (noise32(shape.len(), 4), noise32(shape.len(), 5));
        let weights = noise32(shape.out_len(), 6);
        let loss = |a: &[f32], b: &[f32]| {
            let mut out = vec![f32::NAN; shape.out_len()];
            local_correlation(&shape, a, b, &mut out);
            let terms = out.iter().zip(&weights);
            terms
                .map(|(o, w)| f64::from(*o) * f64::from(*w))
                .sum::<f64>()
        };
        let difference = |v: &[f32], i: usize, loss: &dyn Fn(&[f32]) -> f64| {
            let mut moved = v.to_vec();
            moved[i] += 1.0;
            let up = loss(&moved);
            moved[i] -= 2.0;
            (up - loss(&moved)) / 2.0
        };
        let mut gradient = vec![f32::NAN; shape.len()];
        local_correlation_backward_first(&shape, &b, &weights, &mut gradient);
        let exact: Vec<f64> = (0..shape.len())
            .map(|i| difference(&a, i, &|a| loss(a, &b)))
            .collect();
        assert_close("first", shape, &gradient, &exact);
        local_correlation_backward_second(&shape, &a, &weights, &mut gradient);
        let exact: Vec<f64> = (0..shape.len())
            .map(|i| difference(&b, i, &|b| loss(&a, b)))
            .collect();
        assert_close("second", shape, &gradient, &exact);
    }
}

/// An image of noise and a shifted copy: at the displacement of the shift, the correlation is the mean square.
#[test]
fn a_shift_is_found_where_it_was_made() {
    let shape = shape(4, 12, 20, 4);
    let first = noise32(4 * 240, 7);
    let mut second = vec![0.0; first.len()];
    let (dx, dy) = (3, -2_isize);
    for c in 0..4 {
        for y in 2..12 {
            for x in 0..17 {
                let to = (y as isize + dy) as usize * 20 + x + dx;
                second[c * 240 + to] = first[c * 240 + y * 20 + x];
            }
        }
    }
    let mut out = vec![f32::NAN; 81 * 240];
    local_correlation(&shape, &first, &second, &mut out);
    let channel = (dy + 4) as usize * 9 + dx + 4;
    for (y, x) in [(2, 0), (5, 9), (11, 16)] {
        let p = y * 20 + x;
        let square: f32 = (0..4).map(|c| first[c * 240 + p].powi(2)).sum::<f32>() / 4.0;
        assert!((out[channel * 240 + p] - square).abs() < 1e-7);
    }
    // A pixel of the first row; this displacement reads two rows above it.
    assert_eq!(out[channel * 240 + 7], 0.0, "out of the image");
}

/// The width of the vectors determines how many sums are computed at once, but not their order.
#[test]
fn every_instruction_set_gives_the_same_bits() {
    struct Both<'a>(RowCorrelation<'a>, DisplacementSums<'a>);
    impl WithSimd for Both<'_> {
        type Output = ();
        #[inline(always)]
        fn with_simd<S: Simd>(self, simd: S) {
            self.0.with_simd(simd);
            self.1.with_simd(simd);
        }
    }
    // 31 channels and 3 + 2 displacements: blocks of every size.
    let shape = shape(31, 1, 20, 2);
    let (a, b) = (
        noise32(31 * shape.plane(), 8),
        noise32(31 * shape.plane(), 9),
    );
    let taps: Vec<_> = (0..25).map(|d| (d * 11 % 29, d % 5)).collect();
    let on = |run: &dyn Fn(Both)| {
        let (mut out, mut sums) = (vec![0.0; 25 * 20], vec![0.0; 31 * 20]);
        let row = RowCorrelation {
            shape: &shape,
            pairs: &[(2, 200)],
            first: &a,
            second: &b,
            out: SharedMut::new(&mut out),
        };
        let gradient = DisplacementSums {
            shape: &shape,
            taps: &taps,
            grad: &a,
            other: &b,
            out: SharedMut::new(&mut sums),
            start: 0,
        };
        run(Both(row, gradient));
        out.extend(sums);
        out
    };
    let dispatched = on(&|both| Arch::new().dispatch(both));
    assert!(dispatched.iter().filter(|v| **v != 0.0).count() >= 720);
    assert!(on(&|both| Simd::vectorize(pulp::Scalar::new(), both)) == dispatched);
    #[cfg(target_arch = "x86_64")]
    {
        if let Some(v3) = pulp::x86::V3::try_new() {
            assert!(on(&|both| Simd::vectorize(v3, both)) == dispatched, "AVX2");
        }
        if let Some(v4) = pulp::x86::V4::try_new() {
            assert!(
                on(&|both| Simd::vectorize(v4, both)) == dispatched,
                "AVX-512"
            );
        }
    }
}
