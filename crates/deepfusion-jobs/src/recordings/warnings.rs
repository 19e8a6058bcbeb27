//! Warnings about recordings, for people: a warning that several recordings share is one line.

use deepfusion_data::{DataWarning, Dataset, OpenOptions};

use crate::evaluation::missing_frames;

/// Each warning with the places that it concerns.
pub type PlacedWarning = (String, Vec<String>);

/// The warnings about recordings opened with these options, one per line: what was assumed, what looks odd or cannot be read, and missing
/// frames of the split.
#[must_use]
pub fn warnings_of(options: &OpenOptions, recordings: &[Dataset]) -> Vec<String> {
    let passed_over = recordings.iter().filter_map(Dataset::passed_over);
    let passed_over = passed_over.map(ToString::to_string);
    let placed = placed_warnings(recordings);
    let placed = placed
        .iter()
        .filter_map(|(w, places)| warning_line(w, places));
    let missing = missing_frames(options, recordings);
    let missing = missing.map(|missing| missing.to_string());
    let mut lines: Vec<String> = Vec::new();
    for warning in passed_over.chain(placed).chain(missing) {
        if !lines.contains(&warning) {
            lines.push(warning);
        }
    }
    lines
}

/// A warning about one or more places as a line; `None` without places.
#[must_use]
pub fn warning_line(warning: &str, places: &[String]) -> Option<String> {
    match places {
        [] => None,
        [only] => Some(format!("{only}: {warning}")),
        [first, others @ ..] => Some(format!("{first} and {} more: {warning}", others.len())),
    }
}

/// The warnings about recordings, each once. A place is a file, or a folder if every image is a file. Files that were passed over
/// ([`Dataset::passed_over`]) are not included, since those messages name their folder.
#[must_use]
pub fn placed_warnings(recordings: &[Dataset]) -> Vec<PlacedWarning> {
    by_warning(recordings.iter().flat_map(warnings))
}

/// Each warning with the places that it concerns, each place once, in order of appearance.
fn by_warning(warnings: impl Iterator<Item = (String, String)>) -> Vec<PlacedWarning> {
    let mut found: Vec<PlacedWarning> = Vec::new();
    for (place, warning) in warnings {
        match found.iter_mut().find(|(known, _)| *known == warning) {
            Some((_, places)) if places.contains(&place) => {}
            Some((_, places)) => places.push(place),
            None => found.push((warning, vec![place])),
        }
    }
    found
}

/// The warnings about a recording, each with its place.
fn warnings(dataset: &Dataset) -> impl Iterator<Item = (String, String)> {
    let place = dataset.place().display();
    let about_it = move |warning: &&DataWarning| dataset.passed_over() != Some(*warning);
    let warnings = dataset.warnings().iter().filter(about_it);
    warnings.map(move |warning| (place.to_string(), warning.to_string()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_warning_shared_by_recordings_is_one_line() {
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
        let lines = found
            .iter()
            .map(|(w, places)| warning_line(w, places).unwrap());
        assert_eq!(
            lines.collect::<Vec<_>>(),
            ["a.bag and 1 more: no mount", "a.bag: damaged"]
        );
        assert_eq!(warning_line("no mount", &[]), None);
    }
}
