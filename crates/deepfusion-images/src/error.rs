use deepfusion_fs::FileError;
use deepfusion_hint::Hint;
use image::ImageError;
use std::path::{Path, PathBuf};

/// What can go wrong with an image's file.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// A file or folder could not be opened, read or written.
    #[error(transparent)]
    File(#[from] FileError),
    /// An image that cannot be read.
    #[error("{}: {problem}", path.display())]
    Image {
        /// The file.
        path: PathBuf,
        /// Why.
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
    /// It ends early.
    #[error("the image is truncated: the file ends inside it")]
    Truncated,
    /// It is of another kind.
    #[error("neither a PNG nor a JPEG")]
    OtherFormat,
    /// A JPEG that does not say its size.
    #[error("the JPEG has no frame header")]
    NoFrameHeader,
    /// Its content is damaged.
    #[error("cannot be decoded: {0}")]
    Undecodable(#[source] ImageError),
    /// A picture where KITTI's annotated depth should be.
    #[error("not a 16-bit grey PNG, which depth in steps of 1/256 m needs")]
    NotAnnotatedDepth,
}

impl ImageProblem {
    /// What to do about it.
    #[must_use]
    pub fn hint(&self) -> &'static str {
        match self {
            Self::Truncated => {
                "the file was cut off while copying or unpacking: fetch it again, or delete it, with its line where times are listed (frames.csv, timestamps.txt), to leave the frame out"
            }
            _ => "give a PNG or JPEG image",
        }
    }
}

impl Error {
    /// An error of the system's at `path`.
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
}
