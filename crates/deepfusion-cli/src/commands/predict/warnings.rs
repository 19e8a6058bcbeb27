//! What may be wrong with the metres of a run's images, said with the options that mend it.

use deepfusion_jobs::bulk::ImageWarning;

use crate::commands::warnings::of_another_size;

/// Warns on stderr.
pub(super) fn print(warning: ImageWarning) {
    match warning {
        ImageWarning::AssumedCamera { calibration } => {
            let hint = match calibration {
                Some(file) => format!("is this its calibration? --calib {}", file.display()),
                None => "give --intrinsics, --hfov or --calib".into(),
            };
            tracing::warn!(
                "no intrinsics given, and none in the image's EXIF: the training camera's field of view is assumed, so the metres are \
                 only as right as that is (camera_known: false; {hint})"
            );
        }
        ImageWarning::LearnedCamera => tracing::warn!(
            "no intrinsics given: the camera that the run learned is taken, so the metres are only as right as that is \
             (camera_known: false; give --intrinsics, --hfov or --calib)"
        ),
        ImageWarning::OtherSize { image, camera } => {
            tracing::warn!("{}: {}", image.display(), of_another_size(&camera));
        }
        ImageWarning::PoorFit { image, fit } => {
            tracing::warn!("{}: {fit} (others like it are not named)", image.display());
        }
        ImageWarning::Drift { frame, ratio } => tracing::warn!(
            "{frame}: the scale has drifted: by the road, metres are {ratio:.2} times their initial size. Were the images zoomed, the camera \
             moved, or is the speed wrong? (scale_monitor in each frame's JSON; --correct-scale brings depth back)"
        ),
    }
}
