//! Finds the networks in a folder and generates the Rust code that embeds them. The build script and the crate share this file, so it uses
//! the standard library alone.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// The two files of a network.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Pair {
    /// Name of the network: that of the files, without extension.
    pub name: String,
    /// Path of `NAME.toml`.
    pub card: PathBuf,
    /// Path of `NAME.safetensors`.
    pub weights: PathBuf,
}

/// What is wrong with a folder of networks.
#[derive(Debug)]
pub(crate) enum ScanError {
    /// A folder or a file that cannot be read or written.
    Io {
        path: PathBuf,
        source: std::io::Error,
    },
    /// A file whose name cannot be a network's.
    Name { path: PathBuf },
    /// One of a network's two files is missing.
    Alone {
        folder: PathBuf,
        name: String,
        lacks: NetworkFile,
    },
    /// A path that `include_bytes!` cannot have.
    Path { path: PathBuf },
}

/// One of a network's two files.
#[derive(Debug, Clone, Copy)]
pub(crate) enum NetworkFile {
    Card,
    Weights,
}

impl std::fmt::Display for ScanError {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Io { path, source } => write!(f, "{}: {source}", path.display()),
            Self::Name { path } => write!(
                f,
                "{}: expected a name of letters a to z, digits and dashes that starts with a letter and is not `none`",
                path.display()
            ),
            Self::Alone {
                folder,
                name,
                lacks,
            } => {
                let [has, lacks] = match lacks {
                    NetworkFile::Card => ["safetensors", "toml"],
                    NetworkFile::Weights => ["toml", "safetensors"],
                };
                write!(
                    f,
                    "{}: {name}.{has} has no {name}.{lacks} beside it",
                    folder.display()
                )
            }
            Self::Path { path } => write!(f, "{}: not an absolute path in Unicode", path.display()),
        }
    }
}

/// Whether this is a valid network name: letters a to z, digits and dashes, starting with a letter. `none` is reserved, as it means no
/// network.
pub(crate) fn is_name(name: &str) -> bool {
    let plain = |c: char| c.is_ascii_lowercase() || c.is_ascii_digit() || c == '-';
    name.starts_with(|c: char| c.is_ascii_lowercase()) && name.chars().all(plain) && name != "none"
}

/// The networks in a folder, by name; none if the folder does not exist. Hidden files and those with other extensions are ignored.
///
/// # Errors
/// A file without its counterpart or with an invalid name, or a folder that cannot be read.
pub(crate) fn scan(folder: &Path) -> Result<Vec<Pair>, ScanError> {
    if !folder.exists() {
        return Ok(Vec::new());
    }
    let failed = |source| ScanError::Io {
        path: folder.to_owned(),
        source,
    };
    // For each name: the card, the weights.
    let mut found: BTreeMap<String, [Option<PathBuf>; 2]> = BTreeMap::new();
    for entry in std::fs::read_dir(folder).map_err(failed)? {
        let path = entry.map_err(failed)?.path();
        let ending = path.extension().and_then(|e| e.to_str());
        let half = match ending {
            Some("toml") => 0,
            Some("safetensors") => 1,
            _ => continue,
        };
        let name = path
            .file_stem()
            .unwrap_or_default()
            .to_string_lossy()
            .into_owned();
        if name.starts_with('.') {
            continue;
        }
        if !is_name(&name) {
            return Err(ScanError::Name { path });
        }
        found.entry(name).or_default()[half] = Some(path);
    }
    let pair = |(name, halves): (String, [Option<PathBuf>; 2])| match halves {
        [Some(card), Some(weights)] => Ok(Pair {
            name,
            card,
            weights,
        }),
        [card, _] => Err(ScanError::Alone {
            folder: folder.to_owned(),
            name,
            lacks: match card {
                Some(_) => NetworkFile::Weights,
                None => NetworkFile::Card,
            },
        }),
    };
    found.into_iter().map(pair).collect()
}

/// A Rust expression: `&[Embedded { … }, …]` with the content of every file.
///
/// # Errors
/// If a path is not absolute, or not Unicode, so that `include_bytes!` cannot have it.
pub(crate) fn list(pairs: &[Pair]) -> Result<String, ScanError> {
    let quoted = |path: &Path| match path.to_str() {
        Some(text) if path.is_absolute() => Ok(format!("{text:?}")),
        _ => Err(ScanError::Path {
            path: path.to_owned(),
        }),
    };
    let mut text = "&[\n".to_owned();
    for Pair {
        name,
        card,
        weights,
    } in pairs
    {
        let (card, weights) = (quoted(card)?, quoted(weights)?);
        text += &format!(
            "    Embedded {{ name: {name:?}, card: include_str!({card}), weights: include_bytes!({weights}) }},\n"
        );
    }
    text += "]\n";
    Ok(text)
}
