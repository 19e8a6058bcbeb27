//! Compares targets with labelled boxes: recall, precision, errors, identities.

use crate::Target;
use serde::Serialize;
use std::collections::HashMap;
use std::f64::consts::PI;

/// A labelled box in one frame, in the camera's axes.
#[derive(Debug, Clone, PartialEq)]
pub struct Label {
    /// Its identity, constant over frames.
    pub object: u64,
    /// Centre of the box, metres.
    pub center_m: [f64; 3],
    /// Length, width and height, metres.
    pub size_m: [f64; 3],
    /// Orientation, as in [`Target::yaw_rad`].
    pub yaw_rad: f64,
    /// Velocity over ground, in the camera's axes, m/s, if known.
    pub velocity_mps: Option<[f64; 3]>,
    /// Whether it should be found. Other labels (a tree, a house, a hidden car) are neutral: a target on one is not false, and a missing
    /// one is not missed.
    pub counts: bool,
}

impl Label {
    fn distance(&self) -> f64 {
        norm(self.center_m)
    }

    /// Whether a point is on the box's footprint, enlarged by a metre.
    fn covers(&self, point: [f64; 3]) -> bool {
        let (sin, cos) = self.yaw_rad.sin_cos();
        let (x, z) = (point[0] - self.center_m[0], point[2] - self.center_m[2]);
        let (along, across) = (cos * x - sin * z, sin * x + cos * z);
        along.abs() <= 0.5 * self.size_m[0] + 1.0 && across.abs() <= 0.5 * self.size_m[1] + 1.0
    }
}

/// The rules for counting a label as found.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ScoringRules {
    /// Largest distance between the centres of a target and its label, in metres.
    pub match_m: f64,
    /// Labels beyond this distance from the camera are neutral, in metres.
    pub max_distance_m: f64,
    /// Velocities are compared once one track has followed a label for this long, seconds.
    pub velocity_after_s: f64,
}

impl Default for ScoringRules {
    fn default() -> Self {
        Self {
            match_m: 1.0,
            max_distance_m: 40.0,
            velocity_after_s: 1.0,
        }
    }
}

/// Counts and errors of the labels in one range of distances.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct RangeScore {
    /// Start of the range, metres from the camera.
    pub from_m: f64,
    /// End of the range, metres from the camera.
    pub to_m: f64,
    /// Number of labels that count.
    pub labels: usize,
    /// How many of them were found.
    pub found: usize,
    /// `found / labels`.
    pub recall: Option<f64>,
}

/// Agreement of targets with labels, over all frames.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct TargetScore {
    /// Number of frames.
    pub frames: usize,
    /// Number of labels that count.
    pub labels: usize,
    /// How many of them were found.
    pub found: usize,
    /// Number of targets without a label.
    pub false_targets: usize,
    /// `found / labels`.
    pub recall: Option<f64>,
    /// `found / (found + false_targets)`.
    pub precision: Option<f64>,
    /// Mean distance between the centres of found labels and their targets, in metres.
    pub center_error_m: Option<f64>,
    /// Mean angle between their lengths, up to half a turn, in degrees.
    pub yaw_error_deg: Option<f64>,
    /// Mean norm of the difference of velocities, once tracked for long enough, m/s.
    pub velocity_error_mps: Option<f64>,
    /// Number of velocities compared.
    pub velocities: usize,
    /// Share of these velocities correctly classified as dynamic or static.
    pub motion_accuracy: Option<f64>,
    /// Number of times that an object's track changed.
    pub identity_switches: usize,
    /// Results by distance.
    pub ranges: Vec<RangeScore>,
}

/// The assignment of targets to labels in one frame.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Matched {
    /// For each label the index of its target.
    pub found: Vec<Option<usize>>,
    /// Indices of the targets without a label.
    pub false_targets: Vec<usize>,
}

/// Compares targets with labels, frame by frame of one drive.
#[derive(Debug)]
pub struct Scorer {
    rules: ScoringRules,
    score: TargetScore,
    errors: Errors,
    /// For each object, the track that found it last, and the time since when.
    tracks: HashMap<u64, (u64, f64)>,
}

#[derive(Debug, Default)]
struct Errors {
    center: f64,
    yaw: f64,
    velocity: f64,
    motion: usize,
}

/// Borders of [`TargetScore::ranges`], in metres.
const RANGES: [f64; 5] = [0.0, 10.0, 20.0, 30.0, 40.0];
/// Smallest speed of a dynamic label, m/s.
const MOVES_MPS: f64 = 0.75;

