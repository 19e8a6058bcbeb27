//! What to do about what was assumed on opening a recording: which key changes it, and in which file.

use deepfusion_data::{
    CameraWarning, DataWarning, IncompleteWarning, MotionWarning, MountWarning, TimesWarning,
};

/// The hint if there is no better one.
const SEE: &str = "check that this is right; if not, set the key for it in dataset.toml, or in the TOML file beside a bag";

/// What to do.
pub(super) fn hint(warning: &DataWarning) -> &'static str {
    match warning {
        DataWarning::Camera(warning) => of_camera(warning),
        DataWarning::Mount(warning) => of_mount(warning),
        DataWarning::Times(warning) => of_times(warning),
        DataWarning::Motion(warning) => of_motion(warning),
        DataWarning::Incomplete(warning) => of_what_is_missing(warning),
        DataWarning::FramesElsewhere { .. } => {
            "nothing to do; to keep the images elsewhere, name the video in the dataset.toml of a folder of your own, and set the key cache there"
        }
        _ => SEE,
    }
}

fn of_camera(warning: &CameraWarning) -> &'static str {
    match warning {
        CameraWarning::SizeUnknown { .. } => {
            "check that it was measured on images of this size; if not, set intrinsics in dataset.toml, or add a calibration.yaml"
        }
        CameraWarning::LensCorrected => {
            "nothing to do; to use the images as they are, set intrinsics in dataset.toml"
        }
        CameraWarning::BendsLines { .. } => {
            "name a calibration that includes the lens as calibration in dataset.toml"
        }
        _ => {
            "calibrate the camera, or set intrinsics or hfov_deg in dataset.toml, or [camera] in the TOML file beside a bag"
        }
    }
}

fn of_mount(warning: &MountWarning) -> &'static str {
    match warning {
        MountWarning::NotGiven | MountWarning::Aimed(_) => {
            "measure it, and set forward_m, left_m, up_m, yaw_deg, pitch_deg and roll_deg in dataset.toml, under [mount]"
        }
        MountWarning::CameraUnknown => {
            "measure it, and set cam_from_vehicle in the TOML file beside the bag"
        }
        MountWarning::LidarUnknown => {
            "measure it, and set cam_from_lidar in the TOML file beside the bag"
        }
        MountWarning::BodyAxes { .. } => {
            "check that this is right; if not, set frames.camera or cam_from_vehicle in the TOML file beside the bag"
        }
        MountWarning::BrokenTransforms { .. }
        | MountWarning::NotByFrames { .. }
        | MountWarning::Apart { .. } => {
            "check which is right; cam_from_vehicle, cam_from_lidar and vehicle_from_imu in the TOML file beside the bag override its frames"
        }
        _ => SEE,
    }
}

fn of_times(warning: &TimesWarning) -> &'static str {
    match warning {
        TimesWarning::ImagesUntimed | TimesWarning::VideoUntimed => "set fps in dataset.toml",
        TimesWarning::ImagesByName { .. } | TimesWarning::NoUnit { .. } => {
            "check that this is right; if not, set time_unit in dataset.toml"
        }
        TimesWarning::Repeated { .. } | TimesWarning::OtherCount { .. } => {
            "check that the files are complete"
        }
        TimesWarning::Unstamped { .. } => {
            "to remove a constant delay, set clock.camera_ahead_s in the TOML file beside the bag"
        }
        _ => "check that this is right; if not, set start_s in dataset.toml",
    }
}

