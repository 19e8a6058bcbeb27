//! What is wrong with a file, with a part of it, or with the library that should run it.

use std::path::PathBuf;

use deepfusion_geometry::DepthRange;
use deepfusion_infer::ValueShape;

/// Why a node cannot be written, or is not one that this program writes.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum NodeProblem {
    /// The node, read and written again, differs.
    #[error("differs from what this program writes")]
    Differs,
    /// The operator cannot be at this position.
    #[error("this operation is not expected here")]
    NotExpected,
    /// The operator is not the one that has to follow here.
    #[error("expected {op} here")]
    Expected {
        /// The expected operator.
        op: &'static str,
    },
    /// A border has no convolution.
    #[error("no Conv after it")]
    NoConv,
    /// The values are not a kernel's weights.
    #[error("the weights do not have four dimensions")]
    WeightDimensions,
    /// The values are not a positional code.
    #[error("not a constant 1×C×H×W array")]
    NoPositions,
    /// The values are not one number.
    #[error("expected a number")]
    NoNumber,
    /// The values are not one number each for red, green and blue.
    #[error("expected three numbers")]
    NoColours,
    /// The node's input is not an output of an earlier node.
    #[error("its input `{name}` is unknown")]
    UnknownInput {
        /// Name of the input; empty if it has none.
        name: String,
    },
    /// The node's constant is missing in the file.
    #[error("its constant `{name}` is missing")]
    MissingConstant {
        /// Name of the constant; empty if it has none.
        name: String,
    },
    /// The constant's type is wrong, or its values do not match its dimensions.
    #[error("`{name}` does not have the f32 values that its dimensions require")]
    Values {
        /// Name of the constant.
        name: String,
    },
    /// The node has no output.
    #[error("it has no output")]
    NoOutput,
    /// The node has no name, or that of another node.
    #[error("every node needs a unique name")]
    Name,
    /// A constant would have the name of something else.
    #[error("its `{name}` is already the name of something else")]
    ConstantName {
        /// The name.
        name: String,
    },
}

/// Why a part of a model cannot be written, or is not as this program writes it.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum ModelProblem {
    /// The part is missing.
    #[error("missing")]
    Missing,
    /// The version of the format or of its operators differs.
    #[error("file layout {} with operators {:?}, expected {} with {:?}", found.layout, found.operators, expected.layout, expected.operators)]
    Version {
        /// Versions in the file.
        found: FormatVersion,
        /// Versions of this program.
        expected: FormatVersion,
    },
    /// A required entry is missing.
    #[error("`{key}` is missing")]
    MissingKey {
        /// Key of the entry.
        key: &'static str,
    },
    /// An entry is not a number.
    #[error("`{key}` is `{value}`, expected a number")]
    NoNumber {
        /// Key of the entry.
        key: &'static str,
        /// Value of the entry.
        value: String,
    },
    /// A constant, read and written again, differs.
    #[error("`{name}` differs from what this program writes")]
    Constant {
        /// Name of the constant.
        name: String,
    },
    /// The number of nodes or constants is not that of the network.
    #[error("{found:?}, expected {expected:?}")]
    Counts {
        /// Numbers in the file.
        found: [usize; 2],
        /// Numbers of the network.
        expected: [usize; 2],
    },
    /// The file ends within the network.
    #[error("they end before the depth output")]
    EndsEarly,
    /// The input's size is not fixed, or the input is not a picture.
    #[error("not a 1×H×W×3 picture of fixed size")]
    NoSize,
    /// The input is not the expected one.
    #[error("not a 1×H×W×3 picture of bytes named `image`")]
    NoPicture,
    /// The outputs are not the expected ones.
    #[error("not `depth` and `disparity` of 1×1×H×W")]
    NoDepth,
    /// An output of a depth model is missing.
    #[error("no `{name}`")]
    NoOutput {
        /// Name of the output.
        name: &'static str,
    },
    /// The model does not have exactly one input.
    #[error("found {found}, expected one picture")]
    Inputs {
        /// Number of inputs.
        found: usize,
    },
    /// The two distances are not a range of depths.
    #[error("{} m to {} m, expected 0 < nearest < farthest, both finite", range.min_m, range.max_m)]
    Range {
        /// The distances.
        range: DepthRange,
    },
    /// The output is not a map of the image's size.
    #[error("{} channels at {}, expected one at the image's size", shape.channels, size_of(shape))]
    Output {
        /// Shape of the output.
        shape: ValueShape,
    },
    /// The network does not have exactly one output.
    #[error("found {found}, expected one")]
    Outputs {
        /// Number of outputs.
        found: usize,
    },
}

/// Versions of a file's layout and of its operators.
#[derive(Debug, Clone, PartialEq, Eq)]
#[non_exhaustive]
pub struct FormatVersion {
    /// Version of the layout.
    pub layout: i64,
    /// Versions of the operator sets.
    pub operators: Vec<OperatorSet>,
}

/// A set of operators.
#[derive(Debug, Clone, PartialEq, Eq)]
#[non_exhaustive]
pub struct OperatorSet {
    /// Domain of the set; empty for ONNX's own.
    pub domain: String,
    /// Version of the set.
    pub version: i64,
}

/// Why a file is not a usable ONNX Runtime library.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum LibraryProblem {
    /// The file does not exist.
    #[error("no such file")]
    Missing,
    /// The file is a library of another program.
    #[error("it has no entry point `OrtGetApiBase`")]
    NoEntryPoint,
    /// The entry point returns nothing.
    #[error("its entry point returns nothing")]
    EmptyEntryPoint,
    /// The library is too old.
    #[error("it is version {found}, expected 1.{oldest} or later")]
    Version {
        /// Version of the library.
        found: String,
        /// The second number of the oldest usable version.
        oldest: u32,
    },
    /// The process has opened another library.
    #[error("this process already uses {}, and can use only one library", path.display())]
    AnotherInUse {
        /// Path of that library.
        path: PathBuf,
    },
    /// The message of the system, or of the library itself.
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
