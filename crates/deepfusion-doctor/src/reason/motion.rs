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
    /// Neither road nor poses say whether the speeds are right.
    #[error(
        "neither road nor poses show whether the speeds are right: by them the vehicle drives up to {fastest_mps:.1} m/s ({:.0} km/h)",
        3.6 * fastest_mps
    )]
    Unchecked {
        /// The highest speed, m/s.
        fastest_mps: f64,
    },
    /// The recording's own poses contradict its speeds.
    #[error(
        "the poses go {by_poses_m:.0} m, the speeds {by_speeds_m:.0} m: depths would come out {depth_factor:.2} times as large"
    )]
    Poses {
        /// The way by the poses, metres.
        by_poses_m: f64,
        /// The way by the speeds, metres.
        by_speeds_m: f64,
        /// How many times as large depths would come out.
        depth_factor: f64,
    },
    /// The radial velocities of a LiDAR contradict the speeds.
    #[error(
        "the vehicle's speed is {factor:.2} times what the LiDAR's {scans} scans say: depths would come out {factor:.2} times as large"
    )]
    LidarSpeed {
        /// How many times the LiDAR's the speed is.
        factor: f64,
        /// Scans that say so.
        scans: usize,
    },
    /// By its radial velocities a LiDAR drives to another side than its mount says.
    #[error(
        "by its radial velocities the LiDAR drives {:.1} degrees to the {} of where its mount says",
        left_deg.abs(),
        if *left_deg > 0.0 { "left" } else { "right" }
    )]
    LidarSideways {
        /// How far to the left, degrees.
        left_deg: f64,
    },
    /// By its radial velocities a LiDAR drives higher or lower than its mount says.
    #[error(
        "by its radial velocities the LiDAR drives {:.1} degrees {} where its mount says",
        up_deg.abs(),
        if *up_deg > 0.0 { "above" } else { "below" }
    )]
    LidarUpward {
        /// How far up, degrees.
        up_deg: f64,
    },
    /// Many dynamic points do not move by their radial velocity.
    #[error(
        "of {} that the topic of dynamic points lists, {in_scan} are in the scans and {fast} move by their radial velocity",
        count_of(*listed, "point")
    )]
    DynamicAndSlow {
        /// Points that the topic lists.
        listed: usize,
        /// Of these, points of the scans.
        in_scan: usize,
        /// Of these, points that move by their radial velocity.
        fast: usize,
    },
    /// Many points that move by their radial velocity are no dynamic points.
    #[error(
        "of {fast} points that move by their radial velocity, the topic of dynamic points lists {listed}"
    )]
    FastAndUnlisted {
        /// Points that move by their radial velocity.
        fast: usize,
        /// Of these, points that the topic lists.
        listed: usize,
    },
    /// The gyro feels other turns than the steering says.
    #[error(
        "in {turning_s:.0} s of turning the vehicle turned {factor:.2} times as far as its steering says: the wheelbase or the steering ratio is wrong"
    )]
    Steering {
        /// For how long it turned, seconds.
        turning_s: f64,
        /// How many times as far as the steering says.
        factor: f64,
    },
    /// The camera's clock is another one than the vehicle's.
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
        /// How far the camera's clock is ahead in all, with what the recording says of it already, seconds.
        camera_ahead_s: f64,
    },
    /// The pictures turn the other way.
    #[error(
        "the picture turns right where the vehicle turns left: the images are mirrored, or the yaw rate has the wrong sign"
    )]
    Mirrored,
    /// The pictures turn at other times.
    #[error(
        "the picture's turns do not follow the vehicle's: clock, yaw rate or camera are not of this drive"
    )]
    TurnsUnrelated,
    /// The pictures turn by another angle.
    #[error(
        "turns come out {factor:.2} times the vehicle's with this focal length: it is about {:.2} times the true one (or the yaw rate has another unit), and depths would be wrong by as much",
        1.0 / factor
    )]
    TurnsFactor {
        /// How many times the vehicle's turns the picture's are.
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
                        "divide the speeds: they seem to be in {unit} (speed_unit says so for tables and bare numbers)"
                    );
                }
                None => "see the speed signal's unit and factor, and the camera's focal length",
            },
            Self::Unchecked { .. } => {
                "was it as fast? With a wrong unit (km/h taken for m/s) every depth would be wrong by the same factor"
            }
            Self::Poses { .. } => {
                "see the speed signal's unit and factor (km/h is 3.6, a worn tyre 1.02)"
            }
            Self::LidarSpeed { .. } => {
                "see the speed signal's unit and factor (km/h is 3.6), and lidar.receding for the sign of the radial velocities"
            }
            Self::LidarSideways { .. } => {
                "correct the yaw of cam_from_lidar or of cam_from_vehicle by that angle"
            }
            Self::LidarUpward { .. } => {
                "correct the pitch of cam_from_lidar or of cam_from_vehicle by that angle"
            }
            Self::DynamicAndSlow { .. } => {
                "topics.dynamic names the topic; its points must be the LiDAR's, in its axes and at its times; lidar.moving_mps may be too high"
            }
            Self::FastAndUnlisted { .. } => {
                "see lidar.over_ground and lidar.velocity_field; lidar.moving_mps may be lower than the driver's threshold"
            }
            Self::Steering { factor, .. } => {
                return format!(
                    "multiply vehicle.wheelbase_m by {:.2}, or vehicle.steering_ratio if that is the wrong one",
                    1.0 / factor
                );
            }
            Self::ClockOffset { camera_ahead_s, .. } => {
                return format!(
                    "clock.camera_ahead_s = {camera_ahead_s:.3} in dataset.toml or the TOML file beside a bag, or a clock offset of {:.0} ms given. Better: one \
                     clock for all (PTP, trigger)",
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
                    "calibrate at the size of these images; fx and fy times {factor:.2} would fit"
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
    fn what_contradicts_the_speeds_is_said() {
        let road = SpeedWarning {
            implied_height_m: 6.0,
            pairs: 12,
        };
        assert_eq!(MotionReason::Road(road).to_string(), road.to_string());
        for (reason, said) in [
            (
                MotionReason::Unchecked { fastest_mps: 50.04 },
                "neither road nor poses show whether the speeds are right: by them the vehicle drives up to 50.0 m/s (180 km/h)",
            ),
            (
                MotionReason::Poses {
                    by_poses_m: 100.2,
                    by_speeds_m: 361.0,
                    depth_factor: 3.603,
                },
                "the poses go 100 m, the speeds 361 m: depths would come out 3.60 times as large",
            ),
            (
                MotionReason::LidarSpeed {
                    factor: 3.604,
                    scans: 40,
                },
                "the vehicle's speed is 3.60 times what the LiDAR's 40 scans say: depths would come out 3.60 times as large",
            ),
            (
                MotionReason::DynamicAndSlow {
                    listed: 400,
                    in_scan: 390,
                    fast: 12,
                },
                "of 400 points that the topic of dynamic points lists, 390 are in the scans and 12 move by their radial velocity",
            ),
            (
                MotionReason::FastAndUnlisted {
                    fast: 400,
                    listed: 12,
                },
                "of 400 points that move by their radial velocity, the topic of dynamic points lists 12",
            ),
        ] {
            assert_eq!(reason.to_string(), said);
        }
    }

    #[test]
    fn directions_are_said_in_words() {
        for (reason, said) in [
            (
                MotionReason::LidarSideways { left_deg: 3.96 },
                "by its radial velocities the LiDAR drives 4.0 degrees to the left of where its mount says",
            ),
            (
                MotionReason::LidarSideways { left_deg: -3.96 },
                "by its radial velocities the LiDAR drives 4.0 degrees to the right of where its mount says",
            ),
            (
                MotionReason::LidarUpward { up_deg: 3.96 },
                "by its radial velocities the LiDAR drives 4.0 degrees above where its mount says",
            ),
            (
                MotionReason::LidarUpward { up_deg: -3.96 },
                "by its radial velocities the LiDAR drives 4.0 degrees below where its mount says",
            ),
        ] {
            assert_eq!(reason.to_string(), said);
        }
    }

    #[test]
    fn what_is_wrong_with_turns_and_clock_is_said() {
        let offset = |vehicle_minus_camera_s| MotionReason::ClockOffset {
            vehicle_minus_camera_s,
            std_error_s: 0.0041,
            camera_ahead_s: -vehicle_minus_camera_s,
        };
        for (reason, said) in [
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
            assert_eq!(reason.to_string(), said);
        }
    }

    #[test]
    fn what_to_multiply_by_is_said() {
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
                "divide the speeds: they seem to be in km/h (speed_unit says so for tables and bare numbers)",
            ),
            (
                steering,
                "multiply vehicle.wheelbase_m by 0.66, or vehicle.steering_ratio if that is the wrong one",
            ),
            (
                MotionReason::TurnsFactor { factor: 0.8 },
                "calibrate at the size of these images; fx and fy times 0.80 would fit",
            ),
            (
                clock,
                "clock.camera_ahead_s = 0.120 in dataset.toml or the TOML file beside a bag, or a clock offset of 120 ms given. Better: one clock for all \
                 (PTP, trigger)",
            ),
        ] {
            assert_eq!(reason.hint(), hint);
        }
    }
}
