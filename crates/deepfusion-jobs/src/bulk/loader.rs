//! An input as the network takes it: read, without its lens, with its camera.

use deepfusion_data::{Error as DataError, RgbImage, load_photo};
use deepfusion_geometry::Intrinsics;
use deepfusion_records::{FileMark, LiveMark};
use deepfusion_runtime::{PreparedImage, Preparer};
use deepfusion_video::LiveFrame;

use super::{CameraFrom, CameraSource, PinholeImage};
use crate::{Error, Input, Result};

/// Reads images and makes them a network's input; any thread may.
#[derive(Debug)]
pub struct ImageLoader {
    /// The camera of inputs that do not say it themselves.
    pub camera: CameraSource,
    /// Whether the network's run learned its camera.
    pub camera_learned: bool,
    /// Makes them the network's input.
    pub preparer: Preparer,
    /// Whether metres are corrected for another focal length than the one trained on.
    pub focal_correction: bool,
    /// Whether images of another aspect ratio are cut, and not stretched.
    pub crop: bool,
}

/// An image that was read.
pub struct LoadedImage {
    /// Its file as it was before it was read.
    pub mark: FileMark,
    /// Without the lens's distortion.
    pub image: RgbImage,
    /// At the image's size, where it is known.
    pub camera: Option<Intrinsics>,
    /// Where that comes from.
    pub camera_from: CameraFrom,
    /// Whether a distortion was undone: then the pixels are not those of the file.
    pub undistorted: bool,
    /// Of a live source's frame.
    pub live: Option<LiveMark>,
}

impl ImageLoader {
    /// Reads an image of a file or a recording.
    ///
    /// # Errors
    /// [`Error::NotText`]; a file that cannot be read; [`Error::CameraOf`] for a camera that cannot be its own.
    pub fn load(&self, input: &Input) -> Result<(LoadedImage, PreparedImage)> {
        if input.path.to_str().is_none() {
            let path = input.path.clone();
            return Err(Error::NotText { path });
        }
        // Before it is read: a change in between is then noticed by the next run.
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
                let seen = self.camera.see(photo.image, photo.intrinsics);
                seen.map_err(|source| Error::CameraOf {
                    path: input.path.clone(),
                    source: Box::new(source),
                })?
            }
        };
        Ok(self.prepare(mark, taken))
    }

    /// Takes a live source's frame.
    ///
    /// # Errors
    /// [`Error::Camera`] for a camera that cannot be its own.
    pub fn load_live(&self, frame: LiveFrame) -> Result<(LoadedImage, PreparedImage)> {
        let mark = FileMark::of_arrival(frame.image.as_raw().len() as u64, frame.arrived_at);
        let taken = self.camera.see(frame.image, None)?;
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
