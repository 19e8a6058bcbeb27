//! Convolutions in int8 with AVX-512's dot products of four bytes (VNNI): inputs as steps of 8 bits of the range
//! found in calibration, weights as steps of ±127 of each output channel, sums exact in 32 bits.
//!
//! Between the operations values stay in bf16, so that all others are as they are there. A convolution first writes its
//! input as bytes: x ≈ s·(q − z), s = (high − low) / 255, z = −low / s rounded. Then with weights w ≈ s_o·p of each output
//! channel o, Σ w·x = s·s_o·(Σ p·q − z·Σ p), of which the last part goes into the bias.

mod bytes;
mod dot;

use pulp::x86::V4;

use crate::Conv;
use crate::bf16::has_dot;
use crate::conv::{ConvForm, Geometry, Runs};
use crate::element::Bf16;
use crate::forms::Bf16Conv;
use crate::view::Shared;

pub(crate) use dot::ByteDot;

/// Whether the processor multiplies fours of bytes (AVX512-VNNI), and knows bf16 for all that is not computed in bytes.
pub(crate) fn has_int8() -> bool {
    has_dot() && V4::try_new().is_some() && is_x86_feature_detected!("avx512vnni")
}

/// In bytes where that was calibrated, in bf16 elsewhere.
#[expect(
    clippy::large_enum_variant,
    reason = "a few dozen of them a network, most of them bytes"
)]
#[derive(Debug)]
pub(crate) enum Int8Conv {
    Bytes(ByteDot),
    Bf16(Bf16Conv),
}

impl Int8Conv {
    pub(crate) fn available() -> bool {
        has_int8()
    }
}

impl ConvForm<Bf16> for Int8Conv {
    fn new(conv: &Conv, geometry: Geometry, channel_of: &[Option<usize>]) -> Self {
        match geometry.input_range {
            Some(range) if ByteDot::fits(conv, &geometry) => {
                Self::Bytes(ByteDot::new(conv, geometry, channel_of, range))
            }
            _ => Self::Bf16(Bf16Conv::new(conv, geometry, channel_of)),
        }
    }

    fn overread(pitch: usize) -> usize {
        Bf16Conv::overread(pitch)
    }

    fn name(&self) -> &'static str {
        match self {
            Self::Bytes(_) => "int8",
            Self::Bf16(conv) => conv.name(),
        }
    }

    fn geometry(&self) -> &Geometry {
        match self {
            Self::Bytes(conv) => conv.geometry(),
            Self::Bf16(conv) => conv.geometry(),
        }
    }

    /// Bytes are made of the input alone.
    fn reads_on(&self) -> Option<(&Geometry, &Runs)> {
        match self {
            Self::Bytes(_) => None,
            Self::Bf16(conv) => conv.reads_on(),
        }
    }

    unsafe fn run(&self, arena: Shared<Bf16>) {
        // SAFETY: the caller's promise; `new` is only called where `available` holds.
        unsafe {
            match self {
                Self::Bytes(conv) => conv.run(arena),
                Self::Bf16(conv) => conv.run(arena),
            }
        }
    }
}
