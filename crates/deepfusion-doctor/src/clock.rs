//! The camera's clock compared with the vehicle's.

use super::camera_ahead;
use super::clock_offset::{rates, settled};
use super::epipolar::EpipolarPair;
use super::finding::{Figure, Limit, Outcome, Severity};
use super::reason::MotionReason;
use super::skip::ClockSkip;
use super::survey::Survey;
use deepfusion_motion::{OffsetConfig, Signal, TimeOffset};

/// Offset that matters, in seconds: at 10 m/s² of braking 20 ms are 0.2 m/s.
const MOST_S: f64 = 0.020;
/// The same if positions alone show the turns: a receiver's own delay is of that size.
const MOST_BY_COURSE_S: f64 = 0.1;
/// An estimate counts if it is at least this many standard errors from 0, and these are below `SURE_S`.
const SIGMAS: f64 = 4.0;
const SURE_S: f64 = 0.05;

pub(super) fn check(survey: &Survey<'_>, pairs: &[EpipolarPair]) -> Outcome {
    let Estimate { offset, least_s } = match estimate(survey, pairs) {
        Ok(estimate) => estimate,
        Err(why) => return Outcome::skipped("clock", why),
    };
    let (value, error) = (offset.vehicle_minus_camera_s, offset.std_error_s);
    let mut outcome = Outcome::new("clock");
    // An offset that cannot be distinguished from 0 passes.
    let limit = least_s.max(SIGMAS * error);
    let figure = Figure::new(
        "offset, vehicle minus camera",
        value,
        "s",
        Limit::Within(-limit, limit),
    );
    outcome.judge(Severity::Error, figure, || MotionReason::ClockOffset {
        vehicle_minus_camera_s: value,
        std_error_s: error,
        camera_ahead_s: survey.dataset.camera_ahead_s() - value,
    });
    outcome
}

/// An offset that is certain enough.
pub(super) struct Estimate {
    pub(super) offset: TimeOffset,
    /// Smaller offsets do not count, in seconds.
    least_s: f64,
}

/// The offset of the clocks, or why there is none.
pub(super) fn estimate(survey: &Survey<'_>, pairs: &[EpipolarPair]) -> Result<Estimate, ClockSkip> {
    let rates = rates(survey.dataset).filter(|rates| rates.yaw_rate_radps.is_some());
    let rates = rates.ok_or(ClockSkip::NoRates)?;
    if !survey.dataset.yaw_known() {
        // A course needs more pictures and other settings than a yaw rate.
        let offset = camera_ahead::offset(survey.dataset).map_err(ClockSkip::ByCourse)?;
        let least_s = MOST_BY_COURSE_S;
        return Ok(Estimate { offset, least_s });
    }
    let offset = settled(survey, pairs, &rates, &OffsetConfig::default())?;
    let (offset_s, std_error_s) = (offset.vehicle_minus_camera_s, offset.std_error_s);
    if std_error_s.is_nan() || std_error_s >= SURE_S {
        Err(ClockSkip::Unsure {
            offset_s,
            std_error_s,
        })
    } else {
        // A stream's times are known no better than to its own interval (KITTI's oxts, at 10 Hz, come out 60 ms late).
        let interval_s = rates.speed_mps.as_ref().and_then(Signal::interval_s);
        let least_s = MOST_S.max(interval_s.unwrap_or(0.0));
        Ok(Estimate { offset, least_s })
    }
}
