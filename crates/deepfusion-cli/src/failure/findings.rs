//! The doctor's findings in terms of the command's options: the library says what to do, this file which options do it.

use deepfusion_doctor::{Diagnosis, FindingReason, LogReason, MotionReason};
use deepfusion_hint::Hint;
use deepfusion_logs::{Error, Format};

/// The diagnosis with hints that name the command's options, as `deepfusion doctor` prints it and writes it as JSON.
#[must_use]
pub fn in_options(diagnosis: Diagnosis) -> Diagnosis {
    diagnosis.reworded(|finding| {
        if let Some(words) = hint(&finding.what) {
            finding.hint = words;
        }
        if let Some(words) = message(&finding.what) {
            finding.what = FindingReason::Words(words.to_owned());
        }
    })
}

/// What is wrong, for the findings whose text names options.
fn message(reason: &FindingReason) -> Option<&'static str> {
    match reason {
        FindingReason::Log(LogReason::NoTurns) => Some(
            "the turns of the vehicle are unknown: --view-motion vehicle cannot be used, and --clock-offset auto has only changes of speed to compare",
        ),
        FindingReason::Log(LogReason::CourseAlone) => Some(
            "turns are known from positions alone: enough for --clock-offset auto on a few minutes with bends, but not for --view-motion vehicle",
        ),
        _ => None,
    }
}

/// What to do, for the findings that an option settles.
fn hint(reason: &FindingReason) -> Option<String> {
    match reason {
        FindingReason::Log(reason) => of_log(reason),
        FindingReason::Motion(MotionReason::ClockOffset { camera_ahead_s, .. }) => Some(format!(
            "set clock.camera_ahead_s = {camera_ahead_s:.3} in dataset.toml (for a bag, in the TOML file beside it), or give --clock-offset={:.0} \
             (auto measures it each time); better, give all sensors one clock (PTP, trigger)",
            1e3 * camera_ahead_s
        )),
        _ => None,
    }
}

fn of_log(reason: &LogReason) -> Option<String> {
    const AUTO: &str =
        "data import --clock-offset auto measures the remaining offset between the clocks";
    Some(match reason {
        LogReason::NoSpeed(_) => {
            "switch on the camera's GPS and wait for its fix, or use another log: deepfusion data import LOG --video FILE --out DRIVE".into()
        }
        LogReason::Unreadable(error) => match error.error() {
            Error::Signal { .. } => "give --dbc FILE and --speed Message.Signal".into(),
            Error::Column { problem, .. } => {
                let hint = problem.hint()?;
                format!("{hint}: --time COLUMN --speed COLUMN --unit km/h")
            }
            _ => return None,
        },
        LogReason::TooFast { .. } => "give the unit: --unit km/h (or m/s, mph, knots)".into(),
        LogReason::Unsure { .. } => {
            "drive faster or longer, or log the vehicle's own speed: OBD, CAN (--dbc FILE --speed Message.Signal)".into()
        }
        LogReason::Holds { log, format, .. } => format!(
            "import it: deepfusion data import {}{} --out DRIVE, with the camera as --hfov DEGREES, --intrinsics or --calibration (deepfusion \
             calibrate measures it); then run deepfusion doctor DRIVE",
            log.display(),
            // A GoPro's log is in its video.
            if *format == Format::Gpmf { "" } else { " --video FILE" }
        ),
        LogReason::NoTurns | LogReason::CourseAlone => {
            "use --view-motion posenet or distance, or add a log with a gyroscope: deepfusion data import LOG GYROSCOPE …".into()
        }
        LogReason::LocalDates => format!("give the log's time zone: deepfusion data import … --zone +02:00; {AUTO}"),
        LogReason::NoDates => format!("give the first frame's time on the log's clock: deepfusion data import … --start TIME; {AUTO}"),
        LogReason::Dates => AUTO.into(),
        _ => return None,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use deepfusion_doctor::SharedError;
    use deepfusion_logs::{ColumnProblem, NoGps, SignalProblem};

    #[test]
    fn hints_name_the_options_to_use() {
        let unreadable = |error: Error| LogReason::Unreadable(SharedError::from(error));
        let of_log = [
            LogReason::NoSpeed(NoGps::NoFix),
            unreadable(Error::Signal {
                path: "drive.asc".into(),
                problem: SignalProblem::NoDbc,
            }),
            unreadable(Error::Column {
                path: "drive.csv".into(),
                problem: ColumnProblem::NoTime,
                columns: Vec::new(),
            }),
            LogReason::TooFast { fastest_mps: 99.0 },
            LogReason::Unsure { sigma_percent: 8.2 },
            LogReason::Holds {
                log: "drive.gpx".into(),
                format: Format::Gpx,
                speeds: 13,
                yaw_rates: 0,
                notes: Vec::new(),
            },
            LogReason::NoTurns,
            LogReason::CourseAlone,
            LogReason::LocalDates,
            LogReason::NoDates,
            LogReason::Dates,
        ];
        let clock = MotionReason::ClockOffset {
            vehicle_minus_camera_s: -0.12,
            std_error_s: 0.004,
            camera_ahead_s: 0.12,
        };
        let of_log = of_log.into_iter().map(FindingReason::from);
        for reason in of_log.chain([clock.into()]) {
            assert!(!reason.hint().contains(" --"), "{reason}");
            assert!(hint(&reason).unwrap().contains("--"), "{reason}");
        }
        assert_eq!(
            hint(&FindingReason::Words("record while driving".into())),
            None
        );
    }
}
