//! One line per check: ok, what was found, or why it was not checked.

use std::fmt::Write as _;

use deepfusion_doctor::{CheckSummary, Diagnosis, Outcome, Severity, SkipReason, Status};
use deepfusion_hint::count_of;

/// The checks as lines of text.
pub(super) fn of(diagnosis: &Diagnosis) -> String {
    let mut text = String::new();
    for (check, how) in rows(diagnosis) {
        let _ = writeln!(text, "  {check:15} {how}");
    }
    text
}

/// The checks by name, in order, each with its result over all drives. Checks that were skipped because the recording cannot be opened
/// are one row.
pub(super) fn rows(diagnosis: &Diagnosis) -> Vec<(&'static str, String)> {
    let (unopened, checks): (Vec<_>, Vec<_>) =
        diagnosis.checks().into_iter().partition(had_nothing);
    let mut rows: Vec<_> = checks
        .iter()
        .map(|check| (check.check, summary(check)))
        .collect();
    if let Some(first) = unopened.first() {
        rows.push(("all others", summary(first)));
    }
    rows
}

/// Whether the recording could not be opened for a check.
fn had_nothing(check: &CheckSummary<'_>) -> bool {
    let mut outcomes = check.outcomes.iter();
    outcomes.all(|(_, outcome)| outcome.skipped == Some(SkipReason::NotOpened))
}

/// The result of one check.
fn summary(check: &CheckSummary<'_>) -> String {
    if let [(_, only)] = check.outcomes.as_slice() {
        return match (only.status(), &only.skipped) {
            (Status::Ok, None) => "ok".into(),
            (Status::Ok, Some(why)) => format!("partly checked, ok: {why}"),
            (Status::Found, _) => format!("found: {}", counts(only)),
            (Status::NotChecked, why) => {
                let why = why.as_ref().map(ToString::to_string);
                format!("not checked: {}", why.unwrap_or_default())
            }
        };
    }
    let of = check.outcomes.len();
    let mut parts = Vec::new();
    let ok = check.with(Status::Ok).count();
    if ok > 0 {
        parts.push(format!("ok in {ok} of {of}"));
    }
    let found: Vec<String> = check
        .with(Status::Found)
        .map(|(drive, outcome)| format!("{} ({})", drive.unwrap_or_default(), counts(outcome)))
        .collect();
    if !found.is_empty() {
        parts.push(format!("found in {}", found.join(", ")));
    }
    for (why, drives) in check.not_checked() {
        parts.push(if drives.len() == of {
            format!("not checked: {why}")
        } else {
            let drives: Vec<&str> = drives.into_iter().map(Option::unwrap_or_default).collect();
            format!("not checked in {}: {why}", drives.join(", "))
        });
    }
    parts.join("; ")
}

/// `1 error, 2 notes`.
fn counts(outcome: &Outcome) -> String {
    let kinds = [Severity::Error, Severity::Warning, Severity::Note];
    let counted = kinds.into_iter().filter_map(|severity| {
        let of_kind = outcome.count(severity);
        (of_kind > 0).then(|| count_of(of_kind, &severity.to_string()))
    });
    counted.collect::<Vec<_>>().join(", ")
}
