//! Holes: near things that are predicted far away.
//!
//! Depth learned from motion fails in its own way. An object that moves along with the camera keeps its place in the image, like infinitely
//! distant things, and the photometric loss rewards the network for predicting it far away. The seven metrics hide that: a car ahead is a
//! few hundred pixels, and clamping limits each one's error. The hole rate counts these pixels.

/// Ground truth nearer than this share of the cap is near (40 m for the usual cap of 80 m).
const NEAR: f64 = 0.5;
/// Predictions at or beyond this share of the cap are at the far limit (72 m).
const FAR: f64 = 0.9;
/// Near pixels predicted more than this many times too far are holes, whatever the far limit.
const TIMES: f64 = 3.0;

/// Near pixels of an image, and the holes among them.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub(crate) struct Holes {
    near: usize,
    holes: usize,
}

impl Holes {
    /// Adds one pixel: depths in metres before clamping and without any scaling; `None` if there is no prediction, which also counts as a
    /// hole.
    pub(crate) fn push(&mut self, gt_m: f64, pred_m: Option<f64>, cap_m: f64) {
        if gt_m < NEAR * cap_m {
            self.near += 1;
            let hole = pred_m.is_none_or(|pred| pred >= FAR * cap_m || pred > TIMES * gt_m);
            self.holes += usize::from(hole);
        }
    }

    /// Number of holes divided by that of near pixels; `None` without near pixels.
    pub(crate) fn rate(&self) -> Option<f64> {
        (self.near > 0).then(|| self.holes as f64 / self.near as f64)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn rate(pixels: &[(f64, Option<f64>)]) -> Option<f64> {
        let mut holes = Holes::default();
        for (gt, pred) in pixels {
            holes.push(*gt, *pred, 80.0);
        }
        holes.rate()
    }

    #[test]
    fn near_pixels_predicted_far_are_holes() {
        // At the far limit, on something 30 m away: less than three times too far.
        assert_eq!(rate(&[(30.0, Some(72.0))]), Some(1.0));
        assert_eq!(rate(&[(30.0, Some(71.9))]), Some(0.0));
        // Three times too far.
        assert_eq!(rate(&[(10.0, Some(30.1))]), Some(1.0));
        assert_eq!(rate(&[(10.0, Some(29.9))]), Some(0.0));
        // No prediction.
        assert_eq!(rate(&[(10.0, None)]), Some(1.0));
        // Too near is an error, but not a hole.
        assert_eq!(rate(&[(10.0, Some(1.0))]), Some(0.0));
    }

    #[test]
    fn far_pixels_are_not_counted() {
        assert_eq!(rate(&[(40.0, Some(80.0)), (60.0, None)]), None);
        assert_eq!(
            rate(&[(60.0, Some(80.0)), (5.0, Some(80.0)), (5.0, Some(6.0))]),
            Some(0.5)
        );
    }
}
