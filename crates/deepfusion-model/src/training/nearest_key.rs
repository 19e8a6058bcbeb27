//! Suggests existing keys for one that does not exist.

use super::ConfigKey;
use strsim::osa_distance;

/// Maximum number of suggested keys.
const MOST: usize = 3;

/// The keys with the fewest letters to change, in their order; none if that is more than a third of the letters. A key without a table is
/// compared with the names in every table.
pub(super) fn nearest_keys(key: &str, known: &[ConfigKey]) -> Vec<String> {
    let changes = |known: &ConfigKey| {
        let of_all = osa_distance(key, &known.key);
        if key.contains('.') {
            of_all
        } else {
            of_all.min(osa_distance(key, known.name()))
        }
    };
    let most = (key.chars().count() / 3).max(1);
    let Some(least) = known.iter().map(changes).min().filter(|n| *n <= most) else {
        return Vec::new();
    };
    let nearest = known.iter().filter(|known| changes(known) == least);
    nearest.take(MOST).map(|known| known.key.clone()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::config_keys;

    #[test]
    fn misspelt_keys_get_suggestions() {
        let keys = config_keys();
        for (key, meant) in [
            ("bacth", &["batch"][..]),
            ("loss.smothness", &["loss.smoothness"]),
            ("smoothnes", &["loss.smoothness", "loss.flow.smoothness"]),
            ("data.sets[].lern", &["data.sets[].learn"]),
            ("hope", &[]),
        ] {
            assert_eq!(nearest_keys(key, &keys), meant, "{key}");
        }
    }
}
