//! Whether fine-tuning made a network worse, as far as that can be measured without ground truth.

use std::fmt;

use serde::{Deserialize, Serialize};

use super::Verdict;

/// The share by which the reprojection error may rise: it is an average over thousands of pixels and hardly varies.
const REPROJECTION: f64 = 0.01;
/// The share and the amount by which disagreements between depths may rise, whichever is larger.
const DISAGREEMENT: (f64, f64) = (0.15, 0.005);
/// The amount by which the scale bias may grow.
const BIAS: f64 = 0.02;

/// A check whose value became worse.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct WorsenedCheck {
    /// The check that became worse.
    pub check: Check,
    /// Its value before.
    pub before: f64,
    /// Its value now; `None` if the depth is so wrong that too few frames still give a value.
    pub after: Option<f64>,
}

/// A quantity that is compared.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Check {
    /// How well each frame is reconstructed from its neighbour.
    Reprojection,
    /// Depth compared with that warped from the frame before.
    Consistency,
    /// Depth compared with that of the mirrored image.
    Flip,
    /// The size of the scale bias.
    Scale,
}

impl Verdict {
    /// The checks that are worse in `after`, or have no value there any more; both verdicts are of the same frames. `None` if this verdict
    /// has no values.
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
            // NaN is worse than any number.
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

    /// Whether more than half of the pairs of frames behind a value have dropped out because the frames no longer overlap: the remaining
    /// pairs are not representative.
    fn lost_pairs(&self, check: Check, after: &Self) -> bool {
        let pairs = |of: &Self| of.without_truth.reprojection.map_or(0, |r| r.pairs);
        check == Check::Reprojection && 2 * pairs(after) < pairs(self)
    }

    /// The value of a check; lower is better.
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
    /// The value as text.
    #[must_use]
    pub fn figure(self, value: f64) -> String {
        match self {
            Self::Reprojection => format!("{value:.4}"),
            Self::Consistency | Self::Flip | Self::Scale => format!("{:.1} %", 100.0 * value),
        }
    }

    /// The largest value that does not count as worse than `before`: the same network varies that much between frames of one drive.
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
    fn worsened_checks_are_reported() {
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
        // NaN is not better either.
        assert_eq!(
            names(before.worse(&verdict(f64::NAN, 0.03, 0.05))),
            [Check::Reprojection]
        );
        assert_eq!(Verdict::default().worse(&before), None);
    }

    /// Depth so near that every pixel is warped out of the image has no reprojection error at all.
    #[test]
    fn a_check_that_lost_its_value_is_worse() {
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
