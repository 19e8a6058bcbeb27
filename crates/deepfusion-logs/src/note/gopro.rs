//! How a GoPro's metadata was interpreted.

use deepfusion_hint::count_of;

/// How a GoPro's metadata was interpreted, or what of it has no speed.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum GoproNote {
    /// The speeds are those of the camera's GPS.
    #[error(
        "speeds of the camera's GPS, {} on the video's own clock",
        count_of(*readings, "reading")
    )]
    Gps {
        /// Number of speeds.
        readings: usize,
    },
    /// The GPS had no position for a while.
    #[error(
        "{without} of {} of the video {} no GPS fix and no speed",
        count_of(*stretches, "stretch"),
        if *without == 1 { "has" } else { "have" }
    )]
    NoFix {
        /// Number of stretches without a position.
        without: usize,
        /// Number of all stretches, of about a second each.
        stretches: usize,
    },
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn notes_on_the_receiver_as_text() {
        let (without, stretches) = (2, 60);
        assert_eq!(
            GoproNote::Gps { readings: 1080 }.to_string(),
            "speeds of the camera's GPS, 1080 readings on the video's own clock"
        );
        assert_eq!(
            GoproNote::NoFix { without, stretches }.to_string(),
            "2 of 60 stretches of the video have no GPS fix and no speed"
        );
    }
}
