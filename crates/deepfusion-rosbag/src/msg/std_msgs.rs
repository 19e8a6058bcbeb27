use super::MessageError;
use super::definition::definition;
use super::wire::{Reader, Wire, message};
use crate::Time;

/// The header of most messages: time and frame of a measurement.
#[derive(Debug, Clone, PartialEq, Eq, Hash, Default)]
pub struct Header {
    /// A counter of the publisher; many leave it 0. ROS 2 has none: it is 0 there.
    pub seq: u32,
    /// Time of measurement, by the sensor's or its driver's clock.
    pub stamp: Time,
    /// The frame its coordinates are in.
    pub frame_id: String,
}

impl<'a> Wire<'a> for Header {
    /// The header as ROS 2 has it, without the counter.
    const LEAST: usize = Time::LEAST + String::LEAST;

    fn read(reader: &mut Reader<'a>) -> Result<Self, MessageError> {
        let within = |field: &'static str| move |error: MessageError| error.within(field);
        Ok(Self {
            seq: if reader.is_cdr() {
                0
            } else {
                u32::read(reader).map_err(within("seq"))?
            },
            stamp: Time::read(reader).map_err(within("stamp"))?,
            frame_id: String::read(reader).map_err(within("frame_id"))?,
        })
    }

    fn write(&self, out: &mut Vec<u8>) {
        self.seq.write(out);
        self.stamp.write(out);
        self.frame_id.write(out);
    }
}

message! {
    /// A 32-bit number.
    #[derive(Copy, Default)]
    Float32 = "std_msgs/Float32" "73fcbf46b49191e672908e50842a83d4" definition!("float32 data";);
    /// The number; its unit is the publisher's.
    data: f32,
}

message! {
    /// A 64-bit number.
    #[derive(Copy, Default)]
    Float64 = "std_msgs/Float64" "fdb28210bfa9d7c91146260178d9a584" definition!("float64 data";);
    /// The number; its unit is the publisher's.
    data: f64,
}
