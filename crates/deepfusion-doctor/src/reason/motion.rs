//! What is wrong with the vehicle's speeds and turns, and with its clock.

use deepfusion_data::SpeedWarning;
use deepfusion_hint::count_of;

/// What is wrong with the vehicle's speeds and turns, and with its clock.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum MotionReason {
    /// The speeds contradict the road in the images.
    #[error("{0}")]
    Road(SpeedWarning),
    /// Neither road nor poses show whether the speeds are right.
    #[error(
        "neither road nor poses show whether the speeds are right: according to them, the vehicle drives at up to {fastest_mps:.1} m/s ({:.0} km/h)",
        3.6 * fastest_mps
    )]
    Unchecked {
        /// The highest speed, m/s.
        fastest_mps: f64,
    },
    /// A speed is higher than a road vehicle's.
    #[error(
        "at {time_s:.2} s the speed is {speed_mps:.0} m/s ({:.0} km/h), more than any road vehicle's: its unit or the value is wrong, and depths would be wrong by the same factor",
        3.6 * speed_mps
    )]
    TooFast {
        /// The speed, m/s; negative backwards.
        speed_mps: f64,
        /// Its time on the frames' clock, seconds.
        time_s: f64,
    },
    /// The recording's own poses contradict its speeds.
    #[error(
        "the poses cover {by_poses_m:.0} m, the speeds {by_speeds_m:.0} m: depths would come out {depth_factor:.2} times as large"
    )]
    Poses {
        /// Distance driven according to the poses, metres.
        by_poses_m: f64,
        /// Distance driven according to the speeds, metres.
        by_speeds_m: f64,
        /// Factor by which depths would be too large.
        depth_factor: f64,
    },
    /// The radial velocities of a LiDAR contradict the speeds.
    #[error(
        "the vehicle's speed is {factor:.2} times what the LiDAR's {scans} scans show: depths would come out {factor:.2} times as large"
    )]
    LidarSpeed {
        /// The vehicle's speed over the LiDAR's.
        factor: f64,
        /// Number of scans that were compared.
        scans: usize,
    },
    /// According to its radial velocities, a LiDAR moves left or right of the direction that its mount gives.
    #[error(
        "according to its radial velocities, the LiDAR moves {:.1} degrees to the {} of the direction that its mount gives",
        left_deg.abs(),
        if *left_deg > 0.0 { "left" } else { "right" }
    )]
    LidarSideways {
        /// Angle to the left, degrees.
        left_deg: f64,
    },
    /// According to its radial velocities, a LiDAR moves above or below the direction that its mount gives.
    #[error(
        "according to its radial velocities, the LiDAR moves {:.1} degrees {} the direction that its mount gives",
        up_deg.abs(),
        if *up_deg > 0.0 { "above" } else { "below" }
    )]
    LidarUpward {
        /// Angle upward, degrees.
        up_deg: f64,
    },
    /// Many dynamic points are static according to their radial velocity.
    #[error(
        "of {} in the topic of dynamic points, {in_scan} are in the scans and {fast} are dynamic according to their radial velocity",
        count_of(*listed, "point")
    )]
    DynamicAndSlow {
        /// Number of points in the topic.
        listed: usize,
        /// How many of them are in the scans.
        in_scan: usize,
        /// How many of them are dynamic according to their radial velocity.
        fast: usize,
    },
    /// Many points that are dynamic according to their radial velocity are not in the topic of dynamic points.
    #[error(
        "of {fast} points that are dynamic according to their radial velocity, the topic of dynamic points contains {listed}"
    )]
    FastAndUnlisted {
        /// Number of points that are dynamic according to their radial velocity.
        fast: usize,
        /// How many of them are in the topic.
        listed: usize,
    },
    /// The gyroscope measures other turns than the steering gives.
    #[error(
        "in {turning_s:.0} s of turning the vehicle turned {factor:.2} times as far as its steering says: the wheelbase or the steering ratio is wrong"
    )]
    Steering {
        /// Time during which the vehicle turned, seconds.
        turning_s: f64,
        /// Measured turn over the turn that the steering gives.
        factor: f64,
    },
    /// The camera's clock is ahead of the vehicle's, or behind it.
    #[error(
        "the camera's clock is {:.0} ± {:.0} ms {} the vehicle's: every frame gets the speed of another moment",
        1e3 * vehicle_minus_camera_s.abs(),
        1e3 * std_error_s,
        if *vehicle_minus_camera_s < 0.0 { "ahead of" } else { "behind" }
    )]
    ClockOffset {
        /// How far the vehicle's clock is ahead of the camera's, seconds.
        vehicle_minus_camera_s: f64,
        /// The standard error of that, seconds.
        std_error_s: f64,
        /// Total offset by which the camera's clock is ahead, with the one that the recording gives already, seconds.
        camera_ahead_s: f64,
    },
    /// The picture turns the other way.
    #[error(
        "the picture turns right where the vehicle turns left: the images are mirrored, or the yaw rate has the wrong sign"
    )]
    Mirrored,
    /// The picture turns at other times.
    #[error(
        "the picture's turns do not follow the vehicle's: the clock, yaw rate or camera belongs to another drive"
    )]
    TurnsUnrelated,
    /// The picture turns by another angle.
    #[error(
        "turns come out {factor:.2} times the vehicle's with this focal length: it is about {:.2} times the true one (or the yaw rate has another unit), and depths would be wrong by as much",
        1.0 / factor
    )]
    TurnsFactor {
        /// The picture's turns over the vehicle's.
        factor: f64,
    },
}

