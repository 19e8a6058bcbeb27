//! Warnings of recordings, each printed once.

use std::collections::HashSet;
use std::sync::{LazyLock, Mutex, PoisonError};

use deepfusion_data::{DataWarning, Dataset};

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
    for (warning, places) in by_warning(datasets.iter().flat_map(warnings)) {
        let new: Vec<String> = places
            .into_iter()
            .filter(|place| is_new(&format!("{place}: {warning}")))
            .collect();
        match new.as_slice() {
            [] => {}
            [only] => tracing::warn!("{only}: {warning}"),
            [first, others @ ..] => {
                tracing::warn!("{first} and {} more: {warning}", others.len());
            }
        }
    }
}

/// Whether that text was not printed before; from now on it was.
fn is_new(text: &str) -> bool {
    let mut printed = PRINTED.lock().unwrap_or_else(PoisonError::into_inner);
    printed.insert(text.to_owned())
}

/// Each warning with the places it is about, each place once, in the order in which they come.
fn by_warning(warnings: impl Iterator<Item = (String, String)>) -> Vec<(String, Vec<String>)> {
    let mut found: Vec<(String, Vec<String>)> = Vec::new();
    for (place, warning) in warnings {
        match found.iter_mut().find(|(known, _)| *known == warning) {
            Some((_, places)) if places.contains(&place) => {}
            Some((_, places)) => places.push(place),
            None => found.push((warning, vec![place])),
        }
    }
    found
}

/// The warnings on a recording, each with its file, or its folder where every image is a file; not what was passed over, which names
/// the folder that it is about.
fn warnings(dataset: &Dataset) -> impl Iterator<Item = (String, String)> {
    let image = dataset.frames().first().map(|frame| &frame.image);
    let container = image.filter(|i| i.file().is_none()).map(|i| i.path());
    let place = container.unwrap_or(dataset.folder()).display();
    let about_it = move |warning: &&DataWarning| dataset.passed_over() != Some(*warning);
    let warnings = dataset.warnings().iter().filter(about_it);
    warnings.map(move |warning| (place.to_string(), warning.to_string()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_several_recordings_have_in_common_is_one_line() {
        let of = |place: &str, warning: &str| (place.to_owned(), warning.to_owned());
        let warnings = [
            of("a.bag", "no mount"),
            of("a.bag", "damaged"),
            of("b.bag", "no mount"),
            of("a.bag", "no mount"),
        ];
        let found = by_warning(warnings.into_iter());
        assert_eq!(
            found,
            [
                (
                    "no mount".to_owned(),
                    vec!["a.bag".to_owned(), "b.bag".to_owned()]
                ),
                ("damaged".to_owned(), vec!["a.bag".to_owned()]),
            ]
        );
    }

    #[test]
    fn what_was_printed_is_not_printed_again() {
        assert!(is_new("a warning of this test alone"));
        assert!(!is_new("a warning of this test alone"));
    }
}
