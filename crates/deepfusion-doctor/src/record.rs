//! The results of all checks, as a document for scripts.

use serde::Serialize;

use crate::{Diagnosis, DriveDiagnosis, Finding, Outcome, Severity, SkipReason, Status};

/// A [`Diagnosis`] with its findings counted and in one list.
#[derive(Debug, Serialize)]
pub struct DiagnosisRecord<'a> {
    /// One entry per check.
    pub checks: Vec<CheckRecord<'a>>,
    /// Number of findings that make training fail or its scale wrong.
    pub errors: usize,
    /// Number of findings that make the result of training worse.
    pub warnings: usize,
    /// All findings, the worst first.
    pub findings: Vec<FindingRecord<'a>>,
    /// The checks of the recording as a whole.
    pub recording: &'a [Outcome],
    /// The results of each drive.
    pub drives: &'a [DriveDiagnosis],
}

/// The result of a check.
#[derive(Debug, Serialize)]
pub struct CheckRecord<'a> {
    /// The drive that was checked; `None` for the recording.
    pub drive: Option<&'a str>,
    /// The check's name.
    pub check: &'a str,
    /// Whether it was made, and found something.
    pub status: Status,
    /// Number of findings.
    pub findings: usize,
    /// Why it was not made.
    pub why: Option<&'a SkipReason>,
}

/// A finding and the drive it is about.
#[derive(Debug, Serialize)]
pub struct FindingRecord<'a> {
    /// The drive it is about; `None` for the recording.
    pub drive: Option<&'a str>,
    /// What was found.
    pub finding: &'a Finding,
}

impl Diagnosis {
    /// How many findings have this severity.
    #[must_use]
    pub fn count(&self, severity: Severity) -> usize {
        let findings = self.findings();
        findings
            .iter()
            .filter(|(_, finding)| finding.severity == severity)
            .count()
    }

    /// Every check that was made or could not be made, with its drive: each drive's, then the whole recording's.
    pub fn outcomes(&self) -> impl Iterator<Item = (Option<&str>, &Outcome)> {
        let drives = self.drives.iter();
        let drives =
            drives.flat_map(|d| d.outcomes.iter().map(move |o| (Some(d.name.as_str()), o)));
        drives.chain(self.recording.iter().map(|o| (None, o)))
    }

    /// The diagnosis as a document for scripts.
    #[must_use]
    pub fn record(&self) -> DiagnosisRecord<'_> {
        let checks = self.outcomes().map(|(drive, outcome)| CheckRecord {
            drive,
            check: outcome.check,
            status: outcome.status(),
            findings: outcome.findings.len(),
            why: outcome.skipped.as_ref(),
        });
        let findings = self.findings().into_iter();
        DiagnosisRecord {
            checks: checks.collect(),
            errors: self.count(Severity::Error),
            warnings: self.count(Severity::Warning),
            findings: findings
                .map(|(drive, finding)| FindingRecord { drive, finding })
                .collect(),
            recording: &self.recording,
            drives: &self.drives,
        }
    }
}
