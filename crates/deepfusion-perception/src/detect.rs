//! From one depth image to boxes.

use crate::box_fit::fit;
use crate::clusters::{Cluster, Run, clusters};
use crate::instances::{Instance, Kind};
use crate::obstacles::Obstacles;
use crate::rows::{Turn, Vote, expected};
use crate::seams::part_at_seam;
use crate::silhouette::Silhouette;
use crate::split::split;
use crate::{Ground, GroundBox, PerceptionConfig, Rays, Target};
use rayon::prelude::*;

/// Smallest visible height of a target, in metres.
const MIN_VISIBLE_HEIGHT: f32 = 0.25;

/// Number of times that boxes are refitted with the votes of their rows.
const ROUNDS: usize = 2;

/// The usual orientation of objects at a point on the ground.
pub(crate) type UsualTurn<'a> = dyn Fn([f32; 2]) -> Turn + Sync + 'a;

/// A box and the pixels it was made from.
#[derive(Debug, Clone, PartialEq)]
pub struct Detection {
    /// The box, in the ground's axes.
    pub place: GroundBox,
    /// Number of its pixels.
    pub pixels: usize,
    /// Left, top, right and bottom limits of these pixels.
    pub bounds: [u32; 4],
    /// These pixels.
    pub runs: Vec<Run>,
    /// Confidence, 0 to 1.
    pub confidence: f32,
    /// Standard deviation of its depth divided by the depth, if the depth came with one.
    pub relative_error: Option<f32>,
    /// Its class, if a segmentation model gave one.
    pub kind: Option<Kind>,
}

impl Detection {
    /// Converts it to a target of one image, without velocity; `index` is its index among the image's detections.
    #[must_use]
    pub fn target(&self, ground: &Ground, id: u64, index: usize) -> Target {
        let [right, forward] = self.place.middle;
        let [low, high] = self.place.heights;
        let center_m = ground
            .place([right, forward, 0.5 * (low + high)])
            .map(f64::from);
        let distance_m = center_m.iter().map(|x| x * x).sum::<f64>().sqrt();
        let (sin, cos) = self.place.angle.sin_cos();
        let along = |i: usize| f64::from(cos * ground.right[i] + sin * ground.forward[i]);
        Target {
            id,
            center_m,
            size_m: [self.place.footprint[0], self.place.footprint[1], high - low].map(f64::from),
            yaw_rad: (-along(2)).atan2(along(0)),
            distance_m,
            sigma_m: self
                .relative_error
                .map(|share| f64::from(share) * distance_m),
            velocity_mps: None,
            likely_velocity_mps: None,
            moving: None,
            confidence: f64::from(self.confidence),
            pixels: self.pixels,
            bounds: Some(self.bounds),
            class: self.kind.as_ref().map(|kind| kind.class.clone()),
            detection: Some(index),
        }
    }
}

impl Detection {
    /// Sets the relative error from its pixels: the median of `sigma` over `depth`, both row by row in images of this width. The pixels'
    /// errors are correlated, so averaging does not reduce them.
    pub(crate) fn weigh(&mut self, depth: &[f32], sigma: &[f32], width: usize) {
        let pixels = self.runs.iter().flat_map(|run| run.pixels(width));
        let shares = pixels.map(|i| sigma[i] / depth[i]);
        let mut known: Vec<f32> = shares.filter(|s| s.is_finite() && *s > 0.0).collect();
        if known.is_empty() {
            return;
        }
        let middle = known.len() / 2;
        let (_, median, _) = known.select_nth_unstable_by(middle, f32::total_cmp);
        self.relative_error = Some(*median);
    }
}

/// Boxes for the obstacles of one depth image, row by row at `rays`' size, that have the size of a target: first those of the `instances`,
/// whose pixels are given, then those of the remaining obstacles.
#[must_use]
pub fn detect(
    depth: &[f32],
    obstacles: &Obstacles,
    instances: &[Instance],
    rays: &Rays,
    ground: &Ground,
    config: &PerceptionConfig,
) -> Vec<Detection> {
    let ahead = |_| Turn::ahead();
    detect_turned(depth, obstacles, instances, rays, ground, &ahead, config)
}

/// As [`detect`], with the usual orientation of objects at a point on the ground (right, forward).
pub(crate) fn detect_turned(
    depth: &[f32],
    obstacles: &Obstacles,
    instances: &[Instance],
    rays: &Rays,
    ground: &Ground,
    usual_turn: &UsualTurn,
    config: &PerceptionConfig,
) -> Vec<Detection> {
    let area = depth.len() as f32 / (640.0 * 192.0);
    let min_pixels = ((config.min_pixels * area) as usize).max(4);
    let named = |instance: &Instance| {
        let cluster = instance.cluster(depth, rays.x.len(), obstacles, config);
        let enough = cluster.pixels >= min_pixels;
        let known = Some(instance.kind());
        enough.then(|| candidate(cluster, known, depth, obstacles, rays, ground, config))?
    };
    let mut candidates: Vec<Candidate> = instances.par_iter().filter_map(named).collect();
    let taken: Vec<&Cluster> = candidates.iter().map(|c| &c.cluster).collect();
    let unnamed = (!taken.is_empty()).then(|| obstacles.without(&taken, rays.x.len()));
    let unnamed = unnamed.as_ref().unwrap_or(obstacles);
    let mut left = clusters(depth, unnamed, rays, min_pixels, config);
    // The two parts are classified again.
    while !left.is_empty() {
        let outcomes: Vec<Outcome> = std::mem::take(&mut left)
            .into_par_iter()
            .filter(|cluster| cluster.pixels >= min_pixels)
            .map(|cluster| classify(cluster, depth, obstacles, rays, ground, config))
            .collect();
        for outcome in outcomes {
            match outcome {
                Outcome::Split(halves) => left.extend(halves),
                Outcome::Target(candidate) => candidates.push(*candidate),
                Outcome::Nothing => {}
            }
        }
    }
    without_parts(in_rows(candidates, usual_turn, config))
}

