//! The offset of the camera's clock, to be applied. Measured like the check `clock`, but an error if it is not certain enough.

use super::clock_offset::{rates, settled};
use super::epipolar;
use super::survey::Survey;
use deepfusion_data::Dataset;
use deepfusion_hint::Hint;
use deepfusion_motion::{NoTimeOffset, OffsetConfig, TimeOffset};
use std::fmt;

/// Largest standard error of an offset that is applied, in seconds. At 3 m/s² of braking it makes 0.15 m/s.
pub const MOST_STD_ERROR_S: f64 = 0.05;
/// The same if only a receiver's course shows the turns. Smoothing spreads them, so resampling gives too small a standard error.
pub const MOST_TRACK_STD_ERROR_S: f64 = 0.035;
/// Least correlation of the picture's motion with the vehicle's.
pub const LEAST_CORRELATION: f64 = 0.3;
/// How far apart the clocks may be, in seconds: the near range is tried first. In the wide one, more offsets fit by chance.
const SEARCH_S: [f64; 2] = [1.0, 4.0];
/// How many times as many pictures are read if only a receiver's course shows the turns.
const TRACK_SURVEY: usize = 3;
/// Variations of a course's turns that are slower than this are removed, in seconds. Smoothing has removed those faster than two.
const TRACK_TREND_S: f64 = 15.0;
/// Drives of one recording agree if they differ by at most this many standard errors, or this many seconds.
const SIGMAS: f64 = 4.0;
const AGREE_S: f64 = 0.02;

/// How far the camera's clock is ahead of the vehicle's.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CameraAhead {
    /// In seconds, as [`deepfusion_data::OpenOptions::camera_ahead_s`].
    pub ahead_s: f64,
    /// Its standard error, in seconds.
    pub std_error_s: f64,
    /// The best correlation of the picture's motion with the vehicle's at that offset.
    pub correlation: f64,
}

impl CameraAhead {
    /// How far away an independent measurement is, as a share of what is allowed: above 1 they contradict each other.
    fn apart(&self, other: &Self) -> f64 {
        let error_s = self.std_error_s.hypot(other.std_error_s);
        (self.ahead_s - other.ahead_s).abs() / (SIGMAS * error_s).max(AGREE_S)
    }
}

/// Why no offset can be applied.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub enum NoCameraAhead {
    /// There are no speeds or times to compare the pictures with.
    NoSpeeds {
        /// Name of the drive.
        drive: String,
    },
    /// The picture's motion does not match the vehicle's.
    NotFound {
        /// Name of the drive.
        drive: String,
        /// Why they do not match.
        source: NoTimeOffset,
    },
    /// The picture's motion matches the vehicle's too loosely.
    Weak {
        /// Name of the drive.
        drive: String,
        /// Best offset, in seconds.
        ahead_s: f64,
        /// The correlation at that offset.
        correlation: f64,
    },
    /// The standard error of the offset is too large.
    Unsure {
        /// Name of the drive.
        drive: String,
        /// The offset, in seconds.
        ahead_s: f64,
        /// Its standard error, in seconds.
        std_error_s: f64,
        /// The largest standard error with which an offset is applied, in seconds.
        most_s: f64,
    },
    /// The offset of this drive differs from that of the others.
    Differ {
        /// Name of the drive.
        drive: String,
        /// Its offset, in seconds.
        ahead_s: f64,
        /// Its standard error, in seconds.
        std_error_s: f64,
        /// Mean offset of the others, in seconds.
        others_s: f64,
        /// Its standard error, in seconds.
        others_error_s: f64,
    },
    /// The pictures of this drive do not show its offset, and its file gives another one than the others show.
    GivesOther {
        /// Name of the drive.
        drive: String,
        /// The offset that its file gives, in seconds.
        given_s: f64,
        /// Mean offset of the others, in seconds.
        others_s: f64,
    },
    /// No drive was given.
    Nothing,
}

impl NoCameraAhead {
    /// The drive it is about; `None` if no drive was given.
    #[must_use]
    pub fn drive(&self) -> Option<&str> {
        match self {
            Self::NoSpeeds { drive }
            | Self::NotFound { drive, .. }
            | Self::Weak { drive, .. }
            | Self::Unsure { drive, .. }
            | Self::Differ { drive, .. }
            | Self::GivesOther { drive, .. } => Some(drive),
            Self::Nothing => None,
        }
    }

