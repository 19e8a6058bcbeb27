//! What was noticed while recordings were opened, told once.

use std::collections::HashSet;
use std::sync::{LazyLock, Mutex, PoisonError};

use deepfusion_data::Dataset;

/// What was told already: both cameras of a drive, and a recording that is opened again, have the same remarks.
static TOLD: LazyLock<Mutex<HashSet<String>>> = LazyLock::new(Mutex::default);

/// Warns on stderr, unless the same was warned of before.
pub(super) fn warn_once(warning: String) {
    if is_new(&warning) {
        tracing::warn!("{warning}");
    }
}

/// Warns on stderr of what was taken for granted, looks odd or cannot be read: one line for what several recordings have
/// in common.
pub(super) fn tell(datasets: &[Dataset]) {
    for (remark, places) in by_remark(datasets.iter().flat_map(remarks)) {
        let new: Vec<String> = places
            .into_iter()
            .filter(|place| is_new(&format!("{place}: {remark}")))
            .collect();
        match new.as_slice() {
            [] => {}
            [only] => tracing::warn!("{only}: {remark}"),
            [first, others @ ..] => {
                tracing::warn!("{first} and {} more: {remark}", others.len());
            }
        }
    }
}

/// Whether nothing of that text was told before; from now on it was.
fn is_new(text: &str) -> bool {
    let mut told = TOLD.lock().unwrap_or_else(PoisonError::into_inner);
    told.insert(text.to_owned())
}

/// Each remark with the places it is about, each place once, in the order in which they come.
fn by_remark(remarks: impl Iterator<Item = (String, String)>) -> Vec<(String, Vec<String>)> {
    let mut found: Vec<(String, Vec<String>)> = Vec::new();
    for (place, remark) in remarks {
        match found.iter_mut().find(|(known, _)| *known == remark) {
            Some((_, places)) if places.contains(&place) => {}
            Some((_, places)) => places.push(place),
            None => found.push((remark, vec![place])),
        }
    }
    found
}

/// The remarks on a recording, each with its file, or its folder where every image is a file.
fn remarks(dataset: &Dataset) -> impl Iterator<Item = (String, String)> {
    let image = dataset.frames().first().map(|frame| &frame.image);
    let container = image.filter(|i| i.file().is_none()).map(|i| i.path());
    let place = container.unwrap_or(dataset.folder()).display();
    let remarks = dataset.remarks().iter();
    remarks.map(move |remark| (place.to_string(), remark.clone()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_several_recordings_have_in_common_is_one_line() {
        let of = |place: &str, remark: &str| (place.to_owned(), remark.to_owned());
        let remarks = [
            of("a.bag", "no mount"),
            of("a.bag", "damaged"),
            of("b.bag", "no mount"),
            of("a.bag", "no mount"),
        ];
        let found = by_remark(remarks.into_iter());
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
    fn what_was_told_is_not_told_again() {
        assert!(is_new("a warning of this test alone"));
        assert!(!is_new("a warning of this test alone"));
    }
}
