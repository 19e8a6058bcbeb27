//! Checked products of sizes, on which unchecked reads rely.

/// All sizes multiplied.
///
/// # Panics
/// When that is more than can be counted: a product that wraps round would pass for a length that it is not.
#[track_caller]
pub(crate) fn product<const N: usize>(sizes: [usize; N]) -> usize {
    let all = sizes
        .iter()
        .try_fold(1_usize, |all, size| all.checked_mul(*size));
    all.unwrap_or_else(|| panic!("sizes {sizes:?}: their product is more than can be counted"))
}
