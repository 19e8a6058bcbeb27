//! Figures on how a live source keeps up, in constant memory.

use std::time::{Duration, Instant};

/// Shortest time between two status lines.
const EVERY: Duration = Duration::from_secs(5);

/// A histogram of latencies, with bins of one millisecond.
#[derive(Debug, Clone)]
struct Latencies {
    counts: Vec<u64>,
    longest_ms: f64,
}

impl Latencies {
    /// Number of bins; longer latencies share the last one.
    const BINS: usize = 10_000;

    fn new() -> Self {
        Self {
            counts: vec![0; Self::BINS],
            longest_ms: 0.0,
        }
    }

    fn add(&mut self, ms: f64) {
        self.counts[(ms as usize).min(Self::BINS - 1)] += 1;
        self.longest_ms = self.longest_ms.max(ms);
    }

    fn count(&self) -> u64 {
        self.counts.iter().sum()
    }

    /// The median, rounded to the millisecond.
    fn median_ms(&self) -> usize {
        let half = self.count() / 2;
        let mut below = 0;
        let reached = |n: &u64| {
            below += n;
            below > half
        };
        self.counts.iter().position(reached).unwrap_or(0)
    }

    fn summary(&self) -> String {
        format!(
            "latency {} ms (median), {:.0} ms (longest)",
            self.median_ms(),
            self.longest_ms
        )
    }
}

/// Frames per second, latency and skipped frames: since the last line, and over the whole run.
#[derive(Debug)]
pub(super) struct Figures {
    lately: Latencies,
    since: Instant,
    all: Latencies,
    /// When the first and the last frame were finished.
    span: Option<(Instant, Instant)>,
    dropped: u64,
}

impl Figures {
    /// Figures without frames yet.
    pub(super) fn new() -> Self {
        Self {
            lately: Latencies::new(),
            since: Instant::now(),
            all: Latencies::new(),
            span: None,
            dropped: 0,
        }
    }

    /// Counts a finished frame; from time to time returns a status line.
    pub(super) fn add(&mut self, latency_ms: f64, dropped: u64) -> Option<String> {
        let now = Instant::now();
        let first = self.span.map_or(now, |(first, _)| first);
        if self.span.is_none() {
            self.since = now;
        }
        self.span = Some((first, now));
        self.dropped = dropped;
        self.lately.add(latency_ms);
        self.all.add(latency_ms);
        let period = now.duration_since(self.since);
        if period < EVERY {
            return None;
        }
        let line = format!(
            "{:.1} frames/s, {}, {} skipped so far",
            self.lately.count() as f64 / period.as_secs_f64(),
            self.lately.summary(),
            self.dropped
        );
        (self.lately, self.since) = (Latencies::new(), now);
        Some(line)
    }

    /// Summary of the whole run; `None` if no frame arrived.
    pub(super) fn summary(&self) -> Option<String> {
        let (first, last) = self.span?;
        let took = last.duration_since(first).as_secs_f64();
        let rate = match self.all.count() {
            0..=1 => String::new(),
            // The time begins with the first frame, which therefore does not count.
            n => format!("{:.1} frames/s, ", (n - 1) as f64 / took.max(1e-9)),
        };
        Some(format!(
            "{rate}{}, {} skipped",
            self.all.summary(),
            self.dropped
        ))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_median_latency_is_over_all_frames() {
        let mut latencies = Latencies::new();
        assert_eq!(latencies.median_ms(), 0);
        for ms in [90_000.0, 12.2, 30.9, 12.7, 31.0] {
            latencies.add(ms);
        }
        assert_eq!((latencies.median_ms(), latencies.count()), (30, 5));
        assert_eq!(latencies.longest_ms, 90_000.0);
        assert_eq!(Figures::new().summary(), None);
    }
}
