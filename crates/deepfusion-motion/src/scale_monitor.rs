//! Monitors the metric scale: the camera's height above the road, measured from the road's motion and the vehicle's speed, must not change
//! while driving.
//!
//! It changes if images are zoomed (a lens touched, a resolution switched), if the camera comes loose, or if the speed becomes wrong (other
//! tyres, another unit). The network's depth is not involved, so its errors on a street raise no alarm. The camera's height above the road
//! in the network's depth is reported as well: the ratio of the two is the scale of depth.

use crate::road_height::{CONCLUSIVE, GroundPair, SWEEP_M, least};
use serde::{Deserialize, Serialize};
use std::collections::VecDeque;

/// Settings of the monitor.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct ScaleMonitorConfig {
    /// Number of pairs of frames from which the reference is learned.
    pub learn_pairs: usize,
    /// Number of most recent pairs from which a reading is made.
    pub window_pairs: usize,
    /// Shortest translation of the camera between two frames of a pair that is used, metres.
    pub min_distance_m: f64,
    /// Smallest relative change that raises an alarm.
    pub min_change: f64,
    /// Rise of the vehicle's nose under acceleration, radians per m/s²: 2 degrees per g, a guess for a car.
    pub pitch_per_acceleration: f64,
    /// The camera's height above the road in metres, if it was measured: then no reference has to be learned.
    pub height_m: Option<f64>,
}

impl Default for ScaleMonitorConfig {
    fn default() -> Self {
        Self {
            learn_pairs: 90,
            window_pairs: 60,
            min_distance_m: 0.25,
            min_change: 0.04,
            pitch_per_acceleration: 0.0035,
            height_m: None,
        }
    }
}

/// The monitor's verdict.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum ScaleState {
    /// The reference is being learned.
    Learning,
    /// The scale has not changed.
    Steady,
    /// The scale has changed.
    Drift,
}

/// A reading of the monitor.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct ScaleReading {
    /// Current height divided by the reference: 1.1 if images are zoomed by 10 %, or the reported speed is 10 % too high. `None` while
    /// learning, and while a height far from the last one is measured.
    pub ratio: Option<f64>,
    /// The ratio's 95 % interval.
    pub ci95: Option<[f64; 2]>,
    /// The camera's height according to the road's motion, in metres.
    pub height_m: Option<f64>,
    /// The network's metres divided by the vehicle's, from the height of its road: dividing depth by this would correct it.
    pub depth_ratio: Option<f64>,
    /// The verdict.
    pub state: ScaleState,
}

/// Heights tried relative to the guess: 35 % to both sides in steps of 2 %.
const REACH: f64 = 0.35;
/// See [`REACH`].
const STEP: f64 = 0.02;
/// Share of the camera's fast pitch that is carried over from one pair to the next.
const TILT_KEPT: f64 = 0.9;
/// Number of pairs per estimate: single pairs are too noisy.
const BLOCK: usize = 10;
/// Heights tried first, in metres, in steps of 6 %: those of any vehicle, and those that result from a speed in another unit.
const FIRST_M: (f64, f64) = SWEEP_M;
/// Number of consecutive blocks that none of the heights tried explains before all heights are tried again.
const BLOCKS_LOST: usize = 3;
/// Number of standard errors that make a change significant.
const SIGMAS: f64 = 3.0;
/// Smallest standard error assumed: blocks on one street agree better than different streets do.
const LEAST_ERROR: f64 = 0.012;

/// Monitors the metric scale of a drive.
#[derive(Debug, Clone)]
pub struct ScaleMonitor {
    config: ScaleMonitorConfig,
    /// Centre of the heights tried, in metres, once known.
    guess_m: Option<f64>,
    first: Vec<Vec<f64>>,
    /// Costs of the pairs in the block being filled.
    block: Vec<Vec<f64>>,
    /// ln of the height of each complete block, the most recent last.
    heights: VecDeque<f64>,
    learned: Vec<f64>,
    /// ln of the height above the network's road, the most recent last.
    depth_heights: VecDeque<f64>,
    drifting: bool,
    /// Number of most recent blocks that no height tried explains.
    lost: usize,
    /// The previous centre, while all heights are tried again.
    lost_m: Option<f64>,
    /// The camera's pitch relative to its mount, radians, nose up.
    tilt: f64,
    /// Speed over each of the most recent pairs, m/s, and their duration in seconds.
    speeds: VecDeque<(f64, f64)>,
}

