//! The objective of the identification: the bicycle model against the gyro, with derivatives.

use super::fit::Observation;
use nalgebra::{SMatrix, SVector};

/// Allowed range of the ratio.
pub(super) const RATIO_RANGE: (f64, f64) = (0.7, 40.0);
/// Prior standard deviations of the steering's zero (at the road wheel, in radians) and of the gyro's bias (in rad/s). They keep the fit
/// finite if a drive at constant speed cannot separate the two, and are far larger than real values.
const ZERO_PRIOR_RAD: f64 = 0.1;
const BIAS_PRIOR_RADPS: f64 = 0.05;
/// Huber's constant: 95 % efficient for normal noise.
const HUBER: f64 = 1.345;
/// Smallest noise assumed for a gyro, in rad/s: it keeps weights finite on noiseless data.
const LEAST_SIGMA: f64 = 1e-7;
/// Parameters: ln(L·ρ), ln ρ, the zero at the road wheel s₀/ρ (rad), b (rad/s).
pub(super) type Parameters = SVector<f64, 4>;
pub(super) const PRODUCT: usize = 0;
pub(super) const RATIO: usize = 1;
pub(super) const ZERO: usize = 2;
pub(super) const BIAS: usize = 3;
/// The normal matrix of these parameters, or its inverse.
pub(super) type Covariance = SMatrix<f64, 4, 4>;

/// The observations and the fixed values.
pub(super) struct Problem<'a> {
    pub observations: &'a [Observation],
    pub understeer: f64,
    pub wheelbase: Option<f64>,
    pub ratio_is_known: bool,
}

impl Problem<'_> {
    /// ω − model, and the derivatives of the model.
    fn residual(&self, o: &Observation, p: &Parameters) -> (f64, Parameters) {
        let (product, ratio) = (p[PRODUCT].exp(), p[RATIO].exp());
        let x = o.steering / ratio - p[ZERO];
        let x = x.clamp(-1.4, 1.4);
        let gain = o.speed * ratio / (product * (1.0 + self.understeer * o.speed * o.speed));
        let turning = gain * x.tan();
        let slope = gain / x.cos().powi(2);
        let mut derivative =
            Parameters::new(-turning, turning - slope * o.steering / ratio, -slope, 1.0);
        if self.ratio_is_known {
            derivative[RATIO] = 0.0;
        } else if self.wheelbase.is_some() {
            // With a fixed wheelbase, the product follows the ratio.
            derivative[RATIO] += derivative[PRODUCT];
            derivative[PRODUCT] = 0.0;
        }
        if self.ratio_is_known && self.wheelbase.is_some() {
            derivative[PRODUCT] = 0.0;
        }
        (o.yaw_rate - turning - p[BIAS], derivative)
    }

    /// Parameters clamped to their ranges, and tied if the wheelbase is known.
    pub(super) fn allowed(&self, mut p: Parameters) -> Parameters {
        if !self.ratio_is_known {
            p[RATIO] = p[RATIO].clamp(RATIO_RANGE.0.ln(), RATIO_RANGE.1.ln());
        }
        if let Some(wheelbase) = self.wheelbase {
            p[PRODUCT] = p[RATIO] + wheelbase.max(1e-3).ln();
        }
        p[PRODUCT] = p[PRODUCT].clamp(-3.0, 8.0);
        p
    }

    fn weight(residual: f64, sigma: f64) -> f64 {
        let scaled = residual.abs() / sigma;
        if scaled <= HUBER { 1.0 } else { HUBER / scaled }
    }

    pub(super) fn sigma(&self, p: &Parameters) -> f64 {
        let mut sizes: Vec<f64> = self
            .observations
            .iter()
            .map(|o| self.residual(o, p).0.abs())
            .collect();
        let middle = sizes.len() / 2;
        let median = *sizes.select_nth_unstable_by(middle, f64::total_cmp).1;
        (1.4826 * median).max(LEAST_SIGMA)
    }

    /// Huber's loss divided by σ², plus the priors.
    pub(super) fn cost(&self, p: &Parameters, sigma: f64) -> f64 {
        let loss = |r: f64| {
            let scaled = r.abs() / sigma;
            if scaled <= HUBER {
                0.5 * scaled * scaled
            } else {
                HUBER * (scaled - 0.5 * HUBER)
            }
        };
        let data: f64 = self
            .observations
            .iter()
            .map(|o| loss(self.residual(o, p).0))
            .sum();
        data + 0.5 * (p[ZERO] / ZERO_PRIOR_RAD).powi(2) + 0.5 * (p[BIAS] / BIAS_PRIOR_RADPS).powi(2)
    }

    pub(super) fn normal_equations(&self, p: &Parameters, sigma: f64) -> (Covariance, Parameters) {
        let (mut normal, mut gradient) = (Covariance::zeros(), Parameters::zeros());
        for o in self.observations {
            let (residual, derivative) = self.residual(o, p);
            let weight = Self::weight(residual, sigma) / (sigma * sigma);
            normal += derivative * derivative.transpose() * weight;
            gradient += derivative * (residual * weight);
        }
        for (i, prior) in [(ZERO, ZERO_PRIOR_RAD), (BIAS, BIAS_PRIOR_RADPS)] {
            normal[(i, i)] += 1.0 / (prior * prior);
            gradient[i] -= p[i] / (prior * prior);
        }
        (normal, gradient)
    }

    /// The covariance of the free parameters; that of a fixed one is 0. With a known wheelbase, the product's equals the ratio's.
    pub(super) fn free_inverse(&self, normal: &Covariance) -> Option<Covariance> {
        let mut padded = *normal;
        let fixed = |i: usize| normal[(i, i)] == 0.0;
        for i in (0..4).filter(|i| fixed(*i)) {
            padded[(i, i)] = 1.0;
        }
        let mut inverse = padded.try_inverse()?;
        for i in (0..4).filter(|i| fixed(*i)) {
            inverse[(i, i)] = 0.0;
        }
        if self.wheelbase.is_some() && !self.ratio_is_known {
            let ratio = inverse[(RATIO, RATIO)];
            inverse[(PRODUCT, PRODUCT)] = ratio;
            inverse[(PRODUCT, RATIO)] = ratio;
            inverse[(RATIO, PRODUCT)] = ratio;
        }
        Some(inverse)
    }

    /// Factor by which correlated residuals widen the variance: (1 + r) / (1 − r), where r is the correlation of neighbouring residuals.
    pub(super) fn runs(&self, p: &Parameters) -> f64 {
        let residuals: Vec<f64> = self
            .observations
            .iter()
            .map(|o| self.residual(o, p).0)
            .collect();
        let square: f64 = residuals.iter().map(|r| r * r).sum();
        let neighbours: f64 = residuals.windows(2).map(|w| w[0] * w[1]).sum();
        let r = (neighbours / square.max(f64::MIN_POSITIVE)).clamp(0.0, 0.99);
        (1.0 + r) / (1.0 - r)
    }
}
