//! The speed of a run.

use std::collections::VecDeque;
use std::time::{Duration, Instant};

/// Number of steps over which the scale ratio and the pace are averaged.
const SMOOTHING: usize = 20;

/// An exponential mean that starts at its first value.
pub(super) struct Smoothed(Option<f64>);

impl Smoothed {
    pub(super) fn new() -> Self {
        Self(None)
    }

    /// Adds a value. NaN, from a batch without this number, is ignored.
    pub(super) fn add(&mut self, value: f64) {
        if value.is_nan() {
            return;
        }
        let old = self.0.unwrap_or(value);
        self.0 = Some(old + (value - old) / SMOOTHING as f64);
    }

    pub(super) fn value(&self) -> f64 {
        self.0.unwrap_or(f64::NAN)
    }
}

/// Time that a step takes: the mean of the last steps. The first step, which compiles a GPU's kernels, drops out like any other.
pub(super) struct Pace {
    last: Instant,
    seconds: VecDeque<f64>,
    images: f64,
}

impl Pace {
    pub(super) fn new() -> Self {
        Self {
            last: Instant::now(),
            seconds: VecDeque::with_capacity(SMOOTHING),
            images: 0.0,
        }
    }

    /// Time since the last lap.
    pub(super) fn since_lap(&self) -> Duration {
        self.last.elapsed()
    }

    /// Ends a lap of some steps. Returns the seconds that each took.
    pub(super) fn lap(&mut self, steps: usize) -> f64 {
        let seconds = self.last.elapsed().as_secs_f64();
        self.last = Instant::now();
        seconds / steps as f64
    }

    pub(super) fn step(&mut self, images: usize, seconds: f64) {
        if self.seconds.len() == SMOOTHING {
            self.seconds.pop_front();
        }
        self.seconds.push_back(seconds);
        self.images = images as f64;
    }

    /// Seconds of the shortest of the last steps; 0 before the first.
    pub(super) fn least_seconds_per_step(&self) -> f64 {
        let seconds = self.seconds.iter().copied();
        seconds.reduce(f64::min).unwrap_or_default()
    }

    pub(super) fn seconds_per_step(&self) -> f64 {
        self.seconds.iter().sum::<f64>() / self.seconds.len() as f64
    }

    pub(super) fn images_per_second(&self) -> f64 {
        self.images / self.seconds_per_step()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nan_does_not_change_a_mean() {
        let mut mean = Smoothed::new();
        mean.add(f64::NAN);
        assert!(mean.value().is_nan());
        mean.add(2.0);
        mean.add(f64::NAN);
        assert_eq!(mean.value(), 2.0);
    }

    /// Steps that are read together share their time.
    #[test]
    fn the_pace_is_the_mean_of_the_last_steps() {
        let mut pace = Pace::new();
        for (images, seconds) in [(4, 9.0), (4, 3.0), (8, 3.0)] {
            pace.step(images, seconds);
        }
        assert_eq!(pace.seconds_per_step(), 5.0);
        assert_eq!(pace.images_per_second(), 8.0 / 5.0);
        assert_eq!(pace.least_seconds_per_step(), 3.0);
        for _ in 0..SMOOTHING {
            pace.step(8, 2.0);
        }
        assert_eq!(pace.seconds_per_step(), 2.0);
        let passed = pace.since_lap().as_secs_f64();
        assert!(pace.lap(4) >= passed / 4.0);
        assert!(pace.lap(1) < 1.0, "a lap begins where the last one ended");
    }
}
