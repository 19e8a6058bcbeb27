//! `--clock-offset`: given, or measured from the recordings themselves.

use std::path::PathBuf;

use deepfusion_data::{Dataset, OpenOptions};
use deepfusion_doctor::common_camera_ahead;
use deepfusion_jobs::recordings::open_recordings;
#[cfg(feature = "train")]
use deepfusion_jobs::training::resume::ClockAhead;

use super::warnings;
use crate::cli::ClockOffset;
use crate::failure::Result;
use crate::progress::say;

/// The value of `--clock-offset`, as a request to the library.
#[cfg(feature = "train")]
pub(super) fn ahead(offset: ClockOffset) -> ClockAhead {
    match offset {
        ClockOffset::Auto => ClockAhead::Measured,
        ClockOffset::Seconds(ahead_s) => ClockAhead::Seconds(ahead_s),
    }
}

/// How far the camera's clock is ahead, in seconds, as given or measured; `None` without the option.
pub(super) fn seconds(
    asked: Option<ClockOffset>,
    paths: &[PathBuf],
    options: &OpenOptions,
) -> Result<Option<f64>> {
    match asked {
        None => Ok(None),
        Some(ClockOffset::Seconds(ahead_s)) => Ok(Some(ahead_s)),
        Some(ClockOffset::Auto) => {
            let options = OpenOptions {
                split: None,
                camera_ahead_s: None,
                ..options.clone()
            };
            let datasets = open_recordings(paths, &options)?;
            measured(&datasets).map(Some)
        }
    }
}

/// As [`seconds`], for one recording.
pub(super) fn seconds_of(
    asked: Option<ClockOffset>,
    path: &std::path::Path,
    options: &OpenOptions,
) -> Result<Option<f64>> {
    seconds(asked, &[path.to_owned()], options)
}

/// How far one clock is from another, in milliseconds, and in which direction.
fn apart(ahead_ms: f64, error_ms: f64) -> String {
    let side = if ahead_ms < 0.0 { "behind" } else { "ahead of" };
    format!("{:.0} ± {error_ms:.0} ms {side}", ahead_ms.abs())
}

/// Measures the offset of open recordings, and prints it.
pub(super) fn measured<'a>(datasets: impl IntoIterator<Item = &'a Dataset>) -> Result<f64> {
    let common = common_camera_ahead(datasets)?;
    for why in &common.unmeasured {
        warnings::warn_once(format!("{why}; using the offset of the other recordings"));
    }
    let found = common.ahead;
    let (ahead_ms, error_ms) = (1e3 * found.ahead_s, 1e3 * found.std_error_s);
    say(&format!(
        "the camera's clock is {} the vehicle's, as measured from the turns in the images (correlation {:.2}); --clock-offset {ahead_ms:.0} sets \
         it without measuring",
        apart(ahead_ms, error_ms),
        found.correlation
    ));
    Ok(found.ahead_s)
}

#[cfg(test)]
mod tests {
    #[test]
    fn a_clock_is_ahead_or_behind() {
        assert_eq!(super::apart(35.2, 8.9), "35 ± 9 ms ahead of");
        assert_eq!(super::apart(-35.2, 8.9), "35 ± 9 ms behind");
    }
}
