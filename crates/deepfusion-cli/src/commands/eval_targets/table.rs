use deepfusion_hint::count_of;
use deepfusion_perception::TargetScore;

/// The score in words.
pub(super) fn text(depth: &str, score: &TargetScore) -> String {
    let share = |value: Option<f64>| value.map_or("–".into(), |v| format!("{:.1} %", 100.0 * v));
    let number =
        |value: Option<f64>, unit: &str| value.map_or("–".into(), |v| format!("{v:.2} {unit}"));
    let mut lines = vec![
        format!(
            "targets from {depth} depth, {}",
            count_of(score.frames, "frame")
        ),
        String::new(),
        format!(
            "recall       {:>8}   {} of {}",
            share(score.recall),
            score.found,
            count_of(score.labels, "box")
        ),
        format!(
            "precision    {:>8}   {} on no box",
            share(score.precision),
            count_of(score.false_targets, "target")
        ),
        format!("centre       {:>8}", number(score.center_error_m, "m")),
        format!("yaw          {:>8}", number(score.yaw_error_deg, "°")),
        format!(
            "velocity     {:>8}   {} compared; moving or not: {}",
            number(score.velocity_error_mps, "m/s"),
            score.velocities,
            share(score.motion_accuracy)
        ),
        format!("identities   {:>8} switches", score.identity_switches),
        String::new(),
    ];
    for range in &score.ranges {
        lines.push(format!(
            "  {:>2.0} to {:>2.0} m   recall {:>8}   {} of {}",
            range.from_m,
            range.to_m,
            share(range.recall),
            range.found,
            range.labels
        ));
    }
    lines.join("\n") + "\n"
}
