//! docs/reference/configuration.md is generated from the comments in the source. `UPDATE_REFERENCE=1` updates it.

use deepfusion_train::{ConfigKey, Preset, config_keys};
use std::fmt::Write;
use std::path::Path;

/// The heading of a table of keys.
fn title(table: &str) -> String {
    match table.strip_suffix("[]") {
        _ if table.is_empty() => "The run".into(),
        Some(list) => format!("`[[{list}]]`"),
        None => format!("`[{}]`", table.replace("[]", "")),
    }
}

fn row(key: &ConfigKey, value: Option<&toml::Value>) -> String {
    let escape = |text: &str| text.replace('|', "\\|");
    let meaning = if key.words.is_empty() {
        format!("{} ({})", escape(&key.meaning), key.kind)
    } else {
        let word = |(word, means): &(String, String)| format!("`{word}`: {}", escape(means));
        let words: Vec<String> = key.words.iter().map(word).collect();
        format!("{}<br>{}", escape(&key.meaning), words.join("<br>"))
    };
    let default = value.map(ToString::to_string).or(key.default.clone());
    let default = default.map_or_else(String::new, |value| format!("`{value}`"));
    format!("| `{}` | {meaning} | {default} |", key.name())
}

#[test]
fn the_reference_page_is_up_to_date() {
    // Through TOML, so that a 32-bit number is shown as it is written.
    let written = Preset::Light.config().to_toml().unwrap();
    let values: toml::Table = toml::from_str(&written).unwrap();
    let value_of = |key: &str| {
        let mut parts = key.split('.');
        let first = values.get(parts.next()?)?;
        parts.try_fold(first, |value, part| value.get(part))
    };
    let mut page = include_str!("reference/configuration_head.md").to_owned();
    let mut table = None;
    for key in config_keys() {
        if table.as_deref() != Some(key.table()) {
            table = Some(key.table().to_owned());
            let title = title(key.table());
            writeln!(
                page,
                "\n## {title}\n\n| Key | Meaning | Default |\n|---|---|---|"
            )
            .unwrap();
        }
        writeln!(page, "{}", row(&key, value_of(&key.key))).unwrap();
    }
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/reference/configuration.md");
    if std::env::var_os("UPDATE_REFERENCE").is_some() {
        std::fs::write(&path, &page).unwrap();
    }
    let found = std::fs::read_to_string(&path).unwrap();
    assert!(
        found == page,
        "{} differs from the comments in the source: run this test with UPDATE_REFERENCE=1",
        path.display()
    );
}
