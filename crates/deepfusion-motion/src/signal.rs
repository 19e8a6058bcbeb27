//! A sensor's value over time.

/// Longest gap between two samples that is interpolated, in seconds: five packets of KITTI's oxts. Across a longer gap the value is
/// unknown.
const LONGEST_GAP_S: f64 = 0.5;
/// The same limit for fast sensors, in median intervals, if that is at least [`SHORTEST_GAP_S`].
const GAP_INTERVALS: f64 = 5.0;
/// Scheduling on a recorder's computer delays packets by tens of milliseconds; that does not count as a gap.
const SHORTEST_GAP_S: f64 = 0.1;
/// How far a signal is extended as constant beyond its first or last sample, in seconds: the times of sensors that belong to one frame
/// differ by some milliseconds.
const OVERHANG_S: f64 = 0.15;

/// A value over time: samples in order, linear interpolation between them, and gaps that are not bridged.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Signal {
    time_s: Vec<f64>,
    value: Vec<f64>,
    max_gap_s: f64,
    dropped: usize,
}

impl Signal {
    /// A signal from samples (time in s, value). Samples that are not finite, or not later than the one before (recorders repeat packets,
    /// clocks step back), are dropped and counted. A gap is longer than five median intervals; this limit is at least 0.1 s and at most 0.5
    /// s.
    #[must_use]
    pub fn new(samples: impl IntoIterator<Item = (f64, f64)>) -> Self {
        let mut signal = Self::with_max_gap(samples, LONGEST_GAP_S);
        if let Some(interval_s) = signal.interval_s() {
            signal.max_gap_s = (GAP_INTERVALS * interval_s).clamp(SHORTEST_GAP_S, LONGEST_GAP_S);
        }
        signal
    }

    /// A signal from samples, with the longest interval, in seconds, that is not a gap.
    #[must_use]
    pub fn with_max_gap(samples: impl IntoIterator<Item = (f64, f64)>, max_gap_s: f64) -> Self {
        let mut signal = Self {
            max_gap_s,
            ..Self::default()
        };
        for (time_s, value) in samples {
            let later = signal.time_s.last().is_none_or(|last| time_s > *last);
            if later && time_s.is_finite() && value.is_finite() {
                signal.time_s.push(time_s);
                signal.value.push(value);
            } else {
                signal.dropped += 1;
            }
        }
        signal
    }

    /// Times of the samples, in seconds, ascending.
    #[must_use]
    pub fn times_s(&self) -> &[f64] {
        &self.time_s
    }

    /// Values of the samples.
    #[must_use]
    pub fn values(&self) -> &[f64] {
        &self.value
    }

    /// Number of samples dropped: not finite, or not later than the one before.
    #[must_use]
    pub fn dropped(&self) -> usize {
        self.dropped
    }

    /// The longest interval between two samples that is not a gap, in seconds.
    #[must_use]
    pub fn max_gap_s(&self) -> f64 {
        self.max_gap_s
    }

