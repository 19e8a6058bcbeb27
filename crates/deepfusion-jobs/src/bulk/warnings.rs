//! Warnings about the metres of a run's images.

use std::path::{Path, PathBuf};
use std::sync::Once;

use deepfusion_data::calibration_near;
use deepfusion_geometry::Intrinsics;
use deepfusion_runtime::{PreparedImage, Preparer};

use super::{CameraFrom, LoadedImage, PoorFit, looks_of_another_size};
use crate::Input;

/// Why the metres of an image may be wrong. A run reports only the first warning of each kind, since its images are much alike. Not
/// `non_exhaustive`, so that callers who print them handle every kind.
#[derive(Debug, Clone, PartialEq)]
pub enum ImageWarning {
    /// No camera was given: the one that the network was trained with is assumed.
    AssumedCamera {
        /// A calibration file near the image, which may belong to it.
        calibration: Option<PathBuf>,
    },
    /// No camera was given: the one that the network's run learned is used.
    LearnedCamera,
    /// The camera that was given, or that is part of the recording, looks like that of images of another size.
    OtherSize {
        /// Path of the image.
        image: PathBuf,
        /// The camera, at the image's size.
        camera: Intrinsics,
    },
    /// The image is far from what the network was trained on.
    PoorFit {
        /// Path of the image.
        image: PathBuf,
        /// How it differs.
        fit: PoorFit,
    },
    /// The scale has drifted, measured by the road.
    Drift {
        /// The frame's name.
        frame: String,
        /// The current scale divided by its first value.
        ratio: f64,
    },
}

/// Receives the warnings of a run, from any of its threads.
pub type Warn<'a> = &'a (dyn Fn(ImageWarning) + Sync);

/// Passes on the first warning of each kind.
pub(super) struct Warnings<'a> {
    warn: Warn<'a>,
    camera: Once,
    size: Once,
    fit: Once,
}

impl<'a> Warnings<'a> {
    pub(super) fn new(warn: Warn<'a>) -> Self {
        Self {
            warn,
            camera: Once::new(),
            size: Once::new(),
            fit: Once::new(),
        }
    }

    /// Warns of a camera that may not be the image's own.
    pub(super) fn of_camera(&self, input: &Input, loaded: &LoadedImage) {
        match loaded.camera_from {
            CameraFrom::Assumed => self.camera.call_once(|| (self.warn)(assumed(input))),
            CameraFrom::Learned => {
                let warn = || (self.warn)(ImageWarning::LearnedCamera);
                self.camera.call_once(warn);
            }
            CameraFrom::Given | CameraFrom::Recording => {
                self.of_known(&input.path, loaded.camera);
            }
            CameraFrom::Exif | CameraFrom::Unknown => {}
        }
    }

    fn of_known(&self, image: &Path, camera: Option<Intrinsics>) {
        if let Some(camera) = camera.filter(looks_of_another_size) {
            self.size.call_once(|| {
                let image = image.to_owned();
                (self.warn)(ImageWarning::OtherSize { image, camera });
            });
        }
    }

    /// Warns of an image that is far from what the network was trained on.
    pub(super) fn of_fit(&self, image: &Path, network: &Preparer, prepared: &PreparedImage) {
        if let Some(fit) = PoorFit::of(network, prepared) {
            self.fit.call_once(|| {
                let image = image.to_owned();
                (self.warn)(ImageWarning::PoorFit { image, fit });
            });
        }
    }

    /// Warns of a scale that has drifted. The monitor reports that only once.
    pub(super) fn of_drift(&self, frame: &str, ratio: f64) {
        let frame = frame.to_owned();
        (self.warn)(ImageWarning::Drift { frame, ratio });
    }
}

fn assumed(input: &Input) -> ImageWarning {
    // Recordings read their own calibration.
    let near = input.frame.is_none().then(|| calibration_near(&input.path));
    ImageWarning::AssumedCamera {
        calibration: near.flatten(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::Mutex;
    use std::time::SystemTime;

    use deepfusion_data::RgbImage;
    use deepfusion_records::FileMark;

    #[test]
    fn each_kind_of_warning_is_reported_once() {
        let given = Mutex::new(Vec::new());
        let warn = |warning: ImageWarning| given.lock().unwrap().push(warning);
        let warnings = Warnings::new(&warn);
        let seen = |name: &str, camera: [f64; 4], camera_from| {
            let input = Input {
                path: name.into(),
                name: name.into(),
                frame: None,
            };
            let loaded = LoadedImage {
                mark: FileMark::of_arrival(0, SystemTime::now()),
                image: RgbImage::new(96, 64),
                camera: Some(Intrinsics::from_numbers(camera, (96, 64))),
                camera_from,
                undistorted: false,
                live: None,
            };
            warnings.of_camera(&input, &loaded);
        };
        let (own, twice) = ([56.0, 56.0, 47.0, 31.0], [112.0, 112.0, 95.0, 63.0]);
        seen("a", own, CameraFrom::Given);
        seen("b", own, CameraFrom::Recording);
        assert!(given.lock().unwrap().is_empty());
        for (name, from) in [("c", CameraFrom::Recording), ("d", CameraFrom::Given)] {
            seen(name, twice, from);
            seen(name, own, CameraFrom::Learned);
        }
        let other_size = ImageWarning::OtherSize {
            image: "c".into(),
            camera: Intrinsics::from_numbers(twice, (96, 64)),
        };
        let expected = [other_size, ImageWarning::LearnedCamera];
        assert_eq!(*given.lock().unwrap(), expected);
    }
}
