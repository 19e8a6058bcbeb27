//! The least squares behind the identification.

use super::{Estimate, IdentifyConfig};
use crate::Signal;
use nalgebra::{SMatrix, SVector};

/// The streams are averaged over this, in seconds: it takes off the noise of single samples and their
/// different rates, and no driver steers faster.
const STEP_S: f64 = 0.1;
/// Yaw rates below this are no turning, in rad/s.
const TURNING_RADPS: f64 = 0.03;
/// Ratios tried as a start, and how far they may move.
const RATIOS: [f64; 6] = [1.0, 8.0, 12.0, 16.0, 20.0, 25.0];
const RATIO_RANGE: (f64, f64) = (0.7, 40.0);
/// No road wheel turns further, in radians.
const LOCK_RAD: f64 = 1.1;
/// What is expected of the steering's zero (at the road wheel, in radians) and of the gyro's bias (in
/// rad/s) before anything is seen. It keeps the fit finite where a drive at one speed cannot tell them
/// apart, and is far wider than either is.
const ZERO_PRIOR_RAD: f64 = 0.1;
const BIAS_PRIOR_RADPS: f64 = 0.05;
/// Huber's constant: 95 % efficient on normal noise.
const HUBER: f64 = 1.345;
/// A gyro's noise is not below this, in rad/s: it keeps weights finite on noiseless data.
const LEAST_SIGMA: f64 = 1e-7;
const ITERATIONS: usize = 60;

/// Parameters: ln(L·ρ), ln ρ, the zero at the road wheel s₀/ρ (rad), b (rad/s).
type Parameters = SVector<f64, 4>;
const PRODUCT: usize = 0;
const RATIO: usize = 1;
const ZERO: usize = 2;
const BIAS: usize = 3;

/// A step of the drive.
#[derive(Debug, Clone, Copy)]
pub(super) struct Observation {
    speed: f64,
    steering: f64,
    yaw_rate: f64,
}

/// The three streams averaged over steps that all of them cover.
pub(super) fn observations(
    speed: &Signal,
    steering: &Signal,
    yaw_rate: &Signal,
) -> Vec<Observation> {
    let mut found = Vec::new();
    // Steps follow the samples, so that a time stamp gone astray costs one step, not a million.
    let mut from = f64::NEG_INFINITY;
    for &time in yaw_rate.times_s() {
        if time - from < STEP_S {
            continue;
        }
        let to = time + STEP_S;
        let mean = |signal: &Signal| Some(signal.integral(time, to)? / STEP_S);
        if let (Some(speed), Some(steering), Some(yaw_rate)) =
            (mean(speed), mean(steering), mean(yaw_rate))
        {
            found.push(Observation {
                speed,
                steering,
                yaw_rate,
            });
        }
        from = time;
    }
    found
}

pub(super) fn turning_s(observations: &[Observation]) -> f64 {
    let turning = |o: &&Observation| o.yaw_rate.abs() >= TURNING_RADPS;
    observations.iter().filter(turning).count() as f64 * STEP_S
}

/// The parameters that fit best, with their covariance.
pub(super) struct Fit {
    parameters: Parameters,
    covariance: SMatrix<f64, 4, 4>,
    /// −1 where the steering signal grows to the right.
    sign: f64,
    fixed_wheelbase: Option<f64>,
    /// Standard deviation of the residuals, robust, in rad/s.
    pub sigma: f64,
    /// Whether the ratio ran into the end of its range.
    pub at_the_edge: bool,
    cost: f64,
}

impl Fit {
    /// The best of the fits from several starts; `None` where none converges.
    pub fn best(observations: &[Observation], config: &IdentifyConfig) -> Option<Self> {
        let turning: f64 = observations
            .iter()
            .map(|o| o.speed * o.steering * o.yaw_rate)
            .sum();
        let sign = match config.steering_ratio {
            Some(ratio) => ratio.signum(),
            None => turning.signum(),
        };
        let observations: Vec<Observation> = observations
            .iter()
            .map(|o| Observation {
                steering: sign * o.steering,
                ..*o
            })
            .collect();
        let furthest = observations
            .iter()
            .map(|o| o.steering.abs())
            .fold(0.0, f64::max);
        let known = config.steering_ratio.map(|r| vec![r.abs()]);
        let starts = known.unwrap_or_else(|| RATIOS.to_vec());
        let fits = starts.iter().filter(|ratio| furthest / **ratio < LOCK_RAD);
        let fits = fits.filter_map(|ratio| Self::from_start(&observations, config, *ratio, sign));
        fits.min_by(|a, b| a.cost.total_cmp(&b.cost))
    }

