//! Correlation over offsets, its peak, and the peak's standard error.

use super::OffsetConfig;
use crate::{ImageMotion, Signal};
use std::collections::BTreeMap;

/// Step of the search, in seconds; the peak is interpolated between steps.
const STEP_S: f64 = 0.01;
/// Length of a resampled block, in seconds: longer than a wiggle of the road.
const BLOCK_S: f64 = 1.5;
/// Number of resamples.
const RESAMPLES: usize = 200;

/// The offsets searched: 2 `half` + 1 of them.
fn half(search_s: f64) -> usize {
    (search_s / STEP_S).round() as usize
}

/// Sums over a block of pairs: n, Σx, Σy, Σx², Σy², Σxy.
type Sums = [f64; 6];

/// One comparison, such as shift with yaw rate.
pub(super) struct Channel {
    /// Sums per block (numbered from the first image), per offset.
    blocks: BTreeMap<u64, Vec<Sums>>,
    /// Whether the vehicle's signal changes enough for a comparison.
    pub changes: bool,
    pairs: usize,
    /// Share of the pairs that count as independent.
    independent: f64,
    search_s: f64,
}

impl Channel {
    /// Compares over the pairs that the vehicle's signal covers at every offset, so that all offsets
    /// use the same pairs. `None` without pairs.
    pub(super) fn new(
        pictures: &[ImageMotion],
        picture: fn(&ImageMotion) -> f64,
        vehicle: &Signal,
        least_std: f64,
        config: &OffsetConfig,
    ) -> Option<Self> {
        let half = half(config.search_s) as i64;
        let offsets: Vec<f64> = (-half..=half).map(|i| i as f64 * STEP_S).collect();
        let (mut times, mut ours, mut theirs) = (Vec::new(), Vec::new(), Vec::new());
        for pair in pictures {
            let (from, to) = (pair.from_s, pair.to_s);
            let rate = picture(pair) / (to - from);
            let ordered = times.last().is_none_or(|last| from > *last);
            if !(ordered && to > from && rate.is_finite()) {
                continue;
            }
            let mean = |offset: &f64| {
                let integral = vehicle.integral(from + offset, to + offset)?;
                Some(integral / (to - from))
            };
            if let Some(rates) = offsets.iter().map(mean).collect::<Option<Vec<f64>>>() {
                times.push(from);
                ours.push(rate);
                theirs.push(rates);
            }
        }
        let begin = *times.first()?;
        let ours = without_trend(&times, &ours, config.trend_s);
        let mut blocks = BTreeMap::new();
        let mut best = (0.0, Vec::new());
        let mut changes = false;
        for offset in 0..offsets.len() {
            let column: Vec<f64> = theirs.iter().map(|rates| rates[offset]).collect();
            let column = without_trend(&times, &column, config.trend_s);
            let mut total = [0.0; 6];
            for (i, (x, y)) in column.iter().zip(&ours).enumerate() {
                let block = ((times[i] - begin) / BLOCK_S) as u64;
                let sums: &mut Vec<Sums> = blocks
                    .entry(block)
                    .or_insert_with(|| vec![[0.0; 6]; offsets.len()]);
                let terms = [1.0, *x, *y, x * x, y * y, x * y];
                for ((sum, total), term) in sums[offset].iter_mut().zip(&mut total).zip(terms) {
                    *sum += term;
                    *total += term;
                }
            }
            changes |= (total[3] / total[0]).sqrt() >= least_std;
            let r = correlation(&total);
            if r >= best.0 {
                let slope = total[5] / total[3].max(f64::MIN_POSITIVE);
                let left = column.iter().zip(&ours).map(|(x, y)| y - slope * x);
                best = (r, left.collect());
            }
        }
        Some(Self {
            blocks,
            changes,
            pairs: times.len(),
            independent: independent_share(&best.1),
            search_s: config.search_s,
        })
    }

    /// Number of pairs of frames compared.
    pub(super) fn pairs(&self) -> usize {
        self.pairs
    }

    /// The correlation at the step nearest to an offset.
    pub(super) fn correlation_at(&self, offset_s: f64) -> f64 {
        let step = ((offset_s + self.search_s) / STEP_S).round().max(0.0) as usize;
        let step = step.min(2 * half(self.search_s));
        correlation(&self.sum(step, self.blocks.keys()))
    }

    fn sum<'a>(&self, offset: usize, blocks: impl Iterator<Item = &'a u64>) -> Sums {
        let mut total = [0.0; 6];
        for sums in blocks.filter_map(|block| self.blocks.get(block)) {
            for (sum, term) in total.iter_mut().zip(sums[offset]) {
                *sum += term;
            }
        }
        total
    }
}

/// The maximum of the likelihood.
#[derive(Debug, Clone, Copy)]
pub(super) struct Peak {
    pub offset_s: f64,
    /// Whether the peak is at the first or last offset searched.
    pub at_the_end: bool,
    /// Second derivative of the logarithm of the likelihood, 1/s².
    curvature: f64,
}

