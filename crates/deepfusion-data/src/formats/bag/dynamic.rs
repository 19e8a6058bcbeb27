//! The topic of dynamic points beside a LiDAR: those points of a scan that its driver marks as moving.

use super::index::{MessageRef, nearest};
use super::scan::usable;
use super::{image, scan};
use crate::Result;
use deepfusion_rosbag::MessageSource;
use nalgebra::Vector3;

/// Largest distance between a listed point and the matching point of the scan, metres: a driver may round.
const MAX_DISTANCE_M: f32 = 0.01;
/// Smallest fraction of the listed points that must be in the scan; otherwise the list belongs to another scan or has other axes.
const MIN_FOUND: f64 = 0.5;

/// The positions of the topic's messages.
#[derive(Debug)]
pub(super) struct DynamicPoints {
    pub(super) topic: String,
    /// Each message's position in the bag, and its time on the frames' clock.
    pub(super) places: Vec<(MessageRef, f64)>,
}

/// Which points of a scan are listed.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct MatchedPoints {
    /// One value per point of the scan.
    pub(super) moves: Vec<bool>,
    /// Number of points in the topic's message.
    pub(super) points: usize,
    /// How many of these are in the scan.
    pub(super) found: usize,
}

impl DynamicPoints {
    /// The scan's points that are listed in the message nearest in time; `None` without a message near enough.
    ///
    /// # Errors
    /// Those of [`scan::points`].
    pub(super) fn of(
        &self,
        bag: &dyn MessageSource,
        xyz: &[[f32; 3]],
        scan_s: f64,
        within_s: f64,
    ) -> Result<Option<MatchedPoints>> {
        let Some((place, _)) = nearest(&self.places, scan_s, within_s) else {
            return Ok(None);
        };
        let message = image::message(bag, &self.topic, place)?;
        Ok(Some(MatchedPoints::find(
            xyz,
            &scan::points(bag, &message)?,
        )))
    }
}

impl MatchedPoints {
    /// Finds each listed point among the scan's points. Both are in the LiDAR's axes, metres.
    fn find(xyz: &[[f32; 3]], listed: &[[f32; 3]]) -> Self {
        let mut by_x: Vec<usize> = (0..xyz.len()).filter(|i| usable(&xyz[*i])).collect();
        by_x.sort_by(|a, b| xyz[*a][0].total_cmp(&xyz[*b][0]));
        let mut found = Self {
            moves: vec![false; xyz.len()],
            points: 0,
            found: 0,
        };
        for point in listed.iter().filter(|point| usable(point)) {
            found.points += 1;
            let first = by_x.partition_point(|i| xyz[*i][0] < point[0] - MAX_DISTANCE_M);
            let near = by_x[first..]
                .iter()
                .take_while(|i| xyz[**i][0] <= point[0] + MAX_DISTANCE_M);
            let apart = |i: &usize| (Vector3::from(xyz[*i]) - Vector3::from(*point)).norm();
            let nearest = near.min_by(|a, b| apart(a).total_cmp(&apart(b)));
            if let Some(i) = nearest.filter(|i| apart(i) <= MAX_DISTANCE_M) {
                found.moves[*i] = true;
                found.found += 1;
            }
        }
        found
    }

    /// Whether the list belongs to this scan. An empty list does: nothing moves.
    pub(super) fn belongs_to_scan(&self) -> bool {
        self.found as f64 >= MIN_FOUND * self.points as f64
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn listed_points_match_the_nearest_within_a_centimetre() {
        let scan = [
            [5.0, 1.0, 0.0],
            [5.004, 1.0, 0.0],
            [9.0, 2.0, 0.5],
            [0.0; 3],
            [f32::NAN; 3],
        ];
        let listed = [
            [5.004, 1.0, 0.0],
            [9.0, 2.006, 0.5],
            [9.0, 2.02, 0.5],
            [0.0; 3],
            [f32::NAN; 3],
        ];
        let found = MatchedPoints::find(&scan, &listed);
        assert_eq!(found.moves, [false, true, true, false, false]);
        assert_eq!((found.points, found.found), (3, 2));
        assert!(found.belongs_to_scan());
    }

    #[test]
    fn a_list_in_other_axes_matches_no_scan() {
        let scan = [[5.0, 1.0, 0.0], [6.0, 1.0, 0.0]];
        assert!(!MatchedPoints::find(&scan, &[[1.0, 5.0, 0.0], [1.0, 6.0, 0.0]]).belongs_to_scan());
        assert!(MatchedPoints::find(&scan, &[]).belongs_to_scan());
    }
}