fn of_motion(warning: &MotionWarning) -> &'static str {
    match warning {
        MotionWarning::FramesWithoutSpeed { .. } => {
            "check that the speeds are on the images' clock; if not, shift the images with start_s in dataset.toml, or clock.camera_ahead_s"
        }
        MotionWarning::NoYawRate { .. } => {
            "record an inertial unit or the steering angle, or name a table of yaw rates as imu in dataset.toml"
        }
        MotionWarning::YawNotMeasured => {
            "record an inertial unit; if there was one, set yaw_known in dataset.toml"
        }
        MotionWarning::Understood { .. } => {
            "check that this is right; if not, set speed_column, speed_unit, time_column or time_unit in dataset.toml"
        }
        MotionWarning::NoCourseRates | MotionWarning::CourseNotRead { .. } => {
            "write course.csv again, or remove it"
        }
        MotionWarning::Bridged { .. } => {
            "check that the vehicle did not stop in between; if it did, set a smaller max_gap_s in dataset.toml, or under [vehicle] in the TOML file beside a bag"
        }
        MotionWarning::NotBridged { .. } => {
            "if the vehicle did not stop in between, set a greater max_gap_s in dataset.toml, or under [vehicle] in the TOML file beside a bag"
        }
        MotionWarning::SegmentWithoutTurns | MotionWarning::TurnsOfImages { .. } => {
            "record an inertial unit or the steering angle"
        }
        MotionWarning::NoRates { .. } => {
            "to use another inertial unit, set topics.imu in the TOML file beside the bag"
        }
        MotionWarning::BeyondRange { .. } | MotionWarning::SilentSignal { .. } => {
            "check that the signal is the right one; if not, change the key under [can] in the TOML file beside the bag"
        }
        _ => {
            "check that this is right; if not, set topics.speed, or topics.steering, in the TOML file beside the bag"
        }
    }
}

fn of_what_is_missing(warning: &IncompleteWarning) -> &'static str {
    match warning {
        IncompleteWarning::Damaged(_) | IncompleteWarning::Unreadable { .. } => {
            "copy the bag again; `rosbag reindex` (`ros2 bag reindex`) repairs one whose recording was cut off"
        }
        IncompleteWarning::PassedOver { .. } => "give their own paths to read them too",
        IncompleteWarning::NoImages { .. } | IncompleteWarning::ImagesMissing { .. } => {
            "fetch or unpack the images that are missing"
        }
        IncompleteWarning::ImagesUnlisted { .. } => "add the images to the table, or remove them",
        IncompleteWarning::BeforeKeyFrame { .. } => {
            "nothing to do for this recording; start the next one at a key frame"
        }
        _ => SEE,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn hints_name_the_file_and_its_key() {
        let cases: [(DataWarning, &str); 9] = [
            (
                CameraWarning::Assumed {
                    fx: 900.0,
                    fy: 900.0,
                }
                .into(),
                "hfov_deg in dataset.toml",
            ),
            (MountWarning::NotGiven.into(), "under [mount]"),
            (
                MountWarning::LidarUnknown.into(),
                "cam_from_lidar in the TOML file beside the bag",
            ),
            (
                TimesWarning::VideoOnTablesClock.into(),
                "start_s in dataset.toml",
            ),
            (
                MotionWarning::NoYawRate {
                    log: "speed.csv".into(),
                }
                .into(),
                "imu in dataset.toml",
            ),
            (
                MotionWarning::Bridged {
                    log: "speed.csv".into(),
                    gaps: 1,
                    longest_s: 1.2,
                    setting: "max_gap_s in dataset.toml",
                }
                .into(),
                "if it did, set a smaller max_gap_s",
            ),
            (
                MotionWarning::NotBridged {
                    log: "speed.csv".into(),
                    gaps: 1,
                    most_s: 0.5,
                    setting: "max_gap_s in dataset.toml",
                }
                .into(),
                "if the vehicle did not stop in between, set a greater max_gap_s",
            ),
            (
                DataWarning::FramesElsewhere {
                    folder: "frames".into(),
                },
                "the key cache",
            ),
            (DataWarning::Other("it rained".into()), "dataset.toml"),
        ];
        for (warning, named) in cases {
            let hint = hint(&warning);
            assert!(hint.contains(named), "{warning}: {hint}");
        }
    }
}
