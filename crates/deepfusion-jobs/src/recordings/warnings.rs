//! What may not be meant of recordings, for people: one line for what several of them have in common.

use deepfusion_data::{DataWarning, Dataset, OpenOptions};

use crate::evaluation::missing_frames;

/// Each warning with the places that it is about.
pub type PlacedWarning = (String, Vec<String>);

/// The warnings of recordings that were opened so, a line each: what was taken for granted, looks odd or cannot be read, and frames of the
/// split that are missing.
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

/// A warning of one or several places as a line; `None` without any.
#[must_use]
pub fn warning_line(warning: &str, places: &[String]) -> Option<String> {
    match places {
        [] => None,
        [only] => Some(format!("{only}: {warning}")),
        [first, others @ ..] => Some(format!("{first} and {} more: {warning}", others.len())),
    }
}

/// The warnings on recordings, each once; a place is a file, or a folder where every image is a file. Not what was passed over
/// ([`Dataset::passed_over`]), which names the folder that it is about.
#[must_use]
pub fn placed_warnings(recordings: &[Dataset]) -> Vec<PlacedWarning> {
    by_warning(recordings.iter().flat_map(warnings))
}

/// Each warning with the places it is about, each place once, in the order in which they come.
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

/// The warnings on a recording, each with its place.
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
