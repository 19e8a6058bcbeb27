use std::path::PathBuf;

use clap::{Args, ValueEnum};

use super::EngineArgs;

/// `deepfusion compare`.
#[derive(Debug, Args)]
#[command(
    after_help = "Takes run folders (what `eval --model RUN` kept in RUN/eval), single files from such folders, and files with the output of `eval \
    --json`. Evaluations with different protocols or ground truth go into tables of their own. Rows that cannot be right (delta 1 \
    above delta 2, an RMSE log that the deltas rule out, …) are flagged with the reason and never marked as best. Published rows are \
    quoted with their source.\n\n\
    Examples:\n  deepfusion compare runs/train-1 runs/train-2\n  \
    deepfusion compare --published --format latex --out tables.tex\n  \
    deepfusion compare runs/a runs/b --pictures street --format html --out a-b.html"
)]
pub(crate) struct CompareArgs {
    /// Run folders, saved evaluations, or output of `eval --json`.
    #[arg(value_name = "RUN", required_unless_present = "published")]
    pub runs: Vec<PathBuf>,
    /// Format of the tables.
    #[arg(long, value_enum, default_value_t)]
    pub format: TableFormat,
    /// Add the field's published tables on KITTI.
    #[arg(long)]
    pub published: bool,
    /// Write to this file instead of stdout.
    #[arg(long, value_name = "FILE")]
    pub out: Option<PathBuf>,
    /// Replace existing files.
    #[arg(long, requires = "out")]
    pub overwrite: bool,
    /// Also predict images of this recording with every RUN, side by side: as a PNG beside --out, and in the HTML.
    #[arg(long, value_name = "PATH", requires = "out", requires = "runs")]
    pub pictures: Option<PathBuf>,
    /// Number of images, evenly spread over the recording.
    #[arg(long, value_name = "N", default_value_t = 4, requires = "pictures", value_parser = clap::value_parser!(u16).range(1..=64))]
    pub picture_count: u16,
    /// What runs the networks for --pictures.
    #[command(flatten)]
    pub engine: EngineArgs,
}

/// How tables are written.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, ValueEnum)]
pub(crate) enum TableFormat {
    /// For a terminal.
    #[default]
    Text,
    /// Everything in one table, in full precision.
    Csv,
    /// For a paper, in booktabs style.
    Latex,
    /// A page that opens offline.
    Html,
}
