//! Warnings that depth may be wrong, with the options that correct it.

use deepfusion_jobs::bulk::ImageWarning;

use crate::commands::warnings::of_another_size;

/// Prints a warning on stderr.
pub(super) fn print(warning: ImageWarning) {
    match warning {
        ImageWarning::AssumedCamera { calibration } => {
            let hint = match calibration {
                Some(file) => format!("give --calib {} if that is its calibration", file.display()),
                None => "give --intrinsics, --hfov or --calib".into(),
            };
            tracing::warn!(
                "no intrinsics given, and none in the image's EXIF: assuming the training camera's field of view, so depth in metres is \
                 only as accurate as that (camera_known: false; {hint})"
            );
        }
        ImageWarning::LearnedCamera => tracing::warn!(
            "no intrinsics given: using the camera that the run learned, so depth in metres is only as accurate as that \
             (camera_known: false; give --intrinsics, --hfov or --calib)"
        ),
        ImageWarning::OtherSize { image, camera } => {
            tracing::warn!("{}: {}", image.display(), of_another_size(&camera));
        }
        ImageWarning::PoorFit { image, fit } => {
            tracing::warn!("{}: {fit} (similar images are not listed)", image.display());
        }
        ImageWarning::Drift { frame, ratio } => tracing::warn!(
            "{frame}: the scale has drifted: measured on the road, metres are {ratio:.2} times their initial size; check for zoom, a moved \
             camera or a wrong speed (see scale_monitor in each frame's JSON; --correct-scale corrects depth)"
        ),
    }
}
