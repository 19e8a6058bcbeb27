//! The offset between the camera's clock and the vehicle's.
//!
//! When a car turns, the picture moves sideways; when its nose dips, up; when it rolls, it turns; when
//! it drives faster, it grows faster. The offset at which the picture's motion follows the vehicle's
//! best is that of the clocks. Shift, drop, roll and growth per second are compared with the mean yaw,
//! pitch and roll rate and the speed over the same pair of frames, moved by the offset, both without
//! their slow trend (trees on one side move the picture, too, but slowly). With r(o) their correlation
//! and n the number of independent pairs, the offset is where Σ −n/2 · ln(1 − r²), the logarithm of
//! the likelihood, is largest; r below 0 counts as 0.
//!
//! Its standard error comes from resampling blocks of the drive (Künsch 1989): a straight drive at one
//! speed gives a different offset for every resample, and says so. Bends are slow, and houses that pass
//! disturb the shift: yaw rate and speed alone give some tens of milliseconds on half a minute. Roll
//! and pitch change within a second on any road, and driving ahead moves nothing about the centre: with
//! an inertial unit it is some milliseconds.

mod correlation;

use crate::{FusedTrack, ImageMotion, MotionModel, Signal, VehicleTrack};
use correlation::Channel;
use deepfusion_hint::{Hint, count_of};

/// The vehicle's rates, on its own clock, as far as they are measured.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct VehicleRates {
    /// Forward speed, in m/s.
    pub speed_mps: Option<Signal>,
    /// Yaw rate in rad/s, positive to the left.
    pub yaw_rate_radps: Option<Signal>,
    /// Pitch rate in rad/s, positive where the nose goes down.
    pub pitch_rate_radps: Option<Signal>,
    /// Roll rate in rad/s, positive where the left side rises.
    pub roll_rate_radps: Option<Signal>,
}

impl From<&VehicleTrack> for VehicleRates {
    fn from(track: &VehicleTrack) -> Self {
        Self {
            speed_mps: Some(track.speed().clone()),
            yaw_rate_radps: Some(track.yaw_rate().clone()),
            ..Self::default()
        }
    }
}

impl From<&FusedTrack> for VehicleRates {
    /// The inertial unit's rates; without one, the yaw rate of the steering.
    fn from(track: &FusedTrack) -> Self {
        let imu = track.imu();
        let yaw_rate = imu.map(|i| i.yaw_rate()).or(track.steering_yaw_rate());
        Self {
            speed_mps: Some(track.speed().clone()),
            yaw_rate_radps: yaw_rate.cloned(),
            pitch_rate_radps: imu.map(|i| i.pitch_rate().clone()),
            roll_rate_radps: imu.map(|i| i.roll_rate().clone()),
        }
    }
}

impl From<&MotionModel> for VehicleRates {
    fn from(motion: &MotionModel) -> Self {
        match motion {
            MotionModel::Track(track) => track.as_ref().into(),
            MotionModel::Fused(track) => track.as_ref().into(),
        }
    }
}

/// Settings of the search.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct OffsetConfig {
    /// Largest offset either way, in seconds.
    pub search_s: f64,
    /// Slower trends than this are removed, in seconds.
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
    /// Added to a time of the camera's clock it gives the vehicle's, in seconds.
    pub vehicle_minus_camera_s: f64,
    /// Its standard error, in seconds.
    pub std_error_s: f64,
    /// Correlation of the picture's shift with the yaw rate at that offset; `None` if it is not
    /// measured or does not change.
    pub yaw_correlation: Option<f64>,
    /// The same of drop and pitch rate.
    pub pitch_correlation: Option<f64>,
    /// The same of the picture's and the vehicle's roll rate.
    pub roll_correlation: Option<f64>,
    /// The same of growth and speed.
    pub speed_correlation: Option<f64>,
    /// Number of pairs of frames compared.
    pub pairs: usize,
}

