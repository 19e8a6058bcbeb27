//! What was noticed while recordings were opened, told once for each.

use std::collections::HashSet;
use std::sync::{LazyLock, Mutex, PoisonError};

use deepfusion_data::Dataset;

/// What was told already: both cameras of a drive, and a recording that is opened again, have the same remarks.
static TOLD: LazyLock<Mutex<HashSet<String>>> = LazyLock::new(Mutex::default);

/// Warns on stderr of what was taken for granted, looks odd or cannot be read.
pub fn tell(datasets: &[Dataset]) {
    let mut told = TOLD.lock().unwrap_or_else(PoisonError::into_inner);
    for warning in datasets.iter().flat_map(warnings) {
        if told.insert(warning.clone()) {
            tracing::warn!("{warning}");
        }
    }
}

/// The remarks on a recording, each after its file, or its folder where every image is a file.
fn warnings(dataset: &Dataset) -> impl Iterator<Item = String> {
    let image = dataset.frames().first().map(|frame| &frame.image);
    let container = image.filter(|i| i.file().is_none()).map(|i| i.path());
    let place = container.unwrap_or(dataset.folder()).display();
    let remarks = dataset.remarks().iter();
    remarks.map(move |remark| format!("{place}: {remark}"))
}
