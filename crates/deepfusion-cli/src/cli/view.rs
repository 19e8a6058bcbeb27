use std::net::IpAddr;
use std::path::PathBuf;

use clap::Args;

/// `deepfusion view`.
#[derive(Debug, Args)]
#[command(
    after_help = "The page and everything it needs are part of the program: nothing is installed, and nothing is fetched from elsewhere. A folder \
    that is still being written is shown as it grows. Press ? in the page to see its keys; press Ctrl-C to stop the server.\n\n\
    Examples:\n  deepfusion view depth\n  deepfusion view depth --other depth-of-another-model\n  \
    deepfusion view depth --host 0.0.0.0        # for a phone on the same network, and everyone else on it\n  \
    deepfusion view runs/train-1                # learning curve and panels\n  \
    deepfusion view depth --rerun depth.rrd     # a file for the rerun viewer"
)]
pub(crate) struct ViewArgs {
    /// Folder written by `predict` or `perceive`, or a run of `train`.
    #[arg(value_name = "DIR")]
    pub folder: PathBuf,
    /// Second folder to show beside it; frames of the same name are shown together.
    #[arg(long, value_name = "DIR")]
    pub other: Option<PathBuf>,
    /// Port to listen on; 0 takes any free one.
    #[arg(long, value_name = "N", default_value_t = 8765)]
    pub port: u16,
    /// Address to listen on: 127.0.0.1 serves only this machine, 0.0.0.0 every machine that can reach it.
    #[arg(long, value_name = "ADDR", default_value = "127.0.0.1")]
    pub host: IpAddr,
    /// Do not open a browser.
    #[arg(long)]
    pub no_open: bool,
    /// Write a file for the rerun viewer and exit, without a server (feature `rerun`).
    #[arg(long, value_name = "FILE.rrd", conflicts_with_all = ["other", "port", "host", "no_open"])]
    pub rerun: Option<PathBuf>,
    /// Replace an existing FILE.rrd.
    #[arg(long, requires = "rerun")]
    pub overwrite: bool,
}