    /// What is wrong, without the drive's name.
    #[must_use]
    pub fn reason(&self) -> String {
        match self {
            Self::NoSpeeds { .. } => {
                "the clocks cannot be compared: there are no speeds, or the frames have no times"
                    .into()
            }
            Self::NotFound { source, .. } => source.to_string(),
            Self::Weak {
                ahead_s,
                correlation,
                ..
            } => format!(
                "the pictures match the vehicle's motion best at an offset of {ahead_s:+.2} s, with a correlation of {correlation:.2}, \
                 expected at least {LEAST_CORRELATION}"
            ),
            Self::Unsure {
                ahead_s,
                std_error_s,
                most_s,
                ..
            } => format!(
                "the clocks are {ahead_s:+.2} ± {std_error_s:.3} s apart, expected a standard error of at most {most_s} s"
            ),
            Self::Differ {
                ahead_s,
                std_error_s,
                others_s,
                others_error_s,
                ..
            } => format!(
                "the clocks are {ahead_s:+.3} ± {std_error_s:.3} s apart, those of the other drives {others_s:+.3} ± {others_error_s:.3} s"
            ),
            Self::GivesOther {
                given_s, others_s, ..
            } => format!(
                "its file gives a clock offset of {given_s:+.3} s, which its pictures do not show; those of the other drives show {others_s:+.3} s"
            ),
            Self::Nothing => "no recording was given to compare the clocks of".into(),
        }
    }
}

/// The drive, and the reason.
impl fmt::Display for NoCameraAhead {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if let Some(drive) = self.drive() {
            write!(f, "{drive}: ")?;
        }
        f.write_str(&self.reason())
    }
}

impl std::error::Error for NoCameraAhead {
    fn source(&self) -> Option<&(dyn std::error::Error + 'static)> {
        match self {
            Self::NotFound { source, .. } => Some(source),
            _ => None,
        }
    }
}

impl Hint for NoCameraAhead {
    fn hint(&self) -> Option<String> {
        Some(match self {
            Self::NoSpeeds { .. } => "give a recording with speeds and times, or the offset in milliseconds".into(),
            Self::NotFound { source, .. } => {
                let own = source.hint().map(|hint| hint + ", or ");
                own.unwrap_or_default() + "give the offset in milliseconds"
            }
            Self::Weak { .. } | Self::Unsure { .. } => {
                "use a longer drive with more bends, or a log with a gyroscope; or give the offset in milliseconds".into()
            }
            Self::GivesOther { .. } => {
                "if clock.camera_ahead_s in the file beside it is wrong, remove it; otherwise give the recordings one by one".into()
            }
            Self::Differ { .. } => {
                "set clock.camera_ahead_s beside each recording (dataset.toml), or give them one by one".into()
            }
            Self::Nothing => "name a recording".into(),
        })
    }
}

/// Measures how far the camera's clock is ahead of the vehicle's, from the turns of an inertial unit or a yaw rate, else of a receiver's
/// course, and from changes of speed. A few hundred pictures are read.
///
/// # Errors
/// If the offset is not known well enough to be applied; the error says why.
pub fn camera_ahead(dataset: &Dataset) -> Result<CameraAhead, NoCameraAhead> {
    let offset = offset(dataset)?;
    Ok(CameraAhead {
        ahead_s: dataset.camera_ahead_s() - offset.vehicle_minus_camera_s,
        std_error_s: offset.std_error_s,
        correlation: correlation(&offset),
    })
}

/// The offset that [`camera_ahead`] applies, relative to the one that the recording gives itself.
pub(super) fn offset(dataset: &Dataset) -> Result<TimeOffset, NoCameraAhead> {
    let drive = || dataset.name().to_owned();
    let turning = dataset.turning_as_its_course();
    let by_course = turning.is_some();
    let dataset = turning.as_ref().unwrap_or(dataset);
    let timed = dataset.frames().iter().any(|frame| frame.time_s.is_some());
    let rates = rates(dataset)
        .filter(|_| timed)
        .ok_or_else(|| NoCameraAhead::NoSpeeds { drive: drive() })?;
    // The turns of a course are spread over time, so more of them are needed.
    let survey = if by_course {
        Survey::times(dataset, TRACK_SURVEY)
    } else {
        Survey::of(dataset)
    };
    let pairs = epipolar::pairs(&survey);
    let measure = |search_s: f64| {
        let config = OffsetConfig {
            search_s,
            trend_s: if by_course {
                TRACK_TREND_S
            } else {
                OffsetConfig::default().trend_s
            },
        };
        settled(&survey, &pairs, &rates, &config)
    };
    let mut found = measure(SEARCH_S[0]);
    for search_s in &SEARCH_S[1..] {
        if matches!(found, Err(NoTimeOffset::NoPeak { .. })) {
            found = measure(*search_s);
        }
    }
    let offset = found.map_err(|source| NoCameraAhead::NotFound {
        drive: drive(),
        source,
    })?;
    let ahead_s = dataset.camera_ahead_s() - offset.vehicle_minus_camera_s;
    let (std_error_s, correlation) = (offset.std_error_s, correlation(&offset));
    if correlation < LEAST_CORRELATION {
        return Err(NoCameraAhead::Weak {
            drive: drive(),
            ahead_s,
            correlation,
        });
    }
    let most_s = if by_course {
        MOST_TRACK_STD_ERROR_S
    } else {
        MOST_STD_ERROR_S
    };
    if std_error_s.is_nan() || std_error_s > most_s {
        return Err(NoCameraAhead::Unsure {
            drive: drive(),
            most_s,
            ahead_s,
            std_error_s,
        });
    }
    Ok(offset)
}