    /// Whether there are no samples.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.time_s.is_empty()
    }

    /// The median interval between samples, in seconds; `None` for fewer than two samples.
    #[must_use]
    pub fn interval_s(&self) -> Option<f64> {
        let mut intervals: Vec<f64> = self.time_s.windows(2).map(|w| w[1] - w[0]).collect();
        let middle = intervals.len() / 2;
        (!intervals.is_empty()).then(|| *intervals.select_nth_unstable_by(middle, f64::total_cmp).1)
    }

    /// The same samples with `change` applied to every value.
    #[must_use]
    pub fn map(&self, change: impl Fn(f64) -> f64) -> Self {
        Self {
            value: self.value.iter().map(|v| change(*v)).collect(),
            ..self.clone()
        }
    }

    /// Whether `from_s` to `to_s` lies within the samples (or 0.15 s beyond) and contains no gap.
    #[must_use]
    pub fn covers(&self, from_s: f64, to_s: f64) -> bool {
        let (Some(first), Some(last)) = (self.time_s.first(), self.time_s.last()) else {
            return false;
        };
        // Also false for NaN times.
        let inside = from_s >= first - OVERHANG_S && to_s <= last + OVERHANG_S && from_s <= to_s;
        if !inside {
            return false;
        }
        // From the last sample not after the start to the first one not before the end.
        let begin = self.time_s.partition_point(|t| *t <= from_s).max(1) - 1;
        let end = self.time_s.partition_point(|t| *t < to_s) + 1;
        let around = &self.time_s[begin..end.min(self.time_s.len())];
        around.windows(2).all(|w| w[1] - w[0] <= self.max_gap_s)
    }

    /// The interpolated value at a time; `None` if the signal does not cover it.
    #[must_use]
    pub fn at(&self, time_s: f64) -> Option<f64> {
        self.covers(time_s, time_s).then(|| self.between(time_s))
    }

    /// ∫ value dt from `from_s` to `to_s`: the trapezoidal rule over the samples between, interpolated at both ends. `None` if the signal
    /// does not cover the interval, or the interval runs backwards.
    #[must_use]
    pub fn integral(&self, from_s: f64, to_s: f64) -> Option<f64> {
        self.covers(from_s, to_s).then(|| {
            let steps = self.steps(from_s, to_s);
            steps
                .map(|(h, before, after)| 0.5 * (before + after) * h)
                .sum()
        })
    }

    /// ∬ value dt dt from `from_s` to `to_s`, with the inner integral starting at 0: both integrals by the trapezoidal rule. Eq. 23–24
    /// integrate acceleration to speed and distance in this way.
    #[must_use]
    pub fn double_integral(&self, from_s: f64, to_s: f64) -> Option<f64> {
        self.covers(from_s, to_s).then(|| {
            let (mut inner, mut outer) = (0.0, 0.0);
            for (h, before, after) in self.steps(from_s, to_s) {
                let next = inner + 0.5 * (before + after) * h;
                outer += 0.5 * (inner + next) * h;
                inner = next;
            }
            outer
        })
    }

    /// The value at a covered time.
    fn between(&self, time_s: f64) -> f64 {
        let after = self.time_s.partition_point(|t| *t < time_s);
        if after == 0 {
            return self.value[0];
        }
        if after == self.value.len() {
            return self.value[after - 1];
        }
        let (t0, t1) = (self.time_s[after - 1], self.time_s[after]);
        let fraction = (time_s - t0) / (t1 - t0);
        self.value[after - 1] + (self.value[after] - self.value[after - 1]) * fraction
    }

    /// The linear pieces between two covered times: duration, value before, value after.
    fn steps(&self, from_s: f64, to_s: f64) -> impl Iterator<Item = (f64, f64, f64)> {
        let inner = self.time_s.partition_point(|t| *t <= from_s)
            ..self.time_s.partition_point(|t| *t < to_s);
        let samples = inner.map(|i| (self.time_s[i], self.value[i]));
        let mut before = (from_s, self.between(from_s));
        samples
            .chain(std::iter::once((to_s, self.between(to_s))))
            .map(move |after| {
                let step = (after.0 - before.0, before.1, after.1);
                before = after;
                step
            })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn invalid_samples_are_dropped_and_counted() {
        let signal = Signal::new([
            (f64::NAN, 1.0),
            (0.0, 1.0),
            (0.1, f64::NAN),
            (0.2, f64::INFINITY),
            (0.1, 3.0),
            (0.1, 4.0),
            (0.05, 4.0),
            (f64::INFINITY, 4.0),
        ]);
        assert_eq!(signal.times_s(), [0.0, 0.1]);
        assert_eq!(signal.values(), [1.0, 3.0]);
        assert_eq!(signal.dropped(), 6);
    }

    #[test]
    fn a_fast_sensor_has_a_gap_sooner_than_a_slow_one() {
        let every = |step: f64, skip: std::ops::Range<usize>| {
            let kept = (0..200).filter(move |i| !skip.contains(i));
            Signal::new(kept.map(move |i| (i as f64 * step, 1.0)))
        };
        assert!(every(0.01, 50..58).at(0.54).is_some(), "0.09 s at 100 Hz");
        assert!(every(0.01, 50..65).at(0.54).is_none(), "0.16 s at 100 Hz");
        assert!(every(0.1, 50..53).at(5.2).is_some(), "0.4 s at 10 Hz");
        assert!(every(0.1, 50..55).at(5.2).is_none(), "0.6 s at 10 Hz");
    }

    #[test]
    fn times_that_are_nan_are_not_covered() {
        let signal = Signal::new([(0.0, 1.0), (0.1, 2.0)]);
        assert_eq!(signal.at(f64::NAN), None);
        assert_eq!(signal.integral(f64::NAN, 0.1), None);
        assert_eq!(signal.integral(0.0, f64::NAN), None);
        assert_eq!(signal.integral(0.1, 0.0), None, "backwards");
        assert_eq!(Signal::new([]).at(0.0), None);
    }

    #[test]
    fn a_constant_acceleration_goes_half_a_t_squared() {
        let signal = Signal::new((0..=100).map(|i| (f64::from(i) * 0.01, 2.0)));
        let distance = signal.double_integral(0.105, 0.905).unwrap();
        assert!((distance - 0.64).abs() < 1e-12, "{distance}");
    }

    proptest! {
        /// For any input the output is a finite number or `None`.
        #[test]
        fn results_are_finite_or_none(samples in proptest::collection::vec((any::<f64>(), -1e6..1e6f64), 0..40), t in any::<f64>(), dt in 0.0..1.0f64) {
            let signal = Signal::new(samples);
            prop_assert!(signal.times_s().windows(2).all(|w| w[0] < w[1]));
            prop_assert!(signal.at(t).is_none_or(f64::is_finite));
            prop_assert!(signal.integral(t, t + dt).is_none_or(f64::is_finite));
        }

        /// Integrals over neighbouring intervals add up.
        #[test]
        fn integrals_of_adjacent_intervals_add_up(values in proptest::collection::vec(-20.0..20.0f64, 12), cut in 0.0..1.1f64) {
            let signal = Signal::new(values.iter().enumerate().map(|(i, v)| (i as f64 * 0.1, *v)));
            let integral = |a, b| signal.integral(a, b).unwrap();
            prop_assert!((integral(0.0, cut) + integral(cut, 1.1) - integral(0.0, 1.1)).abs() < 1e-9);
        }
    }
}
