//! Slow correction of depth to the metric scale it was learned with.

use crate::scale_monitor::{ScaleReading, ScaleState};

/// Largest change from one pair of frames to the next, as ln: a change of 10 % takes about thirty frames. So a short error of the reading
/// has little effect, and depth never jumps.
const STEP: f64 = 0.003;

/// Follows the ratio of the [`ScaleMonitor`](crate::ScaleMonitor) while it reports a drift.
///
/// The ratio is the camera's height in the vehicle's metres divided by its reference. In images zoomed by 10 % everything looks 10 % nearer
/// to a network, which judges distance by size; raising the camera has a similar effect on the road. Depth times the ratio is right again.
/// If the speed is wrong, depth follows the wrong speed: the vehicle's metres are the reference.
#[derive(Debug, Clone, Default)]
pub struct ScaleCorrection {
    ln_factor: f64,
}

impl ScaleCorrection {
    /// The factor for depth: 1 until a change was detected.
    #[must_use]
    pub fn factor(&self) -> f64 {
        self.ln_factor.exp()
    }

    /// Moves one step towards the reading's ratio, or back to 1 if the drift has ended.
    pub fn follow(&mut self, reading: &ScaleReading) {
        let target = match (reading.state, reading.ratio) {
            (ScaleState::Drift, Some(ratio)) if ratio > 0.0 && ratio.is_finite() => ratio.ln(),
            (ScaleState::Steady, _) => 0.0,
            _ => return,
        };
        self.ln_factor += (target - self.ln_factor).clamp(-STEP, STEP);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn reading(state: ScaleState, ratio: f64) -> ScaleReading {
        ScaleReading {
            ratio: Some(ratio),
            ci95: None,
            height_m: None,
            depth_ratio: None,
            state,
        }
    }

    #[test]
    fn an_alarm_is_followed_slowly_and_undone_after_it() {
        let mut correction = ScaleCorrection::default();
        correction.follow(&reading(ScaleState::Learning, 1.3));
        correction.follow(&reading(ScaleState::Steady, 1.04));
        assert_eq!(
            correction.factor(),
            1.0,
            "without an alarm, the ratio is not followed"
        );
        correction.follow(&reading(ScaleState::Drift, f64::NAN));
        assert_eq!(correction.factor(), 1.0);
        let mut last = 1.0;
        for _ in 0..40 {
            correction.follow(&reading(ScaleState::Drift, 1.1));
            assert!(correction.factor() / last < 1.0031, "no jump");
            last = correction.factor();
        }
        assert!((last - 1.1).abs() < 1e-9);
        for _ in 0..40 {
            correction.follow(&reading(ScaleState::Steady, 1.01));
        }
        assert!((correction.factor() - 1.0).abs() < 1e-9);
    }
}