    fn from_start(
        observations: &[Observation],
        config: &IdentifyConfig,
        ratio: f64,
        sign: f64,
    ) -> Option<Self> {
        let problem = Problem {
            observations,
            understeer: config.understeer_s2_per_m2,
            wheelbase: config.wheelbase_m,
            ratio_is_known: config.steering_ratio.is_some(),
        };
        let wheelbase = config.wheelbase_m.unwrap_or(2.7);
        let mut parameters = Parameters::new((wheelbase * ratio).ln(), ratio.ln(), 0.0, 0.0);
        let mut sigma = problem.sigma(&parameters);
        let mut damping = 1e-3;
        let mut cost = problem.cost(&parameters, sigma);
        for iteration in 0..ITERATIONS {
            let (normal, gradient) = problem.normal_equations(&parameters, sigma);
            let mut damped = normal;
            for i in 0..4 {
                damped[(i, i)] += damping * normal[(i, i)] + 1e-12;
            }
            let step = damped.cholesky()?.solve(&gradient);
            let next = problem.allowed(parameters + step);
            let next_cost = problem.cost(&next, sigma);
            if next_cost <= cost {
                let small = (next - parameters).norm() < 1e-10;
                (parameters, cost) = (next, next_cost);
                damping = (damping * 0.2f64).max(1e-9);
                // The scale of the noise follows the first rounds, then stays: else the robust
                // weights and the fit could chase each other.
                if iteration < 20 {
                    sigma = problem.sigma(&parameters);
                    cost = problem.cost(&parameters, sigma);
                }
                if small && iteration >= 5 {
                    break;
                }
            } else {
                damping *= 8.0;
            }
        }
        let (normal, _) = problem.normal_equations(&parameters, sigma);
        let inflation = problem.runs(&parameters);
        let covariance = problem.free_inverse(&normal)? * inflation;
        let ratio = parameters[RATIO].exp();
        Some(Self {
            at_the_edge: !problem.ratio_is_known
                && (ratio < RATIO_RANGE.0 * 1.01 || ratio > RATIO_RANGE.1 * 0.99),
            parameters,
            covariance,
            sign,
            fixed_wheelbase: config.wheelbase_m,
            sigma,
            // At one scale for all starts.
            cost: problem.cost(&parameters, 1.0),
        })
        .filter(|fit| fit.parameters.iter().all(|p| p.is_finite()))
    }

    fn variance(&self, direction: Parameters) -> f64 {
        (direction.transpose() * self.covariance * direction)[0].max(0.0)
    }

    pub fn product_m(&self) -> Estimate {
        let value = self.parameters[PRODUCT].exp();
        Estimate {
            value: self.sign * value,
            std_error: value * self.variance(Parameters::x()).sqrt(),
        }
    }

    pub fn steering_ratio(&self) -> Estimate {
        let value = self.parameters[RATIO].exp();
        Estimate {
            value: self.sign * value,
            std_error: value * self.variance(Parameters::y()).sqrt(),
        }
    }

    pub fn wheelbase_m(&self) -> Estimate {
        let value = (self.parameters[PRODUCT] - self.parameters[RATIO]).exp();
        let direction = Parameters::x() - Parameters::y();
        Estimate {
            value: self.fixed_wheelbase.unwrap_or(value),
            std_error: match self.fixed_wheelbase {
                Some(_) => 0.0,
                None => value * self.variance(direction).sqrt(),
            },
        }
    }

    pub fn steering_offset_rad(&self) -> Estimate {
        let ratio = self.parameters[RATIO].exp();
        Estimate {
            value: self.sign * ratio * self.parameters[ZERO],
            std_error: ratio * self.variance(Parameters::z()).sqrt(),
        }
    }

    pub fn yaw_rate_bias(&self) -> Estimate {
        Estimate {
            value: self.parameters[BIAS],
            std_error: self.variance(Parameters::w()).sqrt(),
        }
    }
}

/// The observations and what is held fixed.
struct Problem<'a> {
    observations: &'a [Observation],
    understeer: f64,
    wheelbase: Option<f64>,
    ratio_is_known: bool,
}

impl Problem<'_> {
    /// ω − model, and the model's derivatives.
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
            // The product moves with the ratio.
            derivative[RATIO] += derivative[PRODUCT];
            derivative[PRODUCT] = 0.0;
        }
        if self.ratio_is_known && self.wheelbase.is_some() {
            derivative[PRODUCT] = 0.0;
        }
        (o.yaw_rate - turning - p[BIAS], derivative)
    }

    /// Parameters within their range, and tied where the wheelbase is known.
    fn allowed(&self, mut p: Parameters) -> Parameters {
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

    fn sigma(&self, p: &Parameters) -> f64 {
        let mut sizes: Vec<f64> = self
            .observations
            .iter()
            .map(|o| self.residual(o, p).0.abs())
            .collect();
        let middle = sizes.len() / 2;
        let median = *sizes.select_nth_unstable_by(middle, f64::total_cmp).1;
        (1.4826 * median).max(LEAST_SIGMA)
    }

    /// Huber's loss over σ², and the priors.
    fn cost(&self, p: &Parameters, sigma: f64) -> f64 {
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

    fn normal_equations(&self, p: &Parameters, sigma: f64) -> (SMatrix<f64, 4, 4>, Parameters) {
        let (mut normal, mut gradient) = (SMatrix::<f64, 4, 4>::zeros(), Parameters::zeros());
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

    /// The covariance of the free parameters; a fixed one has none. With the wheelbase known, the
    /// product's is the ratio's.
    fn free_inverse(&self, normal: &SMatrix<f64, 4, 4>) -> Option<SMatrix<f64, 4, 4>> {
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

    /// By how much residuals that come in runs widen the variance: (1 + r) / (1 − r), r the
    /// correlation of neighbours.
    fn runs(&self, p: &Parameters) -> f64 {
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