/// Why there is no offset.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum NoTimeOffset {
    /// Too few pairs of frames whose times the vehicle's track covers at every offset searched.
    #[error(
        "time offset: {} of frames inside the vehicle's track, expected at least {needed}",
        count_of(*pairs, "pair")
    )]
    TooFewPairs {
        /// How many there are.
        pairs: usize,
        /// How many are needed.
        needed: usize,
    },
    /// Nothing changes: any offset fits.
    #[error(
        "time offset: nothing measured changes: no turn (0.004 rad/s), no change of speed (0.1 m/s)"
    )]
    NothingChanges,
    /// The picture's motion does not follow the vehicle's at any offset, or best at the end of the
    /// search.
    #[error(
        "time offset: within ±{search_s} s the picture's motion follows the vehicle's nowhere (best correlation {correlation:.2})"
    )]
    NoPeak {
        /// The search range, in seconds.
        search_s: f64,
        /// The highest correlation.
        correlation: f64,
    },
    /// The configuration is out of range.
    #[error("time offset: search_s and trend_s must be above 0.05 s and below 60 s")]
    Config,
}

impl Hint for NoTimeOffset {
    fn hint(&self) -> Option<String> {
        let text = match self {
            Self::TooFewPairs { .. } => {
                "use a longer drive, and check that both clocks count from the same event"
            }
            Self::NothingChanges => "use a part of the drive with bends",
            Self::NoPeak { .. } => {
                "the clocks may be further apart: search wider, or check the yaw rate's sign"
            }
            Self::Config => "the defaults are 1 s and 4 s",
        };
        Some(text.to_owned())
    }
}

/// Fewest pairs for a result.
const LEAST_PAIRS: usize = 40;
/// Changes below these are noise: rad/s and m/s.
const LEAST_TURN_STD: f64 = 0.004;
const LEAST_SPEED_STD: f64 = 0.1;
/// Least correlation of a picture that follows the vehicle.
const LEAST_CORRELATION: f64 = 0.15;

/// Estimates the offset from the picture's motion (in the order of time) and the vehicle's.
///
/// # Errors
/// [`NoTimeOffset`] says why there is none.
pub fn time_offset(
    pictures: &[ImageMotion],
    vehicle: &VehicleRates,
    config: &OffsetConfig,
) -> Result<TimeOffset, NoTimeOffset> {
    let range = 0.05..60.0;
    if !range.contains(&config.search_s) || !range.contains(&config.trend_s) {
        return Err(NoTimeOffset::Config);
    }
    // What is compared with what; the signs are those of a camera that looks ahead.
    let channel = |picture: fn(&ImageMotion) -> f64, vehicle: &Option<Signal>, least_std| {
        let vehicle = vehicle.as_ref()?;
        Channel::new(pictures, picture, vehicle, least_std, config)
    };
    let channels = [
        channel(|m| m.shift, &vehicle.yaw_rate_radps, LEAST_TURN_STD),
        channel(|m| -m.drop, &vehicle.pitch_rate_radps, LEAST_TURN_STD),
        channel(
            |m| -m.clockwise_rad,
            &vehicle.roll_rate_radps,
            LEAST_TURN_STD,
        ),
        channel(|m| m.growth, &vehicle.speed_mps, LEAST_SPEED_STD),
    ];
    let pairs = channels.iter().flatten().map(Channel::pairs).max();
    let pairs = pairs.unwrap_or(0);
    if pairs < LEAST_PAIRS {
        return Err(NoTimeOffset::TooFewPairs {
            pairs,
            needed: LEAST_PAIRS,
        });
    }
    let usable = |c: &&Channel| c.changes && c.pairs() >= LEAST_PAIRS;
    let used: Vec<&Channel> = channels.iter().flatten().filter(usable).collect();
    if used.is_empty() {
        return Err(NoTimeOffset::NothingChanges);
    }
    let no_peak = |correlation| NoTimeOffset::NoPeak {
        search_s: config.search_s,
        correlation,
    };
    let peak = correlation::peak(&used).ok_or(no_peak(0.0))?;
    let correlations = used.iter().map(|c| c.correlation_at(peak.offset_s));
    let best = correlations.fold(0.0, f64::max);
    if peak.at_the_end || best < LEAST_CORRELATION {
        return Err(no_peak(best));
    }
    let correlation = |i: usize| {
        let channel = channels[i].as_ref().filter(usable);
        channel.map(|c| c.correlation_at(peak.offset_s))
    };
    Ok(TimeOffset {
        vehicle_minus_camera_s: peak.offset_s,
        std_error_s: correlation::std_error(&used, &peak, config.search_s),
        yaw_correlation: correlation(0),
        pitch_correlation: correlation(1),
        roll_correlation: correlation(2),
        speed_correlation: correlation(3),
        pairs,
    })
}
