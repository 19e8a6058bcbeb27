use deepfusion_geometry::ImplausibleCamera;
use deepfusion_hint::Hint;

/// What can go wrong with a depth image.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// The depth image is not of the camera's size.
    #[error(
        "depth of {}x{} pixels with a camera of {}x{}",
        found.0, found.1, expected.0, expected.1
    )]
    Size {
        /// Width and height of the depth.
        found: (usize, usize),
        /// Width and height that the camera has.
        expected: (usize, usize),
    },
    /// A setting that cannot be.
    #[error("{field} is {value}, expected {expected}")]
    Config {
        /// The setting.
        field: &'static str,
        /// What it is.
        value: f64,
        /// What it may be.
        expected: ExpectedSetting,
    },
    /// Pixels of an instance that the depth image does not have.
    #[error("instance `{class}`: row {}, columns {} to {} of a depth image of {}x{}", run[0], run[1], run[2], size.0, size.1)]
    Instance {
        /// What it is.
        class: String,
        /// Row, first column, and the column after the last.
        run: [u32; 3],
        /// Width and height of the depth image.
        size: (usize, usize),
    },
    /// The intrinsics are no camera's.
    #[error("camera: {0}")]
    Camera(#[from] ImplausibleCamera),
}

/// What a setting may be.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum ExpectedSetting {
    /// A number above 0.
    #[error("a number above 0")]
    AboveZero,
    /// A number that is not negative.
    #[error("a number from 0")]
    NotNegative,
    /// A number below this.
    #[error("less than {0}")]
    Below(f64),
    /// A number below another setting.
    #[error("less than {0}")]
    BelowSetting(&'static str),
    /// Two heights, the lower one first.
    #[error("the lower height first")]
    LowerFirst,
}

/// A result with this crate's [`Error`].
pub type Result<T> = std::result::Result<T, Error>;

impl Hint for Error {
    fn hint(&self) -> Option<String> {
        match self {
            Self::Size { .. } => Some(
                "intrinsics belong to one image size: resize them with the image (Intrinsics::resized)".into(),
            ),
            Self::Instance { .. } => Some("masks are taken in the depth image's size".into()),
            Self::Config { .. } => Some("leave it out for its default".into()),
            Self::Camera(problem) => problem.hint(),
        }
    }
}
