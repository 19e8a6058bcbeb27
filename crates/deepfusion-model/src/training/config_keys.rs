//! All keys of a configuration, with their meaning from the comments of the struct fields.

use crate::{Error, TrainConfig};
use serde_json::Value;
use std::collections::BTreeSet;
use std::fmt::Write;

/// A key of a configuration file.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ConfigKey {
    /// Path with dots between tables: `loss.depth.weight`. `data.sets[].name` is a key of each table in a list.
    pub key: String,
    /// The field's comment on one line.
    pub meaning: String,
    /// The words it accepts, and the meaning of each; empty if its value is not a word.
    pub words: Vec<(String, String)>,
    /// Its type if it is not one of these words: a number, a string, …
    pub kind: &'static str,
    /// Its value in TOML if a file leaves it out; `None` if it is required, or absent when left out.
    pub default: Option<String>,
}

/// All keys, table by table.
#[must_use]
pub fn config_keys() -> Vec<ConfigKey> {
    let schema = schemars::schema_for!(TrainConfig).to_value();
    let mut keys = Vec::new();
    collect(&schema, &schema, "", &mut keys);
    keys
}

impl ConfigKey {
    /// The table it belongs to: `loss.depth`.
    #[must_use]
    pub fn table(&self) -> &str {
        self.key.rsplit_once('.').map_or("", |(table, _)| table)
    }

    /// Its name within the table: `weight`.
    #[must_use]
    pub fn name(&self) -> &str {
        self.key
            .rsplit_once('.')
            .map_or(&*self.key, |(_, name)| name)
    }

    /// The first sentence of its meaning, and the words it accepts.
    fn line(&self) -> String {
        let end = self.meaning.find(". ").unwrap_or(self.meaning.len());
        let sentence = self.meaning[..end].trim_end_matches('.');
        let words: Vec<&str> = self.words.iter().map(|(word, _)| &**word).collect();
        if words.is_empty() {
            sentence.to_owned()
        } else {
            format!("{sentence} [{}]", words.join(" | "))
        }
    }
}

/// The schema behind a reference; for an optional value, the schema of the value.
fn resolved<'a>(root: &'a Value, schema: &'a Value) -> &'a Value {
    if let Some(reference) = schema.get("$ref").and_then(Value::as_str) {
        let found = root.pointer(reference.trim_start_matches('#'));
        return found.map_or(schema, |found| resolved(root, found));
    }
    let any = schema.get("anyOf").and_then(Value::as_array);
    let is_value = |s: &&Value| s.get("type").and_then(Value::as_str) != Some("null");
    match any.and_then(|any| any.iter().find(is_value)) {
        Some(value) => resolved(root, value),
        None => schema,
    }
}

fn collect(root: &Value, schema: &Value, prefix: &str, keys: &mut Vec<ConfigKey>) {
    let Some(properties) = schema.get("properties").and_then(Value::as_object) else {
        return;
    };
    let is_table = |own: &Value| own.get("properties").is_some();
    let mut tables: Vec<(String, &Value)> = Vec::new();
    for (name, property) in properties {
        let own = resolved(root, property);
        let key = format!("{prefix}{name}");
        if is_table(own) {
            tables.push((format!("{key}."), own));
            continue;
        }
        let items = own.get("items").map(|items| resolved(root, items));
        if let Some(items) = items.filter(|items| is_table(items)) {
            tables.push((format!("{key}[]."), items));
        }
        keys.push(ConfigKey {
            key,
            meaning: one_line(property.get("description").or(own.get("description"))),
            words: words(own),
            kind: kind(own, items),
            default: default(own, property),
        });
    }
    for (prefix, table) in tables {
        collect(root, table, &prefix, keys);
    }
}

fn words(schema: &Value) -> Vec<(String, String)> {
    let choices = schema.get("oneOf").and_then(Value::as_array);
    let word = |choice: &Value| {
        let word = choice.get("const")?.as_str()?.to_owned();
        Some((word, one_line(choice.get("description"))))
    };
    choices.map_or(Vec::new(), |all| all.iter().filter_map(word).collect())
}

fn kind(schema: &Value, items: Option<&Value>) -> &'static str {
    let types = match schema.get("type") {
        Some(Value::String(one)) => vec![one.as_str()],
        Some(Value::Array(several)) => several.iter().filter_map(Value::as_str).collect(),
        _ => Vec::new(),
    };
    let has = |name: &str| types.contains(&name);
    match items {
        Some(items) => match kind(items, None) {
            "whole number" => "list of whole numbers",
            "string" => "list of strings",
            _ => "list of tables",
        },
        None if has("boolean") => "true or false",
        None if has("integer") => "whole number",
        None if has("number") => "number",
        None if has("string") => "string",
        None => "word",
    }
}

