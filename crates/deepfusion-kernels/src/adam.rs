use pulp::{Arch, Simd, WithSimd};
use rayon::prelude::*;

/// Number of values per task.
const CHUNK: usize = 1 << 15;

/// The settings of a step of Adam.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AdamStep {
    /// Learning rate α.
    pub learning_rate: f32,
    /// Decay β₁ of the first moment.
    pub beta1: f32,
    /// Decay β₂ of the second moment.
    pub beta2: f32,
    /// ε, added to √v̂.
    pub epsilon: f32,
    /// 1 − β₁ᵗ.
    pub correction1: f32,
    /// 1 − β₂ᵗ.
    pub correction2: f32,
    /// Factor that is applied to the gradient first.
    pub gradient_scale: f32,
    /// λ of AdamW: p ← p − α·λ·p in addition to Adam's step; 0 for Adam.
    pub weight_decay: f32,
}

/// One step of Adam in a single pass: m ← β₁m + (1 − β₁)g, v ← β₂v + (1 − β₂)g²,
/// p ← (1 − αλ)·p − α·(m/c₁)/(√(v/c₂) + ε) (Kingma and Ba, Algorithm 1; λ by Loshchilov and Hutter).
///
/// # Panics
/// If the lengths differ.
pub fn adam(
    step: &AdamStep,
    parameter: &mut [f32],
    gradient: &[f32],
    first: &mut [f32],
    second: &mut [f32],
) {
    let n = parameter.len();
    assert!(
        [gradient.len(), first.len(), second.len()] == [n; 3],
        "parameter, gradient and moments have the same length"
    );
    parameter
        .par_chunks_mut(CHUNK)
        .zip(gradient.par_chunks(CHUNK))
        .zip(
            first
                .par_chunks_mut(CHUNK)
                .zip(second.par_chunks_mut(CHUNK)),
        )
        .for_each(|((parameter, gradient), (first, second))| {
            Arch::new().dispatch(Update {
                step,
                parameter,
                gradient,
                first,
                second,
            });
        });
}

/// The step for a part of the values. The loop is compiled for each instruction set.
struct Update<'a> {
    step: &'a AdamStep,
    parameter: &'a mut [f32],
    gradient: &'a [f32],
    first: &'a mut [f32],
    second: &'a mut [f32],
}

impl WithSimd for Update<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        let s = *self.step;
        let keep = 1.0 - s.learning_rate * s.weight_decay;
        // One division and one square root per value. With three divisions, they would be the bottleneck instead of memory.
        let rate = s.learning_rate / s.correction1;
        let shrink = 1.0 / s.correction2.sqrt();
        let moments = self.first.iter_mut().zip(self.second);
        let values = self.parameter.iter_mut().zip(self.gradient);
        for ((p, g), (m, v)) in values.zip(moments) {
            let g = g * s.gradient_scale;
            *m = s.beta1 * *m + (1.0 - s.beta1) * g;
            *v = s.beta2 * *v + (1.0 - s.beta2) * g * g;
            let root = v.sqrt() * shrink + s.epsilon;
            *p = *p * keep - rate * *m / root;
        }
    }
}

/// The sum of squares, in f64 and in an order that does not depend on the number of threads.
#[must_use]
pub fn sum_of_squares(values: &[f32]) -> f64 {
    values
        .par_chunks(CHUNK)
        .map(|chunk| Arch::new().dispatch(Squares(chunk)))
        .collect::<Vec<_>>()
        .iter()
        .sum()
}

struct Squares<'a>(&'a [f32]);

impl WithSimd for Squares<'_> {
    type Output = f64;

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) -> f64 {
        let mut lanes = [0.0f64; 8];
        let (groups, rest) = self.0.as_chunks::<8>();
        for group in groups {
            for (lane, v) in lanes.iter_mut().zip(group) {
                *lane += f64::from(*v) * f64::from(*v);
            }
        }
        lanes.iter().sum::<f64>() + rest.iter().map(|v| f64::from(*v).powi(2)).sum::<f64>()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The first step moves every parameter by α against the sign of its gradient: m̂/√v̂ = ±1.
    #[test]
    fn the_first_step_has_the_length_of_the_learning_rate() {
        let (mut p, mut m, mut v) = ([1.0, 2.0], [0.0; 2], [0.0; 2]);
        let step = AdamStep {
            learning_rate: 0.1,
            beta1: 0.9,
            beta2: 0.999,
            epsilon: 1e-8,
            correction1: 0.1,
            correction2: 0.001,
            gradient_scale: 1.0,
            weight_decay: 0.0,
        };
        adam(&step, &mut p, &[3.0, -0.02], &mut m, &mut v);
        assert!(
            (p[0] - 0.9).abs() < 1e-5 && (p[1] - 2.1).abs() < 1e-5,
            "{p:?}"
        );
    }

    /// Without a gradient, a parameter shrinks by the factor 1 − αλ, whatever its value, and the moments stay.
    #[test]
    fn weight_decay_does_not_depend_on_the_gradient() {
        let (mut p, mut m, mut v) = ([1.0_f32, -200.0], [0.0; 2], [0.0; 2]);
        let step = AdamStep {
            learning_rate: 0.1,
            beta1: 0.9,
            beta2: 0.999,
            epsilon: 1e-8,
            correction1: 0.1,
            correction2: 0.001,
            gradient_scale: 1.0,
            weight_decay: 0.5,
        };
        adam(&step, &mut p, &[0.0; 2], &mut m, &mut v);
        assert!(
            (p[0] - 0.95).abs() < 1e-6 && (p[1] + 190.0).abs() < 1e-4,
            "{p:?}"
        );
        assert_eq!((m, v), ([0.0; 2], [0.0; 2]));
    }

    #[test]
    fn the_sum_of_squares_is_exact() {
        let values: Vec<f32> = (0..70_001).map(|i| (i % 10) as f32).collect();
        let exact: f64 = values.iter().map(|v| f64::from(*v).powi(2)).sum();
        assert_eq!(sum_of_squares(&values), exact);
    }
}
