//! The crates and their dependencies, as in ARCHITECTURE.md and its graph; options in libraries' texts; paths and links in documents.
//! `UPDATE_REFERENCE=1` redraws the graph.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};

type Arrows = BTreeMap<String, BTreeSet<String>>;

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..")
}

/// The workspace's crates that a manifest names, except for tests and benches.
fn uses(manifest: &Path) -> BTreeSet<String> {
    let manifest: toml::Table = fs::read_to_string(manifest).unwrap().parse().unwrap();
    let uses = manifest.get("dependencies").and_then(toml::Value::as_table);
    let uses = uses.into_iter().flat_map(toml::Table::keys);
    uses.filter(|used| used.starts_with("deepfusion"))
        .cloned()
        .collect()
}

/// The crates of the workspace that each of them uses.
fn arrows() -> Arrows {
    let mut arrows = Arrows::new();
    for entry in fs::read_dir(root().join("crates")).unwrap() {
        let folder = entry.unwrap().path();
        let name = folder.file_name().unwrap().to_str().unwrap().to_owned();
        arrows.insert(name, uses(&folder.join("Cargo.toml")));
    }
    arrows
}

/// As [`arrows`], with the Python package, which is beside the crates.
fn arrows_with_python() -> Arrows {
    let mut arrows = arrows();
    arrows.insert("python".to_owned(), uses(&root().join("python/Cargo.toml")));
    arrows
}

/// All crates that a crate uses, directly or not.
fn reached<'a>(arrows: &'a Arrows, from: &str, seen: &mut BTreeSet<&'a str>) {
    for used in &arrows[from] {
        if seen.insert(used) {
            reached(arrows, used, seen);
        }
    }
}

/// The graph as a drawing, without arrows that follow from others.
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
fn the_drawing_is_up_to_date() {
    let page = root().join("docs/reference/crates.md");
    let expected = format!(
        "# The crates\n\nWhat each crate uses, without the arrows that follow from others. Drawn from the crates' manifests by\n\n\
         ```\nUPDATE_REFERENCE=1 cargo test --workspace --test cli architecture\n```\n\n```mermaid\n{}```\n",
        drawing(&arrows_with_python())
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
        .map(|row| row.trim_end_matches('/'))
        .collect();
    let row_of = |name: &str| {
        let row = rows.iter().position(|row| *row == name);
        row.unwrap_or_else(|| panic!("{name} has no row in ARCHITECTURE.md"))
    };
    for (name, uses) in &arrows_with_python() {
        for used in uses {
            assert!(row_of(name) < row_of(used), "{name} uses {used}");
        }
        let above = if name == "python" {
            root()
        } else {
            root().join("crates")
        };
        let readme = above.join(name).join("README.md");
        assert!(readme.exists(), "{}", readme.display());
    }
}

/// A crate's tests are one binary; a file missing from its `main.rs` would never run.
#[test]
fn every_file_of_tests_is_part_of_a_binary() {
    for name in arrows().into_keys() {
        let folder = root().join("crates").join(name).join("tests");
        let Ok(main) = fs::read_to_string(folder.join("main.rs")) else {
            continue;
        };
        let manifest = fs::read_to_string(folder.join("../Cargo.toml")).unwrap();
        for file in fs::read_dir(&folder).unwrap() {
            let path = file.unwrap().path();
            let stem = path.file_stem().unwrap().to_str().unwrap();
            if path.extension().is_some_and(|ending| ending == "rs") && stem != "main" {
                let own = manifest.contains(&format!("[[test]]\nname = \"{stem}\""));
                let part = main.contains(&format!("mod {stem};"));
                assert!(own || part, "{}", path.display());
            }
        }
    }
}

/// The crates that run networks must build without the training framework.
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

/// Files below a folder, except for build outputs.
fn files_below(folder: &Path, found: &mut Vec<PathBuf>) {
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if !path.is_dir() {
            found.push(path);
        } else if !path.ends_with("target") && !path.ends_with(".git") {
            files_below(&path, found);
        }
    }
}

/// The string literals of a source file, without its comments and the tests at its end.
fn literals(source: &str) -> Vec<&str> {
    let source = source.split("#[cfg(test)]\nmod ").next().unwrap();
    let mut found = Vec::new();
    let mut at = 0;
    while let Some(length) = source[at..].find(['"', '\'', '/', 'r']) {
        let rest = &source[at + length..];
        let raw = rest.strip_prefix('r').unwrap_or_default();
        let hashes = raw.len() - raw.trim_start_matches('#').len();
        let (begin, ends) = if rest.starts_with("//") {
            (0, rest.find('\n'))
        } else if raw[hashes..].starts_with('"') {
            let end = format!("\"{}", &raw[..hashes]);
            let begin = hashes + 2;
            (begin, rest[begin..].find(&end).map(|n| begin + n))
        } else if let Some(text) = rest.strip_prefix('"') {
            let mut escaped = false;
            let end = text.find(|c| {
                let ends = c == '"' && !escaped;
                escaped = c == '\\' && !escaped;
                ends
            });
            (1, end.map(|n| n + 1))
        } else if rest.starts_with("'\"'") || rest.starts_with("'\\") {
            // A quote, or an escaped character: at most `'\''`.
            (0, Some(2))
        } else {
            (0, Some(0))
        };
        let end = ends.unwrap_or(rest.len());
        if begin > 0 {
            found.push(&rest[begin..end]);
        }
        at = source.len().min(at + length + end + 1);
    }
    found
}

