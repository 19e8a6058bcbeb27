//! What is wrong with a file, with a part of it, or with what should run it.

use std::path::PathBuf;

use deepfusion_geometry::DepthRange;
use deepfusion_infer::ValueShape;

/// Why a node cannot be written, or is not one that this program writes.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum NodeProblem {
    /// Read and written again, it is another.
    #[error("not as this program writes it")]
    Differs,
    /// An operator where none such can be.
    #[error("not an operation that is expected here")]
    NotExpected,
    /// Another operator than the one that follows here.
    #[error("expected {op} here")]
    Expected {
        /// The operator.
        op: &'static str,
    },
    /// A border without the convolution that it is for.
    #[error("no Conv after it")]
    NoConv,
    /// Something else than a kernel's weights.
    #[error("weights that have not four dimensions")]
    WeightDimensions,
    /// Something else than a code of positions.
    #[error("no 1×C×H×W array of constants")]
    NoPositions,
    /// Something else than one number.
    #[error("expected a number")]
    NoNumber,
    /// Something else than a number for red, green and blue.
    #[error("expected three numbers")]
    NoColours,
    /// It reads what no node before it gives.
    #[error("its input `{name}` is unknown")]
    UnknownInput {
        /// The input's name; empty where there is none.
        name: String,
    },
    /// It reads a constant that the file lacks.
    #[error("its constant `{name}` is missing")]
    MissingConstant {
        /// The constant's name; empty where there is none.
        name: String,
    },
    /// A constant of another type, or with other values than its dimensions say.
    #[error("`{name}` does not hold the f32 values it says")]
    Values {
        /// The constant's name.
        name: String,
    },
    /// A node without output.
    #[error("it gives nothing")]
    NoOutput,
    /// It has no name, or that of another.
    #[error("every node needs a name of its own")]
    Name,
    /// A constant that would have the name of something else.
    #[error("its `{name}` is the name of something else too")]
    ConstantName {
        /// The name.
        name: String,
    },
}

/// Why a part of a model cannot be written, or is not as this program writes it.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum ModelProblem {
    /// There is no such part.
    #[error("missing")]
    Missing,
    /// Another version of the format or of its operators.
    #[error("file layout {} with operators {:?}, expected {} with {:?}", found.layout, found.operators, expected.layout, expected.operators)]
    Version {
        /// The file's.
        found: FormatVersion,
        /// This program's.
        expected: FormatVersion,
    },
    /// An entry that there must be.
    #[error("`{key}` is missing")]
    MissingKey {
        /// Its key.
        key: &'static str,
    },
    /// An entry that must be a number.
    #[error("`{key}` is `{value}`, expected a number")]
    NoNumber {
        /// Its key.
        key: &'static str,
        /// Its value.
        value: String,
    },
    /// A constant that is another, read and written again.
    #[error("`{name}` is not as this program writes it")]
    Constant {
        /// Its name.
        name: String,
    },
    /// Fewer or more nodes and constants than belong to the network.
    #[error("{found:?}, expected {expected:?}")]
    Counts {
        /// Those of the file.
        found: [usize; 2],
        /// Those of the network.
        expected: [usize; 2],
    },
    /// The file ends within the network.
    #[error("they end before the depth")]
    EndsEarly,
    /// The input's size is left open, or it is no picture.
    #[error("no 1×H×W×3 picture of a fixed size")]
    NoSize,
    /// The input is another.
    #[error("no 1×H×W×3 picture of bytes named `image`")]
    NoPicture,
    /// The outputs are others.
    #[error("not `depth` and `disparity` of 1×1×H×W")]
    NoDepth,
    /// An output that a depth model has.
    #[error("no `{name}`")]
    NoOutput {
        /// Its name.
        name: &'static str,
    },
    /// A model of several inputs, or of none.
    #[error("{found} of them, expected one picture")]
    Inputs {
        /// How many.
        found: usize,
    },
    /// Two distances that are no range of depths.
    #[error("{} m to {} m, expected 0 < nearest < farthest, both finite", range.min_m, range.max_m)]
    Range {
        /// The distances.
        range: DepthRange,
    },
    /// An output that is no map of the image's size.
    #[error("{} channels at {}, expected one at the image's size", shape.channels, size_of(shape))]
    Output {
        /// Its shape.
        shape: ValueShape,
    },
    /// A network of several outputs, or of none.
    #[error("{found}, expected one")]
    Outputs {
        /// How many.
        found: usize,
    },
}

/// Versions of a file's layout and of its operators.
#[derive(Debug, Clone, PartialEq, Eq)]
#[non_exhaustive]
pub struct FormatVersion {
    /// Of the layout.
    pub layout: i64,
    /// Of the operators.
    pub operators: Vec<OperatorSet>,
}

/// A set of operators.
#[derive(Debug, Clone, PartialEq, Eq)]
#[non_exhaustive]
pub struct OperatorSet {
    /// Whose; empty for ONNX's own.
    pub domain: String,
    /// Its version.
    pub version: i64,
}

/// Why a file is no ONNX Runtime library that can be used.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum LibraryProblem {
    /// Nothing is there.
    #[error("there is no such file")]
    Missing,
    /// A library of something else.
    #[error("it has no entry point `OrtGetApiBase`")]
    NoEntryPoint,
    /// Its entry point leads nowhere.
    #[error("its entry point gives nothing")]
    EmptyEntryPoint,
    /// A library that is too old.
    #[error("it is version {found}, expected 1.{oldest} or later")]
    Version {
        /// Its version.
        found: String,
        /// The second number of the oldest that will do.
        oldest: u32,
    },
    /// The process has opened another one.
    #[error("this process already uses {}, and can use one only", path.display())]
    AnotherInUse {
        /// That one's file.
        path: PathBuf,
    },
    /// What the system, or the library itself, says.
    #[error("{0}")]
    Refused(#[source] Box<dyn std::error::Error + Send + Sync>),
}

/// The size of a value, in words.
fn size_of(shape: &ValueShape) -> String {
    if shape.pooled {
        "a single pixel".to_owned()
    } else {
        format!("1/{} of the image's size", 1_u64 << shape.halvings)
    }
}
