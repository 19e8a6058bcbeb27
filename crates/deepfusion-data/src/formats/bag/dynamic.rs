//! The topic of dynamic points beside a LiDAR: those points of a scan that its driver calls moving.

use super::index::{MessageRef, nearest};
use super::scan::usable;
use super::{image, scan};
use crate::Result;
use deepfusion_rosbag::MessageSource;
use nalgebra::Vector3;

/// A listed point is the scan's point nearest to it, up to this distance, metres: a driver may round.
const APART_M: f32 = 0.01;
/// Of the listed points at least this share must be in the scan; else the topic is of another scan or in other axes.
const LEAST_FOUND: f64 = 0.5;

/// Where the topic's messages are.
#[derive(Debug)]
pub(super) struct DynamicPoints {
    pub(super) topic: String,
    /// Each message's place and its time on the frames' clock.
    pub(super) places: Vec<(MessageRef, f64)>,
}

/// Which points of a scan are listed.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct MatchedPoints {
    /// One a point of the scan.
    pub(super) moves: Vec<bool>,
    /// Points of the topic's message.
    pub(super) points: usize,
    /// Of these, how many the scan has.
    pub(super) found: usize,
}

impl DynamicPoints {
    /// The scan's points that the message nearest to it lists; `None` without a message near enough.
    ///
    /// # Errors
    /// As [`scan::points`].
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
    /// Looks for each listed point among the scan's. Both in the LiDAR's axes, metres.
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
            let first = by_x.partition_point(|i| xyz[*i][0] < point[0] - APART_M);
            let near = by_x[first..]
                .iter()
                .take_while(|i| xyz[**i][0] <= point[0] + APART_M);
            let apart = |i: &usize| (Vector3::from(xyz[*i]) - Vector3::from(*point)).norm();
            let nearest = near.min_by(|a, b| apart(a).total_cmp(&apart(b)));
            if let Some(i) = nearest.filter(|i| apart(i) <= APART_M) {
                found.moves[*i] = true;
                found.found += 1;
            }
        }
        found
    }

    /// Whether the topic is about this scan: an empty list says that nothing moves.
    pub(super) fn is_of_scan(&self) -> bool {
        self.found as f64 >= LEAST_FOUND * self.points as f64
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_listed_point_is_the_nearest_within_a_centimetre() {
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
        assert!(found.is_of_scan());
    }

    #[test]
    fn a_list_in_other_axes_is_of_no_scan() {
        let scan = [[5.0, 1.0, 0.0], [6.0, 1.0, 0.0]];
        assert!(!MatchedPoints::find(&scan, &[[1.0, 5.0, 0.0], [1.0, 6.0, 0.0]]).is_of_scan());
        assert!(MatchedPoints::find(&scan, &[]).is_of_scan());
    }
}
