/// Why a drive's other camera is no view.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum NoStereo {
    /// No drive of the run has a second one among the data.
    OneCamera,
    /// No frame of the drive has one of the other camera.
    NoCommonFrame,
    /// The calibration does not say where the cameras are.
    NoBaseline,
    /// They see through other lenses, or are turned: their images are not rectified.
    NotRectified,
}

impl std::fmt::Display for NoStereo {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Self::OneCamera => "its other camera is not among the data, nor is that of any other drive, and stereo asks for it",
            Self::NoCommonFrame => "its two cameras have no frame in common",
            Self::NoBaseline => "nothing says where its two cameras are",
            Self::NotRectified => {
                "its two cameras are not rectified: their images have other intrinsics, or are turned"
            }
        })
    }
}
