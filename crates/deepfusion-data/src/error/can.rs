//! What is wrong with the signals of CAN frames that `[can]` names.

/// The highest identifiers of 11 and of 29 bits.
pub(crate) const HIGHEST_STANDARD: u16 = 0x7ff;
pub(crate) const HIGHEST_EXTENDED: u32 = 0x1fff_ffff;

/// What is wrong with the signals of CAN frames that `[can]` names.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum CanProblem {
    /// The DBC file, or that it lacks a signal.
    #[error("can: {0}")]
    Dbc(#[source] Box<deepfusion_motion::Error>),
    /// A signal by its name alone.
    #[error(
        "can.{key} names {signal} of a DBC file, and can.dbc names none; without one, write the signal out: \
         {key} = {{ id = …, layout = {{ start_bit = …, length = …, byte_order = … }} }}"
    )]
    NoDbc {
        /// The key in `[can]`.
        key: &'static str,
        /// The signal's name.
        signal: String,
    },
    /// An identifier of more than 11 bits.
    #[error(
        "can.{key}: id is 0x{id:x}, expected at most 0x{HIGHEST_STANDARD:x}; one of 29 bits is written id = {{ extended = 0x{id:x} }}"
    )]
    StandardId {
        /// The key in `[can]`.
        key: &'static str,
        /// The identifier.
        id: u16,
    },
    /// An identifier of more than 29 bits.
    #[error("can.{key}: id.extended is 0x{id:x}, expected at most 0x{HIGHEST_EXTENDED:x}")]
    ExtendedId {
        /// The key in `[can]`.
        key: &'static str,
        /// The identifier.
        id: u32,
    },
    /// A signal that always has one value.
    #[error("can.{key}: scale is 0, every value would be the same")]
    NoScale {
        /// The key in `[can]`.
        key: &'static str,
    },
    /// A signal that is in no frame.
    #[error("{0}")]
    Layout(#[source] Box<deepfusion_motion::Error>),
    /// The speed's unit, which its DBC file does not say.
    #[error(
        "can.speed_unit is missing, and the DBC file gives {signal} none that is known: \"m/s\", \"km/h\" or \"mph\""
    )]
    UnknownSpeedUnit {
        /// The signal's name.
        signal: String,
    },
    /// The speed's unit, which a signal that is written out has not.
    #[error(
        "can.speed_unit is missing, and can.speed has no unit of its own: \"m/s\", \"km/h\" or \"mph\""
    )]
    NoSpeedUnit,
    /// The steering angle's unit.
    #[error(
        "can.steering_rad is missing: radians for one unit of the signal, 0.0174533 for degrees, 1.0 for radians"
    )]
    NoSteeringUnit,
}
