use super::definition::definition;
use super::wire::message;
use crate::Time;

message! {
    /// What most messages begin with: when and in which frame something was measured.
    #[derive(Eq, Hash, Default)]
    Header;
    /// A number that the publisher counts up; many leave it 0.
    seq: u32,
    /// When it was measured, by the sensor's or its driver's clock.
    stamp: Time,
    /// The frame its coordinates are in.
    frame_id: String,
}

message! {
    /// A number.
    #[derive(Copy, Default)]
    Float32 = "std_msgs/Float32" "73fcbf46b49191e672908e50842a83d4" definition!("float32 data";);
    /// The number; its unit is the publisher's.
    data: f32,
}

message! {
    /// A number.
    #[derive(Copy, Default)]
    Float64 = "std_msgs/Float64" "fdb28210bfa9d7c91146260178d9a584" definition!("float64 data";);
    /// The number; its unit is the publisher's.
    data: f64,
}
