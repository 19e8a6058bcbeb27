//! The vehicle's speed from a GPS receiver's positions (NavSatFix).

use crate::logs::samples::Samples;
use crate::{DataWarning, MotionWarning};
use deepfusion_motion::{Fix, course_rates, speeds_of_fixes};
use deepfusion_rosbag::msg::NavSatFix;

/// A status below this means that the receiver has no position.
const HAS_FIX: i8 = 0;

/// Positions in the order of their messages.
#[derive(Debug, Clone, Default)]
pub(super) struct Fixes {
    /// Times in nanoseconds, with latitude and longitude in degrees.
    places: Vec<(i64, [f64; 2])>,
    /// Number of messages without a position.
    without: usize,
}

/// The vehicle's motion computed from positions. Times are nanoseconds.
#[derive(Debug, Default)]
pub(super) struct SpeedsOfFixes {
    /// Speeds over ground, including interpolated ones between a slow receiver's positions.
    pub(super) speeds_mps: Vec<(i64, f64)>,
    /// Standard deviations of the speeds at the positions.
    pub(super) sigmas_mps: Option<Samples>,
    /// Rate of turn of the course, positive to the left, while the vehicle moved.
    pub(super) course_rates_radps: Option<Samples>,
}

impl Fixes {
    /// Adds a message.
    pub(super) fn add(&mut self, at_ns: i64, fix: &NavSatFix) {
        let place = [fix.latitude, fix.longitude];
        if fix.status.status < HAS_FIX || !place.iter().all(|x| x.is_finite()) {
            self.without += 1;
        } else {
            self.places.push((at_ns, place));
        }
    }

    /// Whether there was no message.
    pub(super) fn is_empty(&self) -> bool {
        self.places.is_empty() && self.without == 0
    }

    /// Times of measurement, in nanoseconds.
    pub(super) fn times(&self) -> impl Iterator<Item = i64> {
        self.places.iter().map(|(ns, _)| *ns)
    }

    /// Speeds from all positions. Gaps of up to `max_gap_s`, or a few seconds if it is not set, are bridged, with a note in the
    /// warnings.
    pub(super) fn speeds(
        &mut self,
        topic: &str,
        max_gap_s: Option<f64>,
        warnings: &mut Vec<DataWarning>,
    ) -> SpeedsOfFixes {
        self.places.sort_by_key(|(ns, _)| *ns);
        if self.without > 0 {
            let left_out = MotionWarning::NoPosition {
                topic: topic.to_owned(),
                messages: self.without,
                of: self.without + self.places.len(),
            };
            warnings.push(left_out.into());
        }
        let Some(&(origin_ns, _)) = self.places.first() else {
            return SpeedsOfFixes::default();
        };
        let fixes = self.places.iter().map(|(ns, [north, east])| Fix {
            time_s: (ns - origin_ns) as f64 * 1e-9,
            latitude_deg: *north,
            longitude_deg: *east,
            speed_mps: None,
        });
        let smoothed = speeds_of_fixes(&fixes.collect::<Vec<_>>());
        let mut sigmas: Vec<f64> = smoothed.iter().map(|s| s.sigma_mps).collect();
        sigmas.sort_by(f64::total_cmp);
        let Some(usual) = sigmas.get(sigmas.len() / 2) else {
            let too_few = MotionWarning::TooFewPositions {
                topic: topic.to_owned(),
                positions: self.places.len(),
            };
            warnings.push(too_few.into());
            return SpeedsOfFixes::default();
        };
        let of_positions = MotionWarning::OfPositions {
            topic: topic.to_owned(),
            sigma_mps: *usual,
        };
        warnings.push(of_positions.into());
        let ns = |s: f64| origin_ns + (s * 1e9).round() as i64;
        let at_fixes = |values: Vec<f64>| Samples {
            ns: smoothed.iter().map(|s| ns(s.time_s)).collect(),
            values,
        };
        let samples = at_fixes(smoothed.iter().map(|s| s.speed_mps).collect());
        let sigmas = at_fixes(smoothed.iter().map(|s| s.sigma_mps).collect());
        let rates = course_rates(&smoothed);
        let course_rates_radps = (!rates.is_empty()).then(|| Samples {
            ns: rates.iter().map(|(time_s, _)| ns(*time_s)).collect(),
            values: rates.iter().map(|(_, rate)| *rate).collect(),
        });
        let setting = "vehicle.max_gap_s in the file beside the bag";
        let bridged = samples.bridged(max_gap_s, Some((warnings, topic, setting)));
        SpeedsOfFixes {
            speeds_mps: bridged.ns.into_iter().zip(bridged.values).collect(),
            sigmas_mps: Some(sigmas),
            course_rates_radps,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use deepfusion_rosbag::msg::{Header, NavSatStatus};

    /// At the equator, where a degree of longitude is 111,319.49 m.
    fn fix(metres_east: f64, status: i8) -> NavSatFix {
        NavSatFix {
            header: Header::default(),
            status: NavSatStatus { status, service: 1 },
            latitude: 0.0,
            longitude: metres_east / 111_319.490_793,
            altitude: 0.0,
            position_covariance: [0.0; 9],
            position_covariance_type: 0,
        }
    }

    #[test]
    fn invalid_positions_are_left_out_and_gaps_are_bridged() {
        let mut fixes = Fixes::default();
        for second in 0..20_i64 {
            // 10 m/s; without a position the receiver gives the origin, and once a number is missing.
            let (metres, status) = match second {
                7 => (0.0, -1),
                8 => (f64::NAN, 0),
                _ => (10.0 * second as f64, 0),
            };
            fixes.add(second * 1_000_000_000, &fix(metres, status));
        }
        let mut warnings = Vec::new();
        let found = fixes.speeds("/fix", None, &mut warnings);
        // Only those of the 18 positions.
        let sigmas = found.sigmas_mps.unwrap();
        assert_eq!(sigmas.ns.len(), 18);
        assert!(sigmas.values.iter().all(|sigma| (0.1..3.0).contains(sigma)));
        let turns = found.course_rates_radps.unwrap();
        assert!(turns.values.iter().all(|rate| rate.abs() < 1e-6));
        let speeds = found.speeds_mps;
        assert!(
            speeds.iter().all(|(_, v)| (v - 10.0).abs() < 0.05),
            "{speeds:?}"
        );
        let steps = speeds.windows(2).map(|w| w[1].0 - w[0].0);
        assert_eq!(steps.max(), Some(250_000_000), "3 s are bridged too");
        let warnings: Vec<String> = warnings.iter().map(ToString::to_string).collect();
        let warnings = warnings.join("\n");
        for part in [
            "2 of 20 messages left out for lack of a position",
            "median standard deviation of 0.",
            "vehicle.max_gap_s",
            "up to 3.0 s",
        ] {
            assert!(warnings.contains(part), "{part}: {warnings}");
        }
        // Not across longer gaps than allowed.
        let speeds = fixes.speeds("/fix", Some(2.0), &mut Vec::new()).speeds_mps;
        let steps = speeds.windows(2).map(|w| w[1].0 - w[0].0);
        assert_eq!(steps.max(), Some(3_000_000_000));
        // Neither a single position nor none gives a speed.
        let mut lone = Fixes::default();
        lone.add(0, &fix(0.0, 0));
        let mut warnings = Vec::new();
        let found = lone.speeds("/fix", None, &mut warnings);
        assert!(found.speeds_mps.is_empty() && found.sigmas_mps.is_none());
        let message = warnings[0].to_string();
        assert!(message.contains("at least two"), "{message}");
    }
}
