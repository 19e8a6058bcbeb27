//! What is wrong with the signals of CAN frames that `[can]` names.

/// The highest identifiers of 11 and 29 bits.
pub(crate) const HIGHEST_STANDARD: u16 = 0x7ff;
pub(crate) const HIGHEST_EXTENDED: u32 = 0x1fff_ffff;

/// What is wrong with the signals of CAN frames that `[can]` names.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum CanProblem {
    /// The DBC file cannot be used, or lacks a signal.
    #[error("can: {0}")]
    Dbc(#[source] Box<deepfusion_motion::Error>),
    /// A signal is given only by its name, without a DBC file.
    #[error(
        "can.{key} is the name {signal}, but can.dbc is missing; set can.dbc, or define the signal: \
         {key} = {{ id = …, layout = {{ start_bit = …, length = …, byte_order = … }} }}"
    )]
    NoDbc {
        /// The key in `[can]`.
        key: &'static str,
        /// The signal's name.
        signal: String,
    },
    /// A standard identifier has more than 11 bits.
    #[error(
        "can.{key}: id is 0x{id:x}, expected at most 0x{HIGHEST_STANDARD:x}; write an identifier of 29 bits as id = {{ extended = 0x{id:x} }}"
    )]
    StandardId {
        /// The key in `[can]`.
        key: &'static str,
        /// The identifier.
        id: u16,
    },
    /// An extended identifier has more than 29 bits.
    #[error("can.{key}: id.extended is 0x{id:x}, expected at most 0x{HIGHEST_EXTENDED:x}")]
    ExtendedId {
        /// The key in `[can]`.
        key: &'static str,
        /// The identifier.
        id: u32,
    },
    /// A signal's scale is 0.
    #[error("can.{key}: scale is 0, so every value would be the same")]
    NoScale {
        /// The key in `[can]`.
        key: &'static str,
    },
    /// A signal does not fit into a frame.
    #[error("{0}")]
    Layout(#[source] Box<deepfusion_motion::Error>),
    /// The speed's unit is missing, also from the DBC file.
    #[error(
        "can.speed_unit is missing, and the DBC file has no known unit for {signal}; expected \"m/s\", \"km/h\" or \"mph\""
    )]
    UnknownSpeedUnit {
        /// The signal's name.
        signal: String,
    },
    /// The unit of a speed signal defined in `[can]` is missing.
    #[error("can.speed_unit is missing; expected \"m/s\", \"km/h\" or \"mph\"")]
    NoSpeedUnit,
    /// The steering angle's unit is missing.
    #[error(
        "can.steering_rad is missing; expected the radians per unit of the signal (0.0174533 for degrees, 1.0 for radians)"
    )]
    NoSteeringUnit,
}
