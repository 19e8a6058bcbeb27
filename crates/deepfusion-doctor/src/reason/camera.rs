//! What is wrong with a camera's intrinsics, and with its mount on the vehicle.

use crate::shared_error::SharedError;
use deepfusion_data::Error;
use deepfusion_hint::Hint;
use std::fmt;

/// What is wrong with a camera's intrinsics, and with its mount on the vehicle.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum CameraReason {
    /// The focal length is not that of a camera on a car.
    #[error(
        "fx {fx:.1} px gives a field of view of {view_deg:.0} degrees at a width of {width} pixels, unlike any camera on a car: depths would be wrong by the same factor"
    )]
    View {
        /// Focal length along x, pixels.
        fx: f64,
        /// Horizontal field of view with this focal length, degrees.
        view_deg: f64,
        /// Width of the images, pixels.
        width: u32,
    },
    /// The two focal lengths differ.
    #[error("fx {fx:.1} px and fy {fy:.1} px differ by more than the shape of pixels explains")]
    PixelShape {
        /// Focal length along x, pixels.
        fx: f64,
        /// Focal length along y, pixels.
        fy: f64,
    },
    /// The principal point belongs to images of another size.
    #[error(
        "{coordinate} {value:.1} is far from the middle of {size} pixels: the intrinsics fit images of about {}x{}, not {}x{}",
        other[0], other[1], image[0], image[1]
    )]
    OtherSize {
        /// Coordinate of the principal point.
        coordinate: CentreCoordinate,
        /// Its value, pixels.
        value: f64,
        /// Size of the image along this coordinate, pixels.
        size: u32,
        /// Width and height that the principal point fits.
        other: [u32; 2],
        /// Width and height of the images.
        image: [u32; 2],
    },
    /// The principal point is far from the middle.
    #[error(
        "{coordinate} {value:.1} is far from the middle of {size} pixels: only a cropped image has it there"
    )]
    OffCentre {
        /// Coordinate of the principal point.
        coordinate: CentreCoordinate,
        /// Its value, pixels.
        value: f64,
        /// Size of the image along this coordinate, pixels.
        size: u32,
    },
    /// The camera does not move in the direction that its mount gives.
    #[error(
        "driving straight, the camera heads {:.1} ± {std_error_deg:.1} degrees further {} than its mount says",
        off_deg.abs(),
        angle.side(*off_deg)
    )]
    Heading {
        /// Angle that is off.
        angle: HeadingAngle,
        /// Difference from the mount, degrees: up and to the right are positive.
        off_deg: f64,
        /// The standard error of that, degrees.
        std_error_deg: f64,
        /// Error of the principal point, pixels, if the mount is right.
        centre_by_px: f64,
    },
    /// The measured depth of a frame cannot be read.
    #[error(transparent)]
    Depth(SharedError<Error>),
    /// The road in the measured depth is turned against the mounts.
    #[error(
        "the road in the measured depth of {frames} frames is turned by {:.1} degrees ({angle}) against what the mounts say",
        camera_by_deg.abs()
    )]
    RoadTurned {
        /// Number of frames that show the road.
        frames: usize,
        /// Rotation of the camera from its mount, if the LiDAR's mount is right: further down, or clockwise seen along its view,
        /// degrees.
        camera_by_deg: f64,
        /// Angle that is off.
        angle: RoadAngle,
    },
    /// The measured depth gives a height that no car's camera has.
    #[error(
        "the measured depth puts the camera {height_m:.2} m above the road, where no car has it"
    )]
    Height {
        /// Height of the camera above the road, metres.
        height_m: f64,
    },
    /// The two cameras are the wrong way round.
    #[error("points lie further right in camera 3 than in camera 2: the cameras are swapped")]
    Swapped,
}

impl CameraReason {
    /// What to do about it.
    pub(super) fn hint(&self) -> String {
        let text = match self {
            Self::View { .. } => {
                "calibrate at this image size; divide a focal length in millimetres by the size of a pixel"
            }
            Self::PixelShape { .. } => {
                "if the images were resized, multiply fx by new width / old width, and fy by new height / old height"
            }
            Self::OtherSize { other, image, .. } => {
                let times = |axis: usize| f64::from(image[axis]) / f64::from(other[axis]);
                return format!(
                    "scale the matrix to the images' own size: multiply fx and cx by {:.4}, fy and cy by {:.4}",
                    times(0),
                    times(1)
                );
            }
            Self::OffCentre { .. } => {
                "check the value; if the images were cropped, subtract the crop's offset from cx and cy, otherwise calibrate again"
            }
            Self::Heading {
                angle,
                centre_by_px,
                ..
            } => {
                let coordinate = angle.coordinate();
                return format!(
                    "correct the camera's {angle} on the vehicle by that angle, or, if the mount is right, {coordinate} by {centre_by_px:+.0} px"
                );
            }
            Self::Depth(error) => {
                return error
                    .hint()
                    .unwrap_or_else(|| "copy the recording again".to_owned());
            }
            Self::RoadTurned {
                angle,
                camera_by_deg,
                ..
            } => {
                let to = match (angle, *camera_by_deg > 0.0) {
                    (RoadAngle::Pitch, true) => "down",
                    (RoadAngle::Pitch, false) => "up",
                    (RoadAngle::Roll, true) => "clockwise",
                    (RoadAngle::Roll, false) => "anticlockwise",
                };
                return format!(
                    "turn the camera on the vehicle (cam_from_vehicle) {to} by that angle, or correct the {angle} of the LiDAR on the camera by it"
                );
            }
            Self::Height { .. } => {
                "check the unit of the depth (metres, millimetres, 1/256 m) and the LiDAR's pose relative to the camera"
            }
            Self::Swapped => "swap the folders image_02 and image_03",
        };
        text.to_owned()
    }
}

