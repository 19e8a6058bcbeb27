//! What is wrong with KITTI's calibration and OXTS files.

use deepfusion_geometry::ImplausibleCamera;
use deepfusion_hint::count_of;
use std::fmt;

/// What is wrong with a field of one of KITTI's calibration files.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum CalibrationProblem {
    /// The file has no line for it.
    #[error("the file has no such line")]
    NoLine,
    /// One of its words is not a number.
    #[error("'{text}' is not a number")]
    NotANumber {
        /// The word.
        text: String,
    },
    /// One of its numbers is NaN or infinite.
    #[error("'{text}' is not finite")]
    NotFinite {
        /// The number, as written.
        text: String,
    },
    /// The field has too many numbers, or too few.
    #[error("{}, expected {expected}", count_of(*found, "number"))]
    Length {
        /// How many numbers it has.
        found: usize,
        /// How many it should have.
        expected: usize,
    },
    /// The matrix is not a rotation.
    #[error("is not a rotation")]
    NotARotation,
    /// The matrix of a transform is not a rotation.
    #[error("its matrix is not a rotation")]
    NotAMotion,
    /// A projection has implausible intrinsics.
    #[error(transparent)]
    Implausible(#[from] ImplausibleCamera),
    /// A number is not a possible width or height.
    #[error("{value} is not a size in pixels")]
    NotASize {
        /// The number.
        value: f64,
    },
}

/// The part of an OXTS packet that is wrong.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum OxtsField {
    /// One of the packet's values.
    Value {
        /// Its name, such as `vf`.
        name: &'static str,
        /// Its position in the packet, counted from 1.
        number: usize,
    },
    /// The whole packet.
    Packet,
}

impl fmt::Display for OxtsField {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Value { name, number } => write!(f, "{name} (value {number} of 30)"),
            Self::Packet => f.write_str("packet"),
        }
    }
}

/// Why an OXTS packet cannot be read.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum OxtsProblem {
    /// A value is not a number.
    #[error("'{text}' is not a number")]
    NotANumber {
        /// The value, as written.
        text: String,
    },
    /// A value is NaN or infinite.
    #[error("{value}, expected a finite number")]
    NotFinite {
        /// The value.
        value: f64,
    },
    /// The packet has too many values, or too few.
    #[error("{}, expected 30", count_of(*found, "value"))]
    Length {
        /// How many values it has.
        found: usize,
    },
}
