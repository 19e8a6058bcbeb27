use deepfusion_geometry::ImplausibleCamera;
use deepfusion_hint::Hint;

/// What can go wrong with a depth image.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// The depth image does not have the camera's size.
    #[error(
        "depth has {}x{} pixels, expected the camera's {}x{}",
        found.0, found.1, expected.0, expected.1
    )]
    Size {
        /// Width and height of the depth image.
        found: (usize, usize),
        /// Width and height of the camera's images.
        expected: (usize, usize),
    },
    /// An invalid setting.
    #[error("{field} is {value}, expected {expected}")]
    Config {
        /// Name of the setting.
        field: &'static str,
        /// The setting's value.
        value: f64,
        /// What the value must be.
        expected: ExpectedSetting,
    },
    /// An instance has pixels outside the depth image.
    #[error("instance `{class}`: row {}, columns {} to {} are outside the depth image of {}x{} pixels", run[0], run[1], run[2], size.0, size.1)]
    Instance {
        /// Class of the instance.
        class: String,
        /// Row, first column, and the column after the last.
        run: [u32; 3],
        /// Width and height of the depth image.
        size: (usize, usize),
    },
    /// The camera intrinsics are invalid.
    #[error("camera: {0}")]
    Camera(#[from] ImplausibleCamera),
}

/// What a setting must be.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum ExpectedSetting {
    /// A number above 0.
    #[error("a number above 0")]
    AboveZero,
    /// A number that is not negative.
    #[error("a number of at least 0")]
    NotNegative,
    /// A number below a fixed limit.
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
                "resize the intrinsics with the image (Intrinsics::resized): they belong to one image size".into(),
            ),
            Self::Instance { .. } => Some("give masks at the depth image's size".into()),
            Self::Config { .. } => Some("leave it out to use its default".into()),
            Self::Camera(problem) => problem.hint(),
        }
    }
}