impl MotionReason {
    /// What to do about it.
    pub(super) fn hint(&self) -> String {
        let text = match self {
            Self::Road(warning) => match warning.likely_unit() {
                Some(unit) => {
                    return format!(
                        "divide the speeds: they seem to be in {unit} (for tables and bare numbers, set speed_unit)"
                    );
                }
                None => "check the speed signal's unit and factor, and the camera's focal length",
            },
            Self::Unchecked { .. } => {
                "check that it was that fast; with a wrong unit (km/h taken for m/s) every depth would be wrong by the same factor"
            }
            Self::TooFast { .. } => {
                "check the speed's unit (in tables: name the column speed_kmh or speed_mph, or set speed_unit in dataset.toml), and delete single wrong values"
            }
            Self::Poses { .. } => {
                "check the speed signal's unit and factor (3.6 for km/h, 1.02 for a worn tyre)"
            }
            Self::LidarSpeed { .. } => {
                "check the speed signal's unit and factor (3.6 for km/h), and lidar.receding for the sign of the radial velocities"
            }
            Self::LidarSideways { .. } => {
                "correct the yaw of cam_from_lidar or of cam_from_vehicle by that angle"
            }
            Self::LidarUpward { .. } => {
                "correct the pitch of cam_from_lidar or of cam_from_vehicle by that angle"
            }
            Self::DynamicAndSlow { .. } => {
                "check that the topic in topics.dynamic has the LiDAR's points, in its axes and at its times; lidar.moving_mps may be too high"
            }
            Self::FastAndUnlisted { .. } => {
                "check lidar.over_ground and lidar.velocity_field; lidar.moving_mps may be lower than the driver's threshold"
            }
            Self::Steering { factor, .. } => {
                return format!(
                    "multiply vehicle.wheelbase_m by {:.2}, or vehicle.steering_ratio if that is the wrong one",
                    1.0 / factor
                );
            }
            Self::ClockOffset { camera_ahead_s, .. } => {
                return format!(
                    "set clock.camera_ahead_s = {camera_ahead_s:.3} in dataset.toml or the TOML file beside a bag, or give a clock offset of {:.0} ms; better, use one clock for all sensors (PTP, trigger)",
                    1e3 * camera_ahead_s
                );
            }
            Self::Mirrored => {
                "mirror the images back, or negate the yaw rate (positive is to the left, z up)"
            }
            Self::TurnsUnrelated => {
                "compare the time stamps and the yaw rate's unit (rad/s) and axis (z up)"
            }
            Self::TurnsFactor { factor } => {
                return format!(
                    "calibrate at this image size; fx and fy times {factor:.2} would fit"
                );
            }
        };
        text.to_owned()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn speed_problems_have_their_messages() {
        let road = SpeedWarning {
            implied_height_m: 6.0,
            pairs: 12,
        };
        assert_eq!(MotionReason::Road(road).to_string(), road.to_string());
        for (reason, message) in [
            (
                MotionReason::Unchecked { fastest_mps: 50.04 },
                "neither road nor poses show whether the speeds are right: according to them, the vehicle drives at up to 50.0 m/s (180 km/h)",
            ),
            (
                MotionReason::TooFast {
                    speed_mps: -500.0,
                    time_s: 0.504,
                },
                "at 0.50 s the speed is -500 m/s (-1800 km/h), more than any road vehicle's: its unit or the value is wrong, and depths would be wrong by the same factor",
            ),
            (
                MotionReason::Poses {
                    by_poses_m: 100.2,
                    by_speeds_m: 361.0,
                    depth_factor: 3.603,
                },
                "the poses cover 100 m, the speeds 361 m: depths would come out 3.60 times as large",
            ),
            (
                MotionReason::LidarSpeed {
                    factor: 3.604,
                    scans: 40,
                },
                "the vehicle's speed is 3.60 times what the LiDAR's 40 scans show: depths would come out 3.60 times as large",
            ),
            (
                MotionReason::DynamicAndSlow {
                    listed: 400,
                    in_scan: 390,
                    fast: 12,
                },
                "of 400 points in the topic of dynamic points, 390 are in the scans and 12 are dynamic according to their radial velocity",
            ),
            (
                MotionReason::FastAndUnlisted {
                    fast: 400,
                    listed: 12,
                },
                "of 400 points that are dynamic according to their radial velocity, the topic of dynamic points contains 12",
            ),
        ] {
            assert_eq!(reason.to_string(), message);
        }
    }

    #[test]
    fn messages_name_the_direction() {
        for (reason, message) in [
            (
                MotionReason::LidarSideways { left_deg: 3.96 },
                "according to its radial velocities, the LiDAR moves 4.0 degrees to the left of the direction that its mount gives",
            ),
            (
                MotionReason::LidarSideways { left_deg: -3.96 },
                "according to its radial velocities, the LiDAR moves 4.0 degrees to the right of the direction that its mount gives",
            ),
            (
                MotionReason::LidarUpward { up_deg: 3.96 },
                "according to its radial velocities, the LiDAR moves 4.0 degrees above the direction that its mount gives",
            ),
            (
                MotionReason::LidarUpward { up_deg: -3.96 },
                "according to its radial velocities, the LiDAR moves 4.0 degrees below the direction that its mount gives",
            ),
        ] {
            assert_eq!(reason.to_string(), message);
        }
    }

    #[test]
    fn turn_and_clock_problems_have_their_messages() {
        let offset = |vehicle_minus_camera_s| MotionReason::ClockOffset {
            vehicle_minus_camera_s,
            std_error_s: 0.0041,
            camera_ahead_s: -vehicle_minus_camera_s,
        };
        for (reason, message) in [
            (
                MotionReason::Steering {
                    turning_s: 12.3,
                    factor: 1.52,
                },
                "in 12 s of turning the vehicle turned 1.52 times as far as its steering says: the wheelbase or the steering ratio is wrong",
            ),
            (
                offset(-0.3),
                "the camera's clock is 300 ± 4 ms ahead of the vehicle's: every frame gets the speed of another moment",
            ),
            (
                offset(0.3),
                "the camera's clock is 300 ± 4 ms behind the vehicle's: every frame gets the speed of another moment",
            ),
            (
                MotionReason::Mirrored,
                "the picture turns right where the vehicle turns left: the images are mirrored, or the yaw rate has the wrong sign",
            ),
            (
                MotionReason::TurnsFactor { factor: 0.8 },
                "turns come out 0.80 times the vehicle's with this focal length: it is about 1.25 times the true one (or the yaw rate has \
                 another unit), and depths would be wrong by as much",
            ),
        ] {
            assert_eq!(reason.to_string(), message);
        }
    }

    #[test]
    fn hints_name_the_factor_or_offset() {
        let road = |implied_height_m| {
            let pairs = 12;
            MotionReason::Road(SpeedWarning {
                implied_height_m,
                pairs,
            })
        };
        let steering = MotionReason::Steering {
            turning_s: 12.3,
            factor: 1.52,
        };
        let clock = MotionReason::ClockOffset {
            vehicle_minus_camera_s: -0.12,
            std_error_s: 0.0041,
            camera_ahead_s: 0.12,
        };
        let km_h = road(1.6 * 3.6);
        for (reason, hint) in [
            (
                km_h,
                "divide the speeds: they seem to be in km/h (for tables and bare numbers, set speed_unit)",
            ),
            (
                steering,
                "multiply vehicle.wheelbase_m by 0.66, or vehicle.steering_ratio if that is the wrong one",
            ),
            (
                MotionReason::TurnsFactor { factor: 0.8 },
                "calibrate at this image size; fx and fy times 0.80 would fit",
            ),
            (
                clock,
                "set clock.camera_ahead_s = 0.120 in dataset.toml or the TOML file beside a bag, or give a clock offset of 120 ms; better, use one clock for all sensors (PTP, trigger)",
            ),
        ] {
            assert_eq!(reason.hint(), hint);
        }
    }
}
