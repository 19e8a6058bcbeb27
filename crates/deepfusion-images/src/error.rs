use deepfusion_fs::FileError;
use deepfusion_hint::Hint;
use image::ImageError;
use std::path::{Path, PathBuf};

/// Why an image file cannot be read or written.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// A file or folder could not be opened, read or written.
    #[error(transparent)]
    File(#[from] FileError),
    /// The image cannot be read.
    #[error("{}: {problem}", path.display())]
    Image {
        /// Path of the file.
        path: PathBuf,
        /// Why it cannot be read.
        #[source]
        problem: ImageProblem,
    },
}

/// A result with this crate's [`Error`].
pub type Result<T> = std::result::Result<T, Error>;

/// Why an image cannot be read.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ImageProblem {
    /// The file ends early.
    #[error("the image is truncated: the file ends inside it")]
    Truncated,
    /// The file has another format.
    #[error("neither a PNG nor a JPEG")]
    OtherFormat,
    /// The JPEG does not give its size.
    #[error("the JPEG has no frame header")]
    NoFrameHeader,
    /// The image data is damaged.
    #[error("cannot be decoded: {0}")]
    Undecodable(#[source] ImageError),
    /// The image is not a depth image of KITTI's format.
    #[error("not a depth image: expected a 16-bit grey PNG, in steps of 1/256 m")]
    NotAnnotatedDepth,
}

impl ImageProblem {
    /// What to do about it.
    #[must_use]
    pub fn hint(&self) -> &'static str {
        match self {
            Self::Truncated => {
                "copy the file again, or, to leave the frame out, delete it with its line in frames.csv or timestamps.txt"
            }
            Self::NotAnnotatedDepth => "give depth as a 16-bit grey PNG, in steps of 1/256 m",
            _ => "replace it with a PNG or JPEG image, or leave it out",
        }
    }
}

impl Error {
    /// An error of the operating system about `path`.
    #[must_use]
    pub fn file(path: &Path, source: std::io::Error) -> Self {
        FileError::new(path, source).into()
    }
}

impl Hint for Error {
    fn hint(&self) -> Option<String> {
        match self {
            Self::File(error) => error.hint(),
            Self::Image { problem, .. } => Some(problem.hint().into()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_missing_folder_is_named() {
        let path = Path::new("no/such/folder/a.png");
        let error = crate::save_png(&image::RgbImage::new(1, 1), path).unwrap_err();
        let message = error.to_string();
        assert!(message.contains("no/such/folder/a.png"), "{message}");
        assert!(error.hint().is_some());
    }

    /// A PNG or JPEG in colour would be refused again.
    #[test]
    fn the_hint_for_depth_asks_for_16_bits() {
        let hint = ImageProblem::NotAnnotatedDepth.hint();
        assert!(hint.contains("16-bit grey PNG"), "{hint}");
    }
}
