//! What to do about a camera's numbers, and its place on the vehicle.

use crate::reason::{CentreCoordinate, HeadingAngle, RoadAngle};
use std::fmt;

/// What to do about a camera's numbers, and its place on the vehicle.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub enum CameraRemedy {
    /// A focal length that is no car's camera's.
    Calibrate,
    /// Focal lengths that differ.
    ScaleEach,
    /// A principal point of images of another size.
    OwnSize {
        /// The images' width over the other one.
        x: f64,
        /// The images' height over the other one.
        y: f64,
    },
    /// A principal point far from the middle.
    LookUp,
    /// A camera that does not head where its mount says.
    Heading {
        /// The angle of the mount that may be wrong.
        angle: HeadingAngle,
        /// The coordinate of the principal point that may be instead.
        coordinate: CentreCoordinate,
        /// By how much it would be, pixels.
        by_px: f64,
    },
    /// Measured depth that cannot be read.
    CopyAgain,
    /// A road that is turned against the mounts.
    Mount {
        /// The angle that is wrong.
        angle: RoadAngle,
    },
    /// A camera that no car has so high.
    DepthUnit,
    /// Two cameras that are the wrong way round.
    Rename,
}

impl fmt::Display for CameraRemedy {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Calibrate => f.write_str(
                "calibrate at the size of these images; a focal length in millimetres has to be divided by the size of a pixel",
            ),
            Self::ScaleEach => f.write_str(
                "where the images were resized, scale fx by the new width over the old, fy by the heights",
            ),
            Self::OwnSize { x, y } => write!(
                f,
                "give the matrix of the images' own size: fx and cx times {x:.4}, fy and cy times {y:.4}"
            ),
            Self::LookUp => f.write_str(
                "look it up again; where the images were cut, subtract the cut from cx and cy, else calibrate anew",
            ),
            Self::Heading {
                angle,
                coordinate,
                by_px,
            } => write!(
                f,
                "correct the camera's {angle} on the vehicle by that angle, or, if the mount is right, {coordinate} by {by_px:+.0} px"
            ),
            Self::CopyAgain => f.write_str("copy the recording again"),
            Self::Mount { angle } => write!(
                f,
                "correct the {angle} of the camera on the vehicle (cam_from_vehicle) or of the LiDAR on the camera by that angle"
            ),
            Self::DepthUnit => f.write_str(
                "see the unit of the depth (metres, millimetres, 1/256 m) and the LiDAR's place on the camera",
            ),
            Self::Rename => f.write_str("rename image_02 to image_03 and the other way round"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn by_how_much_to_correct_is_said() {
        let heading = |by_px| CameraRemedy::Heading {
            angle: HeadingAngle::Yaw,
            coordinate: CentreCoordinate::Cx,
            by_px,
        };
        let angle = RoadAngle::Roll;
        for (remedy, said) in [
            (
                CameraRemedy::OwnSize {
                    x: 0.5153,
                    y: 0.512,
                },
                "give the matrix of the images' own size: fx and cx times 0.5153, fy and cy times 0.5120",
            ),
            (
                heading(12.3),
                "correct the camera's yaw on the vehicle by that angle, or, if the mount is right, cx by +12 px",
            ),
            (
                heading(-12.3),
                "correct the camera's yaw on the vehicle by that angle, or, if the mount is right, cx by -12 px",
            ),
            (
                CameraRemedy::Mount { angle },
                "correct the roll of the camera on the vehicle (cam_from_vehicle) or of the LiDAR on the camera by that angle",
            ),
        ] {
            assert_eq!(remedy.to_string(), said);
        }
    }
}