#[test]
fn literals_are_found_beside_comments_characters_and_tests() {
    let source = "// \"no\"\nlet a = \"one \\\" more\"; let b = '\"'; let c = '\\''; r\"two\"; r#\"thr\"ee\"#;\n#[cfg(test)]\nmod tests { \"no\" }";
    assert_eq!(literals(source), ["one \\\" more", "two", "thr\"ee"]);
}

/// A library names settings and files in texts and comments; only the command line (`failure/`) names the option that sets one.
#[test]
fn libraries_name_no_options() {
    // Options of other programs.
    let allowed = [
        "v4l2-ctl --list-devices",
        "ros2 bag record --compression-mode",
    ];
    let mut wrong = Vec::new();
    for name in arrows().keys().filter(|name| *name != "deepfusion-cli") {
        let mut files = Vec::new();
        files_below(&root().join("crates").join(name).join("src"), &mut files);
        files.retain(|file| file.extension().is_some_and(|e| e == "rs"));
        for file in files {
            let source = fs::read_to_string(&file).unwrap();
            let lines = source.lines().map(str::trim_start);
            let comments = lines.filter(|line| line.starts_with("//"));
            for passage in literals(&source).into_iter().chain(comments) {
                let mut text = format!(" {}", passage.replace(['`', '('], " "));
                for known in allowed {
                    text = text.replace(&known.replace('`', " "), "");
                }
                let mut after = text.split(" --").skip(1);
                if after.any(|option| option.starts_with(|c: char| c.is_ascii_lowercase())) {
                    wrong.push(format!("{}: {passage}", file.display()));
                }
            }
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

/// Paths that documents name exist in the repository: from its root, or as the end of a source file's path.
#[test]
fn paths_in_documents_exist() {
    let root = root().canonicalize().unwrap();
    let mut all = Vec::new();
    let folders = [
        ".ci", ".github", "benches", "crates", "docs", "fuzz", "python", "recipes", "scripts",
    ];
    for folder in folders {
        files_below(&root.join(folder), &mut all);
    }
    let of_repository = all
        .iter()
        .filter(|file| file.extension().is_some_and(|e| e == "md"));
    let pages = ["README.md", "ARCHITECTURE.md", "CONTRIBUTING.md"].map(|page| root.join(page));
    let mut wrong = Vec::new();
    for page in of_repository.chain(&pages) {
        let text = fs::read_to_string(page).unwrap();
        let mut code = false;
        for line in text.lines() {
            if line.starts_with("```") {
                code = !code;
            }
            let quoted = line.split('`').skip(1).step_by(2);
            let is_path = |c: char| c.is_ascii_alphanumeric() || "._-/".contains(c);
            for path in
                quoted.filter(|word| !code && word.contains('/') && word.chars().all(is_path))
            {
                let first = path.split('/').next().unwrap();
                let is_source = [".rs", ".py", ".sh"].iter().any(|end| path.ends_with(end));
                let exists = if folders.contains(&first) {
                    root.join(path).exists()
                } else {
                    !is_source || all.iter().any(|file| file.ends_with(path))
                };
                if !exists {
                    wrong.push(format!("{}: {path}", page.display()));
                }
            }
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

/// The heading's anchor as GitHub makes it: lower-case letters, digits, dashes and underscores, spaces as dashes.
fn anchor(heading: &str) -> String {
    let heading = heading.trim_start_matches('#').trim().to_lowercase();
    let kept = heading.chars().filter_map(|c| match c {
        ' ' => Some('-'),
        c if c.is_alphanumeric() || c == '-' || c == '_' => Some(c),
        _ => None,
    });
    kept.collect()
}

/// Links between documents lead to an existing file and heading.
#[test]
fn links_in_documents_lead_somewhere() {
    let root = root().canonicalize().unwrap();
    let mut pages = Vec::new();
    files_below(&root.join("docs"), &mut pages);
    pages.retain(|file| file.extension().is_some_and(|e| e == "md"));
    pages.extend(
        [
            "README.md",
            "ARCHITECTURE.md",
            "CONTRIBUTING.md",
            "CHANGELOG.md",
        ]
        .map(|p| root.join(p)),
    );
    let anchors_of = |page: &Path| -> Vec<String> {
        let text = fs::read_to_string(page).unwrap();
        let mut code = false;
        let mut anchors = Vec::new();
        for line in text.lines() {
            code ^= line.starts_with("```");
            if line.starts_with('#') && !code {
                anchors.push(anchor(line));
            }
        }
        anchors
    };
    let (mut wrong, mut found) = (Vec::new(), 0);
    for page in &pages {
        let text = fs::read_to_string(page).unwrap();
        for link in text.split("](").skip(1) {
            let link = link.split(')').next().unwrap();
            if link.contains("://") || link.starts_with("mailto:") {
                continue;
            }
            let (path, heading) = link.split_once('#').unwrap_or((link, ""));
            let target = match path {
                "" => page.clone(),
                path => page.parent().unwrap().join(path),
            };
            found += 1;
            let is_there = target.exists()
                && (heading.is_empty() || anchors_of(&target).iter().any(|a| a == heading));
            if !is_there {
                wrong.push(format!("{}: {link}", page.display()));
            }
        }
    }
    assert!(found > 200, "{found} links");
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}
