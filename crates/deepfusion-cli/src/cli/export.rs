use std::path::PathBuf;

use clap::Args;

use super::Size;

/// `deepfusion export`.
#[derive(Debug, Args)]
#[command(
    after_help = "The file takes an RGB picture of bytes, 1xHxWx3, and gives depth in metres and disparity in 1/m; \
    normalisation is inside, resizing (Lanczos) is not. It is read back and compared with the network on four pictures, \
    in this program and in an ONNX Runtime library where one is found, and kept only if they agree.\n\n\
    Examples:\n  deepfusion export --model runs/train-1 --out depth.onnx\n  \
    deepfusion export --model runs/train-1 --out small.onnx --size 320x96"
)]
pub(crate) struct ExportArgs {
    /// A run folder, a checkpoint in it, or the name of an embedded network (`weights list`) [default: street].
    #[arg(long, value_name = "RUN|NAME")]
    pub model: Option<PathBuf>,
    /// The data set whose metric scale to use, for a run trained on several.
    #[arg(long = "data-set", alias = "set", value_name = "NAME")]
    pub set: Option<String>,
    /// File to write.
    #[arg(long, value_name = "FILE.onnx")]
    pub out: PathBuf,
    /// Size of the pictures it takes [default: the one trained with].
    #[arg(long, value_name = "WxH")]
    pub size: Option<Size>,
    /// The ONNX Runtime library to check with [default: ORT_DYLIB_PATH, or where it is usually found].
    #[arg(long, value_name = "ORT_LIB")]
    pub check_with: Option<PathBuf>,
    /// Replace a file that is there.
    #[arg(long)]
    pub overwrite: bool,
    /// Print what was written and checked as JSON on stdout.
    #[arg(long)]
    pub json: bool,
}
