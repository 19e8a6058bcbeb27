//! What a field of a protocol must be.

/// What a field of a protocol must be.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum ExpectedProtocolSetting {
    /// A depth, in metres.
    #[error("metres above 0")]
    Metres,
    /// A depth beyond the smallest that is compared, in metres.
    #[error("metres above the minimum depth")]
    MetresAboveMinimum,
    /// A factor of all depths.
    #[error("a factor above 0")]
    Factor,
}
