//! The element type of the arena: f32, or bf16 (the upper half of an f32).

/// A plain number that may be read from any memory.
///
/// # Safety
/// Any bits must be a valid value, and all zeros the default one. It must have no padding, and its size and alignment must be a power of
/// two of at most 64 bytes. [`crate::aligned::Aligned`] creates values from plain memory and relies on this.
pub(crate) unsafe trait Plain: Copy + Default + 'static {}

// SAFETY: four bytes, of which any are a valid float; zeros are 0.
unsafe impl Plain for f32 {}
// SAFETY: a byte, of which any is a valid number; zero is 0.
unsafe impl Plain for i8 {}
// SAFETY: a `u16`, of which any bits are a valid number; zeros are 0.
unsafe impl Plain for Bf16 {}

/// A number as stored between operations.
pub(crate) trait Element: Plain + Send + Sync + PartialOrd {
    fn of(value: f32) -> Self;
    fn value(self) -> f32;
}

impl Element for f32 {
    #[inline(always)]
    fn of(value: f32) -> Self {
        value
    }

    #[inline(always)]
    fn value(self) -> f32 {
        self
    }
}

/// Eight bits of exponent, seven of mantissa.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
#[repr(transparent)]
pub(crate) struct Bf16(pub(crate) u16);

impl PartialOrd for Bf16 {
    #[inline(always)]
    fn partial_cmp(&self, other: &Self) -> Option<std::cmp::Ordering> {
        self.value().partial_cmp(&other.value())
    }
}

impl Element for Bf16 {
    /// Rounds to nearest, ties to even.
    #[inline(always)]
    fn of(value: f32) -> Self {
        if value.is_nan() {
            // Rounding up could carry and turn NaN into zero.
            return Self(0x7fc0);
        }
        let bits = value.to_bits();
        let rounded = bits.wrapping_add(0x7fff + ((bits >> 16) & 1));
        Self((rounded >> 16) as u16)
    }

    #[inline(always)]
    fn value(self) -> f32 {
        f32::from_bits(u32::from(self.0) << 16)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bf16_rounds_to_the_nearest_and_keeps_nan() {
        let rounded = |v: f32| Bf16::of(v).value();
        // Between 1 and 2 the step is 2⁻⁷; ties go to the even one.
        assert_eq!(rounded(1.0 + 0.6 / 128.0), 1.0 + 1.0 / 128.0);
        assert_eq!(rounded(1.0 + 0.5 / 128.0), 1.0);
        assert_eq!(rounded(1.0 + 1.5 / 128.0), 1.0 + 2.0 / 128.0);
        assert_eq!(rounded(-3.0), -3.0);
        assert_eq!(rounded(f32::INFINITY), f32::INFINITY);
        assert!(rounded(f32::from_bits(0x7fff_ffff)).is_nan());
    }
}
