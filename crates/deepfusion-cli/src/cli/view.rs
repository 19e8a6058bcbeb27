use std::net::IpAddr;
use std::path::PathBuf;

use clap::Args;

/// `deepfusion view`.
#[derive(Debug, Args)]
#[command(
    after_help = "The page and all it needs are in the program: nothing is installed, and nothing is fetched from elsewhere. A folder \
    that is still being written is shown as it grows. Press ? in the page for its keys; Ctrl-C stops the server.\n\n\
    Examples:\n  deepfusion view depth\n  deepfusion view depth --other depth-of-another-model\n  \
    deepfusion view depth --host 0.0.0.0        # for a phone in the same network, and for everybody else there\n  \
    deepfusion view runs/train-1                # learning curve and panels\n  \
    deepfusion view depth --rerun depth.rrd     # a file for the rerun viewer"
)]
pub(crate) struct ViewArgs {
    /// A folder that `predict` or `perceive` wrote, or a run of `train`.
    #[arg(value_name = "DIR")]
    pub folder: PathBuf,
    /// A second folder, to be shown beside it, frames of the same name together.
    #[arg(long, value_name = "DIR")]
    pub other: Option<PathBuf>,
    /// Where to listen; 0 takes any port that is free.
    #[arg(long, value_name = "N", default_value_t = 8765)]
    pub port: u16,
    /// Whom to answer: 127.0.0.1 is this machine alone, 0.0.0.0 every machine that reaches it.
    #[arg(long, value_name = "ADDR", default_value = "127.0.0.1")]
    pub host: IpAddr,
    /// Do not open a browser.
    #[arg(long)]
    pub no_open: bool,
    /// Write a file for the rerun viewer instead, and end (feature `rerun`).
    #[arg(long, value_name = "FILE.rrd", conflicts_with_all = ["other", "port", "host", "no_open"])]
    pub rerun: Option<PathBuf>,
    /// Replace a FILE.rrd that is there.
    #[arg(long, requires = "rerun")]
    pub overwrite: bool,
}
