//! Identifies a vehicle's wheelbase and steering ratio from its speed, steering and yaw rate.
//!
//! The bicycle model (Eq. 27) with a gyro's bias b, s the steering signal and s₀ its zero:
//!
//! ω = v · tan((s − s₀) / ρ) / L + b
//!
//! # What a drive can determine
//! With x = (s − s₀) / ρ, the logarithm of the turning changes with those of the parameters as
//!
//! ∂ ln ω / ∂ ln L = −1, ∂ ln ω / ∂ ln ρ = −2x / sin 2x = −(1 + 2x²/3 + …)
//!
//! At small angles both are −1: only the **product** L·ρ can be determined, since a longer car with a more direct steering turns in the
//! same way. The two differ by 2x²/3: 0.7 % at 0.1 rad of the road wheels (any drive on roads), 17 % at 0.5 rad (parking). So identifying
//! both needs manoeuvres near the lock, or one must be known. The zero s₀ adds a turning that grows with the speed, the bias b one that
//! does not: they can be separated only if the speed changes. A straight drive determines neither L nor ρ.
//!
//! Standard errors are those of the fit, widened for correlated residuals. They do not include tyre slip: identify at low speed, or give
//! [`IdentifyConfig::understeer_s2_per_m2`].

mod fit;
mod problem;

use crate::{Bicycle, Signal};
use deepfusion_hint::Hint;
use fit::Fit;

/// Known parameters of the vehicle, and the required accuracy.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct IdentifyConfig {
    /// The wheelbase in metres, if known.
    pub wheelbase_m: Option<f64>,
    /// The steering ratio, if known (1 for a road wheel's angle).
    pub steering_ratio: Option<f64>,
    /// Understeer of the vehicle, in s²/m² ([`Bicycle::understeer_s2_per_m2`]); not identified.
    pub understeer_s2_per_m2: f64,
    /// Largest relative standard error of wheelbase and ratio that counts as identified.
    pub largest_relative_error: f64,
    /// Shortest turning, in seconds at 0.03 rad/s or more.
    pub least_turning_s: f64,
}

impl Default for IdentifyConfig {
    fn default() -> Self {
        Self {
            wheelbase_m: None,
            steering_ratio: None,
            understeer_s2_per_m2: 0.0,
            largest_relative_error: 0.03,
            least_turning_s: 5.0,
        }
    }
}

/// A value with its standard error, which is 0 if the value was given.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Estimate {
    /// The value.
    pub value: f64,
    /// Its standard error.
    pub std_error: f64,
}

impl Estimate {
    /// The relative standard error.
    #[must_use]
    pub fn relative_error(&self) -> f64 {
        self.std_error / self.value.abs()
    }
}

/// Identified steering parameters of a vehicle.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Identified {
    /// L, in metres.
    pub wheelbase_m: Estimate,
    /// ρ; negative if the signal grows to the right.
    pub steering_ratio: Estimate,
    /// L·ρ in metres, which is known more accurately than either factor.
    pub product_m: Estimate,
    /// s₀, in radians of the steering signal.
    pub steering_offset_rad: Estimate,
    /// b, in rad/s.
    pub yaw_rate_bias_radps: Estimate,
    /// Robust root mean square of the yaw rate's residual, in rad/s.
    pub residual_radps: f64,
    /// Duration of turning, in seconds.
    pub turning_s: f64,
}

impl Identified {
    /// The bicycle model with these parameters.
    #[must_use]
    pub fn bicycle(&self, understeer_s2_per_m2: f64) -> Bicycle {
        Bicycle {
            wheelbase_m: self.wheelbase_m.value,
            steering_ratio: self.steering_ratio.value,
            steering_offset_rad: self.steering_offset_rad.value,
            understeer_s2_per_m2,
        }
    }
}

/// Why a drive does not determine the parameters.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
#[error("not identifiable: {why} ({figure:.3}, needed {needed:.3})")]
#[non_exhaustive]
pub struct Unidentifiable {
    /// The reason.
    pub why: UnidentifiableReason,
    /// The insufficient figure: seconds of turning, or a relative standard error.
    pub figure: f64,
    /// The required figure.
    pub needed: f64,
    /// L·ρ in metres, if at least that is known accurately enough.
    pub product_m: Option<Estimate>,
}

