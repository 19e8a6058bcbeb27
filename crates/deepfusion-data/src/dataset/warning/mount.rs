//! What is unsure about where the sensors are on the vehicle.

use crate::Heading;
use crate::formats::Change;
use deepfusion_hint::count_of;
use std::path::PathBuf;

/// What is said first where nothing tells where the camera is.
const NOT_GIVEN: &str = "the camera's place on the vehicle is not given ([mount] in dataset.toml):";

/// What is unsure about where the sensors are on the vehicle.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum MountWarning {
    /// Nothing, not even its images, tells where the camera is.
    #[error("{NOT_GIVEN} it is taken to look straight ahead and to move as the vehicle does")]
    NotGiven,
    /// Nothing but its images tells where the camera looks ([`crate::Dataset::aim`]).
    #[error("{NOT_GIVEN} {0}")]
    Aimed(Heading),
    /// KITTI odometry leaves it out.
    #[error(
        "KITTI odometry does not say where the cameras are on the car: their place is taken from KITTI raw's calibration, their direction from the way the car goes"
    )]
    OfKittiRaw,
    /// A bag does not say where its camera is.
    #[error(
        "nothing says where the camera is on the vehicle: it is taken to look ahead and to move as the rear axle does"
    )]
    CameraUnknown,
    /// A bag does not say where its LiDAR is.
    #[error("nothing says where the LiDAR is (cam_from_lidar): its scans give no ground truth")]
    LidarUnknown,
    /// A bag has transforms between frames that are none.
    #[error(
        "{} of frames {}",
        count_of(*transforms, "transform"),
        if *transforms == 1 {
            "has no rotation, or holds NaN, and is left out"
        } else {
            "have no rotation, or hold NaN, and are left out"
        }
    )]
    BrokenTransforms {
        /// How many.
        transforms: usize,
    },
    /// The frame of a bag's images has the axes of a body: x forward, y left, z up.
    #[error(
        "the images' frame {frame} has its z axis up, so it is no optical frame: its x is taken to look ahead and its y to the left"
    )]
    BodyAxes {
        /// The frame.
        frame: String,
    },
    /// The frames of a bag do not say a mount that they could be expected to.
    #[error("{mount}: {why}")]
    NotByFrames {
        /// The mount, by its key in the file beside the bag.
        mount: &'static str,
        /// Why not.
        why: NotByFrames,
    },
    /// Two sources say two places of a sensor.
    #[error(
        "{mount}: {taken} and {other} are {} apart; the former is taken",
        Change { metres: *metres, radians: *radians }
    )]
    Apart {
        /// The mount, by its key in the file beside the bag.
        mount: &'static str,
        /// Who says the place that is taken.
        taken: String,
        /// Who says the other one.
        other: String,
        /// How far apart the two places are.
        metres: f64,
        /// By how much they are turned against each other.
        radians: f64,
    },
}

