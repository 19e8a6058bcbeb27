//! Warnings of recordings, each printed once.

use std::collections::HashSet;
use std::f64::consts::PI;
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

/// Warns on stderr of a field of view (`--hfov`) that was hardly meant in degrees.
pub(super) fn warn_of_hfov(degrees: Option<f64>) {
    if let Some(warning) = degrees.and_then(narrow_view) {
        tracing::warn!("{warning}");
    }
}

/// What may not be meant of a field of view in degrees.
fn narrow_view(degrees: f64) -> Option<String> {
    /// Narrower views are telescopes'.
    const NARROW_DEG: f64 = 10.0;
    if degrees >= NARROW_DEG {
        return None;
    }
    let radians = if degrees < PI {
        format!(
            " (--hfov {:.0}, if these are radians)",
            degrees.to_degrees()
        )
    } else {
        String::new()
    };
    Some(format!(
        "--hfov {degrees}: degrees, not radians? A camera with so narrow a view would make every depth very large{radians}"
    ))
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
    fn a_view_in_radians_is_noticed() {
        let said = narrow_view(1.2).unwrap();
        assert!(said.contains("--hfov 69, if these"), "{said}");
        let said = narrow_view(6.0).unwrap();
        assert!(said.ends_with("very large"), "{said}");
        assert_eq!(narrow_view(10.0), None);
    }

    #[test]
    fn what_was_printed_is_not_printed_again() {
        assert!(is_new("a warning of this test alone"));
        assert!(!is_new("a warning of this test alone"));
    }
}