/// The peak for the whole drive.
pub(super) fn peak(channels: &[&Channel]) -> Option<Peak> {
    peak_of(channels, &blocks(channels))
}

/// The numbers of the blocks present in any channel.
fn blocks(channels: &[&Channel]) -> Vec<u64> {
    let mut blocks: Vec<u64> = channels
        .iter()
        .flat_map(|c| c.blocks.keys().copied())
        .collect();
    blocks.sort_unstable();
    blocks.dedup();
    blocks
}

fn peak_of(channels: &[&Channel], blocks: &[u64]) -> Option<Peak> {
    let search_s = channels.first()?.search_s;
    let offsets = 2 * half(search_s) + 1;
    let likelihood = |offset: usize| -> f64 {
        let of = |c: &&Channel| {
            let sums = c.sum(offset, blocks.iter());
            let r = correlation(&sums).clamp(0.0, 0.9999);
            -0.5 * sums[0] * c.independent * (1.0 - r * r).ln()
        };
        channels.iter().map(of).sum()
    };
    let curve: Vec<f64> = (0..offsets).map(likelihood).collect();
    let top = (0..offsets).max_by(|a, b| curve[*a].total_cmp(&curve[*b]))?;
    let at = |step: f64| (step - half(search_s) as f64) * STEP_S;
    if curve[top] <= 0.0 {
        return None;
    }
    if top == 0 || top == offsets - 1 {
        return Some(Peak {
            offset_s: at(top as f64),
            at_the_end: true,
            curvature: 0.0,
        });
    }
    // The parabola through the peak and its neighbours.
    let (before, here, after) = (curve[top - 1], curve[top], curve[top + 1]);
    let bend = before - 2.0 * here + after;
    let shift = if bend < 0.0 {
        (0.5 * (before - after) / bend).clamp(-0.5, 0.5)
    } else {
        0.0
    };
    Some(Peak {
        offset_s: at(top as f64 + shift),
        at_the_end: false,
        curvature: bend / (STEP_S * STEP_S),
    })
}

/// The larger of two standard errors: from resampled blocks, and from the likelihood's curvature.
pub(super) fn std_error(channels: &[&Channel], peak: &Peak, search_s: f64) -> f64 {
    let all = blocks(channels);
    let mut random = SplitMix(0x5eed);
    let mut offsets: Vec<f64> = (0..RESAMPLES)
        .map(|_| {
            let blocks: Vec<u64> = all.iter().map(|_| all[random.below(all.len())]).collect();
            // Without a peak, the offset could be anywhere.
            peak_of(channels, &blocks).map_or(search_s, |p| p.offset_s)
        })
        .collect();
    offsets.sort_by(f64::total_cmp);
    // Half the width of the middle 68 %, which a few outlying resamples do not change.
    let at = |share: f64| offsets[(share * (RESAMPLES - 1) as f64).round() as usize];
    let resampled = 0.5 * (at(0.84) - at(0.16));
    let curved = if peak.curvature < 0.0 {
        (-1.0 / peak.curvature).sqrt()
    } else {
        search_s
    };
    resampled.max(curved).min(search_s)
}

fn correlation(sums: &Sums) -> f64 {
    let [n, x, y, xx, yy, xy] = *sums;
    let covariance = n * xy - x * y;
    let variances = (n * xx - x * x) * (n * yy - y * y);
    if variances > 0.0 {
        covariance / variances.sqrt()
    } else {
        0.0
    }
}

/// Values minus their mean over ± half the trend's time.
fn without_trend(times: &[f64], values: &[f64], trend_s: f64) -> Vec<f64> {
    let mut totals = vec![0.0];
    for value in values {
        totals.push(totals[totals.len() - 1] + value);
    }
    let (mut first, mut end) = (0, 0);
    let around = |i: usize| {
        while times[first] < times[i] - 0.5 * trend_s {
            first += 1;
        }
        while end < times.len() && times[end] <= times[i] + 0.5 * trend_s {
            end += 1;
        }
        values[i] - (totals[end] - totals[first]) / (end - first) as f64
    };
    (0..values.len()).map(around).collect()
}

/// The share of values that count as independent: (1 − r) / (1 + r), r the correlation of neighbours.
fn independent_share(values: &[f64]) -> f64 {
    let square: f64 = values.iter().map(|v| v * v).sum();
    let neighbours: f64 = values.windows(2).map(|w| w[0] * w[1]).sum();
    let r = (neighbours / square.max(f64::MIN_POSITIVE)).clamp(0.0, 0.98);
    (1.0 - r) / (1.0 + r)
}

/// Vigna's SplitMix64: good enough for resampling, and reproducible.
struct SplitMix(u64);

impl SplitMix {
    fn below(&mut self, limit: usize) -> usize {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) % limit.max(1) as u64) as usize
    }
}
