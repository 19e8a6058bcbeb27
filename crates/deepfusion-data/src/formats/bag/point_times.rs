//! Times of a scan's points, if the scan has them.

use crate::logs::clock::{TimeUnit, seconds};
use deepfusion_rosbag::msg::{Column, Datatype};

/// Largest time between a point and its scan, in seconds.
const MAX_AFTER_S: f64 = 1.0;

/// The points' times in seconds after the scan's own time, which is `scan_ns` after 1970. The numbers may be dates in any unit, or count
/// from the scan's time: integers in nanoseconds, like Ouster's `t`, others in seconds, like Velodyne's `time`. Points that are invalid
/// according to `is_point` have no time, whatever their number. `None` if a point is more than a second off.
pub(super) fn seconds_after(
    column: &Column<'_>,
    scan_ns: i64,
    is_point: impl Fn(usize) -> bool,
) -> Option<Vec<f32>> {
    let of_points = column.f64s().enumerate().filter(|(i, _)| is_point(*i));
    let mut times = of_points.map(|(_, number)| number);
    let first = times.find(|number| number.is_finite());
    let is_whole = !matches!(column.datatype(), Datatype::Float32 | Datatype::Float64);
    let (unit, start_s) = match first.and_then(TimeUnit::of_date) {
        Some(unit) => (unit, seconds(scan_ns, 0)),
        None if is_whole => (TimeUnit::Nanoseconds, 0.0),
        None => (TimeUnit::Seconds, 0.0),
    };
    let per_second = unit.per_second();
    let after = column.f64s().enumerate().map(|(i, number)| {
        // A point without a time of its own has the scan's.
        if number.is_nan() || !is_point(i) {
            0.0
        } else {
            number / per_second - start_s
        }
    });
    let after: Vec<f64> = after.collect();
    let is_near = after.iter().all(|s| s.abs() <= MAX_AFTER_S);
    is_near.then(|| after.iter().map(|s| *s as f32).collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use deepfusion_rosbag::msg::{Header, PointCloud2, PointField};
    use std::borrow::Cow;

    const SCAN_NS: i64 = 1_700_000_000_500_000_000;

    /// The times for a cloud whose only field has these bytes, and whose first numbers belong to invalid points.
    fn after(datatype: Datatype, numbers: &[Vec<u8>], no_points: usize) -> Option<Vec<f32>> {
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
        seconds_after(&cloud.column("t").unwrap(), SCAN_NS, |i| i >= no_points)
    }

    #[test]
    fn point_times_are_read_in_the_units_of_drivers() {
        let near = |found: Option<Vec<f32>>, expected: [f32; 2]| {
            let found = found.unwrap();
            let is_near = |(a, b): (&f32, &f32)| (a - b).abs() < 1e-6;
            assert!(found.iter().zip(&expected).all(is_near), "{found:?}");
        };
        let of_f64 = |numbers: [f64; 2]| {
            let bytes = numbers.map(|number| number.to_le_bytes().to_vec());
            after(Datatype::Float64, &bytes, 0)
        };
        let nanoseconds = [0_u32, 99_000_000].map(|t| t.to_le_bytes().to_vec());
        near(after(Datatype::Uint32, &nanoseconds, 0), [0.0, 0.099]);
        let seconds = [-0.05_f32, f32::NAN].map(|t| t.to_le_bytes().to_vec());
        near(after(Datatype::Float32, &seconds, 0), [-0.05, 0.0]);
        near(of_f64([1_700_000_000.5, 1_700_000_000.55]), [0.0, 0.05]);
        near(of_f64([1.700_000_000_5e18, 1.700_000_000_6e18]), [0.0, 0.1]);
        assert_eq!(of_f64([1.0, 99.0]), None);
        assert_eq!(of_f64([1_600_000_000.0, 1_600_000_000.1]), None);
    }

    /// Many drivers fill invalid points with zeros, even if the others have dates.
    #[test]
    fn invalid_points_need_no_times() {
        let numbers = [0.0, f64::INFINITY, 1_700_000_000.55, f64::NAN];
        let bytes = numbers.map(|number: f64| number.to_le_bytes().to_vec());
        let found = after(Datatype::Float64, &bytes, 2).unwrap();
        assert!((found[2] - 0.05).abs() < 1e-6, "{found:?}");
        assert_eq!([found[0], found[1], found[3]], [0.0; 3]);
        assert_eq!(after(Datatype::Float64, &bytes, 0), None);
        assert_eq!(after(Datatype::Float64, &bytes[..2], 2), Some(vec![0.0; 2]));
    }
}
