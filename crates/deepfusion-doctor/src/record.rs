//! What the checks say, as a document for scripts.

use serde::Serialize;

use crate::{Diagnosis, DriveDiagnosis, Finding, Outcome, Severity, SkipReason, Status};

/// A [`Diagnosis`] with its findings counted and in one list.
#[derive(Debug, Serialize)]
pub struct DiagnosisRecord<'a> {
    /// A line for each check.
    pub checks: Vec<CheckRecord<'a>>,
    /// Findings that make training fail or its scale wrong.
    pub errors: usize,
    /// Findings that make it worse.
    pub warnings: usize,
    /// All findings, the worst first.
    pub findings: Vec<FindingRecord<'a>>,
    /// The checks of the recording as a whole.
    pub recording: &'a [Outcome],
    /// Drive by drive.
    pub drives: &'a [DriveDiagnosis],
}

/// How a check went.
#[derive(Debug, Serialize)]
pub struct CheckRecord<'a> {
    /// The drive it looked at; none where it looked at the recording.
    pub drive: Option<&'a str>,
    /// The check's name.
    pub check: &'a str,
    /// Whether it was made, and found something.
    pub status: Status,
    /// How much it found.
    pub findings: usize,
    /// Why it was not made.
    pub why: Option<&'a SkipReason>,
}

/// A finding and where it was made.
#[derive(Debug, Serialize)]
pub struct FindingRecord<'a> {
    /// The drive it is about; none where it is about the recording.
    pub drive: Option<&'a str>,
    /// What was found.
    pub finding: &'a Finding,
}

impl Diagnosis {
    /// How many findings are as bad as this.
    #[must_use]
    pub fn count(&self, severity: Severity) -> usize {
        let findings = self.findings();
        findings
            .iter()
            .filter(|(_, finding)| finding.severity == severity)
            .count()
    }

    /// Every check that was made or could not be, each drive's and then the whole recording's, with the drive it is about.
    pub fn outcomes(&self) -> impl Iterator<Item = (Option<&str>, &Outcome)> {
        let drives = self.drives.iter();
        let drives =
            drives.flat_map(|d| d.outcomes.iter().map(move |o| (Some(d.name.as_str()), o)));
        drives.chain(self.recording.iter().map(|o| (None, o)))
    }

    /// For scripts.
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
