mod expected;
mod varied_conflict;

pub use expected::ExpectedSetting;
pub use varied_conflict::VariedConflict;

use deepfusion_fs::{Unfinished, moved_path};
use deepfusion_hint::{Hint, count_of, system_hint};
use deepfusion_rosbag::Error as BagError;
use std::path::{Path, PathBuf};

/// Why a drive cannot be simulated or written.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// A setting is out of range.
    #[error("simulator setting `{field}` is {value}, expected {expected}")]
    Config {
        /// Name of the field of [`crate::SimConfig`].
        field: &'static str,
        /// Its value.
        value: String,
        /// The values that are accepted.
        expected: ExpectedSetting,
    },
    /// A setting and [`crate::SimConfig::varied`] contradict each other.
    #[error("simulator setting `{}` is {value}: {why}", why.setting())]
    Varied {
        /// The setting's value.
        value: String,
        /// Which setting, and why it conflicts.
        why: VariedConflict,
    },
    /// The output folder is not empty.
    #[error("{}: the output folder is not empty", path.display())]
    OutputNotEmpty {
        /// The folder.
        path: PathBuf,
    },
    /// The output folder looks empty, but another writer is at work in it, or died and left files there that cannot be removed.
    #[error(transparent)]
    Unfinished(#[from] Unfinished),
    /// The caller stopped the simulation before its last frame. Nothing was written.
    #[error("nothing is written: stopped after {done} of {}", count_of(*total, "frame"))]
    Stopped {
        /// Frames rendered before the stop.
        done: usize,
        /// Frames of the whole drive.
        total: usize,
    },
    /// A folder or file cannot be written.
    #[error("{}: cannot {action}: {source}", path.display())]
    Io {
        /// The file or folder.
        path: PathBuf,
        /// What was attempted, after "cannot" in the message.
        action: &'static str,
        /// Why it failed.
        source: std::io::Error,
    },
    /// A bag cannot be written.
    #[error(transparent)]
    Bag(#[from] BagError),
    /// A message of the bag cannot be encoded.
    #[error("cannot encode a message of {topic}: {problem}")]
    Message {
        /// Topic of the message.
        topic: &'static str,
        /// Why it cannot be encoded.
        problem: deepfusion_rosbag::msg::MessageError,
    },
    /// An image cannot be encoded.
    #[error("{}: cannot encode the image: {source}", path.display())]
    Encode {
        /// The file that was to be written.
        path: PathBuf,
        /// Why it failed.
        source: image::ImageError,
    },
}

impl Hint for Error {
    fn hint(&self) -> Option<String> {
        match self {
            Self::Config {
                field, expected, ..
            } => Some(format!("set `{field}` to {expected}")),
            Self::Varied { why, .. } => Some(why.hint()),
            Self::OutputNotEmpty { .. } => {
                Some("choose another folder, or empty this one first".to_owned())
            }
            Self::Unfinished(error) => error.hint(),
            Self::Io { source, .. } => Some(
                match source.kind() {
                    std::io::ErrorKind::StorageFull | std::io::ErrorKind::QuotaExceeded => {
                        "the disk is full: free some space, or simulate fewer frames or scans"
                    }
                    std::io::ErrorKind::PermissionDenied
                    | std::io::ErrorKind::ReadOnlyFilesystem => {
                        "choose an output folder that you may write to"
                    }
                    _ => "check that the output folder exists, is a folder and can be written to",
                }
                .to_owned(),
            ),
            Self::Bag(error) => error.hint(),
            Self::Message { problem, .. } => problem.hint(),
            Self::Stopped { .. } => Some("start it again: nothing was left behind".to_owned()),
            Self::Encode {
                source: image::ImageError::IoError(source),
                ..
            } => Some(system_hint(source.kind()).into()),
            Self::Encode { .. } => None,
        }
    }
}

impl Error {
    /// The same error with `from` replaced by `to` in its path: by the time the message is read, the temporary folder is gone.
    pub(crate) fn moved(self, from: &Path, to: &Path) -> Self {
        let moved = |path| moved_path(path, from, to);
        match self {
            Self::Io {
                path,
                action,
                source,
            } => Self::Io {
                path: moved(path),
                action,
                source,
            },
            Self::Encode { path, source } => Self::Encode {
                path: moved(path),
                source,
            },
            Self::Bag(BagError::File(error)) => Self::Bag(error.moved(from, to).into()),
            other => other,
        }
    }
}

/// A result with this crate's [`Error`].
pub type Result<T> = std::result::Result<T, Error>;

/// Returns [`Error::Config`] unless `ok`.
///
/// # Errors
/// [`Error::Config`].
pub(crate) fn check(
    ok: bool,
    field: &'static str,
    value: String,
    expected: ExpectedSetting,
) -> Result<()> {
    if ok {
        Ok(())
    } else {
        Err(Error::Config {
            field,
            value,
            expected,
        })
    }
}

/// Checks that a setting without a unit is in `from..=to`.
///
/// # Errors
/// [`Error::Config`].
pub(crate) fn within(field: &'static str, value: f64, from: f64, to: f64) -> Result<()> {
    check(
        (from..=to).contains(&value),
        field,
        value.to_string(),
        ExpectedSetting::Within { from, to },
    )
}