/// A coordinate of the principal point.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum CentreCoordinate {
    /// The coordinate along x.
    Cx,
    /// The coordinate along y.
    Cy,
}

impl fmt::Display for CentreCoordinate {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Cx => "cx",
            Self::Cy => "cy",
        })
    }
}

/// An angle between a camera's direction of view and its direction of travel.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum HeadingAngle {
    /// Up and down.
    Pitch,
    /// To the sides.
    Yaw,
}

impl HeadingAngle {
    /// The coordinate of the principal point whose error has the same effect.
    fn coordinate(self) -> CentreCoordinate {
        match self {
            Self::Pitch => CentreCoordinate::Cy,
            Self::Yaw => CentreCoordinate::Cx,
        }
    }

    /// The side of a deviation: up and to the right are positive.
    fn side(self, off: f64) -> &'static str {
        match (self, off > 0.0) {
            (Self::Pitch, true) => "up",
            (Self::Pitch, false) => "down",
            (Self::Yaw, true) => "right",
            (Self::Yaw, false) => "left",
        }
    }
}

impl fmt::Display for HeadingAngle {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Pitch => "pitch",
            Self::Yaw => "yaw",
        })
    }
}

/// An angle between the measured road and the road according to a mount.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum RoadAngle {
    /// Slope in the direction of travel.
    Pitch,
    /// Slope across it.
    Roll,
}

impl fmt::Display for RoadAngle {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Pitch => "pitch",
            Self::Roll => "roll",
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn intrinsics_problems_have_their_messages() {
        for (reason, message) in [
            (
                CameraReason::View {
                    fx: 7.2,
                    view_deg: 177.6,
                    width: 640,
                },
                "fx 7.2 px gives a field of view of 178 degrees at a width of 640 pixels, unlike any camera on a car: depths would be wrong by the same factor",
            ),
            (
                CameraReason::PixelShape {
                    fx: 700.0,
                    fy: 400.0,
                },
                "fx 700.0 px and fy 400.0 px differ by more than the shape of pixels explains",
            ),
            (
                CameraReason::OtherSize {
                    coordinate: CentreCoordinate::Cx,
                    value: 609.56,
                    size: 640,
                    other: [1242, 375],
                    image: [640, 192],
                },
                "cx 609.6 is far from the middle of 640 pixels: the intrinsics fit images of about 1242x375, not 640x192",
            ),
            (
                CameraReason::OffCentre {
                    coordinate: CentreCoordinate::Cy,
                    value: 117.6,
                    size: 480,
                },
                "cy 117.6 is far from the middle of 480 pixels: only a cropped image has it there",
            ),
        ] {
            assert_eq!(reason.to_string(), message);
        }
    }

    #[test]
    fn messages_name_the_direction_of_travel() {
        for (angle, off_deg, side) in [
            (HeadingAngle::Pitch, 2.04, "up"),
            (HeadingAngle::Pitch, -2.04, "down"),
            (HeadingAngle::Yaw, 2.04, "right"),
            (HeadingAngle::Yaw, -2.04, "left"),
        ] {
            let reason = CameraReason::Heading {
                angle,
                off_deg,
                std_error_deg: 0.11,
                centre_by_px: 0.0,
            };
            assert_eq!(
                reason.to_string(),
                format!(
                    "driving straight, the camera heads 2.0 ± 0.1 degrees further {side} than its mount says"
                )
            );
        }
    }

    #[test]
    fn hints_name_the_correction() {
        let heading = |angle, centre_by_px| CameraReason::Heading {
            angle,
            off_deg: 2.04,
            std_error_deg: 0.11,
            centre_by_px,
        };
        let of_another_size = CameraReason::OtherSize {
            coordinate: CentreCoordinate::Cx,
            value: 609.56,
            size: 640,
            other: [1242, 375],
            image: [640, 192],
        };
        let turned = CameraReason::RoadTurned {
            frames: 8,
            camera_by_deg: -3.04,
            angle: RoadAngle::Roll,
        };
        for (reason, hint) in [
            (
                of_another_size,
                "scale the matrix to the images' own size: multiply fx and cx by 0.5153, fy and cy by 0.5120",
            ),
            (
                heading(HeadingAngle::Yaw, 12.3),
                "correct the camera's yaw on the vehicle by that angle, or, if the mount is right, cx by +12 px",
            ),
            (
                heading(HeadingAngle::Pitch, -12.3),
                "correct the camera's pitch on the vehicle by that angle, or, if the mount is right, cy by -12 px",
            ),
            (
                turned,
                "turn the camera on the vehicle (cam_from_vehicle) anticlockwise by that angle, or correct the roll of the LiDAR on the camera by it",
            ),
        ] {
            assert_eq!(reason.hint(), hint);
        }
    }

    #[test]
    fn mount_problems_have_their_messages() {
        let turned = |angle| CameraReason::RoadTurned {
            frames: 8,
            camera_by_deg: 3.04,
            angle,
        };
        for (angle, name) in [(RoadAngle::Pitch, "pitch"), (RoadAngle::Roll, "roll")] {
            let message = format!(
                "the road in the measured depth of 8 frames is turned by 3.0 degrees ({name}) against what the mounts say"
            );
            assert_eq!(turned(angle).to_string(), message);
        }
        assert_eq!(
            CameraReason::Height { height_m: 0.33 }.to_string(),
            "the measured depth puts the camera 0.33 m above the road, where no car has it"
        );
    }
}
