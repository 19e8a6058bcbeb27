//! What a varied drive, or one that is not, cannot have.

/// Why a setting does not go with [`crate::SimConfig::varied`].
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum VariedConflict {
    /// The height is drawn.
    #[error("a varied drive draws the height of its camera")]
    CameraHeight,
    /// Cars may park close to the lane that is kept free for the camera.
    #[error("a varied drive has one camera, beside which cars may park")]
    SecondCamera,
    /// Rooms are for single views.
    #[error("cars drive through no rooms")]
    Rooms,
    /// Without [`crate::SimConfig::varied`].
    #[error("only varied drives lead there")]
    OnlyVaried,
}

impl VariedConflict {
    /// The name of the setting in [`crate::SimConfig`].
    #[must_use]
    pub fn setting(self) -> &'static str {
        match self {
            Self::CameraHeight => "camera_height_m",
            Self::SecondCamera => "stereo_baseline_m",
            Self::Rooms | Self::OnlyVaried => "scene",
        }
    }

    /// What to do.
    pub(super) fn hint(self) -> String {
        match self {
            Self::CameraHeight => "leave `camera_height_m` as it is by default, or `varied` out",
            Self::SecondCamera => "set `stereo_baseline_m` to 0, or leave `varied` out",
            Self::Rooms => "choose another scene",
            Self::OnlyVaried => "set `varied`, or choose another scene",
        }
        .to_owned()
    }
}
