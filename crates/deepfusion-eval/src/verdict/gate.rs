//! Whether a network that was learned on became worse, by what can be known without ground truth.

use std::fmt;

use serde::{Deserialize, Serialize};

use super::Verdict;

/// A share by which the reprojection error may rise: it is of thousands of pixels and hardly varies.
const REPROJECTION: f64 = 0.01;
/// A share and an amount by which disagreements of depths may rise, whichever is more.
const DISAGREEMENT: (f64, f64) = (0.15, 0.005);
/// By how much the bias of the metre may grow.
const BIAS: f64 = 0.02;

/// A check that a network does not pass as well as the one before it.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct WorsenedCheck {
    /// The check.
    pub check: Check,
    /// What it gave before.
    pub before: f64,
    /// What it gives now; `None` where depth is so wrong, or so poor, that too few frames still give anything.
    pub after: Option<f64>,
}

/// What is compared.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Check {
    /// How well the frames explain each other.
    Reprojection,
    /// Depth against the frame before.
    Consistency,
    /// Depth against the mirrored image.
    Flip,
    /// The size of the metre's bias.
    Scale,
}

impl Verdict {
    /// The checks that `after` passes less well than this one, of the same frames, or gives no figure for any more; `None` where this one gave none.
    #[must_use]
    pub fn worse(&self, after: &Self) -> Option<Vec<WorsenedCheck>> {
        let checks = [
            Check::Reprojection,
            Check::Consistency,
            Check::Flip,
            Check::Scale,
        ];
        let mut compared = false;
        let mut worse = Vec::new();
        for check in checks {
            let Some(before) = self.of(check) else {
                continue;
            };
            compared = true;
            let after = after.of(check).filter(|_| !self.lost_pairs(check, after));
            // NaN is worse than any.
            if after.is_none_or(|after| after.is_nan() || after > check.most(before)) {
                worse.push(WorsenedCheck {
                    check,
                    before,
                    after,
                });
            }
        }
        compared.then_some(worse)
    }

    /// Whether most of the pairs of frames that a figure was the mean of are in sight of each other no longer: the few that are say nothing of them.
    fn lost_pairs(&self, check: Check, after: &Self) -> bool {
        let pairs = |of: &Self| of.without_truth.reprojection.map_or(0, |r| r.pairs);
        check == Check::Reprojection && 2 * pairs(after) < pairs(self)
    }

    /// What a check gives; lower is better.
    #[must_use]
    pub fn of(&self, check: Check) -> Option<f64> {
        let found = &self.without_truth;
        match check {
            Check::Reprojection => found.reprojection.map(|r| r.warped),
            Check::Consistency => found.consistency,
            Check::Flip => found.flip,
            Check::Scale => self.scale_certificate.as_ref().map(|c| c.bias.abs()),
        }
    }
}

impl fmt::Display for WorsenedCheck {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self {
            check,
            before,
            after,
        } = *self;
        let before = check.figure(before);
        match after {
            Some(after) => write!(f, "{check} {} after {before}", check.figure(after)),
            None => write!(f, "{check} unknown after {before}"),
        }
    }
}

impl Check {
    /// What it gives, as text.
    #[must_use]
    pub fn figure(self, value: f64) -> String {
        match self {
            Self::Reprojection => format!("{value:.4}"),
            Self::Consistency | Self::Flip | Self::Scale => format!("{:.1} %", 100.0 * value),
        }
    }

    /// The most that does not count as worse than `before`: the same network gives as much on other frames of the same drive.
    #[must_use]
    pub fn most(self, before: f64) -> f64 {
        match self {
            Self::Reprojection => before * (1.0 + REPROJECTION),
            Self::Consistency | Self::Flip => {
                let (share, amount) = DISAGREEMENT;
                before + (share * before).max(amount)
            }
            Self::Scale => before + BIAS,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::{BlockScale, Evidence, Reprojection, ScaleCertificate};
    use super::*;

    fn verdict(warped: f64, flip: f64, log_scale: f64) -> Verdict {
        let block = BlockScale {
            log_scale,
            near_less_far: 0.0,
            points: 100,
        };
        Verdict {
            scale_certificate: ScaleCertificate::of(&[block; 6], 0.03),
            no_certificate: None,
            without_truth: Evidence {
                reprojection: Some(Reprojection {
                    warped,
                    unwarped: 0.2,
                    pairs: 30,
                }),
                flip: Some(flip),
                ..Evidence::default()
            },
        }
    }

    fn names(worse: Option<Vec<WorsenedCheck>>) -> Vec<Check> {
        worse.unwrap().iter().map(|w| w.check).collect()
    }

    #[test]
    fn what_became_worse_is_named() {
        let before = verdict(0.10, 0.03, 0.05);
        assert_eq!(names(before.worse(&before)), []);
        assert_eq!(names(before.worse(&verdict(0.09, 0.034, -0.06))), []);
        assert_eq!(
            names(before.worse(&verdict(0.11, 0.03, 0.05))),
            [Check::Reprojection]
        );
        assert_eq!(
            names(before.worse(&verdict(0.08, 0.05, -0.2))),
            [Check::Flip, Check::Scale]
        );
        // NaN is no better.
        assert_eq!(
            names(before.worse(&verdict(f64::NAN, 0.03, 0.05))),
            [Check::Reprojection]
        );
        assert_eq!(Verdict::default().worse(&before), None);
    }

    /// Depth so near that every pixel leaves the picture has no reprojection error at all.
    #[test]
    fn what_gives_no_figure_any_more_is_worse() {
        let before = verdict(0.10, 0.03, 0.05);
        let mut blind = verdict(0.10, 0.01, 0.05);
        blind.scale_certificate = None;
        blind.without_truth.reprojection = None;
        let worse = before.worse(&blind).unwrap();
        assert_eq!(
            worse[0].to_string(),
            "reprojection error unknown after 0.1000"
        );
        assert_eq!(names(Some(worse)), [Check::Reprojection, Check::Scale]);
        let mut few = verdict(0.05, 0.03, 0.05);
        few.without_truth.reprojection.as_mut().unwrap().pairs = 14;
        assert_eq!(names(before.worse(&few)), [Check::Reprojection]);
        assert_eq!(names(before.worse(&Verdict::default())).len(), 3);
    }
}
