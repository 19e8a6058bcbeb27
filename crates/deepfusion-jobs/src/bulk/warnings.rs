//! What may be wrong with the metres of a run's images.

use std::path::{Path, PathBuf};
use std::sync::Once;

use deepfusion_data::calibration_near;
use deepfusion_geometry::Intrinsics;
use deepfusion_runtime::{PreparedImage, Preparer};

use super::{CameraFrom, LoadedImage, PoorFit, looks_of_another_size};
use crate::Input;

/// By what the metres of an image may be wrong. A run gives the first of each kind alone, for its images are much alike. Whoever prints them
/// matches every kind, so that none is forgotten.
#[derive(Debug, Clone, PartialEq)]
pub enum ImageWarning {
    /// Nobody gave the camera: the one that the network was trained with is assumed.
    AssumedCamera {
        /// A calibration file near the image, which may be its own.
        calibration: Option<PathBuf>,
    },
    /// Nobody gave the camera: the one that the network's run learned is taken.
    LearnedCamera,
    /// The camera that was given, or that the recording says, looks like that of images of another size.
    OtherSize {
        /// The image.
        image: PathBuf,
        /// The camera, at the image's size.
        camera: Intrinsics,
    },
    /// The image is far from what the network takes.
    PoorFit {
        /// The image.
        image: PathBuf,
        /// How far.
        fit: PoorFit,
    },
    /// By the road, metres are not what they were.
    Drift {
        /// The frame's name.
        frame: String,
        /// How many times their first size they are.
        ratio: f64,
    },
}

/// Takes the warnings of a run; any of its threads may have one.
pub type Warn<'a> = &'a (dyn Fn(ImageWarning) + Sync);

/// Gives the first warning of each kind.
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

    /// Of a camera that may not be the image's own.
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

    /// Of an image that is far from what the network takes.
    pub(super) fn of_fit(&self, image: &Path, network: &Preparer, prepared: &PreparedImage) {
        if let Some(fit) = PoorFit::of(network, prepared) {
            self.fit.call_once(|| {
                let image = image.to_owned();
                (self.warn)(ImageWarning::PoorFit { image, fit });
            });
        }
    }

    /// Of metres that have changed. Who watches them finds that once.
    pub(super) fn of_drift(&self, frame: &str, ratio: f64) {
        let frame = frame.to_owned();
        (self.warn)(ImageWarning::Drift { frame, ratio });
    }
}

fn assumed(input: &Input) -> ImageWarning {
    // Recordings know where theirs would lie.
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
    fn each_kind_is_given_once() {
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
