//! Convolutions in int8 with AVX-512's dot products of four bytes (VNNI): inputs as 255 steps of the calibrated range, weights as steps of
//! ±127 for each output channel, sums exact in 32 bits.
//!
//! Between operations, values are in bf16, so all other operations are as in bf16. A convolution first converts its input to bytes: x ≈
//! s·(q − z), s = (high − low) / 255, z = −low / s rounded. Then, with weights w ≈ s_o·p of each output channel o, Σ w·x = s·s_o·(Σ p·q −
//! z·Σ p). The last part is added to the bias.

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

/// Whether the processor multiplies bytes in groups of four (AVX512-VNNI), and has bf16 for everything else.
pub(crate) fn has_int8() -> bool {
    has_dot() && V4::try_new().is_some() && is_x86_feature_detected!("avx512vnni")
}

/// A convolution in int8 if it was calibrated, else in bf16.
#[expect(
    clippy::large_enum_variant,
    reason = "there are a few dozen per network, most of them in int8"
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

    /// Int8 reads its inputs only.
    fn reads_beyond_inputs(&self) -> Option<(&Geometry, &Runs)> {
        match self {
            Self::Bytes(_) => None,
            Self::Bf16(conv) => conv.reads_beyond_inputs(),
        }
    }

    unsafe fn run(&self, arena: Shared<Bf16>) {
        // SAFETY: guaranteed by the caller; `new` is only called if `available` is true.
        unsafe {
            match self {
                Self::Bytes(conv) => conv.run(arena),
                Self::Bf16(conv) => conv.run(arena),
            }
        }
    }
}
