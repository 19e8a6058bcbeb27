//! Why pictures do not show what a check looks for.

/// Why pictures do not show what a check looks for.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum PicturesSkip {
    /// None of them can be read.
    #[error("no image can be read")]
    NoImage,
    /// All of them are plain.
    #[error("no image has any detail")]
    NoDetail,
    /// Too few were taken in motion.
    #[error("fewer than {needed} frames while the vehicle moves")]
    FewInMotion {
        /// How many are needed.
        needed: usize,
    },
    /// None in motion shows how its points moved.
    #[error("no moving pair with points to follow and a yaw rate")]
    NoPoints,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_pictures_lack_is_said() {
        for (reason, said) in [
            (PicturesSkip::NoImage, "no image can be read"),
            (
                PicturesSkip::FewInMotion { needed: 12 },
                "fewer than 12 frames while the vehicle moves",
            ),
            (
                PicturesSkip::NoPoints,
                "no moving pair with points to follow and a yaw rate",
            ),
        ] {
            assert_eq!(reason.to_string(), said);
        }
    }
}
