//! The page of a verdict without ground truth.

use std::path::PathBuf;

use deepfusion_eval::verdict::Verdict;
use deepfusion_render::HtmlReport;
use deepfusion_runtime::ModelSource;

use crate::{ModelFacts, Result, RunHistory, name_of};

/// The page of the verdict on a network's depth on recordings without ground truth; `command` makes it again.
///
/// # Errors
/// A log in the run's folder that another program wrote.
pub fn verdict_page(
    model: &ModelSource,
    data: &[PathBuf],
    verdict: &Verdict,
    command: &str,
) -> Result<HtmlReport> {
    let names: Vec<_> = data.iter().map(|p| name_of(p)).collect();
    let title = format!(
        "Depth evaluated without ground truth on {}",
        names.join(", ")
    );
    let mut page = HtmlReport::new(model.name(), title).verdict(verdict);
    if let Some(run) = model.folder() {
        page = RunHistory::read(run)?.add_to(page);
    }
    Ok(page.section("How it was measured").command(command))
}
