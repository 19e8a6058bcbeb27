//! How fast a run goes.

use std::time::Instant;

/// Number of steps over which the pace and the scale ratio are averaged.
const SMOOTHING: f64 = 20.0;

/// An exponential mean that starts at its first value.
pub(super) struct Smoothed(Option<f64>);

impl Smoothed {
    pub(super) fn new() -> Self {
        Self(None)
    }

    pub(super) fn add(&mut self, value: f64) {
        let old = self.0.unwrap_or(value);
        self.0 = Some(old + (value - old) / SMOOTHING);
    }

    pub(super) fn value(&self) -> f64 {
        self.0.unwrap_or(f64::NAN)
    }
}

/// Time a step takes.
pub(super) struct Pace {
    last: Instant,
    seconds: Smoothed,
    images: f64,
}

impl Pace {
    pub(super) fn new() -> Self {
        Self {
            last: Instant::now(),
            seconds: Smoothed::new(),
            images: 0.0,
        }
    }

    pub(super) fn step(&mut self, images: usize) {
        self.seconds.add(self.last.elapsed().as_secs_f64());
        self.last = Instant::now();
        self.images = images as f64;
    }

    pub(super) fn seconds_per_step(&self) -> f64 {
        self.seconds.value()
    }

    pub(super) fn images_per_second(&self) -> f64 {
        self.images / self.seconds_per_step()
    }
}
