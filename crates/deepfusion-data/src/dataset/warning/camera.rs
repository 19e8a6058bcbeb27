//! Warnings about a recording's camera.

use crate::{CalibrationSource, CameraProblem};
use deepfusion_geometry::ImplausibleCamera;
use std::path::{Path, PathBuf};

/// Added for an action camera's image whose EXIF block has a focal length.
const ACTION_CAMERA: &str = "; an action camera's wide lens bends lines, unlike a pinhole camera: use its linear lens, or \
                             calibrate it as a fisheye lens";
/// Added for images with an EXIF orientation other than upright.
const NOT_TURNED: &str = "; the images are used as stored, without the rotation in EXIF";

/// A warning about a recording's camera.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum CameraWarning {
    /// There is no calibration, so a camera is assumed ([`crate::OpenOptions::assumed_camera`]).
    #[error(
        "no calibration of the camera: assuming fx = {fx:.1}, fy = {fy:.1} and a centred principal point"
    )]
    Assumed {
        /// Focal length along x, pixels.
        fx: f64,
        /// Focal length along y, pixels.
        fy: f64,
    },
    /// The camera is only known from an image's EXIF block.
    #[error(
        "the camera is taken from EXIF in {}: {by}, so fx = fy = {focal_px:.1}, with a centred principal point; a calibration is better{}{}",
        name(image),
        if *action_camera { ACTION_CAMERA } else { "" },
        if *turned { NOT_TURNED } else { "" }
    )]
    ByExif {
        /// Path of the image.
        image: PathBuf,
        /// The entry in the block, as printed.
        by: String,
        /// The resulting focal length, pixels.
        focal_px: f64,
        /// Whether it was taken by an action camera, whose wide lenses are not pinhole cameras.
        action_camera: bool,
        /// Whether EXIF has a rotation to make the images upright, which is not applied.
        turned: bool,
    },
    /// The camera is only known from a GoPro's video, filmed through the linear lens.
    #[error(
        "the camera is taken from {}: the linear lens of a {model}, {diagonal_deg:.1}° from corner to corner, so fx = fy = {focal_px:.1}, with a centred principal point; a calibration is better",
        name(video)
    )]
    ByGopro {
        /// Path of the video.
        video: PathBuf,
        /// The GoPro's model.
        model: String,
        /// The lens' field of view along the diagonal, degrees.
        diagonal_deg: f64,
        /// The resulting focal length, pixels.
        focal_px: f64,
    },
    /// A GoPro's video was filmed through a lens that is not a pinhole camera's, and the calibration has no distortion.
    #[error("{}: {}", bends_lines(lens, model), CameraProblem::OTHER_LENS)]
    BendsLines {
        /// The lens, as the GoPro's menu calls it.
        lens: String,
        /// The GoPro's model.
        model: String,
    },
    /// The calibration does not state its image size.
    #[error(
        "{}: no image size is given, assuming the images' {width}x{height}",
        file_name(by)
    )]
    SizeUnknown {
        /// Where the calibration comes from.
        by: CalibrationSource,
        /// Width of the first image, pixels.
        width: u32,
        /// Height of the first image, pixels.
        height: u32,
    },
    /// The images are corrected for lens distortion, so their intrinsics differ from the calibration's.
    #[error(
        "the images are corrected for lens distortion; fx, fy, cx, cy are those of the corrected images"
    )]
    LensCorrected,
    /// The intrinsics are implausible.
    #[error(transparent)]
    Implausible(#[from] ImplausibleCamera),
}

fn name(file: &Path) -> String {
    let name = file.file_name().unwrap_or(file.as_os_str());
    name.to_string_lossy().into_owned()
}

/// The name of the calibration file, or a description of another source.
fn file_name(by: &CalibrationSource) -> String {
    let file = match by {
        CalibrationSource::File(path) => path.file_name(),
        CalibrationSource::Given => None,
    };
    file.map_or_else(
        || by.to_string(),
        |name| name.to_string_lossy().into_owned(),
    )
}

fn bends_lines(lens: &str, model: &str) -> CameraProblem {
    CameraProblem::BendsLines {
        lens: lens.to_owned(),
        model: model.to_owned(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn messages_name_the_source_of_the_camera() {
        let by_exif = |action_camera, turned| CameraWarning::ByExif {
            image: "drive/images/000.jpg".into(),
            by: "26 mm in 35 mm film".into(),
            focal_px: 3004.62,
            action_camera,
            turned,
        };
        let from_exif = "the camera is taken from EXIF in 000.jpg: 26 mm in 35 mm film, so fx = fy = 3004.6, with a centred principal point; a \
                     calibration is better";
        assert_eq!(by_exif(false, false).to_string(), from_exif);
        let message = by_exif(true, true).to_string();
        let more = message.strip_prefix(from_exif).unwrap();
        assert_eq!(
            more,
            "; an action camera's wide lens bends lines, unlike a pinhole camera: use its linear lens, or calibrate it as a \
             fisheye lens; the images are used as stored, without the rotation in EXIF"
        );
        for (warning, expected) in [
            (
                CameraWarning::Assumed {
                    fx: 920.04,
                    fy: 919.96,
                },
                "no calibration of the camera: assuming fx = 920.0, fy = 920.0 and a centred principal point",
            ),
            (
                CameraWarning::ByGopro {
                    video: "drive/GX010001.MP4".into(),
                    model: "HERO11 Black".into(),
                    diagonal_deg: 90.0,
                    focal_px: 1101.46,
                },
                "the camera is taken from GX010001.MP4: the linear lens of a HERO11 Black, 90.0° from corner to corner, so fx = fy = 1101.5, \
                 with a centred principal point; a calibration is better",
            ),
            (
                CameraWarning::BendsLines {
                    lens: "wide".into(),
                    model: "HERO11 Black".into(),
                },
                "according to the video, it was filmed through the lens \"wide\" of a HERO11 Black, which bends lines, unlike a pinhole camera: \
                 film through the linear lens, or calibrate this one as a fisheye lens",
            ),
            (
                CameraWarning::Implausible(ImplausibleCamera::Focal {
                    name: "fx",
                    value: 0.0,
                }),
                "fx is 0, expected a focal length above 0",
            ),
        ] {
            assert_eq!(warning.to_string(), expected);
        }
    }

    #[test]
    fn a_calibration_without_a_size_is_named_by_its_file() {
        let message = |by| {
            let (width, height) = (1242, 375);
            CameraWarning::SizeUnknown { by, width, height }.to_string()
        };
        assert_eq!(
            message(CalibrationSource::File("drive/intrinsics.txt".into())),
            "intrinsics.txt: no image size is given, assuming the images' 1242x375"
        );
        assert_eq!(
            message(CalibrationSource::Given),
            "given intrinsics: no image size is given, assuming the images' 1242x375"
        );
    }
}
