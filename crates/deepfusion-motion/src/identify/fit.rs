//! The least-squares fit of the identification.

use super::problem::{BIAS, Covariance, PRODUCT, Parameters, Problem, RATIO, RATIO_RANGE, ZERO};
use super::{Estimate, IdentifyConfig};
use crate::Signal;

/// The streams are averaged over this time, in seconds. That removes the noise of single samples and the difference between the sample
/// rates, and no driver steers faster.
const STEP_S: f64 = 0.1;
/// Smallest yaw rate that counts as turning, in rad/s.
const TURNING_RADPS: f64 = 0.03;
/// Ratios from which the fit starts.
const RATIOS: [f64; 6] = [1.0, 8.0, 12.0, 16.0, 20.0, 25.0];
/// Largest angle of a road wheel, in radians.
const LOCK_RAD: f64 = 1.1;
const ITERATIONS: usize = 60;

/// The mean measurements over one time step of the drive.
#[derive(Debug, Clone, Copy)]
pub(super) struct Observation {
    pub speed: f64,
    pub steering: f64,
    pub yaw_rate: f64,
}

/// The three streams averaged over the time steps that all of them cover.
pub(super) fn observations(
    speed: &Signal,
    steering: &Signal,
    yaw_rate: &Signal,
) -> Vec<Observation> {
    let mut found = Vec::new();
    // Steps follow the samples, so that a wrong time stamp costs one step, not a million.
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
    covariance: Covariance,
    /// −1 if the steering signal grows to the right.
    sign: f64,
    fixed_wheelbase: Option<f64>,
    /// Robust standard deviation of the residuals, in rad/s.
    pub sigma: f64,
    /// Whether the ratio reached a limit of its range.
    pub at_the_edge: bool,
    cost: f64,
}

impl Fit {
    /// The best of the fits from several starts; `None` if none converges.
    pub(super) fn best(observations: &[Observation], config: &IdentifyConfig) -> Option<Self> {
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
                // The noise level is estimated in the first rounds and then fixed: otherwise the robust weights and the fit might never
                // settle.
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
            // At the same noise level for all starts.
            cost: problem.cost(&parameters, 1.0),
        })
        .filter(|fit| fit.parameters.iter().all(|p| p.is_finite()))
    }

    fn variance(&self, direction: Parameters) -> f64 {
        (direction.transpose() * self.covariance * direction)[0].max(0.0)
    }

    pub(super) fn product_m(&self) -> Estimate {
        let value = self.parameters[PRODUCT].exp();
        Estimate {
            value: self.sign * value,
            std_error: value * self.variance(Parameters::x()).sqrt(),
        }
    }

    pub(super) fn steering_ratio(&self) -> Estimate {
        let value = self.parameters[RATIO].exp();
        Estimate {
            value: self.sign * value,
            std_error: value * self.variance(Parameters::y()).sqrt(),
        }
    }

    pub(super) fn wheelbase_m(&self) -> Estimate {
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

    pub(super) fn steering_offset_rad(&self) -> Estimate {
        let ratio = self.parameters[RATIO].exp();
        Estimate {
            value: self.sign * ratio * self.parameters[ZERO],
            std_error: ratio * self.variance(Parameters::z()).sqrt(),
        }
    }

    pub(super) fn yaw_rate_bias(&self) -> Estimate {
        Estimate {
            value: self.parameters[BIAS],
            std_error: self.variance(Parameters::w()).sqrt(),
        }
    }
}
