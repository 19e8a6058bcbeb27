//! What is unsure about a recording's camera.

use crate::{CalibrationSource, CameraProblem};
use deepfusion_geometry::ImplausibleCamera;
use std::path::{Path, PathBuf};

/// What is said of an action camera's picture whose EXIF block has a focal length.
const ACTION_CAMERA: &str = "; an action camera's wide lens bends lines, which no pinhole does: take pictures through its linear lens, or \
                             calibrate it as a fisheye lens";
/// What is said of pictures that EXIF says to turn.
const NOT_TURNED: &str =
    "; the images are used as they are stored, not turned as EXIF's orientation says";

/// What is unsure about a recording's camera.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum CameraWarning {
    /// Nothing says it, and one stands in ([`crate::OpenOptions::assumed_camera`]).
    #[error(
        "nothing says what the camera is: fx = {fx:.1}, fy = {fy:.1} are assumed, the principal point in the middle"
    )]
    Assumed {
        /// Focal length along x, pixels.
        fx: f64,
        /// Focal length along y, pixels.
        fy: f64,
    },
    /// Only the EXIF block of an image says it.
    #[error(
        "the camera is taken from EXIF in {}: {by}, so fx = fy = {focal_px:.1}, the principal point in the middle; a calibration is better{}{}",
        name(image),
        if *action_camera { ACTION_CAMERA } else { "" },
        if *turned { NOT_TURNED } else { "" }
    )]
    ByExif {
        /// The image.
        image: PathBuf,
        /// What the block says, for people.
        by: String,
        /// The focal length that follows, pixels.
        focal_px: f64,
        /// Whether an action camera took it, whose wide lenses are no pinhole.
        action_camera: bool,
        /// Whether the images are to be turned to be upright, which is not done.
        turned: bool,
    },
    /// Only a GoPro's video says it, by its linear lens.
    #[error(
        "the camera is taken from {}: the linear lens of a {model}, {diagonal_deg:.1}° from corner to corner, so fx = fy = {focal_px:.1}, the principal point in the middle; a calibration is better",
        name(video)
    )]
    ByGopro {
        /// The video.
        video: PathBuf,
        /// The GoPro's model.
        model: String,
        /// The lens' field of view along the diagonal, degrees.
        diagonal_deg: f64,
        /// The focal length that follows, pixels.
        focal_px: f64,
    },
    /// A GoPro's video was filmed through a lens that is no pinhole's, and its calibration has none of the lens.
    #[error("{}: {}", bends_lines(lens, model), CameraProblem::OTHER_LENS)]
    BendsLines {
        /// The lens, as the GoPro's menu calls it.
        lens: String,
        /// The GoPro's model.
        model: String,
    },
    /// The calibration does not say of which size its images are.
    #[error(
        "{} does not say for which size its camera is: taken for the images' {width}x{height}",
        file_name(by)
    )]
    SizeUnknown {
        /// Who says the camera.
        by: CalibrationSource,
        /// Width of the first image, pixels.
        width: u32,
        /// Its height, pixels.
        height: u32,
    },
    /// The images are freed of their lens' distortion, so that their camera is not quite the calibration's.
    #[error(
        "the lens' distortion is taken out of the images; fx, fy, cx, cy are those of the result"
    )]
    LensCorrected,
    /// The numbers are no usual camera's.
    #[error(transparent)]
    Implausible(#[from] ImplausibleCamera),
}

fn name(file: &Path) -> String {
    let name = file.file_name().unwrap_or(file.as_os_str());
    name.to_string_lossy().into_owned()
}

/// The name of the file that says a camera, else who does.
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
    fn who_says_the_camera_is_named() {
        let by_exif = |action_camera, turned| CameraWarning::ByExif {
            image: "drive/images/000.jpg".into(),
            by: "26 mm in 35 mm film".into(),
            focal_px: 3004.62,
            action_camera,
            turned,
        };
        let taken = "the camera is taken from EXIF in 000.jpg: 26 mm in 35 mm film, so fx = fy = 3004.6, the principal point in the middle; a \
                     calibration is better";
        assert_eq!(by_exif(false, false).to_string(), taken);
        let said = by_exif(true, true).to_string();
        let more = said.strip_prefix(taken).unwrap();
        assert_eq!(
            more,
            "; an action camera's wide lens bends lines, which no pinhole does: take pictures through its linear lens, or calibrate it as a \
             fisheye lens; the images are used as they are stored, not turned as EXIF's orientation says"
        );
        for (warning, said) in [
            (
                CameraWarning::Assumed {
                    fx: 920.04,
                    fy: 919.96,
                },
                "nothing says what the camera is: fx = 920.0, fy = 920.0 are assumed, the principal point in the middle",
            ),
            (
                CameraWarning::ByGopro {
                    video: "drive/GX010001.MP4".into(),
                    model: "HERO11 Black".into(),
                    diagonal_deg: 90.0,
                    focal_px: 1101.46,
                },
                "the camera is taken from GX010001.MP4: the linear lens of a HERO11 Black, 90.0° from corner to corner, so fx = fy = 1101.5, \
                 the principal point in the middle; a calibration is better",
            ),
            (
                CameraWarning::BendsLines {
                    lens: "wide".into(),
                    model: "HERO11 Black".into(),
                },
                "the video says that its lens was \"wide\" on a HERO11 Black, which bends lines as no pinhole does: film through the linear \
                 lens, or calibrate this one as a fisheye lens",
            ),
            (
                CameraWarning::Implausible(ImplausibleCamera::Focal {
                    name: "fx",
                    value: 0.0,
                }),
                "fx is 0, expected a focal length above 0",
            ),
        ] {
            assert_eq!(warning.to_string(), said);
        }
    }

    #[test]
    fn a_calibration_without_a_size_is_named_by_its_file() {
        let said = |by| {
            let (width, height) = (1242, 375);
            CameraWarning::SizeUnknown { by, width, height }.to_string()
        };
        assert_eq!(
            said(CalibrationSource::File("drive/intrinsics.txt".into())),
            "intrinsics.txt does not say for which size its camera is: taken for the images' 1242x375"
        );
        assert_eq!(
            said(CalibrationSource::Given),
            "given intrinsics does not say for which size its camera is: taken for the images' 1242x375"
        );
    }
}
