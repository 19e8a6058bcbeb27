//! The lines that a run reports during training.

use deepfusion_hint::count_of;
use deepfusion_train::{LossTerms, TrainEvent};

use crate::duration::duration_text;

/// An event as a line for people who watch the run; a step's line lacks its number. `None` for a panel, a checkpoint, and a warning, which
/// has its own text.
#[must_use]
pub fn event_line(event: &TrainEvent) -> Option<String> {
    Some(match event {
        TrainEvent::Started {
            from_step,
            steps,
            samples,
            known_depth,
            simulated,
            validation_samples,
            mean_displacement_m,
        } => {
            let going_on = if *from_step > 0 {
                format!(", continuing after step {from_step}")
            } else {
                String::new()
            };
            // Images with known depth have no motion.
            let moved = if *mean_displacement_m > 0.0 {
                format!(", mean displacement {mean_displacement_m:.3} m")
            } else {
                String::new()
            };
            format!(
                "{}{}, {validation_samples} held out{moved}; {}{going_on}",
                count_of(*samples, "training sample"),
                kinds_of(*samples, *known_depth, *simulated),
                count_of(*steps, "step")
            )
        }
        TrainEvent::Step {
            losses,
            images_per_second,
            remaining_s,
            scale_ratio,
            ..
        } => format!(
            "loss {:.4} ({}){}, {images_per_second:.1} images/s, {} left",
            losses.total,
            terms_of_a_step(losses),
            scale_text(*scale_ratio),
            duration_text(*remaining_s)
        ),
        TrainEvent::Validated {
            step,
            losses,
            selection,
            scale_ratio,
            best,
        } => format!(
            "step {step}: held out {selection:.4}{} ({}){}",
            if *best { ", the best so far" } else { "" },
            held_out_terms(losses),
            scale_text(*scale_ratio),
        ),
        TrainEvent::Camera { camera, learned } => {
            let [fx, fy] = learned.focal_px;
            let spread = match learned.sigma_px {
                Some([x, y]) => format!("standard deviations {x:.1} and {y:.1}"),
                None => "not determined by these drives".into(),
            };
            format!(
                "camera learned: fx {fx:.1}, fy {fy:.1} in pixels of {}x{} ({spread}), the principal point in the middle",
                camera.width, camera.height
            )
        }
        TrainEvent::Panel { .. } | TrainEvent::Saved { .. } | TrainEvent::Warning { .. } => {
            return None;
        }
    })
}

/// The kinds of samples, unless all are of video.
fn kinds_of(samples: usize, known_depth: usize, simulated: usize) -> String {
    let of_video = samples - known_depth - simulated;
    let kinds = [
        (of_video, "of video"),
        (known_depth, "of known depth"),
        (simulated, "simulated"),
    ];
    let there: Vec<String> = kinds
        .into_iter()
        .filter(|(count, _)| *count > 0)
        .map(|(count, kind)| format!("{count} {kind}"))
        .collect();
    if of_video == samples {
        String::new()
    } else {
        format!(" ({})", there.join(", "))
    }
}

/// The loss terms of a step.
fn terms_of_a_step(losses: &LossTerms) -> String {
    let mut terms = Vec::new();
    if losses.reprojection > 0.0 {
        terms.push(format!(
            "reprojection {:.4}, smoothness {:.4}",
            losses.reprojection, losses.smoothness
        ));
        terms.extend(speed_text(losses));
    }
    if losses.flow > 0.0 {
        let moving = 100.0 * losses.moving_share;
        terms.push(format!("flow {:.4}, moving {moving:.1} %", losses.flow));
    }
    if losses.depth > 0.0 {
        terms.push(format!("depth {:.4}", losses.depth));
    }
    terms.join(", ")
}

/// The speed term; `None` without PoseNet.
fn speed_text(losses: &LossTerms) -> Option<String> {
    (losses.speed > 0.0).then(|| format!("speed {:.3} m", losses.speed))
}

/// The scale ratio; empty if no network predicts a scale.
fn scale_text(ratio: f64) -> String {
    if ratio.is_finite() {
        format!(", scale ratio {ratio:.3}")
    } else {
        String::new()
    }
}

/// The terms of the held-out samples.
fn held_out_terms(losses: &LossTerms) -> String {
    let mut terms = Vec::new();
    if losses.reprojection > 0.0 {
        terms.push(format!("reprojection {:.4}", losses.reprojection));
        terms.extend(speed_text(losses));
    }
    if losses.depth > 0.0 {
        terms.push(format!("depth {:.4}", losses.depth));
    }
    terms.join(", ")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_that_no_network_predicts_are_not_printed() {
        let mut losses = LossTerms {
            reprojection: 0.125,
            speed: 0.25,
            ..LossTerms::default()
        };
        assert_eq!(
            held_out_terms(&losses),
            "reprojection 0.1250, speed 0.250 m"
        );
        assert_eq!(scale_text(1.5), ", scale ratio 1.500");
        losses.speed = 0.0;
        assert_eq!(held_out_terms(&losses), "reprojection 0.1250");
        assert_eq!(scale_text(f64::NAN), "");
    }

    #[test]
    fn kinds_of_samples_are_counted_separately() {
        let started = |known_depth, simulated| {
            let event = TrainEvent::Started {
                from_step: 0,
                steps: 240,
                samples: 105 + known_depth + simulated,
                known_depth,
                simulated,
                validation_samples: 39,
                mean_displacement_m: 0.5,
            };
            let line = event_line(&event).unwrap();
            line.split_once(", 39 held out").unwrap().0.to_owned()
        };
        assert_eq!(started(0, 0), "105 training samples");
        assert_eq!(
            started(0, 2000),
            "2105 training samples (105 of video, 2000 simulated)"
        );
        assert_eq!(
            started(7, 0),
            "112 training samples (105 of video, 7 of known depth)"
        );
    }

    #[test]
    fn the_line_of_a_step_has_its_losses_and_the_remaining_time() {
        let step = TrainEvent::Step {
            step: 3,
            steps: 40,
            losses: LossTerms {
                total: 0.5,
                depth: 0.25,
                ..LossTerms::default()
            },
            learning_rate: 1e-4,
            images_per_second: 2.0,
            remaining_s: 75.0,
            scale_ratio: f64::NAN,
            gradient_norm: 1.0,
        };
        assert_eq!(
            event_line(&step).as_deref(),
            Some("loss 0.5000 (depth 0.2500), 2.0 images/s, 1:15 min left")
        );
        let saved = TrainEvent::Saved {
            step: 3,
            path: "last.safetensors".into(),
        };
        assert_eq!(event_line(&saved), None);
    }
}
