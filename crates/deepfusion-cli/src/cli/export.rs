use std::path::PathBuf;

use clap::Args;

use super::Size;
use super::values::file_ending_in;

/// `deepfusion export`.
#[derive(Debug, Args)]
#[command(
    after_help = "The file takes an RGB image as bytes, 1xHxWx3, and returns depth in metres and disparity in 1/m. Normalisation is included, \
    resizing (Lanczos) is not. The file is read back and compared with the network on four images, in this program and, if one is \
    found, in an ONNX Runtime library. It is kept only if they agree.\n\n\
    Examples:\n  deepfusion export --model runs/train-1 --out depth.onnx\n  \
    deepfusion export --model runs/train-1 --out small.onnx --size 320x96"
)]
pub(crate) struct ExportArgs {
    /// Run folder, checkpoint in it, or name of an embedded network (`weights list`) [default: street].
    #[arg(long, value_name = "RUN|NAME")]
    pub model: Option<PathBuf>,
    /// Data set whose metric scale to use, for a run trained on several.
    #[arg(long = "data-set", alias = "set", value_name = "NAME")]
    pub set: Option<String>,
    /// File to write.
    #[arg(long, value_name = "FILE.onnx", value_parser = file_ending_in("onnx"))]
    pub out: PathBuf,
    /// Size of the images that it takes [default: the training size].
    #[arg(long, value_name = "WxH")]
    pub size: Option<Size>,
    /// ONNX Runtime library to check with [default: ORT_DYLIB_PATH, or the first one found].
    #[arg(long, value_name = "ORT_LIB")]
    pub check_with: Option<PathBuf>,
    /// Replace an existing file.
    #[arg(long)]
    pub overwrite: bool,
    /// Print what was written and checked as JSON on stdout.
    #[arg(long)]
    pub json: bool,
}
