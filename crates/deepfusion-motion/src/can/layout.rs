use crate::error::{Error, ExpectedLayout as Expected, Result};
use serde::{Deserialize, Serialize};

/// The longest frame (CAN FD), in bits.
const MOST_BITS: u16 = 64 * 8;

/// The byte order of a number in a frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum ByteOrder {
    /// Little-endian, `@1` in a DBC file: the start bit is the lowest.
    Intel,
    /// Big-endian, `@0` in a DBC file: the start bit is the highest. The lower bits follow to its right, then from bit 7 of the next byte.
    Motorola,
}

/// The type of a number.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Number {
    /// An unsigned integer.
    #[default]
    Unsigned,
    /// Two's complement.
    Signed,
    /// IEEE 754, 32 bits.
    Float32,
    /// IEEE 754, 64 bits.
    Float64,
}

/// Position and type of a number in a frame, and its physical value: value = raw · scale + offset.
///
/// Bits are counted as DBC files do: bit b of byte B (both from 0, b from the lowest) is 8 B + b.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct BitLayout {
    /// The first bit: the lowest one (Intel) or the highest one (Motorola).
    pub start_bit: u16,
    /// Number of bits, 1 to 64.
    pub length: u16,
    /// Their byte order.
    pub byte_order: ByteOrder,
    /// Their type.
    #[serde(default)]
    pub number: Number,
    /// Factor to the physical value.
    #[serde(default = "one")]
    pub scale: f64,
    /// Added after scaling.
    #[serde(default)]
    pub offset: f64,
}

fn one() -> f64 {
    1.0
}

impl BitLayout {
    /// Checks that the bits lie within a frame of 64 bytes, and that scale and offset are finite.
    ///
    /// # Errors
    /// [`Error::Layout`] with the signal's `name` and the field.
    pub fn validate(&self, name: &str) -> Result<()> {
        let check = |ok: bool, field, value: f64, expected| {
            ok.then_some(()).ok_or_else(|| Error::Layout {
                name: name.to_owned(),
                field,
                value,
                expected,
            })
        };
        let lengths = match self.number {
            Number::Unsigned | Number::Signed => (1..=64, Expected::Bits { from: 1, to: 64 }),
            Number::Float32 => (32..=32, Expected::FloatBits(32)),
            Number::Float64 => (64..=64, Expected::FloatBits(64)),
        };
        let length = f64::from(self.length);
        check(
            lengths.0.contains(&self.length),
            "length",
            length,
            lengths.1,
        )?;
        let start = f64::from(self.start_bit);
        let bytes = MOST_BITS / 8;
        let fits = self.start_bit < MOST_BITS && self.last_byte() < usize::from(bytes);
        check(fits, "start_bit", start, Expected::EndsWithin { bytes })?;
        check(
            self.scale.is_finite(),
            "scale",
            self.scale,
            Expected::Finite,
        )?;
        check(
            self.offset.is_finite(),
            "offset",
            self.offset,
            Expected::Finite,
        )
    }

    /// The physical value in a frame's data; `None` if the data is too short, or the value is not
    /// finite.
    #[must_use]
    pub fn decode(&self, data: &[u8]) -> Option<f64> {
        let raw = self.raw(data)?;
        let number = match self.number {
            Number::Unsigned => raw as f64,
            Number::Signed => {
                // The highest bit counts as negative: moved to bit 63 and back with its sign.
                let unused = 64 - u32::from(self.length);
                ((raw << unused) as i64 >> unused) as f64
            }
            Number::Float32 => f64::from(f32::from_bits(raw as u32)),
            Number::Float64 => f64::from_bits(raw),
        };
        let value = number * self.scale + self.offset;
        value.is_finite().then_some(value)
    }

