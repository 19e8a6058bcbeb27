use serde::{Deserialize, Serialize};

use crate::{CardProblem, Error};

/// Version of the format of a card and its weights; other versions are rejected.
pub const FORMAT_VERSION: u32 = 1;

/// The description of a packed network and its origin: the content of `NAME.toml`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Card {
    /// Version of the format: [`FORMAT_VERSION`].
    pub format_version: u32,
    /// Name of the network.
    pub name: String,
    /// SHA-256 of `NAME.safetensors`, in hexadecimal.
    pub sha256: String,
    /// Length of that file in bytes.
    pub bytes: u64,
    /// Number of learned parameters of the depth network.
    pub parameters: u64,
    /// Number of steps of its last run; the note says what that run started from.
    pub steps: usize,
    /// The checkpoint of its run that was packed: `best` or `last`.
    pub checkpoint: String,
    /// The date on which that checkpoint was written, `2026-01-31`, UTC.
    pub date: String,
    /// Names of the recordings it was trained on.
    pub data: Vec<String>,
    /// Whether none of them has real images.
    pub simulated_only: bool,
    /// How to reproduce it: a file of `recipes/`, or a command.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub recipe: Option<String>,
    /// Its licence.
    pub licence: String,
    /// Number formats of the tensors.
    pub numbers: String,
    /// Largest |packed − original| / original of the depths of a picture: the cost of rounding the numbers.
    pub depth_difference: f64,
    /// Further notes.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub note: Option<String>,
    /// Evaluations of the checkpoint before it was packed.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub figures: Vec<Figure>,
    /// Calibration of the network's uncertainty, from an evaluation.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub uncertainty: Option<toml::Table>,
    /// Calibration for int8, by `weights calibrate`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub int8: Option<toml::Table>,
    /// The run's configuration, without the paths of its recordings.
    pub config: toml::Table,
}

/// An evaluation in a few numbers.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Figure {
    /// Names of the evaluated recordings.
    pub data: String,
    /// Number of images.
    pub images: usize,
    /// Whether training saw none of them; absent if unknown.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub held_out: Option<bool>,
    /// Mean |prediction − truth| / truth, unscaled.
    pub abs_rel: f64,
    /// Mean |prediction − truth| / truth, median-scaled.
    pub abs_rel_scaled: f64,
    /// Median over the images of median(truth) / median(prediction); 1 if the scale is metric.
    pub scale: f64,
    /// Share of pixels whose depth is within 25 % of the truth (δ < 1.25).
    pub a1: f64,
}

impl Card {
    /// The preset its run started from, as its configuration names it.
    #[must_use]
    pub fn preset(&self) -> &str {
        let preset = self.config.get("preset").and_then(|p| p.as_str());
        preset.unwrap_or("unknown")
    }

    /// Width and height of its input images in pixels, according to its configuration.
    #[must_use]
    pub fn size(&self) -> Option<[i64; 2]> {
        let size = self.config.get("size")?;
        let side = |name: &str| size.get(name).and_then(toml::Value::as_integer);
        Some([side("width")?, side("height")?])
    }

    /// The card as TOML. Equal cards have equal texts.
    ///
    /// # Errors
    /// [`Error::Card`] for a value that has no TOML form.
    pub fn to_toml(&self) -> Result<String, Error> {
        let text = toml::to_string_pretty(self).map_err(|e| Error::Card {
            origin: self.name.clone(),
            reason: CardProblem::Unwritten(Box::new(e)),
        })?;
        let weights = format!("{}.safetensors", self.name);
        Ok(format!(
            "# What {weights} is and what it was made from. Written by `deepfusion weights pack`.\n{text}"
        ))
    }

    /// Reads a card; error messages call it `origin`.
    ///
    /// # Errors
    /// [`Error::Version`] for a card of another version, [`Error::Card`] for a text that is not a card.
    pub fn parse(origin: &str, text: &str) -> Result<Self, Error> {
        let failed = |e: toml::de::Error| Error::Card {
            origin: origin.to_owned(),
            reason: CardProblem::NotOne(Box::new(e)),
        };
        // The version first: the content of other versions is unknown.
        let table: toml::Table = text.parse().map_err(failed)?;
        let version = table
            .get("format_version")
            .and_then(toml::Value::as_integer);
        if version.is_some_and(|version| version != i64::from(FORMAT_VERSION)) {
            return Err(Error::Version {
                origin: origin.to_owned(),
                found: version.unwrap_or_default(),
            });
        }
        table.try_into().map_err(failed)
    }
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;

    pub(crate) fn card(name: &str) -> Card {
        Card {
            format_version: FORMAT_VERSION,
            name: name.into(),
            sha256: "ab".repeat(32),
            bytes: 10,
            parameters: 4,
            steps: 60_000,
            checkpoint: "best".into(),
            date: "2026-01-31".into(),
            data: vec!["street-1".into(), "street-2".into()],
            simulated_only: true,
            recipe: Some("recipes/street.toml".into()),
            licence: "MIT OR Apache-2.0".into(),
            numbers: "bf16".into(),
            depth_difference: 0.003,
            note: None,
            figures: vec![Figure {
                data: "street-3".into(),
                images: 25,
                held_out: Some(true),
                abs_rel: 0.07,
                abs_rel_scaled: 0.06,
                scale: 1.01,
                a1: 0.95,
            }],
            uncertainty: None,
            int8: None,
            config: "preset = 'light'\nsize = { width = 640, height = 192 }"
                .parse()
                .unwrap(),
        }
    }

    #[test]
    fn a_card_is_written_and_read_back() {
        let card = card("street");
        let text = card.to_toml().unwrap();
        assert!(text.starts_with("# What street.safetensors is"), "{text}");
        assert_eq!(Card::parse("street.toml", &text).unwrap(), card);
        assert_eq!(card.to_toml().unwrap(), text);
        assert_eq!((card.preset(), card.size()), ("light", Some([640, 192])));
    }

    /// Errors name the card, and another version is reported before any other problem.
    #[test]
    fn invalid_cards_are_named() {
        let message = |text: &str| Card::parse("street.toml", text).unwrap_err().to_string();
        let newer = message("format_version = 7\nnew = 'thing'");
        assert!(
            newer.contains("street.toml") && newer.contains("version 7"),
            "{newer}"
        );
        for text in ["", "name = 3", "not toml", "format_version = 1"] {
            assert!(message(text).contains("street.toml"), "{text}");
        }
        let text = card("street").to_toml().unwrap();
        let unknown = text.replacen("steps", "stepz", 1);
        assert!(message(&unknown).contains("stepz"));
    }
}
