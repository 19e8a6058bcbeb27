//! Values at times, and the gaps between them.

use super::clock::seconds;
use crate::{DataWarning, MotionWarning};

/// Samples farther apart are not bridged, as in [`crate::VehicleTrack`].
const MAX_GAP_S: f64 = 0.5;
/// A step between samples from which on a log is a slow one; what is filled in is no farther apart.
const SLOW_S: f64 = 0.25;
/// Longest gap of a slow log that is bridged unasked: a car does not stop and start again within it.
const MOST_BRIDGED_S: f64 = 3.5;

/// Values at times, on the recording's clock.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Samples {
    /// In nanoseconds.
    pub(crate) ns: Vec<i64>,
    /// In m/s or rad/s.
    pub(crate) values: Vec<f64>,
}

impl Samples {
    /// The same with steps that are longer than [`SLOW_S`] and not too long filled in a straight line: to `most` seconds, else to
    /// three times the usual step where that is long, a few seconds at most. Steps of half a second are filled, too: whoever reads the samples bridges [`MAX_GAP_S`] at
    /// most, and rounded times are on either side of it. What was done is added to the warnings, with the samples'
    /// name and the setting that `most` is of.
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
            (3.0 * usual).min(MOST_BRIDGED_S)
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

    /// The value at a time, straight between its neighbours; `None` beyond the ends and across gaps.
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

    /// Half a second after half a second, as a clock of dates has it.
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
