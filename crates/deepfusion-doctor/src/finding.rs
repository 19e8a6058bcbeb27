//! What a check reports: a figure with its limit and, if it is outside the limit, what is wrong and what to do.

use super::reason::FindingReason;
use super::skip::SkipReason;
use serde::{Serialize, Serializer};
use std::fmt;

/// The severity of a finding.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Severity {
    /// Good to know; nothing is wrong.
    Note,
    /// Training runs, but its result will suffer.
    Warning,
    /// Training fails, or its depths have a wrong scale.
    Error,
}

/// The limit of a figure.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Limit {
    /// At most this value.
    AtMost(f64),
    /// At least this value.
    AtLeast(f64),
    /// From the first value to the second, both included.
    Within(f64, f64),
}

/// A measured number and its limit.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Figure {
    /// What was measured, in a few words.
    pub quantity: &'static str,
    /// The measured value.
    #[serde(serialize_with = "finite")]
    pub value: f64,
    /// Its unit, empty for a ratio.
    pub unit: &'static str,
    /// The limit it is compared with.
    pub limit: Limit,
}

/// Something that is wrong with a recording.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Finding {
    /// Severity of the finding.
    pub severity: Severity,
    /// The check that found it, such as `clock`.
    pub check: &'static str,
    /// Number of the frame it is about, if it is about one; the first, if it is about several.
    pub frame: Option<u64>,
    /// The figure, if one was measured.
    pub figure: Option<Figure>,
    /// What is wrong, and how it affects training; in JSON a sentence.
    pub what: FindingReason,
    /// What to do about it: [`FindingReason::hint`], or a program's own words.
    #[serde(rename = "remedy")]
    pub hint: String,
}

/// The result of a check.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Status {
    /// It was made, and everything is in order.
    Ok,
    /// It was made, and found something.
    Found,
    /// It could not be made; the reason is in the `skipped` of its outcome.
    NotChecked,
}

/// What one check measured and found.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Outcome {
    /// The check's name.
    pub check: &'static str,
    /// Everything it measured, within the limits or not.
    pub measured: Vec<Figure>,
    /// Why it could not measure, if it could not; in JSON a sentence.
    pub skipped: Option<SkipReason>,
    /// What it found.
    pub findings: Vec<Finding>,
}

impl Limit {
    /// Whether a value is within it. NaN is not.
    #[must_use]
    pub fn holds(&self, value: f64) -> bool {
        match *self {
            Self::AtMost(most) => value <= most,
            Self::AtLeast(least) => value >= least,
            Self::Within(least, most) => (least..=most).contains(&value),
        }
    }
}

impl Figure {
    /// A measurement.
    #[must_use]
    pub fn new(quantity: &'static str, value: f64, unit: &'static str, limit: Limit) -> Self {
        Self {
            quantity,
            value,
            unit,
            limit,
        }
    }

    /// Whether it is within its limit.
    #[must_use]
    pub fn holds(&self) -> bool {
        self.limit.holds(self.value)
    }
}

impl Outcome {
    /// The result. A check that could measure one thing of two counts as made. One that only notes the consequences of not having
    /// measured counts as not made.
    #[must_use]
    pub fn status(&self) -> Status {
        let complains = self.findings.iter().any(|f| f.severity > Severity::Note);
        if self.skipped.is_some() && self.measured.is_empty() && !complains {
            Status::NotChecked
        } else if self.findings.is_empty() {
            Status::Ok
        } else {
            Status::Found
        }
    }

    /// How many of its findings have this severity.
    #[must_use]
    pub fn count(&self, severity: Severity) -> usize {
        let findings = self.findings.iter();
        findings.filter(|found| found.severity == severity).count()
    }

    /// The outcome of a check before it measures.
    pub(crate) fn new(check: &'static str) -> Self {
        Self {
            check,
            measured: Vec::new(),
            skipped: None,
            findings: Vec::new(),
        }
    }

    /// The outcome of a check that cannot measure.
    pub(crate) fn skipped(check: &'static str, why: impl Into<SkipReason>) -> Self {
        Self {
            skipped: Some(why.into()),
            ..Self::new(check)
        }
    }

