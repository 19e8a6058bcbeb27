//! The camera's clock against the vehicle's.
//!
//! When a car turns, the picture moves sideways; when it drives faster, the picture grows faster. The
//! offset at which the picture's motion follows the vehicle's best is that of the clocks. Shift and
//! growth per second are compared with the mean yaw rate and speed over the same pair of frames, moved
//! by the offset, both without their slow trend (near trees on one side move the picture, too, but
//! slowly). With r(o) their correlation and n the number of independent pairs, the offset is where
//! Σ −n/2 · ln(1 − r²), the logarithm of the likelihood, is largest; r below 0 counts as 0.
//!
//! Its standard error comes from resampling blocks of the drive (Künsch 1989): a straight drive at one
//! speed gives a different offset for every resample, and says so.

mod correlation;

use crate::{ImageMotion, MotionModel};
use correlation::{Channel, Peak};

/// How the offset is searched.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct OffsetConfig {
    /// Largest offset either way, in seconds.
    pub search_s: f64,
    /// What is slower than this is taken off, in seconds.
    pub trend_s: f64,
}

impl Default for OffsetConfig {
    fn default() -> Self {
        Self {
            search_s: 1.0,
            trend_s: 4.0,
        }
    }
}

/// The offset of two clocks.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TimeOffset {
    /// What to add to a time of the camera's clock to have the vehicle's, in seconds.
    pub vehicle_minus_camera_s: f64,
    /// Its standard error, in seconds.
    pub std_error_s: f64,
    /// Correlation of the picture's shift with the yaw rate there; `None` where the vehicle does not turn.
    pub yaw_correlation: Option<f64>,
    /// Correlation of the picture's growth with the speed there; `None` where the speed is constant.
    pub speed_correlation: Option<f64>,
    /// How many pairs of frames were compared.
    pub pairs: usize,
}

/// Why there is no offset.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum NoTimeOffset {
    /// Too few pairs of frames whose times the vehicle's track covers at every offset searched.
    #[error(
        "time offset: {pairs} pairs of frames inside the vehicle's track, expected at least {needed}"
    )]
    TooFewPairs {
        /// How many there are.
        pairs: usize,
        /// How many are needed.
        needed: usize,
    },
    /// The vehicle drives straight at one speed: any offset fits.
    #[error(
        "time offset: the vehicle neither turns nor changes its speed \
         (yaw rate ±{yaw_rate_std:.4} rad/s, speed ±{speed_std:.2} m/s)"
    )]
    NothingChanges {
        /// Standard deviation of the yaw rate without its trend, rad/s.
        yaw_rate_std: f64,
        /// Standard deviation of the speed without its trend, m/s.
        speed_std: f64,
    },
    /// The picture's motion does not follow the vehicle's at any offset, or best at the end of the
    /// search.
    #[error(
        "time offset: within ±{search_s} s the picture's motion follows the vehicle's nowhere (best correlation {correlation:.2})"
    )]
    NoPeak {
        /// How far was searched, in seconds.
        search_s: f64,
        /// The highest correlation.
        correlation: f64,
    },
    /// The configuration is out of range.
    #[error("time offset: search_s and trend_s must be above 0.05 s and below 60 s")]
    Config,
}

impl NoTimeOffset {
    /// What to do about it, in one line.
    #[must_use]
    pub fn hint(&self) -> String {
        match self {
            Self::TooFewPairs { .. } => {
                "use a longer drive, and check that both clocks count from the same event"
            }
            Self::NothingChanges { .. } => "use a part of the drive with bends",
            Self::NoPeak { .. } => {
                "the clocks may be further apart: search wider, or check the yaw rate's sign"
            }
            Self::Config => "the defaults are 1 s and 4 s",
        }
        .to_owned()
    }
}

/// Fewer pairs than this prove nothing.
const LEAST_PAIRS: usize = 40;
/// Changes below these are noise: rad/s and m/s.
const LEAST_YAW_STD: f64 = 0.004;
const LEAST_SPEED_STD: f64 = 0.1;
/// Below this the picture does not follow the vehicle.
const LEAST_CORRELATION: f64 = 0.15;

/// Estimates the offset from the picture's motion (in the order of time) and the vehicle's.
///
/// # Errors
/// [`NoTimeOffset`] says why there is none.
pub fn time_offset(
    pictures: &[ImageMotion],
    vehicle: &MotionModel,
    config: &OffsetConfig,
) -> Result<TimeOffset, NoTimeOffset> {
    let range = 0.05..60.0;
    if !range.contains(&config.search_s) || !range.contains(&config.trend_s) {
        return Err(NoTimeOffset::Config);
    }
    let pairs = correlation::pairs(pictures, vehicle, config.search_s);
    if pairs.len() < LEAST_PAIRS {
        return Err(NoTimeOffset::TooFewPairs {
            pairs: pairs.len(),
            needed: LEAST_PAIRS,
        });
    }
    let of = |picture: fn(&ImageMotion) -> f64, least_std: f64, vehicle_is: usize| {
        Channel::new(&pairs, picture, vehicle_is, least_std, config)
    };
    let yaw = of(|m| m.shift, LEAST_YAW_STD, correlation::YAW);
    let speed = of(|m| m.growth, LEAST_SPEED_STD, correlation::SPEED);
    let usable: Vec<&Channel> = [&yaw, &speed].into_iter().filter(|c| c.changes).collect();
    if usable.is_empty() {
        return Err(NoTimeOffset::NothingChanges {
            yaw_rate_std: yaw.vehicle_std,
            speed_std: speed.vehicle_std,
        });
    }
    let best = |peak: &Peak| {
        let of = |c: &&Channel| c.correlation_at(peak.offset_s);
        usable.iter().map(of).fold(0.0, f64::max)
    };
    let no_peak = |correlation| NoTimeOffset::NoPeak {
        search_s: config.search_s,
        correlation,
    };
    let peak = correlation::peak(&usable).ok_or(no_peak(0.0))?;
    if peak.at_the_end || best(&peak) < LEAST_CORRELATION {
        return Err(no_peak(best(&peak)));
    }
    Ok(TimeOffset {
        vehicle_minus_camera_s: peak.offset_s,
        std_error_s: correlation::std_error(&usable, &peak, config.search_s),
        yaw_correlation: yaw.changes.then(|| yaw.correlation_at(peak.offset_s)),
        speed_correlation: speed.changes.then(|| speed.correlation_at(peak.offset_s)),
        pairs: pairs.len(),
    })
}
