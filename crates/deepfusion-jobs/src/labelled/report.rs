//! How well targets agree with labels, as text and as JSON.

use std::fmt;

use deepfusion_eval::PostProcess;
use deepfusion_hint::count_of;
use deepfusion_perception::{ScoringRules, TargetScore};
use serde::Serialize;

use super::TargetEvaluation;

/// The score, with its conditions: text for people, JSON for scripts.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct TargetReport {
    /// The source of depth: `truth`, `lidar` or `predicted`.
    pub depth: &'static str,
    /// How several predictions of each image were combined; `None` for single predictions.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub post_process: Option<&'static str>,
    /// The rules by which targets match labels.
    pub rules: ScoringRules,
    /// The score.
    #[serde(flatten)]
    pub score: TargetScore,
}

impl TargetEvaluation {
    /// The report so far; `post_process` is how the predictions of each image were combined.
    #[must_use]
    pub fn report(&self, post_process: Option<PostProcess>) -> TargetReport {
        TargetReport {
            depth: self.source().word(),
            post_process: post_process.map(PostProcess::name),
            rules: ScoringRules::default(),
            score: self.score(),
        }
    }
}

impl fmt::Display for TargetReport {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let score = &self.score;
        let share =
            |value: Option<f64>| value.map_or("–".into(), |v| format!("{:.1} %", 100.0 * v));
        let number = |value: Option<f64>, unit: &str| {
            value.map_or("–".into(), |v| format!("{v:.2} {unit}"))
        };
        let combined = self.post_process.map(|how| format!(" ({how})"));
        writeln!(
            f,
            "targets from {}{} depth, {}\n",
            self.depth,
            combined.unwrap_or_default(),
            count_of(score.frames, "frame")
        )?;
        writeln!(
            f,
            "recall       {:>8}   {} of {}",
            share(score.recall),
            score.found,
            count_of(score.labels, "box")
        )?;
        writeln!(
            f,
            "precision    {:>8}   {} on no box",
            share(score.precision),
            count_of(score.false_targets, "target")
        )?;
        writeln!(f, "centre       {:>8}", number(score.center_error_m, "m"))?;
        writeln!(f, "yaw          {:>8}", number(score.yaw_error_deg, "°"))?;
        writeln!(
            f,
            "velocity     {:>8}   {} compared; moving or not: {}",
            number(score.velocity_error_mps, "m/s"),
            score.velocities,
            share(score.motion_accuracy)
        )?;
        writeln!(
            f,
            "identities   {:>8} {}\n",
            score.identity_switches,
            if score.identity_switches == 1 {
                "switch"
            } else {
                "switches"
            }
        )?;
        for range in &score.ranges {
            writeln!(
                f,
                "  {:>2.0} to {:>2.0} m   recall {:>8}   {} of {}",
                range.from_m,
                range.to_m,
                share(range.recall),
                range.found,
                range.labels
            )?;
        }
        Ok(())
    }
}
