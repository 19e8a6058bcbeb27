//! What is wrong with a camera's numbers, and with its place on the vehicle.

use crate::shared_error::SharedError;
use deepfusion_data::Error;
use deepfusion_hint::Hint;
use std::fmt;

/// What is wrong with a camera's numbers, and with its place on the vehicle.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum CameraReason {
    /// The focal length is no car's camera's.
    #[error(
        "fx {fx:.1} px sees {view_deg:.0} degrees of {width} pixels, which no camera on a car does: depths would be wrong by the same factor"
    )]
    View {
        /// Focal length along x, pixels.
        fx: f64,
        /// How much the image is wide by it, degrees.
        view_deg: f64,
        /// Its width, pixels.
        width: u32,
    },
    /// The two focal lengths differ.
    #[error("fx {fx:.1} and fy {fy:.1} px differ more than pixels do")]
    PixelShape {
        /// Focal length along x, pixels.
        fx: f64,
        /// Focal length along y, pixels.
        fy: f64,
    },
    /// The principal point is that of images of another size.
    #[error(
        "{coordinate} {value:.1} is far from the middle of {size} pixels: these are the numbers of an image of about {}x{}, not of {}x{}",
        other[0], other[1], image[0], image[1]
    )]
    OtherSize {
        /// Which coordinate of it.
        coordinate: CentreCoordinate,
        /// Its value, pixels.
        value: f64,
        /// How large the image is along it, pixels.
        size: u32,
        /// Width and height that it fits.
        other: [u32; 2],
        /// Width and height of the images.
        image: [u32; 2],
    },
    /// The principal point is far from the middle.
    #[error(
        "{coordinate} {value:.1} is far from the middle of {size} pixels: only a cut-out image has it there"
    )]
    OffCentre {
        /// Which coordinate of it.
        coordinate: CentreCoordinate,
        /// Its value, pixels.
        value: f64,
        /// How large the image is along it, pixels.
        size: u32,
    },
    /// The camera does not head where its mount says.
    #[error(
        "driving straight, the camera heads {:.1} ± {std_error_deg:.1} degrees further {} than its mount says",
        off_deg.abs(),
        angle.side(*off_deg)
    )]
    Heading {
        /// About which axis.
        angle: HeadingAngle,
        /// By how much, degrees: up and to the right are positive.
        off_deg: f64,
        /// The standard error of that, degrees.
        std_error_deg: f64,
        /// By how much the principal point is off, pixels, if the mount is right.
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
        /// Frames that show it.
        frames: usize,
        /// By how much the camera is turned against its mount, if the LiDAR is where it is said to be: further down, or clockwise as it looks,
        /// degrees.
        camera_by_deg: f64,
        /// About which axis.
        angle: RoadAngle,
    },
    /// The measured depth puts the camera where no car has it.
    #[error(
        "the measured depth puts the camera {height_m:.2} m above the road, where no car has it"
    )]
    Height {
        /// How high above the road, metres.
        height_m: f64,
    },
    /// The two cameras are the wrong way round.
    #[error("what camera 2 sees lies further right in camera 3: the two are swapped")]
    Swapped,
}

impl CameraReason {
    /// What to do about it.
    pub(super) fn hint(&self) -> String {
        let text = match self {
            Self::View { .. } => {
                "calibrate at the size of these images; a focal length in millimetres has to be divided by the size of a pixel"
            }
            Self::PixelShape { .. } => {
                "where the images were resized, scale fx by the new width over the old, fy by the heights"
            }
            Self::OtherSize { other, image, .. } => {
                let times = |axis: usize| f64::from(image[axis]) / f64::from(other[axis]);
                return format!(
                    "give the matrix of the images' own size: fx and cx times {:.4}, fy and cy times {:.4}",
                    times(0),
                    times(1)
                );
            }
            Self::OffCentre { .. } => {
                "look it up again; where the images were cut, subtract the cut from cx and cy, else calibrate anew"
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
                "see the unit of the depth (metres, millimetres, 1/256 m) and the LiDAR's place on the camera"
            }
            Self::Swapped => "rename image_02 to image_03 and the other way round",
        };
        text.to_owned()
    }
}

/// A coordinate of the principal point.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum CentreCoordinate {
    /// Along x.
    Cx,
    /// Along y.
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

/// An angle between where a camera looks and where it goes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum HeadingAngle {
    /// Up and down.
    Pitch,
    /// To the sides.
    Yaw,
}

impl HeadingAngle {
    /// The coordinate of the principal point that looks the same where it is off.
    fn coordinate(self) -> CentreCoordinate {
        match self {
            Self::Pitch => CentreCoordinate::Cy,
            Self::Yaw => CentreCoordinate::Cx,
        }
    }

    /// Where something is that is off by so much: up and to the right are positive.
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

/// An angle between the road and what a mount says of it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum RoadAngle {
    /// Along the way ahead.
    Pitch,
    /// Across it.
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
    fn what_is_wrong_with_its_numbers_is_said() {
        for (reason, said) in [
            (
                CameraReason::View {
                    fx: 7.2,
                    view_deg: 177.6,
                    width: 640,
                },
                "fx 7.2 px sees 178 degrees of 640 pixels, which no camera on a car does: depths would be wrong by the same factor",
            ),
            (
                CameraReason::PixelShape {
                    fx: 700.0,
                    fy: 400.0,
                },
                "fx 700.0 and fy 400.0 px differ more than pixels do",
            ),
            (
                CameraReason::OtherSize {
                    coordinate: CentreCoordinate::Cx,
                    value: 609.56,
                    size: 640,
                    other: [1242, 375],
                    image: [640, 192],
                },
                "cx 609.6 is far from the middle of 640 pixels: these are the numbers of an image of about 1242x375, not of 640x192",
            ),
            (
                CameraReason::OffCentre {
                    coordinate: CentreCoordinate::Cy,
                    value: 117.6,
                    size: 480,
                },
                "cy 117.6 is far from the middle of 480 pixels: only a cut-out image has it there",
            ),
        ] {
            assert_eq!(reason.to_string(), said);
        }
    }

    #[test]
    fn where_it_heads_is_said_in_words() {
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
    fn by_how_much_to_correct_is_said() {
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
                "give the matrix of the images' own size: fx and cx times 0.5153, fy and cy times 0.5120",
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
    fn what_measured_depth_says_of_the_mounts() {
        let turned = |angle| CameraReason::RoadTurned {
            frames: 8,
            camera_by_deg: 3.04,
            angle,
        };
        for (angle, name) in [(RoadAngle::Pitch, "pitch"), (RoadAngle::Roll, "roll")] {
            let said = format!(
                "the road in the measured depth of 8 frames is turned by 3.0 degrees ({name}) against what the mounts say"
            );
            assert_eq!(turned(angle).to_string(), said);
        }
        assert_eq!(
            CameraReason::Height { height_m: 0.33 }.to_string(),
            "the measured depth puts the camera 0.33 m above the road, where no car has it"
        );
    }
}
