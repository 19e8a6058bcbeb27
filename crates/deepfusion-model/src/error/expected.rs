//! What a setting must be, and what was found instead.

use deepfusion_hint::count_of;

/// What a setting must be.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum ExpectedSetting {
    /// A count of one or more.
    #[error("at least 1")]
    AtLeastOne,
    /// A number above 0.
    #[error("above 0")]
    AboveZero,
    /// A number above 0, at most the given one.
    #[error("above 0, at most {0}")]
    AboveZeroUpTo(f64),
    /// A number that is 0 or more.
    #[error("0 or more")]
    NotNegative,
    /// A number within two limits, both included.
    #[error("{from} to {to}")]
    Within {
        /// The smallest.
        from: f64,
        /// The largest.
        to: f64,
    },
    /// An angle between two limits, both excluded.
    #[error("above {above} and below {below} degrees")]
    Degrees {
        /// Lower limit in degrees.
        above: f64,
        /// Upper limit in degrees.
        below: f64,
    },
    /// A time in seconds.
    #[error("a time in seconds")]
    Seconds,
    /// Two depths, the smaller one first.
    #[error("0 < min_m < max_m")]
    DepthRange,
    /// One of these names.
    #[error("one of {}", .0.join(", "))]
    OneOf(Vec<String>),
    /// Cameras as configurations name them.
    #[error("2, 3 or both")]
    Cameras,
    /// A unique name.
    #[error("a unique name")]
    OwnName,
    /// Recordings to train on.
    #[error("data.paths or [[data.sets]]")]
    Recordings,
    /// At least one recording in a data set.
    #[error("at least one")]
    OneRecording,
    /// A setting that all data sets have, or none.
    #[error("given for all sets or for none")]
    AllSetsOrNone,
    /// Offsets of the source frames.
    #[error("at least one offset")]
    OneOffset,
    /// Source frames other than the target.
    #[error("offsets other than 0")]
    OtherOffsets,
    /// Names of weights.
    #[error("the beginning of a weight's name, such as depth.encoder or depth.encoder.layer1")]
    Weights,
    /// Fewer frozen weights: none are left to learn from video.
    #[error("weights left to learn from video")]
    LeftForVideo,
    /// Fewer frozen weights: none are left to learn from known depth.
    #[error("weights left to learn from known depth")]
    LeftForDepth,
    /// Values that TOML has a form for.
    #[error("values that TOML can hold")]
    TomlValues,
    /// A condition of another setting.
    #[error(transparent)]
    AskedBy(#[from] AskedBy),
}

/// What another setting demands of a setting. Each alone would be valid.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum AskedBy {
    /// There is no canonical focal length, with which a sigmoid disparity means the same metres at every size.
    #[error("none without canonical_focal_px")]
    NoCanonicalFocal,
    /// No data set has known depth.
    #[error("false if no data set has known depth: the head learns from nothing else")]
    NoKnownDepth,
    /// A data set teaches nothing but depth.
    #[error("above 0 (or depth_net.uncertainty = true) if any recordings have learn = \"depth\"")]
    DepthAlone,
    /// The depth network is not a ResNet.
    #[error("0 unless the depth network is a ResNet, whose features the flow decoder reads")]
    NoResNet,
    /// Without the speed loss, a run uses no measured motion.
    #[error("posenet if loss.speed is 0")]
    NoSpeedLoss,
    /// Reprojection is bidirectional: the two frames are warped onto each other.
    #[error("[1] for bidirectional reprojection")]
    BothWays,
    /// Reprojection is not bidirectional.
    #[error("0 unless reprojection is bidirectional: the term compares the depths of both frames")]
    OneWay,
    /// There are explainability masks, which need this term.
    #[error("above 0 if pose_net.explainability is true: otherwise the masks fall to 0")]
    MasksForTerm,
    /// There are explainability masks, one for each source.
    #[error("mean if pose_net.explainability is true")]
    MasksForMean,
    /// There are no explainability masks.
    #[error("0 if pose_net.explainability is false: there are no masks")]
    NoMasks,
    /// Reprojection takes the mean of the sources' errors.
    #[error("false if reprojection is mean")]
    MeanOfSources,
    /// The other camera's image is a source.
    #[error("{0} if stereo is on")]
    Stereo(&'static str),
    /// There is no flow decoder.
    #[error("false if loss.flow.weight is 0: dynamic pixels are found by the flow")]
    NoFlow,
    /// There are data sets.
    #[error("none if data.sets is given: each set has its own")]
    DataSets,
    /// The set's views are simulated: it has no recordings.
    #[error("none for simulated views")]
    SimulatedViews,
    /// The set's views are simulated: they have no neighbouring frames.
    #[error("\"depth\" for simulated views, which have no neighbours")]
    NoNeighbours,
}

/// What was found instead.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum FoundSetting {
    /// A value.
    #[error("{0}")]
    Value(String),
    /// The setting is missing.
    #[error("none")]
    Nothing,
    /// The setting is given.
    #[error("some")]
    Something,
    /// Only some of the data sets have the setting.
    #[error("{with} of {}", count_of(*of, "set"))]
    SomeSets {
        /// Number of data sets that have it.
        with: usize,
        /// Number of data sets.
        of: usize,
    },
    /// A data set lacks the setting.
    #[error("none in {set}")]
    NothingIn {
        /// The data set's name.
        set: String,
    },
    /// A data set has the setting.
    #[error("some in {set}")]
    SomethingIn {
        /// The data set's name.
        set: String,
    },
    /// A data set has another value.
    #[error("another in {set}")]
    AnotherIn {
        /// The data set's name.
        set: String,
    },
    /// The value has no form in TOML: the serialiser's message.
    #[error("{0}")]
    NoTomlForm(Box<toml::ser::Error>),
}

impl From<String> for FoundSetting {
    fn from(value: String) -> Self {
        Self::Value(value)
    }
}

impl From<toml::ser::Error> for FoundSetting {
    fn from(error: toml::ser::Error) -> Self {
        Self::NoTomlForm(Box::new(error))
    }
}

/// Which data set of a run may be named.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum ExpectedDataSet {
    /// The run learned from one unnamed data set.
    #[error("none, as this run learned from one unnamed data set")]
    NoSets,
    /// The run learned from this data set only.
    #[error("{0} (the only one that this run learned from) or none")]
    Only(String),
    /// The run learned from several data sets.
    #[error(
        "one of {}: this run learned from several data sets, and each has its own metres",
        .0.join(", ")
    )]
    OneOf(Vec<String>),
}
