//! Settings that a varied drive cannot have, and scenes that only varied drives have.

/// Why a setting conflicts with the value of [`crate::SimConfig::varied`].
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum VariedConflict {
    /// The camera's height is drawn from the seed.
    #[error("a varied drive draws the height of its camera")]
    CameraHeight,
    /// Cars may be parked where a second camera would drive: only one camera's lane is kept free.
    #[error("a varied drive has one camera: parked cars may stand where a second one would be")]
    SecondCamera,
    /// Rooms are for single views only.
    #[error("cars cannot drive through rooms")]
    Rooms,
    /// Only varied drives have the scene.
    #[error("only varied drives have this scene")]
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

    /// The hint: what to set or leave out.
    pub(super) fn hint(self) -> String {
        match self {
            Self::CameraHeight => "leave out `camera_height_m` or `varied`",
            Self::SecondCamera => "set `stereo_baseline_m` to 0, or leave out `varied`",
            Self::Rooms => "choose another scene",
            Self::OnlyVaried => "set `varied`, or choose another scene",
        }
        .to_owned()
    }
}
