//! Warnings of recordings, each printed once.

use std::collections::HashSet;
use std::f64::consts::PI;
use std::sync::{LazyLock, Mutex, PoisonError};

use deepfusion_data::Dataset;
use deepfusion_geometry::Intrinsics;
use deepfusion_jobs::recordings::{placed_warnings, warning_line};

/// The warnings that were printed. Both cameras of a drive have the same warnings, as does a recording that is opened again.
static PRINTED: LazyLock<Mutex<HashSet<String>>> = LazyLock::new(Mutex::default);

/// Warns on stderr, unless the same warning was printed before.
pub(super) fn warn_once(warning: String) {
    if is_new(&warning) {
        tracing::warn!("{warning}");
    }
}

/// Prints the recordings' warnings on stderr: what was assumed, looks odd or cannot be read. A warning that several recordings share
/// is one line.
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

/// The warning that a camera's intrinsics look like those of images of another size.
pub(super) fn of_another_size(k: &Intrinsics) -> String {
    format!(
        "the principal point {:.1}, {:.1} is far from the middle of {}x{}: if the intrinsics are for images of another size, \
         metres are wrong by the ratio of the two sizes",
        k.cx, k.cy, k.width, k.height
    )
}

/// Warns on stderr of a field of view (`--hfov`) that was probably not given in degrees.
pub(super) fn warn_of_hfov(degrees: Option<f64>) {
    if let Some(warning) = degrees.and_then(narrow_view) {
        tracing::warn!("{warning}");
    }
}

/// The warning for a field of view that is improbably narrow in degrees.
fn narrow_view(degrees: f64) -> Option<String> {
    /// Only telephoto lenses have narrower fields of view.
    const NARROW_DEG: f64 = 10.0;
    if degrees >= NARROW_DEG {
        return None;
    }
    let radians = if degrees < PI {
        format!(
            " (give --hfov {:.0} if these are radians)",
            degrees.to_degrees()
        )
    } else {
        String::new()
    };
    Some(format!(
        "--hfov {degrees}: expected degrees; a field of view this narrow would make every depth very large{radians}"
    ))
}

/// Whether a text was not printed before; remembers it as printed.
fn is_new(text: &str) -> bool {
    let mut printed = PRINTED.lock().unwrap_or_else(PoisonError::into_inner);
    printed.insert(text.to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_view_in_radians_is_noticed() {
        let warning = narrow_view(1.2).unwrap();
        assert!(warning.contains("--hfov 69 if these"), "{warning}");
        let warning = narrow_view(6.0).unwrap();
        assert!(warning.ends_with("very large"), "{warning}");
        assert_eq!(narrow_view(10.0), None);
    }

    #[test]
    fn a_warning_is_printed_once() {
        assert!(is_new("a warning of this test alone"));
        assert!(!is_new("a warning of this test alone"));
    }
}
