//! Why the pictures do not allow a check.

/// Why the pictures do not allow a check.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum PicturesSkip {
    /// No picture can be read.
    #[error("no image can be read")]
    NoImage,
    /// No picture has any detail.
    #[error("no image has any detail")]
    NoDetail,
    /// Too few pictures were taken in motion.
    #[error("fewer than {needed} frames while the vehicle moves")]
    FewInMotion {
        /// How many are needed.
        needed: usize,
    },
    /// No pair in motion has points to follow and a yaw rate.
    #[error("no moving pair with points to follow and a yaw rate")]
    NoPoints,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn skip_reasons_have_their_messages() {
        for (reason, message) in [
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
            assert_eq!(reason.to_string(), message);
        }
    }
}
