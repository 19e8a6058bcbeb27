//! What settings of sensors and layouts of signals must be.

/// What a setting of a vehicle or sensor, or what is given to be aligned, must be.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum ExpectedSetting {
    /// A number above 0.
    #[error("above 0")]
    AboveZero,
    /// A number from one to the other, both included.
    #[error("{from} to {to}")]
    Within {
        /// The smallest.
        from: f64,
        /// The largest.
        to: f64,
    },
    /// A length from one to the other, both included.
    #[error("{from} to {to} m")]
    Metres {
        /// The smallest, metres.
        from: f64,
        /// The largest, metres.
        to: f64,
    },
    /// A time from one to the other, both included.
    #[error("{from} to {to} s")]
    Seconds {
        /// The smallest, seconds.
        from: f64,
        /// The largest, seconds.
        to: f64,
    },
    /// A true speed over the measured one.
    #[error("{from} to {to} (a unit is converted, not scaled)")]
    SpeedScale {
        /// The smallest.
        from: f64,
        /// The largest.
        to: f64,
    },
    /// A steering wheel's angle over the road wheels', with any sign.
    #[error("{from} to {to}, negative where the signal grows to the right")]
    SteeringRatio {
        /// The smallest, without its sign.
        from: f64,
        /// The largest, without its sign.
        to: f64,
    },
    /// How a car understeers.
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
    /// Where a sensor is.
    #[error("a place on the vehicle, in metres")]
    PlaceOnVehicle,
    /// An angular rate, either way.
    #[error("below {0} rad/s")]
    AngularRateBelow(f64),
    /// A picture that can be aligned.
    #[error("at least {width}×{height} pixels")]
    PictureSize {
        /// Its least width.
        width: usize,
        /// Its least height.
        height: usize,
    },
    /// As many values as the picture has pixels.
    #[error("width × height")]
    AllPixels,
}

/// What a field of a signal's layout must be.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum ExpectedLayout {
    /// The length of an integer.
    #[error("{from} to {to} bits")]
    Bits {
        /// The smallest.
        from: u16,
        /// The largest.
        to: u16,
    },
    /// The length of a number with a fraction.
    #[error("{0} bits for float{0}")]
    FloatBits(u16),
    /// A place in the frame.
    #[error("one that ends within {bytes} bytes")]
    EndsWithin {
        /// Length of the longest frame.
        bytes: u16,
    },
    /// A number, neither NaN nor infinite.
    #[error("a finite number")]
    Finite,
}

#[cfg(test)]
mod tests {
    use super::{ExpectedLayout, ExpectedSetting as Expected};

    #[test]
    fn a_setting_is_said_in_words_with_its_unit() {
        let (from, to) = (0.05, 60.0);
        for (expected, said) in [
            (Expected::AboveZero, "above 0"),
            (Expected::Within { from, to }, "0.05 to 60"),
            (Expected::Metres { from, to }, "0.05 to 60 m"),
            (Expected::Seconds { from, to }, "0.05 to 60 s"),
            (
                Expected::SpeedScale { from, to },
                "0.05 to 60 (a unit is converted, not scaled)",
            ),
            (
                Expected::SteeringRatio { from, to },
                "0.05 to 60, negative where the signal grows to the right",
            ),
            (Expected::Understeer { from, to }, "0.05 to 60 s²/m²"),
            (Expected::AngularRateBelow(1.0), "below 1 rad/s"),
            (
                Expected::PictureSize {
                    width: 32,
                    height: 16,
                },
                "at least 32×16 pixels",
            ),
            (Expected::AllPixels, "width × height"),
        ] {
            assert_eq!(expected.to_string(), said);
        }
    }

    #[test]
    fn a_layout_is_said_in_bits_and_bytes() {
        for (expected, said) in [
            (ExpectedLayout::Bits { from: 1, to: 64 }, "1 to 64 bits"),
            (ExpectedLayout::FloatBits(32), "32 bits for float32"),
            (
                ExpectedLayout::EndsWithin { bytes: 64 },
                "one that ends within 64 bytes",
            ),
            (ExpectedLayout::Finite, "a finite number"),
        ] {
            assert_eq!(expected.to_string(), said);
        }
    }
}
