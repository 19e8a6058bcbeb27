//! What a check says: a figure against its limit, and, where it does not hold, what is wrong and what to do.

use super::reason::FindingReason;
use super::skip::SkipReason;
use serde::{Serialize, Serializer};
use std::fmt;

/// How bad a finding is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Severity {
    /// Good to know.
    Note,
    /// Training runs, and its result will suffer.
    Warning,
    /// Training fails, or its depths have a wrong scale.
    Error,
}

/// What a figure has to keep to.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Limit {
    /// Not above.
    AtMost(f64),
    /// Not below.
    AtLeast(f64),
    /// From the first to the second, both included.
    Within(f64, f64),
}

/// A measured number and its limit.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Figure {
    /// What was measured, in a few words.
    pub quantity: &'static str,
    /// The number.
    #[serde(serialize_with = "finite")]
    pub value: f64,
    /// Its unit, empty for a ratio.
    pub unit: &'static str,
    /// What it has to keep to.
    pub limit: Limit,
}

/// Something that is wrong with a recording.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Finding {
    /// How bad it is.
    pub severity: Severity,
    /// The check that found it, such as `clock`.
    pub check: &'static str,
    /// The number of the frame it is about, where it is about one; the first, where it is about several.
    pub frame: Option<u64>,
    /// What was measured, where something was.
    pub figure: Option<Figure>,
    /// What is wrong, and what it does to a training; in JSON a sentence.
    pub what: FindingReason,
    /// What to do about it: [`FindingReason::hint`], or a program's own words.
    #[serde(rename = "remedy")]
    pub hint: String,
}

/// How a check came out.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Status {
    /// It looked, and what it looked at is in order.
    Ok,
    /// It found something.
    Found,
    /// It could not look; why is in the `skipped` of its outcome.
    NotChecked,
}

/// What one check measured and found.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Outcome {
    /// The check's name.
    pub check: &'static str,
    /// Everything it measured, whether it holds or not.
    pub measured: Vec<Figure>,
    /// Why it could not measure, if so; in JSON a sentence.
    pub skipped: Option<SkipReason>,
    /// What it found.
    pub findings: Vec<Finding>,
}

impl Limit {
    /// Whether a value keeps to it. NaN does not.
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

    /// Whether it keeps to its limit.
    #[must_use]
    pub fn holds(&self) -> bool {
        self.limit.holds(self.value)
    }
}

impl Outcome {
    /// How it came out. A check that measured one thing of two counts as one that looked, and one that merely notes what follows from not
    /// having looked as one that did not.
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

    /// How many of its findings are as bad as this.
    #[must_use]
    pub fn count(&self, severity: Severity) -> usize {
        let findings = self.findings.iter();
        findings.filter(|found| found.severity == severity).count()
    }

    /// Of a check that has not measured yet.
    pub(crate) fn new(check: &'static str) -> Self {
        Self {
            check,
            measured: Vec::new(),
            skipped: None,
            findings: Vec::new(),
        }
    }

    /// Of a check that cannot measure.
    pub(crate) fn skipped(check: &'static str, why: impl Into<SkipReason>) -> Self {
        Self {
            skipped: Some(why.into()),
            ..Self::new(check)
        }
    }

    /// Notes a figure; where it does not hold, `what` becomes a finding.
    pub(crate) fn judge<W: Into<FindingReason>>(
        &mut self,
        severity: Severity,
        figure: Figure,
        what: impl FnOnce() -> W,
    ) {
        self.judge_at(severity, None, figure, what);
    }

    /// The same of a figure that comes from single frames: the first of them, to look at.
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

    /// A finding without a figure, about a frame or the whole.
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

/// Three digits that count.
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

/// JSON has no infinity; `null` stands for what is not finite.
fn finite<S: Serializer>(value: &f64, serializer: S) -> Result<S::Ok, S::Error> {
    value.is_finite().then_some(*value).serialize(serializer)
}

/// The middle of the values; NaN where there is none.
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
    fn who_notes_that_he_could_not_look_did_not_look() {
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
    fn nan_never_holds() {
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
