//! Values at times, and the gaps between them.

use super::clock::seconds;
use crate::{DataWarning, MotionWarning};

/// Longest gap between samples across which users of the samples interpolate, as in [`crate::VehicleTrack`].
const MAX_GAP_S: f64 = 0.5;
/// Longer steps are filled with samples at most this far apart.
const SLOW_S: f64 = 0.25;
/// Longest gap of a slow log that is bridged by default: too short for a vehicle to stop and start again.
const MAX_BRIDGED_S: f64 = 3.5;

/// Values at times, on the recording's clock.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Samples {
    /// Times in nanoseconds.
    pub(crate) ns: Vec<i64>,
    /// Values in m/s or rad/s.
    pub(crate) values: Vec<f64>,
}

impl Samples {
    /// The same samples with steps longer than [`SLOW_S`] filled by linear interpolation: steps of up to `most` seconds, or by default up
    /// to three times the usual step if that is long, but at most a few seconds. Steps of half a second are filled too, because users of
    /// the samples interpolate across at most [`MAX_GAP_S`], and rounded times are on both sides of it. Notes are added to the warnings,
    /// with the samples' name and the setting of `most`.
    pub(crate) fn bridged(
        mut self,
        most: Option<f64>,
        warnings: Option<(&mut Vec<DataWarning>, &str, &'static str)>,
    ) -> Self {
        let steps = self.ns.windows(2).map(|w| seconds(w[1], w[0]));
        let mut steps: Vec<f64> = steps.collect();
        steps.sort_by(f64::total_cmp);
        let usual = steps.get(steps.len() / 2).copied().unwrap_or(0.0);
        let most = most.unwrap_or(if usual > SLOW_S {
            (3.0 * usual).min(MAX_BRIDGED_S)
        } else {
            MAX_GAP_S
        });
        let (mut ns, mut values) = (Vec::new(), Vec::new());
        let (mut filled, mut longest, mut left) = (0, 0.0_f64, 0);
        for i in 0..self.ns.len() {
            if let Some(before) = i.checked_sub(1) {
                let gap = seconds(self.ns[i], self.ns[before]);
                if gap > SLOW_S && gap <= most {
                    if gap > MAX_GAP_S {
                        (filled, longest) = (filled + 1, longest.max(gap));
                    }
                    let parts = (gap / SLOW_S).ceil() as i64;
                    for part in 1..parts {
                        let share = part as f64 / parts as f64;
                        let step = self.ns[i] - self.ns[before];
                        ns.push(self.ns[before] + (step as f64 * share).round() as i64);
                        let (a, b) = (self.values[before], self.values[i]);
                        values.push(a + (b - a) * share);
                    }
                } else if gap > MAX_GAP_S {
                    left += 1;
                }
            }
            ns.push(self.ns[i]);
            values.push(self.values[i]);
        }
        if let Some((warnings, name, setting)) = warnings {
            if filled > 0 {
                let bridged = MotionWarning::Bridged {
                    log: name.to_owned(),
                    gaps: filled,
                    longest_s: longest,
                    setting,
                };
                warnings.push(bridged.into());
            }
            if left > 0 {
                let not_bridged = MotionWarning::NotBridged {
                    log: name.to_owned(),
                    gaps: left,
                    most_s: most,
                    setting,
                };
                warnings.push(not_bridged.into());
            }
        }
        (self.ns, self.values) = (ns, values);
        self
    }

    /// The value at a time, interpolated linearly; `None` beyond the ends and in gaps.
    pub(crate) fn at(&self, ns: i64) -> Option<f64> {
        let after = self.ns.partition_point(|t| *t < ns);
        if self.ns.get(after) == Some(&ns) {
            return self.values.get(after).copied();
        }
        let before = after.checked_sub(1)?;
        let (t0, t1) = (self.ns[before], *self.ns.get(after)?);
        let gap_s = seconds(t1, t0);
        let part = seconds(ns, t0) / gap_s;
        (gap_s <= MAX_GAP_S)
            .then(|| self.values[before] + (self.values[after] - self.values[before]) * part)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Steps of half a second, from times given as dates.
    #[test]
    fn two_samples_a_second_leave_no_gap() {
        let ns: Vec<i64> = (0..20)
            .map(|i| 1_777_636_800_000_000_000 + i * 500_000_000)
            .collect();
        let values = (0..20).map(f64::from).collect();
        let mut warnings = Vec::new();
        let bridged = Samples {
            ns: ns.clone(),
            values,
        }
        .bridged(None, Some((&mut warnings, "log", "max_gap_s")));
        assert!(warnings.is_empty(), "{warnings:?}");
        let steps = bridged.ns.windows(2).map(|w| seconds(w[1], w[0]));
        assert!(steps.fold(0.0, f64::max) <= SLOW_S);
        assert_eq!(bridged.at(ns[7] + 100_000_000), Some(7.2));
    }
}
