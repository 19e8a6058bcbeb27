//! What settings of sensors and layouts of signals must be.

/// What a setting of a vehicle or sensor, or an image to be aligned, must be.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum ExpectedSetting {
    /// A number above 0.
    #[error("above 0")]
    AboveZero,
    /// A number in a range, limits included.
    #[error("{from} to {to}")]
    Within {
        /// The smallest.
        from: f64,
        /// The largest.
        to: f64,
    },
    /// A length in a range, limits included.
    #[error("{from} to {to} m")]
    Metres {
        /// The smallest, metres.
        from: f64,
        /// The largest, metres.
        to: f64,
    },
    /// A time in a range, limits included.
    #[error("{from} to {to} s")]
    Seconds {
        /// The smallest, seconds.
        from: f64,
        /// The largest, seconds.
        to: f64,
    },
    /// A ratio of true to measured speed.
    #[error("{from} to {to} (convert units instead of scaling)")]
    SpeedScale {
        /// The smallest.
        from: f64,
        /// The largest.
        to: f64,
    },
    /// A ratio of the steering wheel's angle to the road wheels', with either sign.
    #[error("{from} to {to}, negative if the signal grows to the right")]
    SteeringRatio {
        /// The smallest absolute value.
        from: f64,
        /// The largest absolute value.
        to: f64,
    },
    /// An understeer coefficient.
    #[error("{from} to {to} s²/m²")]
    Understeer {
        /// The smallest, s²/m².
        from: f64,
        /// The largest, s²/m².
        to: f64,
    },
    /// An angle.
    #[error("an angle in radians")]
    Angle,
    /// Angles about three axes.
    #[error("angles in radians")]
    Angles,
    /// A sensor's position.
    #[error("a position on the vehicle, in metres")]
    PlaceOnVehicle,
    /// An angular rate of either sign.
    #[error("below {0} rad/s")]
    AngularRateBelow(f64),
    /// An image size that can be aligned.
    #[error("at least {width}x{height} pixels")]
    PictureSize {
        /// Smallest width.
        width: usize,
        /// Smallest height.
        height: usize,
    },
    /// One value per pixel.
    #[error("width × height")]
    AllPixels,
}

/// What a field of a signal's layout must be.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum ExpectedLayout {
    /// Length of an integer.
    #[error("{from} to {to} bits")]
    Bits {
        /// The smallest.
        from: u16,
        /// The largest.
        to: u16,
    },
    /// Length of a floating-point number.
    #[error("{0} bits for float{0}")]
    FloatBits(u16),
    /// A position in the frame.
    #[error("a position that ends within {bytes} bytes")]
    EndsWithin {
        /// Length of the longest frame.
        bytes: u16,
    },
    /// A number that is neither NaN nor infinite.
    #[error("a finite number")]
    Finite,
}

#[cfg(test)]
mod tests {
    use super::{ExpectedLayout, ExpectedSetting as Expected};

    #[test]
    fn expected_settings_as_text_with_their_unit() {
        let (from, to) = (0.05, 60.0);
        for (expected, text) in [
            (Expected::AboveZero, "above 0"),
            (Expected::Within { from, to }, "0.05 to 60"),
            (Expected::Metres { from, to }, "0.05 to 60 m"),
            (Expected::Seconds { from, to }, "0.05 to 60 s"),
            (
                Expected::SpeedScale { from, to },
                "0.05 to 60 (convert units instead of scaling)",
            ),
            (
                Expected::SteeringRatio { from, to },
                "0.05 to 60, negative if the signal grows to the right",
            ),
            (Expected::Understeer { from, to }, "0.05 to 60 s²/m²"),
            (Expected::AngularRateBelow(1.0), "below 1 rad/s"),
            (
                Expected::PictureSize {
                    width: 32,
                    height: 16,
                },
                "at least 32x16 pixels",
            ),
            (Expected::AllPixels, "width × height"),
        ] {
            assert_eq!(expected.to_string(), text);
        }
    }

    #[test]
    fn expected_layouts_as_text_in_bits_and_bytes() {
        for (expected, text) in [
            (ExpectedLayout::Bits { from: 1, to: 64 }, "1 to 64 bits"),
            (ExpectedLayout::FloatBits(32), "32 bits for float32"),
            (
                ExpectedLayout::EndsWithin { bytes: 64 },
                "a position that ends within 64 bytes",
            ),
            (ExpectedLayout::Finite, "a finite number"),
        ] {
            assert_eq!(expected.to_string(), text);
        }
    }
}
