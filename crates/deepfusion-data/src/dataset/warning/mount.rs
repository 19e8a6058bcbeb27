//! Warnings about the sensors' mounts on the vehicle.

use crate::Heading;
use crate::formats::Change;
use deepfusion_hint::count_of;
use std::path::PathBuf;

/// Beginning of the warnings about an unknown camera mount.
const NOT_GIVEN: &str = "the camera's mount is not given ([mount] in dataset.toml):";

/// A warning about the sensors' mounts on the vehicle.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum MountWarning {
    /// The camera's mount is unknown, and was not estimated from its images.
    #[error("{NOT_GIVEN} assuming that it looks straight ahead from the vehicle's origin")]
    NotGiven,
    /// The camera's viewing direction is estimated from its images ([`crate::Dataset::aim`]).
    #[error("{NOT_GIVEN} {0}")]
    Aimed(Heading),
    /// KITTI odometry does not include the cameras' mounts.
    #[error(
        "KITTI odometry does not include the cameras' mounts: taking their positions from KITTI raw's calibration, their direction from the path"
    )]
    OfKittiRaw,
    /// A bag does not include the camera's mount.
    #[error(
        "the camera's mount is not given: assuming that it looks straight ahead from the rear axle"
    )]
    CameraUnknown,
    /// A bag does not include the LiDAR's mount.
    #[error("the LiDAR's mount is not given (cam_from_lidar): its scans give no ground truth")]
    LidarUnknown,
    /// A bag has invalid transforms between frames.
    #[error(
        "{} between frames {}",
        count_of(*transforms, "transform"),
        if *transforms == 1 {
            "has no rotation or a NaN, and is left out"
        } else {
            "have no rotation or a NaN, and are left out"
        }
    )]
    BrokenTransforms {
        /// Number of transforms.
        transforms: usize,
    },
    /// The frame of a bag's images has body axes (x forward, y left, z up) instead of optical ones.
    #[error(
        "the images' frame {frame} has its z axis up, so it is not an optical frame: assuming that its x axis points ahead and its y axis to the left"
    )]
    BodyAxes {
        /// Name of the frame.
        frame: String,
    },
    /// A mount cannot be taken from the bag's frames, although it should be.
    #[error("{mount}: {why}")]
    NotByFrames {
        /// The mount's key in the file beside the bag.
        mount: &'static str,
        /// Why it cannot be taken from them.
        why: NotByFrames,
    },
    /// Two sources disagree on a mount.
    #[error(
        "{mount}: {taken} and {other} are {} apart; the former is used",
        Change { metres: *metres, radians: *radians }
    )]
    Apart {
        /// The mount's key in the file beside the bag.
        mount: &'static str,
        /// The source of the mount that is used.
        taken: String,
        /// The source of the other mount.
        other: String,
        /// Distance between the two positions, in metres.
        metres: f64,
        /// Angle between the two orientations, in radians.
        radians: f64,
    },
}

