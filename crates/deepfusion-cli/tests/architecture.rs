//! The crates and their arrows, as ARCHITECTURE.md and its drawing say them. `UPDATE_REFERENCE=1` draws anew.

#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    reason = "a test's panic is its message"
)]

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};

type Arrows = BTreeMap<String, BTreeSet<String>>;

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..")
}

/// What each crate of the workspace uses of the others, tests and benches apart.
fn arrows() -> Arrows {
    let mut arrows = Arrows::new();
    for entry in fs::read_dir(root().join("crates")).unwrap() {
        let folder = entry.unwrap().path();
        let text = fs::read_to_string(folder.join("Cargo.toml")).unwrap();
        let manifest: toml::Table = text.parse().unwrap();
        let name = folder.file_name().unwrap().to_str().unwrap().to_owned();
        let uses = manifest.get("dependencies").and_then(toml::Value::as_table);
        let uses = uses.into_iter().flat_map(toml::Table::keys);
        let ours = uses.filter(|used| used.starts_with("deepfusion")).cloned();
        arrows.insert(name, ours.collect());
    }
    arrows
}

/// All that a crate uses, directly or not.
fn reached<'a>(arrows: &'a Arrows, from: &str, seen: &mut BTreeSet<&'a str>) {
    for used in &arrows[from] {
        if seen.insert(used) {
            reached(arrows, used, seen);
        }
    }
}

/// The arrows that follow from no others.
fn drawing(arrows: &Arrows) -> String {
    let mut text = String::from("graph TD\n");
    for (name, uses) in arrows {
        for used in uses {
            let by_another = uses.iter().filter(|other| *other != used).any(|other| {
                let mut all = BTreeSet::new();
                reached(arrows, other, &mut all);
                all.contains(used.as_str())
            });
            if !by_another {
                let short = |name: &str| name.replace("deepfusion-", "");
                text.push_str(&format!("    {} --> {}\n", short(name), short(used)));
            }
        }
    }
    text
}

#[test]
fn the_drawing_is_of_todays_crates() {
    let page = root().join("docs/reference/crates.md");
    let expected = format!(
        "# The crates\n\nWhat each crate uses, without the arrows that follow from others. Drawn from the crates' manifests by\n\n\
         ```\nUPDATE_REFERENCE=1 cargo test --workspace --test architecture\n```\n\n```mermaid\n{}```\n",
        drawing(&arrows())
    );
    if std::env::var_os("UPDATE_REFERENCE").is_some() {
        fs::write(&page, &expected).unwrap();
    }
    assert_eq!(fs::read_to_string(page).unwrap(), expected);
}

/// Each crate has a row and a README, and uses only crates of rows below its own.
#[test]
fn every_crate_is_described_above_what_it_uses() {
    let text = fs::read_to_string(root().join("ARCHITECTURE.md")).unwrap();
    let rows: Vec<&str> = text
        .lines()
        .filter_map(|line| line.strip_prefix("| `")?.split('`').next())
        .collect();
    let row_of = |name: &str| {
        let row = rows.iter().position(|row| *row == name);
        row.unwrap_or_else(|| panic!("{name} has no row in ARCHITECTURE.md"))
    };
    for (name, uses) in &arrows() {
        for used in uses {
            assert!(row_of(name) < row_of(used), "{name} uses {used}");
        }
        let readme = root().join("crates").join(name).join("README.md");
        assert!(readme.exists(), "{}", readme.display());
    }
}

/// What runs networks must build without what trains them.
#[test]
fn running_needs_no_training_framework() {
    let arrows = arrows();
    for name in [
        "deepfusion-runtime",
        "deepfusion-eval",
        "deepfusion-perception",
        "deepfusion-view",
    ] {
        let mut all = BTreeSet::new();
        reached(&arrows, name, &mut all);
        for used in all.into_iter().chain([name]) {
            let path = root().join("crates").join(used).join("Cargo.toml");
            let manifest: toml::Table = fs::read_to_string(path).unwrap().parse().unwrap();
            let uses = manifest.get("dependencies").and_then(toml::Value::as_table);
            let has_burn = uses.is_some_and(|uses| uses.contains_key("burn"));
            assert!(!has_burn, "{name} reaches Burn by {used}");
        }
    }
}
