use crate::{LossTerms, TrainConfig, ViewMotion};

/// The value that selects `best`: the part of a held-out loss that depth can change, at weights that never change.
///
/// It is the photometric error alone if the vehicle's sensors give the distance between the views (`distance`, `vehicle`, `auto`):
/// PoseNet's own loss does not depend on depth and would dominate the choice. With `posenet` the views depend on PoseNet alone, and depth
/// and motion share one scale. The photometric error does not depend on that scale, so the speed term is added, at its full weight.
///
/// Smoothness and the affine term are left out, though depth changes them: a flat depth minimises the former, and
/// neither measures how well the images are explained. Flow and masks exist only in training.
///
/// The loss of the explainability masks is included: without it the masks alone could make the error small.
///
/// The loss on known depth is included at its own weight, and is the whole value for a run that learns from known depth alone. If only the
/// uncertainty head learns (`loss.depth.weight` 0), the value is that head's loss, which may be negative.
pub(crate) fn selection(config: &TrainConfig, held_out: &LossTerms) -> f64 {
    let views = match config.view_motion {
        ViewMotion::PoseNet => held_out.reprojection + config.loss.speed * held_out.speed,
        ViewMotion::Distance | ViewMotion::Vehicle | ViewMotion::Auto => held_out.reprojection,
    };
    let masks = config.loss.explainability * held_out.explainability;
    let head_alone = config.depth_net.uncertainty && config.loss.depth.weight == 0.0;
    let known = if head_alone {
        held_out.uncertainty
    } else {
        config.loss.depth.weight * held_out.depth
    };
    views + masks + known
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Preset;

    /// Depth explains the images better, but PoseNet drifts away from the vehicle's measurements.
    #[test]
    fn only_terms_that_depth_can_change_count() {
        let mut config = Preset::Tiny.config();
        config.loss.speed = 0.2;
        let terms = |reprojection, speed| LossTerms {
            total: reprojection + 0.2 * speed,
            reprojection,
            speed,
            ..LossTerms::default()
        };
        let (early, late) = (terms(0.11, 0.05), terms(0.09, 0.5));
        assert!(late.total > early.total);
        for motion in [ViewMotion::Distance, ViewMotion::Vehicle, ViewMotion::Auto] {
            config.view_motion = motion;
            assert!(selection(&config, &late) < selection(&config, &early));
        }
        // With `posenet` the scale of depth follows PoseNet's.
        config.view_motion = ViewMotion::PoseNet;
        assert!((selection(&config, &late) - (0.09 + 0.2 * 0.5)).abs() < 1e-12);
        assert!(selection(&config, &late) > selection(&config, &early));
        config.loss.speed = 0.0;
        assert_eq!(selection(&config, &late), 0.09);
    }

    /// Depth does not change then: only the head's loss can.
    #[test]
    fn an_uncertainty_head_alone_is_chosen_by_its_own_loss() {
        let mut config = Preset::Tiny.config();
        (config.depth_net.uncertainty, config.loss.depth.weight) = (true, 0.0);
        let terms = |uncertainty| LossTerms {
            depth: 0.2,
            uncertainty,
            ..LossTerms::default()
        };
        assert!(selection(&config, &terms(-0.4)) < selection(&config, &terms(0.1)));
        config.loss.depth.weight = 1.0;
        assert_eq!(selection(&config, &terms(-0.4)), 0.2);
    }
}
