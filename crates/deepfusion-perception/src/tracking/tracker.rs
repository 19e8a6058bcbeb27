use super::measurement::Measurement;
use super::track::Track;
use crate::{Detection, Ground, PerceptionConfig, Rays, Target};
use deepfusion_geometry::Se3;
use nalgebra::Vector3;

/// The gate for association: squared standard deviations, and metres.
const GATE: (f64, f64) = (16.0, 3.5);
/// How long a track continues unseen, in seconds: while it is hidden, and while it should be visible but is not.
const HIDDEN_S: f64 = 1.5;
/// See [`HIDDEN_S`].
const MISSED_S: f64 = 0.35;
/// Number of frames in which a track must have been seen before it is reported while unseen.
const CONFIRMED: u32 = 3;
/// A pause longer than this, in seconds, drops all tracks.
const LONGEST_PAUSE_S: f64 = 2.0;

/// Time, pose and content of a frame.
pub(crate) struct FrameContext<'a> {
    pub time_s: f64,
    pub world_from_cam: Se3,
    pub depth: &'a [f32],
    pub rays: &'a Rays,
    pub ground: &'a Ground,
}

/// Follows targets from frame to frame.
#[derive(Debug, Default)]
pub(crate) struct Tracker {
    tracks: Vec<Track>,
    next_id: u64,
    time_s: Option<f64>,
}

impl Tracker {
    /// A new, unused id.
    pub(crate) fn new_id(&mut self) -> u64 {
        self.next_id += 1;
        self.next_id
    }

    /// Drops all tracks; their ids are not used again.
    pub(crate) fn reset(&mut self) {
        self.tracks.clear();
        self.time_s = None;
    }

    /// The last positions of dynamic targets, in the world.
    pub(crate) fn moving(&self) -> impl Iterator<Item = Vector3<f64>> {
        let moving = self.tracks.iter().filter(|track| track.is_moving());
        moving.map(Track::centre)
    }

    /// Updates the tracks with a frame's detections and returns its targets.
    pub(crate) fn step(
        &mut self,
        detections: &[Detection],
        now: &FrameContext,
        config: &PerceptionConfig,
    ) -> Vec<Target> {
        let dt = self.time_s.map_or(0.0, |before| now.time_s - before);
        if !(0.0..=LONGEST_PAUSE_S).contains(&dt) {
            self.tracks.clear();
        }
        self.time_s = Some(now.time_s);
        for track in &mut self.tracks {
            track.predict(dt.max(0.0));
        }
        self.associate(detections, now, config);
        let cam_from_world = now.world_from_cam.inverse();
        let visibility = |track: &Track| Visibility::of(track, &cam_from_world, now);
        self.tracks.retain(|track| {
            let limit = match visibility(track) {
                Visibility::InSight => MISSED_S,
                Visibility::Hidden | Visibility::OutOfView => HIDDEN_S,
            };
            track.unseen_s == 0.0 || (track.hits >= CONFIRMED && track.unseen_s <= limit)
        });
        self.tracks
            .iter()
            .filter(|track| track.hits >= config.confirm_frames)
            .filter(|track| track.seen.is_some() || visibility(track) != Visibility::OutOfView)
            .map(|track| track.target(&cam_from_world))
            .filter(|target| target.center_m[2] > 0.0 && target.confidence >= config.min_confidence)
            .collect()
    }

    /// Greedy association, nearest pairs first; unmatched detections start tracks.
    fn associate(
        &mut self,
        detections: &[Detection],
        now: &FrameContext,
        config: &PerceptionConfig,
    ) {
        let measurements: Vec<Measurement> = detections
            .iter()
            .enumerate()
            .map(|d| Measurement::new(d, now.ground, &now.world_from_cam))
            .collect();
        let noises: Vec<_> = measurements.iter().map(|m| m.noise(config)).collect();
        let mut pairs = Vec::new();
        for (i, track) in self.tracks.iter().enumerate() {
            for (j, measurement) in measurements.iter().enumerate() {
                let (deviations2, metres2) = track.distance2(measurement, &noises[j]);
                if deviations2 < GATE.0 && metres2 < GATE.1 * GATE.1 {
                    // If two tracks are about equally near, the older one is preferred, as its estimates are better.
                    let cost =
                        deviations2 + metres2 + if track.hits < CONFIRMED { 2.0 } else { 0.0 };
                    pairs.push((cost, i, j));
                }
            }
        }
        pairs.sort_by(|a, b| a.0.total_cmp(&b.0));
        let mut free_track = vec![true; self.tracks.len()];
        let mut free_detection = vec![true; detections.len()];
        for (_, i, j) in pairs {
            if free_track[i] && free_detection[j] {
                self.tracks[i].update(&measurements[j], &noises[j]);
                free_track[i] = false;
                free_detection[j] = false;
            }
        }
        for (j, measurement) in measurements.iter().enumerate() {
            if free_detection[j] {
                let id = self.new_id();
                self.tracks.push(Track::new(id, measurement, config));
            }
        }
    }
}

/// Visibility of the position where a track should be.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Visibility {
    /// Nothing is in front of it.
    InSight,
    /// Something nearer is in front of it, or the image ends before its middle.
    Hidden,
    /// It is beside the image or behind the camera.
    OutOfView,
}

impl Visibility {
    fn of(track: &Track, cam_from_world: &Se3, now: &FrameContext) -> Self {
        let centre = cam_from_world.transform(&track.centre());
        if centre.z < 0.5 {
            return Self::OutOfView;
        }
        let (width, height) = (now.rays.x.len(), now.rays.y.len());
        let column = |p: &Vector3<f64>| {
            let x = (p.x / p.z) as f32;
            now.rays.x.partition_point(|ray| *ray < x)
        };
        let y = (centre.y / centre.z) as f32;
        let v = now.rays.y.partition_point(|ray| *ray < y);
        let u = column(&centre);
        if u == 0 || u >= width || v == 0 || v >= height {
            let corners = track.corners();
            let partly = corners.iter().any(|corner| {
                let corner = cam_from_world.transform(corner);
                corner.z > 0.5 && (1..width).contains(&column(&corner))
            });
            return if partly {
                Self::Hidden
            } else {
                Self::OutOfView
            };
        }
        let z = f64::from(now.depth[v * width + u]);
        if z > 0.0 && z < centre.z - track.reach() {
            Self::Hidden
        } else {
            Self::InSight
        }
    }
}