/// The highest of the correlations.
fn correlation(offset: &TimeOffset) -> f64 {
    let all = [
        offset.yaw_correlation,
        offset.pitch_correlation,
        offset.roll_correlation,
        offset.speed_correlation,
    ];
    all.into_iter().flatten().fold(0.0, f64::max)
}

/// The offset that drives recorded with one setup show together.
#[derive(Debug, Clone, PartialEq)]
pub struct CommonCameraAhead {
    /// The mean, weighted by the inverse squares of the standard errors.
    pub ahead: CameraAhead,
    /// Drives that do not show it themselves, with the reason; they get the mean of the others.
    pub unmeasured: Vec<NoCameraAhead>,
}

/// [`camera_ahead`] of drives recorded with one setup. Of two cameras on one clock, only the first is used.
///
/// # Errors
/// As [`camera_ahead`], if no drive shows it; [`NoCameraAhead::Differ`] and [`NoCameraAhead::GivesOther`] if a drive contradicts the
/// others.
pub fn common_camera_ahead<'a>(
    datasets: impl IntoIterator<Item = &'a Dataset>,
) -> Result<CommonCameraAhead, NoCameraAhead> {
    let mut drives: Vec<&Dataset> = Vec::new();
    for dataset in datasets {
        let same = |d: &&Dataset| d.place() == dataset.place() && d.name() == dataset.name();
        if !drives.iter().any(same) {
            drives.push(dataset);
        }
    }
    let (mut found, mut unmeasured) = (Vec::new(), Vec::new());
    for drive in drives {
        match camera_ahead(drive) {
            Ok(ahead) => found.push((drive, ahead)),
            Err(why) => unmeasured.push((drive, why)),
        }
    }
    let measured: Vec<CameraAhead> = found.iter().map(|(_, ahead)| *ahead).collect();
    let Some(mean) = weighted_mean(&measured) else {
        let last = unmeasured.pop().map(|(_, why)| why);
        return Err(last.unwrap_or(NoCameraAhead::Nothing));
    };
    if let Some((i, others)) = outlier(&measured) {
        let (drive, ahead) = &found[i];
        return Err(NoCameraAhead::Differ {
            drive: drive.name().to_owned(),
            ahead_s: ahead.ahead_s,
            std_error_s: ahead.std_error_s,
            others_s: others.ahead_s,
            others_error_s: others.std_error_s,
        });
    }
    for (drive, _) in &unmeasured {
        let given_s = drive.camera_ahead_s();
        let given = CameraAhead {
            ahead_s: given_s,
            std_error_s: 0.0,
            correlation: 1.0,
        };
        if given_s != 0.0 && given.apart(&mean) > 1.0 {
            return Err(NoCameraAhead::GivesOther {
                drive: drive.name().to_owned(),
                given_s,
                others_s: mean.ahead_s,
            });
        }
    }
    Ok(CommonCameraAhead {
        ahead: mean,
        unmeasured: unmeasured.into_iter().map(|(_, why)| why).collect(),
    })
}

/// The measurement that contradicts the mean of the others most, with that mean.
fn outlier(all: &[CameraAhead]) -> Option<(usize, CameraAhead)> {
    let apart = |i: usize| {
        let others = weighted_mean(&[&all[..i], &all[i + 1..]].concat())?;
        Some((all[i].apart(&others), i, others))
    };
    let worst = (0..all.len())
        .filter_map(apart)
        .max_by(|a, b| a.0.total_cmp(&b.0));
    worst
        .filter(|(apart, ..)| *apart > 1.0)
        .map(|(_, i, others)| (i, others))
}

/// `None` for an empty slice.
fn weighted_mean(all: &[CameraAhead]) -> Option<CameraAhead> {
    let weight = |ahead: &CameraAhead| ahead.std_error_s.max(1e-3).powi(-2);
    let sum: f64 = all.iter().map(weight).sum();
    let ahead_s = all.iter().map(|a| weight(a) * a.ahead_s).sum::<f64>() / sum;
    (!all.is_empty()).then(|| CameraAhead {
        ahead_s,
        std_error_s: sum.sqrt().recip(),
        correlation: all
            .iter()
            .map(|a| a.correlation)
            .fold(f64::INFINITY, f64::min),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ahead(ahead_s: f64) -> CameraAhead {
        CameraAhead {
            ahead_s,
            std_error_s: 0.005,
            correlation: 0.9,
        }
    }

    #[test]
    fn the_drive_that_differs_is_named() {
        for (place, all) in [
            (2, [0.0, 0.01, 0.5]),
            (0, [0.5, 0.0, 0.01]),
            (1, [0.0, 0.5, 0.01]),
        ] {
            let (found, others) = outlier(&all.map(ahead)).unwrap();
            assert_eq!(found, place);
            assert!((others.ahead_s - 0.005).abs() < 1e-9, "{others:?}");
        }
        assert_eq!(outlier(&[0.0, 0.015, -0.01].map(ahead)), None);
        // Four standard errors of the difference of two.
        assert!(outlier(&[0.0, 0.029].map(ahead)).is_some());
        assert_eq!(outlier(&[0.0, 0.027].map(ahead)), None);
        assert_eq!(outlier(&[ahead(0.3)]), None);
    }
}
