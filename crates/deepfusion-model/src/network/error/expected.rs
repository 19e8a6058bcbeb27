//! What a value of a network's configuration must be.

/// What a value of a network's configuration must be.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum ExpectedNetworkSetting {
    /// A number from 1 to the given one.
    #[error("1 to {0}")]
    UpTo(usize),
    /// One of two numbers.
    #[error("{0} or {1}")]
    Either(usize, usize),
    /// An even number.
    #[error("an even number, 2 to {0}")]
    EvenUpTo(usize),
    /// An odd number.
    #[error("odd, at most {0}")]
    OddUpTo(usize),
    /// Number of images that a depth network reads.
    #[error("1 (a depth network reads one image)")]
    OneImage,
    /// Number of images that a pose network reads.
    #[error("2 (a pose network reads a pair)")]
    Pair,
    /// Factors of the dilations in a ResNet's last layer.
    #[error("three factors of 1 to 16")]
    MultiGrid,
    /// Dilations of the context encoding.
    #[error("up to eight rates of 1 to 64")]
    Rates,
    /// Dilations of Lite-Mono's stages.
    #[error("up to 64 rates of 1 to 64 for each of three stages")]
    RatesOfStages,
    /// Channels of the decoder's stages.
    #[error("five widths of 1 to 4096")]
    FiveWidths,
    /// Channels of the flow decoder.
    #[error("at least one width of 1 to 4096")]
    OneWidth,
    /// Channels of a Lite-Mono's stages.
    #[error("three even widths of 2 to 2048, multiples of the number of heads ({heads})")]
    WidthsOfHeads {
        /// Number of attention heads.
        heads: usize,
    },
    /// Metres per unit of PoseNet's translation.
    #[error("a positive number of metres")]
    Metres,
    /// Two depths, the smaller one first.
    #[error("0 < min_m < max_m, finite")]
    DepthRange,
    /// A depth within the network's range.
    #[error("within the range, {min_m} to {max_m} m")]
    InRange {
        /// Smallest depth of the range in metres.
        min_m: f64,
        /// Largest depth of the range in metres.
        max_m: f64,
    },
    /// Output stride of a network with explainability masks.
    #[error("32 if explainability is on")]
    StrideOfMasks,
    /// A part of a ResNet's network, beside a network that does not read it.
    #[error("its default, as lite_mono, r_msfm and disp_net do not read it")]
    NotRead,
    /// A part that R-MSFM cannot have.
    #[error("absent if r_msfm is given")]
    NotBesideRMsfm,
    /// A part that SfMLearner's network cannot have.
    #[error("absent if disp_net is given")]
    NotBesideDispNet,
}