/// Why a mount cannot be taken from a bag's frames.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum NotByFrames {
    /// No frame has a known name for the vehicle.
    #[error(
        "none of the frames {} is known as the vehicle's ({}); set frames.vehicle in {}",
        frames.join(", "), known.join(", "), config.display()
    )]
    NoVehicle {
        /// Names of the bag's frames.
        frames: Vec<String>,
        /// Known names of vehicle frames.
        known: Vec<&'static str>,
        /// Path of the file beside the bag.
        config: PathBuf,
    },
    /// A sensor's messages name a frame that is in none of the transforms.
    #[error(
        "the frame of {whose}, {frame}, is in no transform of the bag; set frames.{key} in {} to another",
        config.display()
    )]
    Absent {
        /// Which messages, as in "the images".
        whose: &'static str,
        /// The frame that they name.
        frame: String,
        /// The key of `[frames]` for another frame.
        key: &'static str,
        /// Path of the file beside the bag.
        config: PathBuf,
    },
    /// A transform in the chain between the two frames changes.
    #[error(
        "the frames {from} and {to} are not fixed to each other ({} moves in {} by up to {}), so the mount is not taken from them",
        moving[0], moving[1], Change { metres: *metres, radians: *radians }
    )]
    Moves {
        /// The frame of the sensor or vehicle to be located.
        from: String,
        /// The frame in which it is to be located.
        to: String,
        /// The frame that moves, and the frame in which it moves.
        moving: [String; 2],
        /// How far it moves, in metres.
        metres: f64,
        /// How far it turns, in radians.
        radians: f64,
    },
    /// The two frames are not connected.
    #[error("no transforms lead from the frame {from} to {to}")]
    NoWay {
        /// The frame of the sensor or vehicle to be located.
        from: String,
        /// The frame in which it is to be located.
        to: String,
    },
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Vector2;

    #[test]
    fn messages_about_assumed_mounts() {
        let heading = Heading {
            off: Vector2::new(2_f64.to_radians(), (-1_f64).to_radians()),
            std_error: Vector2::new(0.002, 0.001),
        };
        let broken = |transforms| MountWarning::BrokenTransforms { transforms };
        for (warning, expected) in [
            (
                MountWarning::NotGiven,
                "the camera's mount is not given ([mount] in dataset.toml): assuming that it looks straight ahead from the vehicle's origin",
            ),
            (
                MountWarning::Aimed(heading),
                "the camera's mount is not given ([mount] in dataset.toml): according to its images when driving straight, it looks \
                 2.0 ± 0.1 degrees down and 1.0 ± 0.1 degrees to the right, which is used",
            ),
            (
                MountWarning::OfKittiRaw,
                "KITTI odometry does not include the cameras' mounts: taking their positions from KITTI raw's calibration, their \
                 direction from the path",
            ),
            (
                MountWarning::CameraUnknown,
                "the camera's mount is not given: assuming that it looks straight ahead from the rear axle",
            ),
            (
                broken(1),
                "1 transform between frames has no rotation or a NaN, and is left out",
            ),
            (
                broken(2),
                "2 transforms between frames have no rotation or a NaN, and are left out",
            ),
            (
                MountWarning::BodyAxes {
                    frame: "camera".into(),
                },
                "the images' frame camera has its z axis up, so it is not an optical frame: assuming that its x axis points ahead and its y axis \
                 to the left",
            ),
            (
                MountWarning::Apart {
                    mount: "cam_from_vehicle",
                    taken: "drive.toml".into(),
                    other: "frames base_link → camera".into(),
                    metres: 0.4,
                    radians: 0.0,
                },
                "cam_from_vehicle: drive.toml and frames base_link → camera are 0.400 m and 0.00° apart; the former is used",
            ),
        ] {
            assert_eq!(warning.to_string(), expected);
        }
    }

    #[test]
    fn messages_say_why_frames_give_no_mount() {
        let config = PathBuf::from("drive.toml");
        let (from, to) = ("base_link".to_owned(), "camera".to_owned());
        for (why, expected) in [
            (
                NotByFrames::NoVehicle {
                    frames: vec!["camera".into(), "chassis".into()],
                    known: vec!["base_link", "car"],
                    config: config.clone(),
                },
                "none of the frames camera, chassis is known as the vehicle's (base_link, car); set frames.vehicle in drive.toml",
            ),
            (
                NotByFrames::Absent {
                    whose: "the images",
                    frame: "camera".into(),
                    key: "camera",
                    config,
                },
                "the frame of the images, camera, is in no transform of the bag; set frames.camera in drive.toml to another",
            ),
            (
                NotByFrames::Moves {
                    from: from.clone(),
                    to: to.clone(),
                    moving: ["pan".into(), "base_link".into()],
                    metres: 0.0,
                    radians: 0.48,
                },
                "the frames base_link and camera are not fixed to each other (pan moves in base_link by up to 0.000 m and 27.50°), so the mount \
                 is not taken from them",
            ),
            (
                NotByFrames::NoWay { from, to },
                "no transforms lead from the frame base_link to camera",
            ),
        ] {
            let mount = "cam_from_vehicle";
            let warning = MountWarning::NotByFrames { mount, why };
            assert_eq!(warning.to_string(), format!("{mount}: {expected}"));
        }
    }
}
