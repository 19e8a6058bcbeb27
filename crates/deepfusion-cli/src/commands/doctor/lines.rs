//! A line a check: in order, found something, or not checked and why.

use std::fmt::Write as _;

use deepfusion_doctor::{Outcome, Severity, Status};
use deepfusion_hint::count_of;

/// A check and the drive it looked at; no drive where it looked at the whole recording.
type Checked<'a> = (Option<&'a str>, &'a Outcome);

/// The checks as lines of text.
pub(super) fn of(checks: &[Checked<'_>]) -> String {
    let mut text = String::new();
    for (check, how) in rows(checks) {
        let _ = writeln!(text, "  {check:15} {how}");
    }
    text
}

/// The checks by name, in the order in which they come, each with how it came out in all drives.
pub(super) fn rows<'a>(checks: &[Checked<'a>]) -> Vec<(&'a str, String)> {
    let mut names: Vec<&str> = Vec::new();
    for (_, outcome) in checks {
        if !names.contains(&outcome.check) {
            names.push(outcome.check);
        }
    }
    let row = |name: &'a str| {
        let of_name = checks.iter().filter(|(_, outcome)| outcome.check == name);
        (name, summary(&of_name.copied().collect::<Vec<_>>()))
    };
    names.into_iter().map(row).collect()
}

/// How one check came out.
fn summary(checks: &[Checked<'_>]) -> String {
    if let [(_, only)] = checks {
        return match (only.status(), &only.skipped) {
            (Status::Ok, None) => "ok".into(),
            (Status::Ok, Some(why)) => format!("ok in part: {why}"),
            (Status::Found, _) => format!("found: {}", counts(only)),
            (Status::NotChecked, why) => {
                format!("not checked: {}", why.as_deref().unwrap_or_default())
            }
        };
    }
    let with = |status| checks.iter().filter(move |(_, o)| o.status() == status);
    let mut parts = Vec::new();
    let ok = with(Status::Ok).count();
    if ok > 0 {
        parts.push(format!("ok in {ok} of {}", checks.len()));
    }
    let found: Vec<String> = with(Status::Found)
        .map(|(drive, outcome)| format!("{} ({})", drive.unwrap_or_default(), counts(outcome)))
        .collect();
    if !found.is_empty() {
        parts.push(format!("found in {}", found.join(", ")));
    }
    // Most drives of a folder have the same sensors, and so the same reason.
    let mut reasons: Vec<(&str, Vec<&str>)> = Vec::new();
    for (drive, outcome) in with(Status::NotChecked) {
        let why = outcome.skipped.as_deref().unwrap_or_default();
        let drive = drive.unwrap_or_default();
        match reasons.iter_mut().find(|(known, _)| *known == why) {
            Some((_, drives)) => drives.push(drive),
            None => reasons.push((why, vec![drive])),
        }
    }
    for (why, drives) in reasons {
        parts.push(if drives.len() == checks.len() {
            format!("not checked: {why}")
        } else {
            format!("not checked in {}: {why}", drives.join(", "))
        });
    }
    parts.join("; ")
}

/// `1 error, 2 notes`.
fn counts(outcome: &Outcome) -> String {
    let kinds = [Severity::Error, Severity::Warning, Severity::Note];
    let counted = kinds.into_iter().filter_map(|severity| {
        let of_kind = outcome.findings.iter().filter(|f| f.severity == severity);
        match of_kind.count() {
            0 => None,
            n => Some(count_of(n, &severity.to_string())),
        }
    });
    counted.collect::<Vec<_>>().join(", ")
}