/// The value of a key that is left out. A switch that older runs' files lack is off.
fn default(own: &Value, property: &Value) -> Option<String> {
    let off = || (kind(own, None) == "true or false").then(|| "false".to_owned());
    let own = property.get("default").and_then(as_toml);
    own.or_else(off)
}

/// A value of the schema in TOML.
fn as_toml(value: &Value) -> Option<String> {
    match value {
        Value::Null => None,
        Value::Number(number) if number.is_f64() => number.as_f64().map(shortest),
        other => Some(other.to_string()),
    }
}

/// The shortest decimal form of a number that may have been an f32.
fn shortest(number: f64) -> String {
    let single = number as f32;
    if f64::from(single) == number {
        format!("{single:?}")
    } else {
        format!("{number:?}")
    }
}

fn one_line(description: Option<&Value>) -> String {
    let text = description.and_then(Value::as_str).unwrap_or_default();
    text.split_whitespace().collect::<Vec<_>>().join(" ")
}

impl TrainConfig {
    /// The configuration as TOML, with a comment above each key that explains it. Keys that are not set appear as comments.
    ///
    /// # Errors
    /// As for [`TrainConfig::to_toml`].
    pub fn to_commented_toml(&self) -> Result<String, Error> {
        let all = config_keys();
        let mut written = BTreeSet::new();
        let mut text = String::new();
        let mut table = String::new();
        for line in self.to_toml()?.lines() {
            let header = line.strip_prefix('[').and_then(|l| l.strip_suffix(']'));
            if let Some(header) = header {
                unset(&mut text, &all, &mut written, &table);
                table = header.to_owned();
            } else if let Some((name, _)) = line.split_once(" = ")
                && let Some(key) = all.iter().find(|k| k.table() == table && k.name() == name)
            {
                // `writeln!` into a string does not fail.
                let _ = writeln!(text, "# {}", key.line());
                written.insert(key.key.clone());
            }
            text += line;
            text.push('\n');
        }
        unset(&mut text, &all, &mut written, &table);
        // Tables that are missing altogether.
        let mut left: Vec<&str> = Vec::new();
        for key in all.iter().filter(|k| !written.contains(&k.key)) {
            if !left.contains(&key.table()) {
                left.push(key.table());
            }
        }
        for table in left {
            let _ = match table.strip_suffix("[]") {
                Some(list) => writeln!(text, "\n# [[{list}]]"),
                None => writeln!(text, "\n# [{}]", table.replace("[]", "")),
            };
            unset(&mut text, &all, &mut BTreeSet::new(), table);
        }
        Ok(text)
    }
}

/// Inserts the unset keys of a table as comments before its final empty line.
fn unset(text: &mut String, all: &[ConfigKey], written: &mut BTreeSet<String>, table: &str) {
    let ends_empty = text.ends_with("\n\n");
    if ends_empty {
        text.pop();
    }
    for key in all.iter().filter(|k| k.table() == table) {
        if written.insert(key.key.clone()) {
            let _ = writeln!(text, "# {}: {}", key.name(), key.line());
        }
    }
    if ends_empty {
        text.push('\n');
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Preset;

    /// Every key that any preset writes is listed and has a meaning.
    #[test]
    fn every_key_has_a_meaning() {
        let keys = config_keys();
        for key in &keys {
            assert!(key.meaning.len() > 5, "{key:?}");
            assert!(!key.meaning.contains("SPEC"), "{key:?}");
        }
        fn leaves(table: &toml::Table, prefix: &str, found: &mut Vec<String>) {
            for (name, value) in table {
                match value {
                    toml::Value::Table(inner) => leaves(inner, &format!("{prefix}{name}."), found),
                    _ => found.push(format!("{prefix}{name}")),
                }
            }
        }
        for preset in Preset::ALL {
            let mut written = Vec::new();
            let table = toml::Table::try_from(preset.config()).unwrap();
            leaves(&table, "", &mut written);
            for key in written {
                assert!(keys.iter().any(|k| k.key == key), "{key} of {preset}");
            }
        }
        let weight = keys.iter().find(|k| k.key == "data.sets[].simulated.plain");
        assert_eq!(weight.unwrap().kind, "number");
    }

    /// The output is a valid configuration and lists all keys.
    #[test]
    fn a_commented_file_is_the_configuration() {
        for preset in Preset::ALL {
            let config = preset.config();
            let text = config.to_commented_toml().unwrap();
            assert_eq!(toml::from_str::<TrainConfig>(&text).unwrap(), config);
            for key in config_keys() {
                let name = key.name();
                let set = text.contains(&format!("\n{name} = "));
                assert!(
                    set || text.contains(&format!("\n# {name}: ")),
                    "{}",
                    key.key
                );
            }
        }
    }
}