/// A reason of [`Unidentifiable`].
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum UnidentifiableReason {
    /// The drive is too straight: the figure is the seconds of turning.
    Straight,
    /// Wheelbase and ratio cannot be separated: there are no large steering angles. The figure is the
    /// larger of their relative standard errors.
    OnlyTheProduct,
    /// The measurements are too noisy, or contradict the model. The figure is a relative standard error.
    TooUncertain,
}

impl std::fmt::Display for UnidentifiableReason {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Self::Straight => "the drive is too straight; seconds of turning",
            Self::OnlyTheProduct => {
                "without large steering angles only the product of wheelbase and steering ratio is known; relative standard error"
            }
            Self::TooUncertain => "the turning does not follow the steering well enough; relative standard error",
        })
    }
}

impl Hint for Unidentifiable {
    fn hint(&self) -> Option<String> {
        let text = match self.why {
            UnidentifiableReason::Straight => {
                "use a drive with bends, or give wheelbase and steering ratio"
            }
            UnidentifiableReason::OnlyTheProduct => {
                "give one of the two, or add a parking manoeuvre to the drive"
            }
            UnidentifiableReason::TooUncertain => {
                "check the streams' clocks and units, or use a longer drive"
            }
        };
        Some(text.to_owned())
    }
}

/// Fits wheelbase, steering ratio, the steering's zero and the gyro's bias to a drive, robustly
/// (iteratively reweighted least squares, Huber's weights). `speed` in m/s, `steering` in radians,
/// `yaw_rate` in rad/s and positive to the left, all on one clock.
///
/// # Errors
/// [`Unidentifiable`] if the drive is too straight, or a standard error is above the limit.
pub fn identify(
    speed: &Signal,
    steering: &Signal,
    yaw_rate: &Signal,
    config: &IdentifyConfig,
) -> Result<Identified, Unidentifiable> {
    let observations = fit::observations(speed, steering, yaw_rate);
    let turning_s = fit::turning_s(&observations);
    let straight = |turning_s: f64| Unidentifiable {
        why: UnidentifiableReason::Straight,
        figure: turning_s,
        needed: config.least_turning_s,
        product_m: None,
    };
    // No value satisfies a NaN limit.
    let turns = turning_s >= config.least_turning_s;
    if observations.len() < 20 || !turns {
        return Err(straight(turning_s));
    }
    let Some(fit) = Fit::best(&observations, config) else {
        return Err(Unidentifiable {
            why: UnidentifiableReason::TooUncertain,
            figure: f64::INFINITY,
            needed: config.largest_relative_error,
            product_m: None,
        });
    };
    judge(&fit, config, turning_s)
}

fn judge(fit: &Fit, config: &IdentifyConfig, turning_s: f64) -> Result<Identified, Unidentifiable> {
    let found = Identified {
        wheelbase_m: fit.wheelbase_m(),
        steering_ratio: fit.steering_ratio(),
        product_m: fit.product_m(),
        steering_offset_rad: fit.steering_offset_rad(),
        yaw_rate_bias_radps: fit.yaw_rate_bias(),
        residual_radps: fit.sigma,
        turning_s,
    };
    let limit = config.largest_relative_error;
    let fail = |why, figure, product_m| {
        Err(Unidentifiable {
            why,
            figure,
            needed: limit,
            product_m,
        })
    };
    let product = found.product_m.relative_error();
    let product_is_known = product <= limit;
    if !product_is_known {
        return fail(UnidentifiableReason::TooUncertain, product, None);
    }
    let worst = found
        .wheelbase_m
        .relative_error()
        .max(found.steering_ratio.relative_error());
    // A ratio at the limit of the range was not found; the search was stopped there.
    let both_are_known = worst <= limit && !fit.at_the_edge;
    if !both_are_known {
        let figure = if fit.at_the_edge {
            f64::INFINITY
        } else {
            worst
        };
        return fail(
            UnidentifiableReason::OnlyTheProduct,
            figure,
            Some(found.product_m),
        );
    }
    Ok(found)
}
