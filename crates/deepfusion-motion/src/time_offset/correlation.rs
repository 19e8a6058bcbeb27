//! Correlation over offsets, its peak, and how sure the peak is.

use super::OffsetConfig;
use crate::{ImageMotion, MotionModel};

/// Step of the search, in seconds; the peak is interpolated between.
const STEP_S: f64 = 0.01;
/// Length of a block that is resampled as a whole, in seconds: longer than a wiggle of the road.
const BLOCK_S: f64 = 1.5;
/// How many resamples.
const RESAMPLES: usize = 200;

pub(super) const YAW: usize = 0;
pub(super) const SPEED: usize = 1;

/// A pair of frames, and the vehicle's mean [yaw rate, speed] over it at every offset.
pub(super) struct Pair {
    picture: ImageMotion,
    vehicle: Vec<[f64; 2]>,
}

/// The offsets searched: 2 `half` + 1 of them.
fn half(search_s: f64) -> usize {
    (search_s / STEP_S).round() as usize
}

/// The pairs that the vehicle's track covers at every offset, so that all offsets compare the same.
pub(super) fn pairs(pictures: &[ImageMotion], vehicle: &MotionModel, search_s: f64) -> Vec<Pair> {
    let half = half(search_s) as i64;
    let mut last_s = f64::NEG_INFINITY;
    let mut found = Vec::new();
    for picture in pictures {
        let (from, to) = (picture.from_s, picture.to_s);
        let dt = to - from;
        let is_pair = dt > 0.0 && picture.shift.is_finite() && picture.growth.is_finite();
        if !is_pair || from < last_s {
            continue;
        }
        let at = |step: i64| {
            let offset = step as f64 * STEP_S;
            let motion = vehicle.motion(from + offset, to + offset)?;
            Some([motion.yaw_rad / dt, motion.distance_m / dt])
        };
        if let Some(vehicle) = (-half..=half).map(at).collect() {
            found.push(Pair {
                picture: *picture,
                vehicle,
            });
            last_s = from;
        }
    }
    found
}

/// Sums over a block of pairs: n, Σx, Σy, Σx², Σy², Σxy.
type Sums = [f64; 6];

/// One comparison: shift with yaw rate, or growth with speed.
pub(super) struct Channel {
    /// Per block, per offset.
    blocks: Vec<Vec<Sums>>,
    /// Whether the vehicle's side changes enough to compare anything.
    pub changes: bool,
    /// Standard deviation of the vehicle's side without its trend.
    pub vehicle_std: f64,
    /// Share of the pairs that count as independent.
    independent: f64,
    search_s: f64,
}

impl Channel {
    pub fn new(
        pairs: &[Pair],
        picture: fn(&ImageMotion) -> f64,
        vehicle_is: usize,
        least_std: f64,
        config: &OffsetConfig,
    ) -> Self {
        let times: Vec<f64> = pairs.iter().map(|p| p.picture.from_s).collect();
        let detrended = |values: Vec<f64>| without_trend(&times, &values, config.trend_s);
        let rate = |p: &Pair| picture(&p.picture) / (p.picture.to_s - p.picture.from_s);
        let ours = detrended(pairs.iter().map(rate).collect());
        let begin = times[0];
        let block = |i: usize| ((times[i] - begin) / BLOCK_S) as u64;
        let mut block_of = vec![0; pairs.len()];
        for i in 1..pairs.len() {
            block_of[i] = block_of[i - 1] + usize::from(block(i) != block(i - 1));
        }
        let offsets = 2 * half(config.search_s) + 1;
        let mut blocks = vec![vec![[0.0; 6]; offsets]; block_of[pairs.len() - 1] + 1];
        let mut vehicle_std = 0.0;
        let mut independent = 1.0;
        for offset in 0..offsets {
            let theirs = pairs.iter().map(|p| p.vehicle[offset][vehicle_is]);
            let theirs = detrended(theirs.collect());
            for (i, (x, y)) in theirs.iter().zip(&ours).enumerate() {
                let sums = &mut blocks[block_of[i]][offset];
                for (sum, term) in sums.iter_mut().zip([1.0, *x, *y, x * x, y * y, x * y]) {
                    *sum += term;
                }
            }
            if offset == half(config.search_s) {
                let square: f64 = theirs.iter().map(|x| x * x).sum();
                vehicle_std = (square / theirs.len() as f64).sqrt();
                independent = independent_share(&ours);
            }
        }
        Self {
            blocks,
            changes: vehicle_std >= least_std,
            vehicle_std,
            independent,
            search_s: config.search_s,
        }
    }

    /// The correlation at the step nearest to an offset.
    pub fn correlation_at(&self, offset_s: f64) -> f64 {
        let step = ((offset_s + self.search_s) / STEP_S).round().max(0.0) as usize;
        let step = step.min(2 * half(self.search_s));
        correlation(&self.sum(step, 0..self.blocks.len()))
    }

    fn sum(&self, offset: usize, blocks: impl Iterator<Item = usize>) -> Sums {
        let mut total = [0.0; 6];
        for block in blocks {
            for (sum, term) in total.iter_mut().zip(self.blocks[block][offset]) {
                *sum += term;
            }
        }
        total
    }
}

/// Where the likelihood is largest.
#[derive(Debug, Clone, Copy)]
pub(super) struct Peak {
    pub offset_s: f64,
    /// Whether it is the first or last offset searched.
    pub at_the_end: bool,
    /// Second derivative of the logarithm of the likelihood, 1/s².
    curvature: f64,
}

/// The peak over the whole drive.
pub(super) fn peak(channels: &[&Channel]) -> Option<Peak> {
    let blocks: Vec<usize> = (0..channels.first()?.blocks.len()).collect();
    peak_of(channels, &blocks)
}

fn peak_of(channels: &[&Channel], blocks: &[usize]) -> Option<Peak> {
    let search_s = channels.first()?.search_s;
    let offsets = 2 * half(search_s) + 1;
    let likelihood = |offset: usize| -> f64 {
        let of = |c: &&Channel| {
            let sums = c.sum(offset, blocks.iter().copied());
            let r = correlation(&sums).clamp(0.0, 0.9999);
            -0.5 * sums[0] * c.independent * (1.0 - r * r).ln()
        };
        channels.iter().map(of).sum()
    };
    let curve: Vec<f64> = (0..offsets).map(likelihood).collect();
    let top = (0..offsets).max_by(|a, b| curve[*a].total_cmp(&curve[*b]))?;
    let at = |step: f64| (step - half(search_s) as f64) * STEP_S;
    if !(curve[top] > 0.0) {
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
    let count = channels[0].blocks.len();
    let mut random = SplitMix(0x5eed);
    let mut offsets: Vec<f64> = (0..RESAMPLES)
        .map(|_| {
            let blocks: Vec<usize> = (0..count).map(|_| random.below(count)).collect();
            // No peak at all: anywhere.
            peak_of(channels, &blocks).map_or(search_s, |p| p.offset_s)
        })
        .collect();
    offsets.sort_by(f64::total_cmp);
    // Half of what holds the middle 68 %: a stray resample does not count, many do.
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

/// Values without their mean over ± half the trend's time.
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

/// Vigna's SplitMix64: a resample needs no better, and stays the same from run to run.
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