impl Scorer {
    /// A scorer without frames.
    #[must_use]
    pub fn new(rules: ScoringRules) -> Self {
        let ranges = RANGES
            .windows(2)
            .map(|pair| RangeScore {
                from_m: pair[0],
                to_m: pair[1],
                ..RangeScore::default()
            })
            .collect();
        Self {
            rules,
            score: TargetScore {
                ranges,
                ..TargetScore::default()
            },
            errors: Errors::default(),
            tracks: HashMap::new(),
        }
    }

    /// Starts a new drive: drops the assignment of tracks to objects.
    pub fn begin_drive(&mut self) {
        self.tracks.clear();
    }

    /// Adds a frame and returns its assignment.
    pub fn add(&mut self, time_s: f64, targets: &[Target], labels: &[Label]) -> Matched {
        self.add_but(time_s, targets, labels, &|_| false)
    }

    /// As [`Self::add`], for a frame in which not everything is labelled: an `unlabelled` target without a label is neither found nor
    /// false.
    pub fn add_but(
        &mut self,
        time_s: f64,
        targets: &[Target],
        labels: &[Label],
        unlabelled: &dyn Fn(&Target) -> bool,
    ) -> Matched {
        let counts = |label: &Label| label.counts && label.distance() <= self.rules.max_distance_m;
        let mut pairs = Vec::new();
        for (i, label) in labels.iter().enumerate() {
            for (j, target) in targets.iter().enumerate() {
                let apart = norm(minus(label.center_m, target.center_m));
                if apart <= self.rules.match_m {
                    // Labels that count are matched first, so that a tree beside a car does not take the car's target.
                    pairs.push((!counts(label), apart, i, j));
                }
            }
        }
        pairs.sort_by(|a, b| a.0.cmp(&b.0).then(a.1.total_cmp(&b.1)));
        let mut found: Vec<Option<usize>> = vec![None; labels.len()];
        let mut used = vec![false; targets.len()];
        for (_, _, i, j) in pairs {
            if found[i].is_none() && !used[j] {
                found[i] = Some(j);
                used[j] = true;
            }
        }
        let neither = |target: &Target| {
            target.distance_m > self.rules.max_distance_m
                || unlabelled(target)
                || labels
                    .iter()
                    .any(|l| !counts(l) && l.covers(target.center_m))
        };
        let false_targets: Vec<usize> = (0..targets.len())
            .filter(|j| !used[*j] && !neither(&targets[*j]))
            .collect();
        self.score.false_targets += false_targets.len();
        self.score.frames += 1;
        let counting: Vec<usize> = (0..labels.len()).filter(|i| counts(&labels[*i])).collect();
        for i in counting {
            self.count(time_s, &labels[i], found[i].map(|j| &targets[j]));
        }
        Matched {
            found,
            false_targets,
        }
    }

    fn count(&mut self, time_s: f64, label: &Label, target: Option<&Target>) {
        self.score.labels += 1;
        let distance = label.distance();
        let range = self
            .score
            .ranges
            .iter_mut()
            .find(|r| (r.from_m..r.to_m).contains(&distance));
        if let Some(range) = range {
            range.labels += 1;
            range.found += usize::from(target.is_some());
        }
        let Some(target) = target else { return };
        self.score.found += 1;
        self.errors.center += norm(minus(label.center_m, target.center_m));
        let turned = (label.yaw_rad - target.yaw_rad).rem_euclid(PI);
        self.errors.yaw += turned.min(PI - turned).to_degrees();
        let since = match self.tracks.get(&label.object) {
            Some((id, since)) if *id == target.id => *since,
            Some(_) => {
                self.score.identity_switches += 1;
                time_s
            }
            None => time_s,
        };
        self.tracks.insert(label.object, (target.id, since));
        if time_s - since >= self.rules.velocity_after_s
            && let (Some(truth), Some(measured)) = (label.velocity_mps, target.velocity_mps)
        {
            self.score.velocities += 1;
            self.errors.velocity += norm(minus(truth, measured));
            let moves = norm(truth) >= MOVES_MPS;
            self.errors.motion += usize::from(target.moving == Some(moves));
        }
    }

