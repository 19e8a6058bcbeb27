//! What a value of a network's configuration must be.

/// What a value of a network's configuration must be.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum ExpectedNetworkSetting {
    /// A number from 1 to this.
    #[error("1 to {0}")]
    UpTo(usize),
    /// One of two numbers.
    #[error("{0} or {1}")]
    Either(usize, usize),
    /// A number that has a half.
    #[error("an even number, 2 to {0}")]
    EvenUpTo(usize),
    /// A number that has a middle.
    #[error("odd, at most {0}")]
    OddUpTo(usize),
    /// The frames of a depth network.
    #[error("1 (a depth network sees one image)")]
    OneImage,
    /// The frames of a pose network.
    #[error("2 (a pose network sees a pair)")]
    Pair,
    /// The factors of the last stage's dilations.
    #[error("three factors of 1 to 16")]
    MultiGrid,
    /// The dilations of the context encoding.
    #[error("up to eight rates of 1 to 64")]
    Rates,
    /// Those of a Lite-Mono's stages.
    #[error("for each of three stages up to 64 rates of 1 to 64")]
    RatesOfStages,
    /// Channels of the decoder's stages.
    #[error("five widths of 1 to 4096")]
    FiveWidths,
    /// Channels of the flow decoder.
    #[error("one width or more, of 1 to 4096")]
    OneWidth,
    /// Channels of a Lite-Mono's stages.
    #[error("three even widths of 2 to 2048, multiples of the {heads} heads")]
    WidthsOfHeads {
        /// Heads of its attention.
        heads: usize,
    },
    /// A length that one unit stands for.
    #[error("a positive number of metres")]
    Metres,
    /// Two depths, the smaller one first.
    #[error("0 < min_m < max_m, finite")]
    DepthRange,
    /// A depth of the network's range.
    #[error("between {min_m} and {max_m} m, the ends of the range")]
    InRange {
        /// The smallest of the range, metres.
        min_m: f64,
        /// The largest, metres.
        max_m: f64,
    },
    /// The output stride of a network with explainability masks.
    #[error("32 where explainability is on")]
    StrideOfMasks,
    /// What the network has another part for.
    #[error(
        "left as it is where there is a lite_mono, an r_msfm or a disp_net, which do not read it"
    )]
    NotRead,
    /// What does not go with R-MSFM.
    #[error("absent where there is an r_msfm")]
    NotBesideRMsfm,
    /// What does not go with SfMLearner's network.
    #[error("absent where there is a disp_net")]
    NotBesideDispNet,
}