/// A cluster that may be a target.
struct Candidate {
    kind: Option<Kind>,
    cluster: Cluster,
    silhouette: Silhouette,
    vote: Vote,
}

/// The candidates' boxes, refitted with the orientation that their neighbours suggest.
fn in_rows(
    candidates: Vec<Candidate>,
    usual_turn: &UsualTurn,
    config: &PerceptionConfig,
) -> Vec<Detection> {
    let mut votes: Vec<Vote> = candidates.iter().map(|c| c.vote).collect();
    for _ in 0..ROUNDS {
        votes = candidates
            .par_iter()
            .enumerate()
            .map(|(i, candidate)| {
                fit(
                    &candidate.silhouette,
                    expected(&votes, i, usual_turn(votes[i].at)),
                )
                .unwrap_or(candidate.vote)
            })
            .collect();
    }
    let fitted = candidates.into_iter().zip(votes);
    fitted
        .filter(|(candidate, vote)| is_target(&candidate.silhouette, &vote.place, config))
        .map(|(candidate, vote)| Detection {
            place: vote.place,
            pixels: candidate.cluster.pixels,
            bounds: candidate.cluster.bounds(),
            runs: candidate.cluster.runs,
            confidence: confidence(&vote.place, candidate.kind.as_ref()),
            relative_error: None,
            kind: candidate.kind,
        })
        .collect()
}

/// Combines the visible share of a box and the model's score as independent evidence.
fn confidence(place: &GroundBox, kind: Option<&Kind>) -> f32 {
    let seen = 0.5 * (place.seen[0] + place.seen[1]);
    1.0 - (1.0 - seen) * (1.0 - kind.map_or(0.0, |kind| kind.score))
}

/// Drops detections inside a larger detection (a roof's edge, a mirror, a number plate's frame), or inside one with a class.
fn without_parts(mut detections: Vec<Detection>) -> Vec<Detection> {
    detections.sort_by_key(|d| std::cmp::Reverse((d.kind.is_some(), d.pixels)));
    let mut kept: Vec<Detection> = Vec::with_capacity(detections.len());
    for detection in detections {
        if !kept.iter().any(|k| k.place.overlap(&detection.place) > 0.4) {
            kept.push(detection);
        }
    }
    kept
}

/// The result of classifying a cluster.
enum Outcome {
    Split([Cluster; 2]),
    Target(Box<Candidate>),
    Nothing,
}

fn classify(
    cluster: Cluster,
    depth: &[f32],
    obstacles: &Obstacles,
    rays: &Rays,
    ground: &Ground,
    config: &PerceptionConfig,
) -> Outcome {
    let silhouette = Silhouette::of(&cluster, depth, obstacles, rays, ground, config);
    if let Some(parts) = part_at_seam(&cluster, &silhouette, depth, rays, ground, config) {
        return Outcome::Split(parts);
    }
    let Some(vote) = fit(&silhouette, Turn::ahead()) else {
        return Outcome::Nothing;
    };
    if let Some(halves) = split(&cluster, &silhouette, &vote.place, depth, rays, ground) {
        Outcome::Split(halves)
    } else if is_target(&silhouette, &vote.place, config) {
        Outcome::Target(Box::new(Candidate {
            kind: None,
            cluster,
            silhouette,
            vote,
        }))
    } else {
        Outcome::Nothing
    }
}

/// A candidate from a single object's pixels: it is not split.
fn candidate(
    cluster: Cluster,
    kind: Option<Kind>,
    depth: &[f32],
    obstacles: &Obstacles,
    rays: &Rays,
    ground: &Ground,
    config: &PerceptionConfig,
) -> Option<Candidate> {
    let silhouette = Silhouette::of(&cluster, depth, obstacles, rays, ground, config);
    let vote = fit(&silhouette, Turn::ahead())?;
    is_target(&silhouette, &vote.place, config).then_some(Candidate {
        kind,
        cluster,
        silhouette,
        vote,
    })
}

fn is_target(silhouette: &Silhouette, place: &GroundBox, config: &PerceptionConfig) -> bool {
    let [length, width] = place.footprint;
    let [most_length, most_width] = config.max_footprint_m;
    let heights = config.min_target_height_m..=config.max_target_height_m;
    let rows = silhouette.top - silhouette.bottom;
    !silhouette.tall
        && rows > MIN_VISIBLE_HEIGHT
        && length <= most_length
        && width <= most_width
        && heights.contains(&place.heights[1])
}
