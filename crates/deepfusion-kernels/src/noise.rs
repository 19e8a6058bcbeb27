//! Reproducible pseudo-random test values.

/// `len` values in [0, 1).
pub(crate) fn noise(len: usize, seed: u64) -> Vec<f64> {
    let mut state = seed.wrapping_mul(0x9E37_79B9_7F4A_7C15) | 1;
    (0..len)
        .map(|_| {
            state ^= state << 13;
            state ^= state >> 7;
            state ^= state << 17;
            (state >> 40) as f64 / (1u64 << 24) as f64
        })
        .collect()
}

/// `len` values in [−½, ½), in single precision.
pub(crate) fn noise32(len: usize, seed: u64) -> Vec<f32> {
    noise(len, seed).iter().map(|v| (*v - 0.5) as f32).collect()
}
