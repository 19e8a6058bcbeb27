//! The outcome of an adaptation.

use std::fmt;
use std::path::{Path, PathBuf};

use deepfusion_eval::verdict::{Check, Verdict, WorsenedCheck};
use deepfusion_hint::count_of;
use serde::Serialize;

use crate::Result;
use crate::files::write;

/// The verdicts before and after, and the decision; written as `adapt.json` into the run's folder.
#[derive(Debug, Serialize)]
pub struct Outcome {
    /// Name of the given network.
    pub from: String,
    /// Path of the adapted network's run.
    #[serde(skip_serializing_if = "is_nowhere")]
    pub run: PathBuf,
    /// Number of training steps.
    pub steps: usize,
    /// Whether the adapted network replaces the given one.
    pub kept: bool,
    /// The checks that became worse.
    pub worse: Vec<WorsenedCheck>,
    /// The verdict on the given network, on the held-out frames.
    pub before: Verdict,
    /// The verdict on the adapted network, on the same frames.
    pub after: Verdict,
}

fn is_nowhere(path: &Path) -> bool {
    path.as_os_str().is_empty()
}

impl Outcome {
    /// Compares the verdicts; the run's path is not yet known.
    pub(super) fn of(from: String, steps: usize, (before, after): (Verdict, Verdict)) -> Self {
        let worse = before.worse(&after);
        Self {
            from,
            run: PathBuf::new(),
            steps,
            kept: worse.as_ref().is_some_and(Vec::is_empty),
            worse: worse.unwrap_or_default(),
            before,
            after,
        }
    }

    /// Why it does not replace the given network; `None` if it does.
    #[must_use]
    pub fn refusal(&self) -> Option<Refusal<'_>> {
        if self.kept {
            None
        } else if self.worse.is_empty() {
            Some(Refusal::NotJudged)
        } else {
            Some(Refusal::Worse(&self.worse))
        }
    }

    /// Writes the outcome into the run's folder, so that it moves with it.
    pub(super) fn write(&self, folder: &Path) -> Result<()> {
        let text = serde_json::to_string_pretty(self)?;
        Ok(write(&folder.join("adapt.json"), text + "\n")?)
    }
}

/// Why an adapted network does not replace the given one.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub enum Refusal<'a> {
    /// These checks became worse.
    Worse(&'a [WorsenedCheck]),
    /// No check can be compared.
    NotJudged,
}

impl fmt::Display for Refusal<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Worse(checks) => {
                let checks: Vec<String> = checks.iter().map(ToString::to_string).collect();
                f.write_str(&checks.join(", "))
            }
            Self::NotJudged => f.write_str("the held-out frames can no longer be used to judge it"),
        }
    }
}

/// Before and after, one check per line, with the largest value that does not count as worse.
impl fmt::Display for Outcome {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(
            f,
            "{:<36}{:>10}{:>10}{:>10}",
            format!(
                "held out ({})",
                count_of(self.after.without_truth.frames, "frame")
            ),
            "before",
            "after",
            "at most"
        )?;
        let mut row = |name: &str, figures: [Option<String>; 3]| {
            write!(f, "{name:<36}")?;
            for figure in figures {
                write!(f, "{:>10}", figure.as_deref().unwrap_or("–"))?;
            }
            writeln!(f)
        };
        for check in [
            Check::Reprojection,
            Check::Consistency,
            Check::Flip,
            Check::Scale,
        ] {
            let of = |verdict: &Verdict| verdict.of(check).map(|value| check.figure(value));
            let most = self.before.of(check).map(|before| check.most(before));
            let most = most.map(|most| check.figure(most));
            row(
                &check.to_string(),
                [of(&self.before), of(&self.after), most],
            )?;
        }
        let scale = |verdict: &Verdict| {
            let certificate = verdict.scale_certificate.as_ref();
            certificate.map(|certificate| format!("{:.3}", certificate.scale))
        };
        row(
            "scale (1 is metric)",
            [scale(&self.before), scale(&self.after), None],
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// 4.6 to 4.8 % is kept, and the table shows why.
    #[test]
    fn the_table_shows_the_largest_value_that_is_not_worse() {
        let verdict = |flip| {
            let mut verdict = Verdict::default();
            verdict.without_truth.flip = Some(flip);
            verdict
        };
        let outcome = Outcome::of("street".into(), 9, (verdict(0.046), verdict(0.048)));
        assert!(outcome.kept);
        let table = outcome.to_string();
        let words =
            |line: &str| -> Vec<String> { line.split_whitespace().map(str::to_owned).collect() };
        let flip = table.lines().find(|line| line.contains("mirrored"));
        let flip = words(flip.unwrap());
        assert!(
            flip.ends_with(&["4.6", "%", "4.8", "%", "5.3", "%"].map(str::to_owned)),
            "{table}"
        );
        assert!(
            table.lines().next().unwrap().ends_with("at most"),
            "{table}"
        );
    }

    #[test]
    fn a_network_that_cannot_be_judged_is_not_kept() {
        let (before, after) = (Verdict::default(), Verdict::default());
        let outcome = Outcome::of("street".into(), 9, (before, after));
        let refusal = outcome.refusal();
        assert_eq!(refusal, Some(Refusal::NotJudged));
        assert_eq!(
            refusal.map(|refusal| refusal.to_string()).as_deref(),
            Some("the held-out frames can no longer be used to judge it")
        );
    }
}
