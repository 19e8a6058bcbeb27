//! Why it is not understood what a camera is to give.

/// Why it is not understood what a camera is to give.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum CameraModeProblem {
    /// There is no such setting.
    #[error("a camera has no setting `{0}`")]
    Unknown(String),
    /// A setting is given twice.
    #[error("setting `{0}` is given twice")]
    Again(String),
    /// That is no size.
    #[error("setting `size`: expected width and height in pixels, such as 1920x1080, found `{0}`")]
    Size(String),
    /// That is no rate.
    #[error("setting `fps`: expected frames a second, such as 30, at most 1000, found `{0}`")]
    Rate(String),
    /// That is no format's name.
    #[error("setting `format`: expected a format by ffmpeg's name, such as mjpeg, found `{0}`")]
    Format(String),
}
