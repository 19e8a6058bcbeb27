//! Speeds from a receiver's fixes.

use crate::error::{Error, Result};
use crate::log::{Clock, DriveLog, Format, Speed, YawRate};
use crate::note::FixesNote;
use crate::problem::SpeedProblem;
use deepfusion_motion::{Fix, FixSpeedSource, course_rates, speeds_of_fixes};
use std::path::Path;

/// A fix with its time in nanoseconds; the fix's own time is not set.
pub(crate) struct TimedFix {
    pub(crate) ns: i64,
    pub(crate) fix: Fix,
}

/// The speeds of fixes with dates: as the receiver measured them if most fixes have one, else from the smoothed positions.
///
/// # Errors
/// [`Error::NoSpeed`] if fewer than two fixes have a neighbour.
pub(crate) fn log_of_fixes(path: &Path, format: Format, timed: &[TimedFix]) -> Result<DriveLog> {
    let origin = timed.first().map_or(0, |t| t.ns);
    let fixes = timed.iter().map(|t| Fix {
        time_s: (i128::from(t.ns) - i128::from(origin)) as f64 * 1e-9,
        ..t.fix
    });
    let fixes: Vec<Fix> = fixes.collect();
    let smoothed = speeds_of_fixes(&fixes);
    if smoothed.len() < 2 {
        return Err(Error::NoSpeed {
            path: path.to_owned(),
            problem: SpeedProblem::TooFewFixes { fixes: fixes.len() },
        });
    }
    let of = |source: FixSpeedSource| smoothed.iter().filter(move |s| s.source == source);
    let measured = of(FixSpeedSource::Positions).next().is_none();
    let standing = of(FixSpeedSource::Standing).count();
    let mut notes = Vec::new();
    if smoothed.len() < fixes.len() {
        let (lost, fixes) = (fixes.len() - smoothed.len(), fixes.len());
        notes.push(FixesNote::Alone { lost, fixes }.into());
    }
    let mut sigmas: Vec<f64> = smoothed.iter().map(|s| s.sigma_mps).collect();
    sigmas.sort_by(f64::total_cmp);
    let sigma_mps = sigmas[sigmas.len() / 2];
    let of_speeds = FixesNote::Speeds {
        measured,
        sigma_mps,
    };
    notes.push(of_speeds.into());
    if standing > 0 {
        let fixes = fixes.len();
        notes.push(FixesNote::Standing { standing, fixes }.into());
    }
    let time = |s: f64| origin.saturating_add((s * 1e9).round() as i64);
    let course_rates = course_rates(&smoothed);
    let course_rates = course_rates.iter().map(|(time_s, radps)| YawRate {
        ns: time(*time_s),
        radps: *radps,
    });
    let course_rates = course_rates.collect();
    let speeds = smoothed.iter().map(|s| Speed {
        ns: time(s.time_s),
        mps: s.speed_mps,
        sigma_mps: Some(s.sigma_mps),
    });
    Ok(DriveLog {
        format,
        clock: Clock::Date,
        speeds: speeds.collect(),
        yaw_rates: Vec::new(),
        course_rates,
        notes,
    })
}