    /// The bits as an unsigned integer; `None` if the data is too short.
    #[must_use]
    pub fn raw(&self, data: &[u8]) -> Option<u64> {
        let within = (1..=64).contains(&self.length) && self.last_byte() < data.len();
        if !within {
            return None;
        }
        let bit = |at: usize| u64::from(data[at / 8] >> (at % 8) & 1);
        let start = usize::from(self.start_bit);
        let length = usize::from(self.length);
        Some(match self.byte_order {
            ByteOrder::Intel => (0..length).fold(0, |raw, i| raw | bit(start + i) << i),
            ByteOrder::Motorola => {
                // Counted from the left, the bits continue from one byte to the next without jumps.
                let first = start / 8 * 8 + (7 - start % 8);
                let from_left = |at: usize| bit(at / 8 * 8 + (7 - at % 8));
                (first..first + length).fold(0, |raw, at| raw << 1 | from_left(at))
            }
        })
    }

    /// Index of the byte with the last bit. The length is at least 1.
    fn last_byte(&self) -> usize {
        let start = usize::from(self.start_bit);
        let first = match self.byte_order {
            ByteOrder::Intel => start,
            ByteOrder::Motorola => start / 8 * 8 + (7 - start % 8),
        };
        (first + usize::from(self.length).max(1) - 1) / 8
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn layout(start_bit: u16, length: u16, byte_order: ByteOrder, number: Number) -> BitLayout {
        BitLayout {
            start_bit,
            length,
            byte_order,
            number,
            scale: 1.0,
            offset: 0.0,
        }
    }

    #[test]
    fn whole_words_equal_the_standard_librarys() {
        let data = [0x12, 0x34, 0x56, 0x78, 0x9a, 0xbc, 0xde, 0xf0];
        let intel = |s, n, k| layout(s, n, ByteOrder::Intel, k).decode(&data).unwrap();
        let motorola = |s, n, k| layout(s, n, ByteOrder::Motorola, k).decode(&data).unwrap();
        assert_eq!(intel(8, 16, Number::Unsigned), f64::from(0x5634));
        assert_eq!(motorola(15, 16, Number::Unsigned), f64::from(0x3456));
        assert_eq!(intel(40, 16, Number::Signed), f64::from(0xdebc_u16 as i16));
        assert_eq!(
            motorola(47, 16, Number::Signed),
            f64::from(0xbcde_u16 as i16)
        );
        assert_eq!(
            intel(0, 64, Number::Unsigned),
            u64::from_le_bytes(data) as f64
        );
        assert_eq!(
            motorola(7, 64, Number::Signed),
            i64::from_be_bytes(data) as f64
        );
        assert_eq!(
            intel(0, 32, Number::Float32),
            f64::from(f32::from_le_bytes([0x12, 0x34, 0x56, 0x78]))
        );
    }

    #[test]
    fn a_layout_beyond_a_frame_is_refused() {
        let bad = [
            (layout(0, 0, ByteOrder::Intel, Number::Unsigned), "length"),
            (layout(0, 65, ByteOrder::Intel, Number::Signed), "length"),
            (layout(0, 16, ByteOrder::Intel, Number::Float32), "length"),
            (
                layout(510, 3, ByteOrder::Intel, Number::Unsigned),
                "start_bit",
            ),
            (
                layout(65535, 8, ByteOrder::Motorola, Number::Unsigned),
                "start_bit",
            ),
            (
                layout(505, 3, ByteOrder::Motorola, Number::Unsigned),
                "start_bit",
            ),
        ];
        for (layout, field) in bad {
            let error = layout.validate("Speed").unwrap_err().to_string();
            assert!(error.contains("Speed") && error.contains(field), "{error}");
        }
        assert!(
            layout(506, 3, ByteOrder::Motorola, Number::Unsigned)
                .validate("x")
                .is_ok()
        );
    }

    proptest! {
        /// For any layout and data the result is a finite number or `None`; bits beyond the data
        /// give `None`.
        #[test]
        fn nothing_is_read_beyond_the_data(start in any::<u16>(), length in any::<u16>(), motorola in any::<bool>(),
            kind in 0usize..4, data in proptest::collection::vec(any::<u8>(), 0..65)) {
            let order = if motorola { ByteOrder::Motorola } else { ByteOrder::Intel };
            let number = [Number::Unsigned, Number::Signed, Number::Float32, Number::Float64][kind];
            let value = layout(start, length, order, number).decode(&data);
            prop_assert!(value.is_none_or(f64::is_finite));
            if usize::from(start) >= data.len() * 8 {
                prop_assert!(value.is_none());
            }
        }
    }
}
