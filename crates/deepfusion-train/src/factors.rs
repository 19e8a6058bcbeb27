use burn::tensor::{Device, Tensor};
use deepfusion_model::SampleFactors;

use crate::Motion;

/// The factors that turn the networks' raw outputs into metres, for each sample of a batch from several data sets.
#[derive(Debug, Clone)]
pub struct BatchFactors {
    /// The set's metres per unit of translation over the pose network's own, B.
    pub translation: Tensor<1>,
    /// 1/D_max, B, in 1/m; D_max of the sample's own camera.
    pub nearest_zero: Tensor<1>,
    /// 1/D_min − 1/D_max, B, in 1/m.
    pub span: Tensor<1>,
}

impl BatchFactors {
    /// From the samples' factors; `unit_m` is the pose network's own metres per unit.
    #[must_use]
    pub fn new(samples: &[SampleFactors], unit_m: f64, device: &Device) -> Self {
        let tensor = |value: &dyn Fn(&SampleFactors) -> f64| {
            let values: Vec<f32> = samples.iter().map(|s| value(s) as f32).collect();
            Tensor::<1>::from_data(values.as_slice(), device)
        };
        let span = |s: &SampleFactors| 1.0 / s.range.min_m - 1.0 / s.range.max_m;
        Self {
            translation: tensor(&|s| s.metres_per_unit / unit_m),
            nearest_zero: tensor(&|s| 1.0 / (s.range.max_m * s.focal)),
            span: tensor(&|s| span(s) / s.focal),
        }
    }

    /// The factors of a network with a canonical focal length, for a camera whose f_y is `ratio` (one number) times as large: depth grows
    /// in proportion.
    #[must_use]
    pub(crate) fn refocused(&self, ratio: Tensor<1>) -> Self {
        Self {
            nearest_zero: self.nearest_zero.clone().div(ratio.clone()),
            span: self.span.clone().div(ratio),
            ..self.clone()
        }
    }

    /// Motions with their sets' unit of translation. T is B, or a multiple of it: the samples repeated.
    #[must_use]
    pub fn scale(&self, motion: &Motion) -> Motion {
        let [n, _] = motion.translation.dims();
        let factor = repeated(&self.translation, n).reshape([n, 1]);
        Motion {
            rotation: motion.rotation.clone(),
            translation: motion.translation.clone().mul(factor),
        }
    }

    /// Disparity, 1/m, of sigmoid disparities: d = 1/D_max + (1/D_min − 1/D_max)·σ with each sample's range.
    ///
    /// # Shapes
    /// - `sigmoid`, output: `[T, 1, H, W]`, T as in [`Self::scale`]
    #[must_use]
    pub fn metric_disparity(&self, sigmoid: Tensor<4>) -> Tensor<4> {
        let [n, ..] = sigmoid.dims();
        let of = |values: &Tensor<1>| repeated(values, n).reshape([n, 1, 1, 1]);
        sigmoid.mul(of(&self.span)).add(of(&self.nearest_zero))
    }
}

/// The values repeated until there are `n`.
fn repeated(values: &Tensor<1>, n: usize) -> Tensor<1> {
    let [len] = values.dims();
    match n / len.max(1) {
        1 => values.clone(),
        times => values.clone().repeat_dim(0, times),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use burn::tensor::TensorData;
    use deepfusion_geometry::DepthRange;

    const ROAD: DepthRange = DepthRange {
        min_m: 0.1,
        max_m: 90.0,
    };
    const GARAGE: DepthRange = DepthRange {
        min_m: 0.2,
        max_m: 30.0,
    };

    /// Each sample's depth and motion use its own set's factors, in both halves of a bidirectional batch.
    #[test]
    fn every_sample_has_its_own_factors() {
        let device = Device::flex();
        let sample = |range, metres_per_unit, focal| SampleFactors {
            range,
            metres_per_unit,
            focal,
        };
        let samples = [sample(ROAD, 1.2, 1.0), sample(GARAGE, 0.1, 2.0)];
        let factors = BatchFactors::new(&samples, 0.6, &device);
        let sigmoid = [0.0_f32, 1.0, 0.25, 0.5, 0.1, 0.9, 0.0, 1.0];
        let tensor = Tensor::from_data(TensorData::new(sigmoid.to_vec(), [4, 1, 1, 2]), &device);
        let found: Vec<f32> = factors
            .metric_disparity(tensor)
            .into_data()
            .iter()
            .collect();
        for (i, (found, sigmoid)) in found.iter().zip(sigmoid).enumerate() {
            let SampleFactors { range, focal, .. } = samples[(i / 2) % 2];
            let expected = range.disparity(f64::from(sigmoid)) / focal;
            assert!(
                (f64::from(*found) - expected).abs() < 1e-6 * expected,
                "{i}"
            );
        }
        let motion = Motion::new(
            Tensor::from_data([[0.1_f32, 0.0, 0.0]; 4], &device),
            Tensor::from_data([[0.0_f32, 0.3, -0.6]; 4], &device),
        );
        let scaled: Vec<f32> = factors
            .scale(&motion)
            .translation
            .into_data()
            .iter()
            .collect();
        for (i, z) in scaled.chunks(3).map(|t| t[2]).enumerate() {
            let metres = samples[i % 2].metres_per_unit;
            assert!((f64::from(z) + metres).abs() < 1e-6, "{z} and {metres}");
        }
    }
}
