//! The result of each check over all drives.

use crate::{Diagnosis, Outcome, SkipReason, Status};

/// A check, and its outcome for every drive.
#[derive(Debug, Clone, PartialEq)]
pub struct CheckSummary<'a> {
    /// The check's name.
    pub check: &'static str,
    /// The outcomes, each with its drive; `None` for the recording.
    pub outcomes: Vec<(Option<&'a str>, &'a Outcome)>,
}

impl<'a> CheckSummary<'a> {
    /// The drives with this status.
    pub fn with(&self, status: Status) -> impl Iterator<Item = (Option<&'a str>, &'a Outcome)> {
        let outcomes = self.outcomes.iter().copied();
        outcomes.filter(move |(_, outcome)| outcome.status() == status)
    }

    /// Why it could not be made, and for which drives. Most drives of a folder have the same sensors, and so the same reason.
    /// Reasons are the same if their texts are.
    #[must_use]
    pub fn not_checked(&self) -> Vec<(&'a SkipReason, Vec<Option<&'a str>>)> {
        let mut reasons: Vec<(&SkipReason, Vec<Option<&str>>)> = Vec::new();
        for (drive, outcome) in self.with(Status::NotChecked) {
            let Some(why) = &outcome.skipped else {
                continue;
            };
            let message = why.to_string();
            match reasons
                .iter_mut()
                .find(|(one, _)| one.to_string() == message)
            {
                Some((_, drives)) => drives.push(drive),
                None => reasons.push((why, vec![drive])),
            }
        }
        reasons
    }
}

impl Diagnosis {
    /// The checks by name, in the order in which they are made.
    #[must_use]
    pub fn checks(&self) -> Vec<CheckSummary<'_>> {
        let mut checks: Vec<CheckSummary<'_>> = Vec::new();
        for (drive, outcome) in self.outcomes() {
            match checks.iter_mut().find(|one| one.check == outcome.check) {
                Some(known) => known.outcomes.push((drive, outcome)),
                None => checks.push(CheckSummary {
                    check: outcome.check,
                    outcomes: vec![(drive, outcome)],
                }),
            }
        }
        checks
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{DriveDiagnosis, DrivePlots, Figure, FramesSkip, Limit, MotionSkip};
    use deepfusion_data::DatasetKind;

    fn drive(name: &str, outcomes: Vec<Outcome>) -> DriveDiagnosis {
        DriveDiagnosis {
            name: name.into(),
            camera: 2,
            kind: DatasetKind::Folder,
            frames: 9,
            looked_at: 9,
            outcomes,
            place: name.into(),
            plots: DrivePlots::default(),
        }
    }

    fn ok(check: &'static str) -> Outcome {
        let mut outcome = Outcome::new(check);
        let figure = Figure::new("any", 0.0, "", Limit::AtMost(1.0));
        outcome.measured.push(figure);
        outcome
    }

    #[test]
    fn checks_and_reasons_are_merged_over_all_drives() {
        let turns = |spread_radps| MotionSkip::HardlyTurns {
            spread_radps,
            needed_radps: 0.015,
        };
        let skipped = |why: MotionSkip| Outcome::skipped("turn", why);
        let diagnosis = Diagnosis {
            recording: vec![ok("stereo")],
            drives: vec![
                drive("a", vec![ok("timing"), skipped(turns(0.00401))]),
                drive(
                    "b",
                    vec![
                        Outcome::skipped("timing", FramesSkip::NoTimes),
                        skipped(turns(0.00402)),
                    ],
                ),
                drive("c", vec![ok("timing"), skipped(turns(0.009))]),
            ],
        };
        let checks = diagnosis.checks();
        let names: Vec<&str> = checks.iter().map(|check| check.check).collect();
        assert_eq!(names, ["timing", "turn", "stereo"]);
        assert_eq!(checks[0].with(Status::Ok).count(), 2);
        let no_times = SkipReason::from(FramesSkip::NoTimes);
        assert_eq!(checks[0].not_checked(), vec![(&no_times, vec![Some("b")])]);
        let drives: Vec<_> = checks[1]
            .not_checked()
            .into_iter()
            .map(|(_, d)| d)
            .collect();
        assert_eq!(drives, [vec![Some("a"), Some("b")], vec![Some("c")]]);
        assert_eq!(checks[2].outcomes[0].0, None);
    }
}
