//! What to do about what was assumed on opening a recording: which key says otherwise, and in which file.

use deepfusion_data::{
    CameraWarning, DataWarning, IncompleteWarning, MotionWarning, MountWarning, TimesWarning,
};

/// Where nothing better is known.
const SEE: &str =
    "see that it is so; dataset.toml, or the TOML file beside a bag, has keys for what is not";

/// What to do.
pub(super) fn hint(warning: &DataWarning) -> &'static str {
    match warning {
        DataWarning::Camera(warning) => of_camera(warning),
        DataWarning::Mount(warning) => of_mount(warning),
        DataWarning::Times(warning) => of_times(warning),
        DataWarning::Motion(warning) => of_motion(warning),
        DataWarning::Incomplete(warning) => of_what_is_missing(warning),
        DataWarning::FramesElsewhere { .. } => {
            "nothing has to be done; a folder of your own, whose dataset.toml names the video, may have the key cache for another place"
        }
        _ => SEE,
    }
}

fn of_camera(warning: &CameraWarning) -> &'static str {
    match warning {
        CameraWarning::SizeUnknown { .. } => {
            "see that it was measured with images of this size; intrinsics in dataset.toml, or a calibration.yaml, says another"
        }
        CameraWarning::LensCorrected => {
            "nothing is to be done; intrinsics in dataset.toml takes the images as they are"
        }
        CameraWarning::BendsLines { .. } => {
            "name a calibration with the lens: calibration in dataset.toml"
        }
        _ => {
            "calibrate the camera, or say it: intrinsics or hfov_deg in dataset.toml, [camera] in the TOML file beside a bag"
        }
    }
}

fn of_mount(warning: &MountWarning) -> &'static str {
    match warning {
        MountWarning::NotGiven | MountWarning::Aimed(_) => {
            "measure it, and say it in dataset.toml: forward_m, left_m, up_m, yaw_deg, pitch_deg, roll_deg under [mount]"
        }
        MountWarning::CameraUnknown => {
            "measure it, and say it as cam_from_vehicle in the TOML file beside the bag"
        }
        MountWarning::LidarUnknown => {
            "measure it, and say it as cam_from_lidar in the TOML file beside the bag"
        }
        MountWarning::BodyAxes { .. } => {
            "see that it is so; frames.camera or cam_from_vehicle in the TOML file beside the bag says otherwise"
        }
        MountWarning::BrokenTransforms { .. }
        | MountWarning::NotByFrames { .. }
        | MountWarning::Apart { .. } => {
            "see which is right; cam_from_vehicle, cam_from_lidar and vehicle_from_imu in the TOML file beside the bag come before its frames"
        }
        _ => SEE,
    }
}

fn of_times(warning: &TimesWarning) -> &'static str {
    match warning {
        TimesWarning::ImagesUntimed | TimesWarning::VideoUntimed => "set fps in dataset.toml",
        TimesWarning::ImagesByName { .. } | TimesWarning::NoUnit { .. } => {
            "see that it is so; time_unit in dataset.toml says otherwise"
        }
        TimesWarning::Repeated { .. } | TimesWarning::OtherCount { .. } => {
            "see whether the files are whole"
        }
        TimesWarning::Unstamped { .. } => {
            "clock.camera_ahead_s in the TOML file beside the bag takes a constant delay out"
        }
        _ => "see that it is so; start_s in dataset.toml says otherwise",
    }
}

fn of_motion(warning: &MotionWarning) -> &'static str {
    match warning {
        MotionWarning::FramesWithoutSpeed { .. } => {
            "see whether the speeds are on the images' clock; start_s in dataset.toml, or clock.camera_ahead_s, moves the images"
        }
        MotionWarning::NoYawRate { .. } => {
            "record an inertial unit or the steering angle; imu in dataset.toml names a table of yaw rates"
        }
        MotionWarning::YawNotMeasured => {
            "record an inertial unit; yaw_known in dataset.toml says that there was one"
        }
        MotionWarning::Understood { .. } => {
            "see that it is so; speed_column, speed_unit, time_column and time_unit in dataset.toml say otherwise"
        }
        MotionWarning::NoCourseRates | MotionWarning::CourseNotRead { .. } => {
            "write course.csv anew, or remove it"
        }
        MotionWarning::Bridged { .. } | MotionWarning::NotBridged { .. } => {
            "see that the vehicle did not stop in between; max_gap_s says otherwise: in dataset.toml, or under [vehicle] in the TOML file beside a bag"
        }
        MotionWarning::SegmentWithoutTurns | MotionWarning::TurnsOfImages { .. } => {
            "record an inertial unit or the steering angle"
        }
        MotionWarning::NoRates { .. } => {
            "topics.imu in the TOML file beside the bag names another inertial unit"
        }
        MotionWarning::BeyondRange { .. } | MotionWarning::SilentSignal { .. } => {
            "see that the signal is the right one; the key is under [can] in the TOML file beside the bag"
        }
        _ => {
            "see that it is so; topics.speed, or topics.steering, in the TOML file beside the bag names another topic"
        }
    }
}

fn of_what_is_missing(warning: &IncompleteWarning) -> &'static str {
    match warning {
        IncompleteWarning::Damaged(_) | IncompleteWarning::Unreadable { .. } => {
            "copy the bag again; `rosbag reindex` (`ros2 bag reindex`) repairs one whose recording was cut off"
        }
        IncompleteWarning::PassedOver { .. } => "give what is to be read as well by its own path",
        IncompleteWarning::NoImages { .. } | IncompleteWarning::ImagesMissing { .. } => {
            "fetch or unpack the images that are missing"
        }
        IncompleteWarning::ImagesUnlisted { .. } => "add the images to the table, or remove them",
        IncompleteWarning::BeforeKeyFrame { .. } => {
            "nothing can be done now; record from a key frame on"
        }
        _ => SEE,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_file_and_its_key_are_named() {
        let cases: [(DataWarning, &str); 7] = [
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
                DataWarning::FramesElsewhere {
                    folder: "frames".into(),
                },
                "the key cache",
            ),
            (DataWarning::Other("it rained".into()), "dataset.toml"),
        ];
        for (warning, named) in cases {
            let said = hint(&warning);
            assert!(said.contains(named), "{warning}: {said}");
        }
    }
}
