//! By what a path of the pose network may be wrong.

/// By what a path of the pose network may be wrong.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum OdometryWarning {
    /// The network sees pixels, and another focal length shows it another motion.
    #[error(
        "{drive}: its focal length is {ratio:.2} times the one trained with, at network size; poses are not corrected for it"
    )]
    OtherFocalLength {
        /// The drive's name.
        drive: String,
        /// Its focal length over the one trained with, both at the network's size.
        ratio: f64,
    },
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn another_focal_length_is_said_as_a_ratio() {
        let warning = OdometryWarning::OtherFocalLength {
            drive: "park".into(),
            ratio: 1.234,
        };
        assert_eq!(
            warning.to_string(),
            "park: its focal length is 1.23 times the one trained with, at network size; poses are not corrected for it"
        );
    }
}