/// Why the frames of a bag do not say a mount that they could be expected to.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum NotByFrames {
    /// None of them has a vehicle's name.
    #[error(
        "none of the frames {} is known as the vehicle's ({}); frames.vehicle in {} names it",
        frames.join(", "), known.join(", "), config.display()
    )]
    NoVehicle {
        /// The frames that there are.
        frames: Vec<String>,
        /// The names that are known.
        known: Vec<&'static str>,
        /// The file beside the bag.
        config: PathBuf,
    },
    /// A sensor's messages name a frame that is none of them.
    #[error(
        "the frame of {whose}, {frame}, is in no transform of the bag; frames.{key} in {} names another",
        config.display()
    )]
    Absent {
        /// Whose messages.
        whose: &'static str,
        /// The frame that they name.
        frame: String,
        /// The key of `frames` that names another.
        key: &'static str,
        /// The file beside the bag.
        config: PathBuf,
    },
    /// Something on the way from one to the other moves.
    #[error(
        "the frames {from} and {to} are not fixed to each other: {} moves in {} by up to {}, so it is not taken from them",
        moving[0], moving[1], Change { metres: *metres, radians: *radians }
    )]
    Moves {
        /// The frame of the sensor or the vehicle whose place is wanted.
        from: String,
        /// The frame in which it is wanted.
        to: String,
        /// The frame that moves, and the one in which it does.
        moving: [String; 2],
        /// How far it moves.
        metres: f64,
        /// By how much it turns.
        radians: f64,
    },
    /// They are not connected.
    #[error("no transforms lead from the frame {from} to {to}")]
    NoWay {
        /// The frame of the sensor or the vehicle whose place is wanted.
        from: String,
        /// The frame in which it is wanted.
        to: String,
    },
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Vector2;

    #[test]
    fn a_mount_that_is_not_given_is_said_to_be_taken() {
        let heading = Heading {
            off: Vector2::new(2_f64.to_radians(), (-1_f64).to_radians()),
            std_error: Vector2::new(0.002, 0.001),
        };
        let broken = |transforms| MountWarning::BrokenTransforms { transforms };
        for (warning, said) in [
            (
                MountWarning::NotGiven,
                "the camera's place on the vehicle is not given ([mount] in dataset.toml): it is taken to look straight ahead and to move \
                 as the vehicle does",
            ),
            (
                MountWarning::Aimed(heading),
                "the camera's place on the vehicle is not given ([mount] in dataset.toml): driving straight, its images show that it looks \
                 2.0 ± 0.1 degrees down and 1.0 ± 0.1 degrees to the right, and that is taken",
            ),
            (
                MountWarning::OfKittiRaw,
                "KITTI odometry does not say where the cameras are on the car: their place is taken from KITTI raw's calibration, their \
                 direction from the way the car goes",
            ),
            (
                MountWarning::CameraUnknown,
                "nothing says where the camera is on the vehicle: it is taken to look ahead and to move as the rear axle does",
            ),
            (
                broken(1),
                "1 transform of frames has no rotation, or holds NaN, and is left out",
            ),
            (
                broken(2),
                "2 transforms of frames have no rotation, or hold NaN, and are left out",
            ),
            (
                MountWarning::BodyAxes {
                    frame: "camera".into(),
                },
                "the images' frame camera has its z axis up, so it is no optical frame: its x is taken to look ahead and its y to the left",
            ),
            (
                MountWarning::Apart {
                    mount: "cam_from_vehicle",
                    taken: "drive.toml".into(),
                    other: "frames base_link → camera".into(),
                    metres: 0.4,
                    radians: 0.0,
                },
                "cam_from_vehicle: drive.toml and frames base_link → camera are 0.400 m and 0.00° apart; the former is taken",
            ),
        ] {
            assert_eq!(warning.to_string(), said);
        }
    }

    #[test]
    fn why_the_frames_do_not_say_a_mount_is_said() {
        let config = PathBuf::from("drive.toml");
        let (from, to) = ("base_link".to_owned(), "camera".to_owned());
        for (why, said) in [
            (
                NotByFrames::NoVehicle {
                    frames: vec!["camera".into(), "chassis".into()],
                    known: vec!["base_link", "car"],
                    config: config.clone(),
                },
                "none of the frames camera, chassis is known as the vehicle's (base_link, car); frames.vehicle in drive.toml names it",
            ),
            (
                NotByFrames::Absent {
                    whose: "the images",
                    frame: "camera".into(),
                    key: "camera",
                    config,
                },
                "the frame of the images, camera, is in no transform of the bag; frames.camera in drive.toml names another",
            ),
            (
                NotByFrames::Moves {
                    from: from.clone(),
                    to: to.clone(),
                    moving: ["pan".into(), "base_link".into()],
                    metres: 0.0,
                    radians: 0.48,
                },
                "the frames base_link and camera are not fixed to each other: pan moves in base_link by up to 0.000 m and 27.50°, so it is \
                 not taken from them",
            ),
            (
                NotByFrames::NoWay { from, to },
                "no transforms lead from the frame base_link to camera",
            ),
        ] {
            let mount = "cam_from_vehicle";
            let warning = MountWarning::NotByFrames { mount, why };
            assert_eq!(warning.to_string(), format!("{mount}: {said}"));
        }
    }
}
