//! Depth brought back to the metres it was learned in, slowly.

use crate::scale_monitor::{ScaleReading, ScaleState};

/// Largest change from one pair of frames to the next, as ln: 10 % take some thirty frames. A reading that errs for a
/// moment hardly moves it, and depth never jumps.
const STEP: f64 = 0.003;

/// Follows what the [`ScaleMonitor`](crate::ScaleMonitor) says while it says that metres have changed.
///
/// The ratio is the camera's height in the vehicle's metres over what it was. Images zoomed by 10 % show everything 10 %
/// nearer to a network, which judges distance by size, and a camera that came to stand higher likewise by the road:
/// depth times the ratio is right again. Where it is the speed that went wrong, depth follows the wrong speed: the
/// vehicle's metres are what is held on to.
#[derive(Debug, Clone, Default)]
pub struct ScaleCorrection {
    ln_factor: f64,
}

impl ScaleCorrection {
    /// What depth is to be multiplied by: 1 until a change was seen.
    #[must_use]
    pub fn factor(&self) -> f64 {
        self.ln_factor.exp()
    }

    /// Goes one step towards what the reading says, or back to 1 where nothing is wrong any more.
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
    fn a_change_is_followed_slowly_and_left_again() {
        let mut correction = ScaleCorrection::default();
        correction.follow(&reading(ScaleState::Learning, 1.3));
        correction.follow(&reading(ScaleState::Steady, 1.04));
        assert_eq!(correction.factor(), 1.0, "what is no alarm is not followed");
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
