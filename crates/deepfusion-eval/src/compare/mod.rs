//! Evaluations side by side, the field's published tables, and which rows cannot be right.
//!
//! A [`SavedEvaluation`] is what `eval` writes into a run's folder. [`Evaluation::collect`] reads such files, whole run folders and plain
//! [`Report`](crate::Report)s. [`run_tables`] groups them by what they were measured on, so that no table mixes protocols or images.
//! [`published_tables`] are the field's, quoted with their sources. Every row is checked by [`plausibility::check`]. Tables are printed as
//! [text](Tables::to_text), [CSV](Tables::to_csv) and [LaTeX](Tables::to_latex), and by `deepfusion-render` as a section of an HTML page.

mod eigen;
mod error;
mod evaluation;
mod format;
mod metric_scale;
pub mod plausibility;
mod published;
mod runs;
mod saved;
mod table;

pub use deepfusion_fs::FileError;
pub use error::{Error, EvaluationProblem, PublishedProblem, Result};
pub use evaluation::{Evaluation, Origin};
pub use metric_scale::{LEAST_IMAGES, LEAST_STEPS, MetricScale, TRUSTED_WITHIN, Verdict};
pub use published::{Published, published_tables};
pub use runs::run_tables;
pub use saved::{
    FrameScore, MeasuredOn, ModelFile, SAVED_VERSION, SavedEvaluation, sha256_of_file,
};
pub use table::{Better, Column, Rank, Row, Table, Tables, Value};
