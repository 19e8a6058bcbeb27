//! Holes: near things that a method sees far away.
//!
//! Depth learned from motion has a failure of its own. An object that moves along with the camera keeps its place in
//! the image, which is what infinitely far things do, and the photometric loss rewards the network for
//! saying so. The seven metrics blur that: a car ahead is a few hundred pixels, each as wrong as the clamp
//! allows. The hole rate counts it.

/// Ground truth nearer than this share of the cap is near (40 m under the usual cap of 80 m).
const NEAR: f64 = 0.5;
/// Predictions from this share of the cap on are at the far limit (72 m).
const FAR: f64 = 0.9;
/// Near pixels predicted more than so many times too far are holes, wherever the far limit is.
const TIMES: f64 = 3.0;

/// Near pixels of an image, and those of them that are holes.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub(crate) struct Holes {
    near: usize,
    holes: usize,
}

impl Holes {
    /// One pixel: depths in metres before clamping and without any scaling; `None` where the method says
    /// nothing, which is a hole too.
    pub(crate) fn push(&mut self, gt_m: f64, pred_m: Option<f64>, cap_m: f64) {
        if gt_m < NEAR * cap_m {
            self.near += 1;
            let hole = pred_m.is_none_or(|pred| pred >= FAR * cap_m || pred > TIMES * gt_m);
            self.holes += usize::from(hole);
        }
    }

    /// Holes over near pixels; `None` without any.
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
    fn a_hole_is_near_and_seen_far() {
        // At the far limit, on something 30 m away: less than three times too far.
        assert_eq!(rate(&[(30.0, Some(72.0))]), Some(1.0));
        assert_eq!(rate(&[(30.0, Some(71.9))]), Some(0.0));
        // Three times too far.
        assert_eq!(rate(&[(10.0, Some(30.1))]), Some(1.0));
        assert_eq!(rate(&[(10.0, Some(29.9))]), Some(0.0));
        // Nothing said.
        assert_eq!(rate(&[(10.0, None)]), Some(1.0));
        // Too near is an error, and no hole.
        assert_eq!(rate(&[(10.0, Some(1.0))]), Some(0.0));
    }

    #[test]
    fn far_things_neither_are_holes_nor_count() {
        assert_eq!(rate(&[(40.0, Some(80.0)), (60.0, None)]), None);
        assert_eq!(
            rate(&[(60.0, Some(80.0)), (5.0, Some(80.0)), (5.0, Some(6.0))]),
            Some(0.5)
        );
    }
}
