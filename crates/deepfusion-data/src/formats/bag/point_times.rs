//! When each point of a scan was measured, where the scan says it.

use crate::logs::clock::TimeUnit;
use deepfusion_rosbag::Time;
use deepfusion_rosbag::msg::{Column, Datatype};

/// Farther from its scan's time than this, in seconds, no point is.
const FARTHEST_S: f64 = 1.0;

/// The points' times in seconds after the scan's own, which is `stamp`: of dates in any unit, and else of numbers that count from it, whole
/// ones in nanoseconds, as Ouster's `t`, others in seconds, as Velodyne's `time`. `None` where a point would be more than a second off.
pub(super) fn seconds_after(column: &Column<'_>, stamp: Time) -> Option<Vec<f32>> {
    let first = column.f64s().find(|number| number.is_finite());
    let is_whole = !matches!(column.datatype(), Datatype::Float32 | Datatype::Float64);
    let (unit, start_s) = match first.and_then(TimeUnit::of_date) {
        Some(unit) => (unit, stamp.seconds()),
        None if is_whole => (TimeUnit::Nanoseconds, 0.0),
        None => (TimeUnit::Seconds, 0.0),
    };
    let per_second = unit.per_second();
    let after = column.f64s().map(|number| number / per_second - start_s);
    // Rays without an echo may have no time either.
    let after: Vec<f64> = after.map(|s| if s.is_nan() { 0.0 } else { s }).collect();
    let is_near = after.iter().all(|s| s.abs() <= FARTHEST_S);
    is_near.then(|| after.iter().map(|s| *s as f32).collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use deepfusion_rosbag::msg::{Header, PointCloud2, PointField};
    use std::borrow::Cow;

    const STAMP: Time = Time {
        sec: 1_700_000_000,
        nsec: 500_000_000,
    };

    /// Of a cloud whose only field has these bytes.
    fn after(datatype: Datatype, numbers: &[Vec<u8>]) -> Option<Vec<f32>> {
        let size = datatype.size() as u32;
        let cloud = PointCloud2 {
            header: Header::default(),
            height: 1,
            width: numbers.len() as u32,
            fields: vec![PointField {
                name: "t".into(),
                offset: 0,
                datatype: datatype as u8,
                count: 1,
            }],
            is_bigendian: false,
            point_step: size,
            row_step: size * numbers.len() as u32,
            data: Cow::Owned(numbers.concat()),
            is_dense: true,
        };
        seconds_after(&cloud.column("t").unwrap(), STAMP)
    }

    #[test]
    fn times_of_points_as_drivers_write_them() {
        let near = |found: Option<Vec<f32>>, expected: [f32; 2]| {
            let found = found.unwrap();
            let is_near = |(a, b): (&f32, &f32)| (a - b).abs() < 1e-6;
            assert!(found.iter().zip(&expected).all(is_near), "{found:?}");
        };
        let of_f64 = |numbers: [f64; 2]| {
            let bytes = numbers.map(|number| number.to_le_bytes().to_vec());
            after(Datatype::Float64, &bytes)
        };
        let nanoseconds = [0_u32, 99_000_000].map(|t| t.to_le_bytes().to_vec());
        near(after(Datatype::Uint32, &nanoseconds), [0.0, 0.099]);
        let seconds = [-0.05_f32, f32::NAN].map(|t| t.to_le_bytes().to_vec());
        near(after(Datatype::Float32, &seconds), [-0.05, 0.0]);
        near(of_f64([1_700_000_000.5, 1_700_000_000.55]), [0.0, 0.05]);
        near(of_f64([1.700_000_000_5e18, 1.700_000_000_6e18]), [0.0, 0.1]);
        assert_eq!(of_f64([1.0, 99.0]), None);
        assert_eq!(of_f64([1_600_000_000.0, 1_600_000_000.1]), None);
    }
}