impl ScaleMonitor {
    /// A monitor without pairs.
    #[must_use]
    pub fn new(config: ScaleMonitorConfig) -> Self {
        Self {
            config,
            guess_m: None,
            first: Vec::new(),
            block: Vec::new(),
            heights: VecDeque::new(),
            learned: Vec::new(),
            depth_heights: VecDeque::new(),
            drifting: false,
            lost: 0,
            lost_m: None,
            tilt: 0.0,
            speeds: VecDeque::new(),
        }
    }

    /// The monitor's settings.
    #[must_use]
    pub fn config(&self) -> &ScaleMonitorConfig {
        &self.config
    }

    /// Adds a pair of frames. `depth_height_m` is the camera's height above the network's road in the later frame, in metres, if there is a
    /// network and it finds a road.
    pub fn add(&mut self, pair: &GroundPair, depth_height_m: Option<f64>) -> ScaleReading {
        if let Some(height) = depth_height_m.filter(|h| h.is_finite() && *h > 0.0) {
            self.depth_heights.push_back(height.ln());
            if self.depth_heights.len() > self.config.window_pairs {
                self.depth_heights.pop_front();
            }
        }
        let way = pair.earlier_from_later.translation().norm();
        if way >= self.config.min_distance_m && way.is_finite() {
            match self.guess_m {
                None => self.coarse_search(pair),
                Some(guess) => self.refine(pair, guess),
            }
        }
        self.reading()
    }

    /// Marks a break: the next pair does not continue the last one, so pitch and speeds are reset. The learned reference stays.
    pub fn pause(&mut self) {
        self.tilt = 0.0;
        self.speeds.clear();
    }

    /// A pair's costs. The camera pitches when the vehicle brakes or the road undulates. Speed and yaw rate do not contain this, and a
    /// tenth of a degree matters. Fast pitch is measured in the distant scene from frame to frame and summed with a decay, so that it does
    /// not drift; slow pitch follows from the acceleration.
    fn costs(&mut self, pair: &GroundPair, heights: &[f64]) -> Option<Vec<f64>> {
        let tilt = self.tilt + self.config.pitch_per_acceleration * self.acceleration(pair);
        let (costs, pitch) = pair.costs_and_pitch(heights, tilt);
        self.tilt = TILT_KEPT * (self.tilt + pitch);
        costs
    }

    /// The vehicle's acceleration over the most recent pairs, m/s².
    fn acceleration(&mut self, pair: &GroundPair) -> f64 {
        let speed = pair.earlier_from_later.translation().norm() / pair.seconds;
        if !speed.is_finite() {
            return 0.0;
        }
        self.speeds.push_back((speed, pair.seconds));
        if self.speeds.len() > BLOCK {
            self.speeds.pop_front();
        }
        let seconds: f64 = self.speeds.iter().skip(1).map(|(_, s)| s).sum();
        match self.speeds.front() {
            Some((before, _)) if seconds > 0.0 => (speed - before) / seconds,
            _ => 0.0,
        }
    }

    /// A coarse sweep over all possible heights while no guess is known.
    fn coarse_search(&mut self, pair: &GroundPair) {
        let count = ((FIRST_M.1 / FIRST_M.0).ln() / 0.06).ceil() as usize;
        let heights: Vec<f64> = (0..=count)
            .map(|i| FIRST_M.0 * (0.06 * i as f64).exp())
            .collect();
        let costs = self.costs(pair, &heights);
        self.first.extend(costs);
        if self.first.len() >= BLOCK {
            // If the images are inconclusive, it is tried again.
            self.guess_m = best(&self.first).map(|place| FIRST_M.0 * (0.06 * place).exp());
            self.first.clear();
            let moved = |before: f64, now: f64| (now / before).ln().abs() > REACH;
            if let (Some(now), Some(before)) = (self.guess_m, self.lost_m)
                && moved(before, now)
            {
                // Earlier measurements no longer apply.
                self.heights.clear();
                self.lost_m = None;
            }
        }
    }