    /// Adds a figure; if it is outside its limit, `what` becomes a finding.
    pub(crate) fn judge<W: Into<FindingReason>>(
        &mut self,
        severity: Severity,
        figure: Figure,
        what: impl FnOnce() -> W,
    ) {
        self.judge_at(severity, None, figure, what);
    }

    /// The same for a figure that comes from single frames; `frame` is the first of them.
    pub(crate) fn judge_at<W: Into<FindingReason>>(
        &mut self,
        severity: Severity,
        frame: Option<u64>,
        figure: Figure,
        what: impl FnOnce() -> W,
    ) {
        if !figure.holds() {
            self.push(severity, frame, Some(figure.clone()), what().into());
        }
        self.measured.push(figure);
    }

    /// Adds a finding without a figure, about a frame or the whole drive.
    pub(crate) fn find(
        &mut self,
        severity: Severity,
        frame: Option<u64>,
        what: impl Into<FindingReason>,
    ) {
        self.push(severity, frame, None, what.into());
    }

    fn push(
        &mut self,
        severity: Severity,
        frame: Option<u64>,
        figure: Option<Figure>,
        what: FindingReason,
    ) {
        self.findings.push(Finding {
            severity,
            check: self.check,
            frame,
            figure,
            hint: what.hint(),
            what,
        });
    }
}

impl fmt::Display for Severity {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Note => "note",
            Self::Warning => "warning",
            Self::Error => "error",
        })
    }
}

impl fmt::Display for Figure {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let space = if self.unit.is_empty() { "" } else { " " };
        write!(
            f,
            "{} {}{space}{} ",
            self.quantity,
            short(self.value),
            self.unit
        )?;
        match self.limit {
            Limit::AtMost(most) => write!(f, "(at most {})", short(most)),
            Limit::AtLeast(least) => write!(f, "(at least {})", short(least)),
            Limit::Within(least, most) => write!(f, "({} to {})", short(least), short(most)),
        }
    }
}

/// The value with three significant digits.
fn short(value: f64) -> String {
    let digits = match value.abs() {
        v if v >= 100.0 => 0,
        v if v >= 10.0 => 1,
        v if v >= 0.1 || v == 0.0 => 2,
        _ => 4,
    };
    let text = format!("{value:.digits$}");
    if text.contains('.') {
        text.trim_end_matches('0').trim_end_matches('.').to_owned()
    } else {
        text
    }
}

/// JSON has no infinity or NaN; `null` stands for them.
fn finite<S: Serializer>(value: &f64, serializer: S) -> Result<S::Ok, S::Error> {
    value.is_finite().then_some(*value).serialize(serializer)
}

/// The median of the values; NaN for none.
pub(crate) fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied().unwrap_or(f64::NAN)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{MotionReason, MotionSkip};

    #[test]
    fn a_figure_is_printed_with_its_limit() {
        let figure = Figure::new("offset", 0.30049, "s", Limit::Within(-0.02, 0.02));
        assert!(!figure.holds());
        assert_eq!(figure.to_string(), "offset 0.3 s (-0.02 to 0.02)");
        let share = Figure::new("share", 25.0, "%", Limit::AtMost(30.0));
        assert!(share.holds());
        assert_eq!(share.to_string(), "share 25 % (at most 30)");
    }

    #[test]
    fn a_skipped_check_with_only_a_note_counts_as_not_made() {
        let mut outcome = Outcome::skipped("speed", MotionSkip::NoRoad);
        let unchecked = MotionReason::Unchecked { fastest_mps: 50.0 };
        outcome.find(Severity::Note, None, unchecked);
        assert_eq!(outcome.status(), Status::NotChecked);
        outcome.find(Severity::Warning, None, MotionReason::TurnsUnrelated);
        assert_eq!(outcome.status(), Status::Found);
        outcome.findings.clear();
        assert_eq!(outcome.status(), Status::NotChecked);
        outcome.skipped = None;
        assert_eq!(outcome.status(), Status::Ok);
    }

    #[test]
    fn nan_is_outside_every_limit() {
        for limit in [
            Limit::AtMost(1.0),
            Limit::AtLeast(0.0),
            Limit::Within(0.0, 1.0),
        ] {
            let figure = Figure::new("x", f64::NAN, "", limit);
            assert!(!figure.holds());
            let json = serde_json::to_value(&figure).unwrap();
            assert!(json["value"].is_null(), "{json}");
        }
    }
}
