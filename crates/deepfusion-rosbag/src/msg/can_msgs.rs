use super::definition::{definition, header, part};
use super::std_msgs::Header;
use super::wire::message;

message! {
    /// A frame of a CAN bus, undecoded.
    #[derive(Eq, Hash, Default)]
    Frame = "can_msgs/Frame" "64ae5cebf967dc6aae4e78f5683a5b25" definition!(
        "std_msgs/Header header"
        "uint32 id"
        "bool is_rtr"
        "bool is_extended"
        "bool is_error"
        "uint8 dlc"
        "uint8[8] data";
        header!()
    );
    /// Time of reception.
    header: Header,
    /// The arbitration identifier: 11 bits, or 29 if `is_extended`.
    id: u32,
    /// A remote transmission request, without data.
    is_rtr: bool,
    /// Whether the identifier has 29 bits.
    is_extended: bool,
    /// An error frame.
    is_error: bool,
    /// Number of valid bytes of `data`.
    dlc: u8,
    /// The payload.
    data: [u8; 8],
}