    /// The score of all frames so far.
    #[must_use]
    pub fn score(&self) -> TargetScore {
        let mut score = self.score.clone();
        let share = |part: f64, of: usize| (of > 0).then(|| part / of as f64);
        score.recall = share(score.found as f64, score.labels);
        score.precision = share(score.found as f64, score.found + score.false_targets);
        score.center_error_m = share(self.errors.center, score.found);
        score.yaw_error_deg = share(self.errors.yaw, score.found);
        score.velocity_error_mps = share(self.errors.velocity, score.velocities);
        score.motion_accuracy = share(self.errors.motion as f64, score.velocities);
        for range in &mut score.ranges {
            range.recall = share(range.found as f64, range.labels);
        }
        score
    }
}

fn norm(v: [f64; 3]) -> f64 {
    v.iter().map(|x| x * x).sum::<f64>().sqrt()
}

fn minus(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    std::array::from_fn(|i| a[i] - b[i])
}

#[cfg(test)]
mod tests {
    use super::*;

    fn target(id: u64, center_m: [f64; 3]) -> Target {
        Target {
            id,
            center_m,
            size_m: [4.0, 1.8, 1.5],
            yaw_rad: 0.1,
            distance_m: norm(center_m),
            sigma_m: None,
            velocity_mps: Some([0.0; 3]),
            likely_velocity_mps: None,
            moving: Some(false),
            confidence: 1.0,
            pixels: 100,
            bounds: None,
            class: None,
            detection: None,
        }
    }

    fn label(object: u64, center_m: [f64; 3], counts: bool) -> Label {
        Label {
            object,
            center_m,
            size_m: [4.0, 1.8, 1.5],
            yaw_rad: 0.1 + PI,
            velocity_mps: Some([0.3, 0.0, 0.4]),
            counts,
        }
    }

    #[test]
    fn unlabelled_targets_are_not_false() {
        let mut scorer = Scorer::new(ScoringRules::default());
        let (near, far) = (target(1, [0.0, 1.0, 10.0]), target(2, [0.0, 1.0, 30.0]));
        let labels = [label(5, [0.0, 1.0, 10.0], true)];
        let beyond = |t: &Target| t.center_m[2] > 5.0;
        scorer.add_but(0.0, &[near, far], &labels, &beyond);
        let score = scorer.score();
        assert_eq!((score.found, score.false_targets), (1, 0));
    }

    #[test]
    fn found_missed_false_and_neither_are_distinguished() {
        let mut scorer = Scorer::new(ScoringRules::default());
        let labels = [
            label(1, [0.0, 1.0, 10.0], true),
            label(2, [5.0, 1.0, 20.0], true),
            label(3, [-5.0, 1.0, 15.0], false),
            label(4, [0.0, 1.0, 60.0], true),
        ];
        let targets = [
            target(7, [0.5, 1.0, 10.0]),
            target(8, [-5.0, 1.0, 16.5]),
            target(9, [9.0, 1.0, 9.0]),
        ];
        let found = scorer.add(0.0, &targets, &labels);
        assert_eq!(found.found, [Some(0), None, None, None]);
        assert_eq!(found.false_targets, [2]);
        let score = scorer.score();
        assert_eq!((score.labels, score.found, score.false_targets), (2, 1, 1));
        assert_eq!((score.recall, score.precision), (Some(0.5), Some(0.5)));
        assert_eq!(score.center_error_m, Some(0.5));
        // Half a turn is not an error for a box.
        assert!(score.yaw_error_deg.unwrap() < 1e-9);
        assert_eq!(score.velocities, 0);
        assert_eq!(score.ranges[1].labels, 1);
    }

    #[test]
    fn velocities_count_after_a_second_and_again_after_a_switch() {
        let mut scorer = Scorer::new(ScoringRules::default());
        let labels = [label(1, [0.0, 1.0, 10.0], true)];
        for (time_s, id) in [(0.0, 3), (0.5, 3), (1.0, 3), (1.5, 4), (2.0, 4)] {
            scorer.add(time_s, &[target(id, [0.0, 1.0, 10.0])], &labels);
        }
        let score = scorer.score();
        assert_eq!((score.velocities, score.identity_switches), (1, 1));
        assert!((score.velocity_error_mps.unwrap() - 0.5).abs() < 1e-12);
        assert_eq!(score.motion_accuracy, Some(1.0));
    }

    #[test]
    fn scores_without_data_are_none_and_not_nan() {
        let score = Scorer::new(ScoringRules::default()).score();
        assert_eq!((score.recall, score.center_error_m), (None, None));
    }
}
