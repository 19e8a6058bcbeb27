//! What a setting must be, and what it is instead.

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
    /// A number above 0, at most this.
    #[error("above 0, at most {0}")]
    AboveZeroUpTo(f64),
    /// A number that is not negative.
    #[error("0 or more")]
    NotNegative,
    /// A number from one to the other, both included.
    #[error("{from} to {to}")]
    Within {
        /// The smallest.
        from: f64,
        /// The largest.
        to: f64,
    },
    /// An angle between two others, both excluded.
    #[error("above {above} and below {below} degrees")]
    Degrees {
        /// The smaller one, degrees.
        above: f64,
        /// The larger one, degrees.
        below: f64,
    },
    /// A time.
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
    /// A name that nothing else has.
    #[error("a name of its own")]
    OwnName,
    /// Recordings to learn from.
    #[error("data.paths or [[data.sets]]")]
    Recordings,
    /// A recording of a data set, or more.
    #[error("at least one")]
    OneRecording,
    /// What all data sets have, or none of them.
    #[error("given for all sets or for none")]
    AllSetsOrNone,
    /// Neighbouring frames, by how far they are from the target's.
    #[error("at least one offset")]
    OneOffset,
    /// Other frames than the target's own.
    #[error("offsets other than 0")]
    OtherOffsets,
    /// Weights of the networks.
    #[error(
        "weights by their names, or by the beginning of them, as depth.encoder or depth.encoder.layer1"
    )]
    Weights,
    /// Fewer weights that do not learn: none learns from video.
    #[error("weights left to learn from video")]
    LeftForVideo,
    /// The same of known depth.
    #[error("weights left to learn from known depth")]
    LeftForDepth,
    /// Something that a TOML file can say.
    #[error("values that TOML can hold")]
    TomlValues,
    /// What another setting asks of it.
    #[error(transparent)]
    AskedBy(#[from] AskedBy),
}

/// What another setting asks of a setting: alone, each could be as it is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum AskedBy {
    /// There is no canonical focal length, by which metres are the same at every size.
    #[error("none without canonical_focal_px")]
    NoCanonicalFocal,
    /// No data set has known depth.
    #[error(
        "false where nothing is learned from known depth: the head has nothing else to learn from"
    )]
    NoKnownDepth,
    /// A data set has nothing else to learn from.
    #[error(
        "above 0 where recordings are learned from by their depth alone, or depth_net.uncertainty = true"
    )]
    DepthAlone,
    /// The depth network is another one.
    #[error(
        "0 where the depth network is no ResNet with its decoder: the flow decoder reads a ResNet's features"
    )]
    NoResNet,
    /// Nothing measured may enter.
    #[error("posenet where loss.speed is 0")]
    NoSpeedLoss,
    /// Both frames are warped onto each other.
    #[error("[1] for bidirectional reprojection")]
    BothWays,
    /// They are not.
    #[error("0 where reprojection is not bidirectional: it compares both frames' depths")]
    OneWay,
    /// There are explainability masks, of which the term is.
    #[error("above 0 where pose_net.explainability is true: nothing else keeps the masks up")]
    MasksForTerm,
    /// There are explainability masks, one for each source.
    #[error("mean where pose_net.explainability is true")]
    MasksForMean,
    /// There are none.
    #[error("0 where pose_net.explainability is false: there are no masks")]
    NoMasks,
    /// The mean of the sources' errors is taken.
    #[error("false where reprojection is mean")]
    MeanOfSources,
    /// The other camera's image is a source.
    #[error("{0} where stereo is on")]
    Stereo(&'static str),
    /// There is no flow.
    #[error("false where loss.flow.weight is 0: the flow shows what is dynamic")]
    NoFlow,
    /// There are data sets.
    #[error("none beside data.sets: each set has its own")]
    DataSets,
    /// The set's views are simulated.
    #[error("none beside simulated views")]
    SimulatedViews,
    /// The same of what is learned from them.
    #[error("\"depth\" for simulated views, which have no neighbours")]
    NoNeighbours,
}

/// What a setting is instead.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum FoundSetting {
    /// This.
    #[error("{0}")]
    Value(String),
    /// It is not given.
    #[error("none")]
    Nothing,
    /// It is given.
    #[error("some")]
    Something,
    /// So many of the data sets have it.
    #[error("{with} of {}", count_of(*of, "set"))]
    SomeSets {
        /// How many.
        with: usize,
        /// Of how many.
        of: usize,
    },
    /// A data set has none.
    #[error("none in {set}")]
    NothingIn {
        /// Its name.
        set: String,
    },
    /// A data set has some.
    #[error("some in {set}")]
    SomethingIn {
        /// Its name.
        set: String,
    },
    /// A data set has another one.
    #[error("another in {set}")]
    AnotherIn {
        /// Its name.
        set: String,
    },
    /// TOML has no form for it: what the writer says.
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
    /// There are none to name.
    #[error("none: this run learned from one data set")]
    NoSets,
    /// This one.
    #[error("{0}, the only one that this run learned from, or none")]
    Only(String),
    /// One of these must be.
    #[error(
        "one of {}, as this run learned from several data sets and metres are each one's own",
        .0.join(", ")
    )]
    OneOf(Vec<String>),
}
