//! The offset between the camera's clock and the vehicle's.
//!
//! When a car turns, the image moves sideways; when its nose dips, up; when it rolls, the image rotates; when it drives faster, the image
//! grows faster. The offset at which the image motion follows the vehicle's motion best is that of the clocks. Shift, drop, roll and growth
//! per second are compared with the mean yaw, pitch and roll rate and the speed over the same pair of frames, moved by the offset. Slow
//! trends are removed from both (trees on one side move the image, too, but slowly). With r(o) their correlation and n the number of
//! independent pairs, the offset is where Σ −n/2 · ln(1 − r²), the log-likelihood, is largest; r below 0 counts as 0.
//!
//! The standard error comes from resampling blocks of the drive (Künsch 1989): on a straight drive at constant speed every resample gives a
//! different offset, so the error is large. Bends are slow, and passing houses disturb the shift: with yaw rate and speed alone, half a
//! minute gives some tens of milliseconds. Roll and pitch change within a second on any road, and driving forward moves nothing about the
//! centre: with an inertial unit the error is some milliseconds.

mod correlation;

use crate::{FusedTrack, ImageMotion, MotionModel, Signal, VehicleTrack};
use correlation::Channel;
use deepfusion_hint::{Hint, count_of};

/// The vehicle's measured rates, on its own clock.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct VehicleRates {
    /// Forward speed, in m/s.
    pub speed_mps: Option<Signal>,
    /// Yaw rate in rad/s, positive to the left.
    pub yaw_rate_radps: Option<Signal>,
    /// Pitch rate in rad/s, positive if the nose goes down.
    pub pitch_rate_radps: Option<Signal>,
    /// Roll rate in rad/s, positive if the left side rises.
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
    /// The inertial unit's rates; without one, the yaw rate from the steering.
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
    /// Largest offset in either direction, in seconds.
    pub search_s: f64,
    /// Trends slower than this are removed, in seconds.
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

/// The offset between two clocks.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TimeOffset {
    /// Added to a time of the camera's clock, it gives the vehicle's time, in seconds.
    pub vehicle_minus_camera_s: f64,
    /// Standard error of the offset, in seconds.
    pub std_error_s: f64,
    /// Correlation of the image's shift with the yaw rate at that offset; `None` if the rate is not measured or does not change.
    pub yaw_correlation: Option<f64>,
    /// The same for drop and pitch rate.
    pub pitch_correlation: Option<f64>,
    /// The same for the image's and the vehicle's roll rate.
    pub roll_correlation: Option<f64>,
    /// The same for growth and speed.
    pub speed_correlation: Option<f64>,
    /// Number of pairs of frames compared.
    pub pairs: usize,
}

/// Why no offset was found.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum NoTimeOffset {
    /// Too few pairs of frames whose times are covered by the vehicle's track at every offset searched.
    #[error(
        "time offset: {} of frames with recorded motion at every offset tried, expected at least {needed}",
        count_of(*pairs, "pair")
    )]
    TooFewPairs {
        /// Number of pairs.
        pairs: usize,
        /// Number of pairs needed.
        needed: usize,
    },
    /// The vehicle's motion does not change: any offset fits.
    #[error(
        "time offset: the motion does not change: no turn above 0.004 rad/s, no change of speed above 0.1 m/s"
    )]
    NothingChanges,
    /// The image motion does not follow the vehicle's at any offset, or best at the limit of the search.
    #[error(
        "time offset: the image motion does not follow the vehicle's within ±{search_s} s (best correlation {correlation:.2})"
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
                "use a longer drive, and check that both clocks count from the same moment"
            }
            Self::NothingChanges => "use a part of the drive with bends",
            Self::NoPeak { .. } => {
                "search wider in case the clocks are further apart, or check the sign of the yaw rate"
            }
            Self::Config => "set them to values in this range, such as the defaults 1 s and 4 s",
        };
        Some(text.to_owned())
    }
}

/// Fewest pairs for a result.
const LEAST_PAIRS: usize = 40;
/// Smaller changes are noise: rad/s and m/s.
const LEAST_TURN_STD: f64 = 0.004;
const LEAST_SPEED_STD: f64 = 0.1;
/// Smallest correlation at which the image motion counts as following the vehicle.
const LEAST_CORRELATION: f64 = 0.15;

/// Estimates the offset from the image motions (in order of time) and the vehicle's motion.
///
/// # Errors
/// [`NoTimeOffset`], with the reason.
pub fn time_offset(
    pictures: &[ImageMotion],
    vehicle: &VehicleRates,
    config: &OffsetConfig,
) -> Result<TimeOffset, NoTimeOffset> {
    let range = 0.05..60.0;
    if !range.contains(&config.search_s) || !range.contains(&config.trend_s) {
        return Err(NoTimeOffset::Config);
    }
    // The pairs that are compared; the signs are those of a camera that looks forward.
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
