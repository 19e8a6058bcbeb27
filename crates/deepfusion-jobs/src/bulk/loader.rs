//! Loads an input for the network: read, with the lens's distortion removed, and with its camera.

use deepfusion_data::{Error as DataError, RgbImage, load_photo};
use deepfusion_geometry::Intrinsics;
use deepfusion_records::{FileMark, LiveMark};
use deepfusion_runtime::{PreparedImage, Preparer};
use deepfusion_video::LiveFrame;

use super::{CameraFrom, CameraSource, PinholeImage};
use crate::{Error, Input, Result};

/// Reads images and prepares them for a network, on any thread.
#[derive(Debug)]
pub struct ImageLoader {
    /// The camera of inputs without a camera of their own.
    pub camera: CameraSource,
    /// Whether the network's run learned its camera.
    pub camera_learned: bool,
    /// Makes the network's input from an image.
    pub preparer: Preparer,
    /// Whether depth is corrected for a focal length other than the one trained with.
    pub focal_correction: bool,
    /// Whether images of another aspect ratio are cropped rather than stretched.
    pub crop: bool,
}

/// An image that was read.
pub struct LoadedImage {
    /// Mark of its file before it was read.
    pub mark: FileMark,
    /// The pixels, after the lens's distortion was removed.
    pub image: RgbImage,
    /// The camera at the image's size, if it is known.
    pub camera: Option<Intrinsics>,
    /// The camera's source.
    pub camera_from: CameraFrom,
    /// Whether a distortion was removed, so that the pixels are not those of the file.
    pub undistorted: bool,
    /// Set for a live source's frame.
    pub live: Option<LiveMark>,
}

impl ImageLoader {
    /// Reads an image from a file or a recording.
    ///
    /// # Errors
    /// [`Error::NotText`]; a file that cannot be read; [`Error::CameraOf`] for a camera that does not fit the image.
    pub fn load(&self, input: &Input) -> Result<(LoadedImage, PreparedImage)> {
        if input.path.to_str().is_none() {
            let path = input.path.clone();
            return Err(Error::NotText { path });
        }
        // Taken before the file is read: if it changes in between, the next run notices.
        let mark = FileMark::of(&input.path).map_err(|e| DataError::file(&input.path, e))?;
        let taken = match &input.frame {
            Some((dataset, index)) => PinholeImage {
                image: dataset.load_image(*index)?,
                undistorted: dataset.corrects_lens(),
                camera: Some(dataset.intrinsics(*index)),
                from: match (dataset.camera_assumed(), self.camera_learned) {
                    (false, _) => CameraFrom::Recording,
                    (true, false) => CameraFrom::Assumed,
                    (true, true) => CameraFrom::Learned,
                },
            },
            None => {
                let photo = load_photo(&input.path)?;
                let seen = self.camera.pinhole_image(photo.image, photo.intrinsics);
                seen.map_err(|source| Error::CameraOf {
                    path: input.path.clone(),
                    source: Box::new(source),
                })?
            }
        };
        Ok(self.prepare(mark, taken))
    }

    /// Prepares a live source's frame.
    ///
    /// # Errors
    /// [`Error::Camera`] for a camera that does not fit the image.
    pub fn load_live(&self, frame: LiveFrame) -> Result<(LoadedImage, PreparedImage)> {
        let mark = FileMark::of_arrival(frame.image.as_raw().len() as u64, frame.arrived_at);
        let taken = self.camera.pinhole_image(frame.image, None)?;
        Ok(self.prepare(mark, taken))
    }

    fn prepare(&self, mark: FileMark, taken: PinholeImage) -> (LoadedImage, PreparedImage) {
        let PinholeImage {
            image,
            camera,
            from,
            undistorted,
        } = taken;
        let (correct, crop) = (self.focal_correction, self.crop);
        let prepared = self
            .preparer
            .prepare(&image, camera.as_ref(), correct, crop);
        let loaded = LoadedImage {
            mark,
            image,
            camera,
            camera_from: from,
            undistorted,
            live: None,
        };
        (loaded, prepared)
    }
}
