//! A summary of a card: as rows for people, and as JSON without the configuration for scripts.

use std::fmt;

use deepfusion_hint::count_of;
use serde::Serialize;

use crate::{Card, DEFAULT, Figure};

/// Maximum number of recordings listed by name.
const NAMED: usize = 6;

/// A card without its configuration, but with the most important settings; for scripts.
#[derive(Debug, Serialize)]
pub struct CardSummary<'a> {
    name: &'a str,
    /// Whether it is the default network.
    default: bool,
    preset: &'a str,
    size: Option<[i64; 2]>,
    parameters: u64,
    bytes: u64,
    numbers: &'a str,
    depth_difference: f64,
    checkpoint: &'a str,
    steps: usize,
    date: &'a str,
    data: &'a [String],
    simulated_only: bool,
    recipe: Option<&'a str>,
    licence: &'a str,
    note: Option<&'a str>,
    figures: &'a [Figure],
    sha256: &'a str,
    format_version: u32,
}

impl Card {
    /// Whether this is the default network, [`DEFAULT`].
    #[must_use]
    pub fn is_default(&self) -> bool {
        self.name == DEFAULT
    }

    /// The summary for scripts.
    #[must_use]
    pub fn summary(&self) -> CardSummary<'_> {
        CardSummary {
            name: &self.name,
            default: self.is_default(),
            preset: self.preset(),
            size: self.size(),
            parameters: self.parameters,
            bytes: self.bytes,
            numbers: &self.numbers,
            depth_difference: self.depth_difference,
            checkpoint: &self.checkpoint,
            steps: self.steps,
            date: &self.date,
            data: &self.data,
            simulated_only: self.simulated_only,
            recipe: self.recipe.as_deref(),
            licence: &self.licence,
            note: self.note.as_deref(),
            figures: &self.figures,
            sha256: &self.sha256,
            format_version: self.format_version,
        }
    }

    /// The summary for people: rows of a name and a value each, without the network's name.
    #[must_use]
    pub fn rows(&self) -> Vec<(&'static str, String)> {
        let size = self
            .size()
            .map_or(String::new(), |[w, h]| format!(" at {w}x{h}"));
        let mut data: Vec<String> = self.data.iter().take(NAMED).cloned().collect();
        if self.data.len() > NAMED {
            data.push(format!("and {} more", self.data.len() - NAMED));
        }
        let real = if self.simulated_only {
            ", no real image among them"
        } else {
            ""
        };
        let mut rows = vec![
            (
                "network",
                format!(
                    "{}{size}, {:.2} M parameters, {:.1} MB ({})",
                    self.preset(),
                    self.parameters as f64 / 1e6,
                    self.bytes as f64 / 1e6,
                    self.numbers
                ),
            ),
            (
                "last run",
                format!(
                    "{}, the {} checkpoint, {}",
                    count_of(self.steps, "step"),
                    self.checkpoint,
                    self.date
                ),
            ),
            ("from", format!("{}{real}", data.join(", "))),
        ];
        let figures = self.figures.iter();
        rows.extend(figures.map(|figure| ("measured", figure.to_string())));
        let rest = [
            ("recipe", self.recipe.clone()),
            ("note", self.note.clone()),
            ("licence", Some(self.licence.clone())),
            ("sha256", Some(self.sha256.clone())),
        ];
        rows.extend(
            rest.into_iter()
                .filter_map(|(key, value)| Some((key, value?))),
        );
        rows
    }
}

impl fmt::Display for Figure {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let seen = match self.held_out {
            Some(true) => "not seen in training",
            Some(false) => "seen in training",
            None => "not known whether seen in training",
        };
        write!(
            f,
            "{}: abs_rel {:.3}, scaled {:.3}, scale {:.3}, within 25 % {:.1} % ({}, {seen})",
            self.data,
            self.abs_rel,
            self.abs_rel_scaled,
            self.scale,
            100.0 * self.a1,
            count_of(self.images, "image"),
        )
    }
}

#[cfg(test)]
mod tests {
    use crate::card::tests::card;

    #[test]
    fn a_card_is_read_row_by_row() {
        let rows = card("street-x").rows();
        let rows: Vec<String> = rows
            .into_iter()
            .map(|(name, value)| format!("{name}: {value}"))
            .collect();
        assert_eq!(
            rows,
            [
                "network: light at 640x192, 0.00 M parameters, 0.0 MB (bf16)",
                "last run: 60000 steps, the best checkpoint, 2026-01-31",
                "from: street-1, street-2, no real image among them",
                "measured: street-3: abs_rel 0.070, scaled 0.060, scale 1.010, within 25 % 95.0 % (25 images, not seen in training)",
                "recipe: recipes/street.toml",
                "licence: MIT OR Apache-2.0",
                format!("sha256: {}", "ab".repeat(32)).as_str(),
            ]
        );
    }

    #[test]
    fn of_many_recordings_some_are_named() {
        let mut card = card("street-x");
        card.data = (0..9).map(|i| format!("d{i}")).collect();
        card.simulated_only = false;
        let rows = card.rows();
        let from = rows.iter().find(|(name, _)| *name == "from");
        assert_eq!(
            from.map(|(_, value)| value.as_str()),
            Some("d0, d1, d2, d3, d4, d5, and 3 more")
        );
        assert!(!card.is_default());
    }
}
