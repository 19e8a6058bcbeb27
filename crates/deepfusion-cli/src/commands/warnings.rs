//! Warnings of recordings, each printed once.

use std::collections::HashSet;
use std::sync::{LazyLock, Mutex, PoisonError};

use deepfusion_data::Dataset;
use deepfusion_geometry::Intrinsics;
use deepfusion_jobs::recordings::{placed_warnings, warning_line};

/// Those that were printed: both cameras of a drive, and a recording that is opened again, have the same warnings.
static PRINTED: LazyLock<Mutex<HashSet<String>>> = LazyLock::new(Mutex::default);

/// Warns on stderr, unless the same was warned of before.
pub(super) fn warn_once(warning: String) {
    if is_new(&warning) {
        tracing::warn!("{warning}");
    }
}

/// Warns on stderr of what was taken for granted, looks odd or cannot be read: one line for what several recordings have
/// in common.
pub(super) fn print(datasets: &[Dataset]) {
    for warning in datasets.iter().filter_map(Dataset::passed_over) {
        warn_once(warning.to_string());
    }
    for (warning, places) in placed_warnings(datasets) {
        let new: Vec<String> = places
            .into_iter()
            .filter(|place| is_new(&format!("{place}: {warning}")))
            .collect();
        if let Some(line) = warning_line(&warning, &new) {
            tracing::warn!("{line}");
        }
    }
}

/// That a camera's numbers look like those of images of another size.
pub(super) fn of_another_size(k: &Intrinsics) -> String {
    format!(
        "the principal point {:.1}, {:.1} is far from the middle of {}x{}: are the numbers those of images of another size? \
         Metres are then wrong by the ratio of the two sizes",
        k.cx, k.cy, k.width, k.height
    )
}

/// Whether that text was not printed before; from now on it was.
fn is_new(text: &str) -> bool {
    let mut printed = PRINTED.lock().unwrap_or_else(PoisonError::into_inner);
    printed.insert(text.to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_was_printed_is_not_printed_again() {
        assert!(is_new("a warning of this test alone"));
        assert!(!is_new("a warning of this test alone"));
    }
}
