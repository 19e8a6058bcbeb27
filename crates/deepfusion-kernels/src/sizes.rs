//! Checked products of sizes, which unchecked reads rely on.

/// All sizes multiplied.
///
/// # Panics
/// If the product overflows: wrapped around, it would pass for a valid length.
#[track_caller]
pub(crate) fn product<const N: usize>(sizes: [usize; N]) -> usize {
    let all = sizes
        .iter()
        .try_fold(1_usize, |all, size| all.checked_mul(*size));
    all.unwrap_or_else(|| panic!("sizes {sizes:?}: their product overflows"))
}