    fn refine(&mut self, pair: &GroundPair, guess: f64) {
        let count = (2.0 * REACH / STEP).round() as usize;
        let heights: Vec<f64> = (0..=count)
            .map(|i| guess * (STEP * i as f64 - REACH).exp())
            .collect();
        let costs = self.costs(pair, &heights);
        self.block.extend(costs);
        if self.block.len() < BLOCK {
            return;
        }
        let place = best(&self.block);
        self.block.clear();
        let Some(place) = place else {
            // The height may be outside those tried, after a change of the speed's unit or of the images' size.
            self.lost += 1;
            if self.lost == BLOCKS_LOST {
                (self.lost, self.lost_m) = (0, self.guess_m.take());
            }
            return;
        };
        (self.lost, self.lost_m) = (0, None);
        let height = guess.ln() + STEP * place - REACH;
        if self.learned.len() * BLOCK < self.config.learn_pairs && self.config.height_m.is_none() {
            self.learned.push(height);
            return;
        }
        self.heights.push_back(height);
        if self.heights.len() * BLOCK > self.config.window_pairs {
            self.heights.pop_front();
        }
    }

    /// ln of the reference height, and its standard error.
    fn reference(&self) -> Option<(f64, f64)> {
        match self.config.height_m {
            Some(height) => Some((height.ln(), 0.0)),
            None if self.learned.len() * BLOCK < self.config.learn_pairs => None,
            None => mean_and_error(&self.learned),
        }
    }

    fn reading(&mut self) -> ScaleReading {
        let reference = self.reference();
        let recent: Vec<f64> = self.heights.iter().copied().collect();
        let now = mean_and_error(&recent)
            .filter(|_| 2 * recent.len() * BLOCK >= self.config.window_pairs);
        let latest = now.or_else(|| mean_and_error(&self.learned));
        let height_m = latest.map(|(height, _)| height.exp());
        let mut reading = ScaleReading {
            ratio: None,
            ci95: None,
            height_m,
            depth_ratio: latest.and_then(|(height, _)| {
                let mut depths: Vec<f64> = self.depth_heights.iter().copied().collect();
                depths.sort_by(f64::total_cmp);
                depths.get(depths.len() / 2).map(|d| (d - height).exp())
            }),
            // The alarm stays on while the height is measured again.
            state: if self.drifting {
                ScaleState::Drift
            } else {
                ScaleState::Learning
            },
        };
        if let (Some((reference, reference_error)), Some((now, error))) = (reference, now) {
            let change = now - reference;
            let error = reference_error.hypot(error).max(LEAST_ERROR);
            reading.ratio = Some(change.exp());
            reading.ci95 = Some([-1.96, 1.96].map(|z| (change + z * error).exp()));
            // An alarm ends only at half the change that raises it, so it does not flicker.
            let limit = (1.0 + self.config.min_change).ln().max(SIGMAS * error);
            let limit = if self.drifting { 0.5 * limit } else { limit };
            self.drifting = change.abs() > limit;
            reading.state = if self.drifting {
                ScaleState::Drift
            } else {
                ScaleState::Steady
            };
        }
        reading
    }
}

/// Index of the smallest pooled cost, interpolated by a parabola; `None` if no height is clearly better, or the best is the first or the
/// last.
fn best(costs: &[Vec<f64>]) -> Option<f64> {
    let count = costs.first()?.len();
    let pooled: Vec<f64> = (0..count)
        .map(|i| costs.iter().map(|c| c[i]).sum::<f64>())
        .collect();
    let place = least(&pooled)?;
    let mut sorted = pooled;
    sorted.sort_by(f64::total_cmp);
    (sorted[0] <= CONCLUSIVE * sorted[count / 2]).then_some(place)
}

/// Mean and standard error of the middle half of independent values, so that a car ahead in one block has no effect.
fn mean_and_error(values: &[f64]) -> Option<(f64, f64)> {
    if values.is_empty() {
        return None;
    }
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    let cut = sorted.len() / 4;
    let kept = &sorted[cut..sorted.len() - cut];
    let n = kept.len() as f64;
    let mean = kept.iter().sum::<f64>() / n;
    // From the median deviation of all values: 1.48 times that is the standard deviation.
    let mut off: Vec<f64> = values.iter().map(|v| (v - mean).abs()).collect();
    off.sort_by(f64::total_cmp);
    Some((
        mean,
        1.48 * off[off.len() / 2] / (values.len() as f64).sqrt(),
    ))
}
