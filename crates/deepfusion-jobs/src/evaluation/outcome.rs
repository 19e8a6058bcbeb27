//! All results of an evaluation, as text and as JSON.

use std::fmt;

use deepfusion_eval::Report;
use deepfusion_eval::verdict::{ScaleCertificate, Verdict};
use serde::{Serialize, Serializer};

use super::UsedCheckpoint;

/// All results of an evaluation, as far as the data allow: text for people, JSON for scripts.
#[derive(Debug, Clone, Default)]
pub struct EvaluationOutcome {
    /// The network's checkpoint that was evaluated.
    pub checkpoint: Option<UsedCheckpoint>,
    /// The metrics, if there is ground truth.
    pub report: Option<Report>,
    /// The verdict without ground truth.
    pub verdict: Option<Verdict>,
}

/// The JSON of the results.
#[derive(Serialize)]
struct OutcomeRecord<'a> {
    #[serde(skip_serializing_if = "Option::is_none")]
    checkpoint: Option<&'a UsedCheckpoint>,
    #[serde(flatten)]
    report: Option<&'a Report>,
    /// The scale certificate, if there is no ground truth; `null` if no part of the drives was suitable. It is always in
    /// `scale_certificate`, too.
    #[serde(skip_serializing_if = "Option::is_none")]
    certificate: Option<Option<&'a ScaleCertificate>>,
    #[serde(flatten)]
    verdict: Option<&'a Verdict>,
}

impl Serialize for EvaluationOutcome {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let verdict = self.verdict.as_ref();
        let certificate = verdict.and_then(|verdict| verdict.scale_certificate.as_ref());
        OutcomeRecord {
            checkpoint: self.checkpoint.as_ref(),
            report: self.report.as_ref(),
            certificate: self.report.is_none().then_some(certificate),
            verdict,
        }
        .serialize(serializer)
    }
}

impl fmt::Display for EvaluationOutcome {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if let Some(checkpoint) = &self.checkpoint {
            write!(f, "{checkpoint}\n\n")?;
        }
        if let Some(report) = &self.report {
            write!(f, "{report}")?;
        }
        if let Some(verdict) = &self.verdict {
            let between = if self.report.is_some() { "\n" } else { "" };
            write!(f, "{between}{verdict}")?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use deepfusion_eval::verdict::{BlockScale, Evidence};

    #[test]
    fn without_ground_truth_the_certificate_comes_first() {
        let block = BlockScale {
            log_scale: 0.1,
            near_less_far: 0.0,
            points: 50,
        };
        let outcome = EvaluationOutcome {
            verdict: Some(Verdict {
                scale_certificate: ScaleCertificate::of(&[block], 0.03),
                no_certificate: None,
                without_truth: Evidence::default(),
            }),
            ..EvaluationOutcome::default()
        };
        let json = serde_json::to_value(&outcome).unwrap();
        assert_eq!(json["certificate"], json["scale_certificate"]);
        assert_eq!(json["certificate"]["blocks"], 1);
        assert!(json.get("checkpoint").is_none());
        let text = outcome.to_string();
        assert!(text.starts_with("without ground truth"), "{text}");
    }
}
