//! What was measured over time, to be drawn.

use super::epipolar::EpipolarPair;
use super::survey::Survey;
use super::turn::picture_yaw_rate;
use deepfusion_data::GtKind;

/// A line of values over time.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Line {
    /// Its name in the legend.
    pub name: &'static str,
    /// Seconds on the frames' clock, and the value.
    pub points: Vec<(f64, f64)>,
}

/// Measurements of a drive over time.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct DrivePlots {
    /// Speeds, m/s: the vehicle's, and the LiDAR's where it measures one.
    pub speeds_mps: Vec<Line>,
    /// Yaw rates, rad/s, positive to the left: the vehicle's and the picture's.
    pub yaw_rates_radps: Vec<Line>,
    /// Mean grey level of the pictures, 0 to 255.
    pub brightness: Vec<Line>,
    /// Sharpness of the pictures.
    pub sharpness: Vec<Line>,
    /// Indices of frames with measured depth, to be drawn on their images: a few, spread over the drive.
    pub with_depth: Vec<usize>,
}

/// Number of overlays in a report.
const MOST_OVERLAYS: usize = 4;
/// Number of LiDAR scans in a plot.
const MOST_SCANS: usize = 40;

impl DrivePlots {
    pub(super) fn of(survey: &Survey<'_>, pairs: &[EpipolarPair]) -> Self {
        let dataset = survey.dataset;
        let times = |of: fn(&super::image_quality::ImageQuality) -> Option<f64>| {
            let seen = survey.frames.iter();
            seen.filter_map(|f| Some((dataset.frames()[f.index].time_s?, of(&f.quality)?)))
                .collect()
        };
        let line = |name, points: Vec<(f64, f64)>| Line { name, points };
        let speeds = dataset.frames().iter();
        let speeds = speeds.filter_map(|f| Some((f.time_s?, f.speed_mps?)));
        let by_scan = dataset.lidar_motion(MOST_SCANS).unwrap_or_default();
        let by_scan = by_scan.iter().map(|m| (m.time_s, m.by_scan_mps.x));
        let vehicle = pairs.iter().map(|p| (p.middle_s, p.vehicle_yaw_rate()));
        let picture = pairs
            .iter()
            .filter_map(|p| Some((p.middle_s, picture_yaw_rate(p)?)));
        let with_depth: Vec<usize> = (0..dataset.frames().len())
            .filter(|i| dataset.has_ground_truth(*i, GtKind::Z))
            .collect();
        let step = with_depth.len().div_ceil(MOST_OVERLAYS).max(1);
        let keep = |lines: Vec<Line>| lines.into_iter().filter(|l| !l.points.is_empty()).collect();
        Self {
            speeds_mps: keep(vec![
                line("vehicle", speeds.collect()),
                line("LiDAR", by_scan.collect()),
            ]),
            yaw_rates_radps: keep(vec![
                line("vehicle", vehicle.collect()),
                line("picture", picture.collect()),
            ]),
            brightness: keep(vec![line("mean grey level", times(|l| Some(l.mean)))]),
            sharpness: keep(vec![line("sharpness", times(|l| l.sharpness))]),
            with_depth: with_depth.into_iter().step_by(step).collect(),
        }
    }
}
