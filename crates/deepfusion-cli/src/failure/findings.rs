//! What the command line says of the doctor's findings: the library names a remedy, this the options that do it.

use deepfusion_doctor::{Diagnosis, FindingReason, Remedy};
use deepfusion_logs::Clock;

/// A diagnosis whose findings name the command's options, as `deepfusion doctor` prints them and its JSON has them.
#[must_use]
pub fn in_options(diagnosis: Diagnosis) -> Diagnosis {
    diagnosis.reworded(|finding| {
        if let Some(words) = remedy(&finding.remedy) {
            if let Some(what) = what(&finding.remedy) {
                finding.what = FindingReason::Words(what.to_owned());
            }
            finding.remedy = Remedy::Words(words);
        }
    })
}

/// What is wrong, where that speaks of options.
fn what(remedy: &Remedy) -> Option<&'static str> {
    match remedy {
        Remedy::Turns {
            from_positions: false,
        } => Some(
            "nothing says how the vehicle turned: --view-motion vehicle cannot train, and --clock-offset auto has changes of speed alone to go by",
        ),
        Remedy::Turns {
            from_positions: true,
        } => Some(
            "turns are known from positions alone: enough for --clock-offset auto on a few minutes with bends, not for --view-motion vehicle",
        ),
        _ => None,
    }
}

/// What to do, where an option does it.
fn remedy(remedy: &Remedy) -> Option<String> {
    const AUTO: &str = "data import --clock-offset auto measures what is left between the clocks";
    Some(match remedy {
        Remedy::OtherLog => {
            "switch the camera's GPS on and wait for its fix; or bring another log: deepfusion data import LOG --video FILE --out DRIVE".into()
        }
        Remedy::Signal => "give --dbc FILE and --speed Message.Signal".into(),
        Remedy::Columns(hint) => format!("{hint}: --time COLUMN --speed COLUMN --unit km/h"),
        Remedy::SpeedUnit => "say the unit: --unit km/h (m/s, mph, knots)".into(),
        Remedy::VehicleSpeed => {
            "drive faster or longer, or log the vehicle's own speed: OBD, CAN (--dbc FILE --speed Message.Signal)".into()
        }
        Remedy::Import { log, video } => format!(
            "deepfusion data import {}{} --out DRIVE, with the camera as --hfov DEGREES, --intrinsics or --calibration (deepfusion calibrate \
             measures it); then deepfusion doctor DRIVE",
            log.display(),
            if *video { " --video FILE" } else { "" }
        ),
        Remedy::Turns { .. } => {
            "--view-motion posenet or distance need no turns; a second log with a gyroscope brings them: deepfusion data import LOG GYROSCOPE …".into()
        }
        Remedy::StartOfVideo(Clock::LocalDate) => {
            format!("deepfusion data import … --zone +02:00; {AUTO}")
        }
        Remedy::StartOfVideo(Clock::TimeOfDay | Clock::Free) => {
            format!("deepfusion data import … --start TIME says it; {AUTO}")
        }
        Remedy::StartOfVideo(_) => AUTO.into(),
        Remedy::ClockOffset { camera_ahead_s } => format!(
            "clock.camera_ahead_s = {camera_ahead_s:.3} in the file beside the recording, or a clock offset of {:.0} ms given (--clock-offset auto measures it \
             again on opening). Better: one clock for all (PTP, trigger)",
            1e3 * camera_ahead_s
        ),
        _ => return None,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_remedy_that_an_option_does_names_it() {
        for named in [
            Remedy::OtherLog,
            Remedy::Signal,
            Remedy::Columns("say which".into()),
            Remedy::SpeedUnit,
            Remedy::VehicleSpeed,
            Remedy::Import {
                log: "drive.gpx".into(),
                video: true,
            },
            Remedy::Turns {
                from_positions: true,
            },
            Remedy::StartOfVideo(Clock::Free),
            Remedy::StartOfVideo(Clock::LocalDate),
            Remedy::StartOfVideo(Clock::Date),
            Remedy::ClockOffset {
                camera_ahead_s: 0.12,
            },
        ] {
            assert!(!named.to_string().contains(" --"), "{named}");
            assert!(remedy(&named).unwrap().contains("--"), "{named}");
        }
        assert_eq!(remedy(&Remedy::Words("log a drive".into())), None);
    }
}
