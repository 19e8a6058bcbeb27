//! Folders that may contain an ONNX Runtime library. They are only listed: no program is started.

use std::collections::HashSet;
use std::env;
use std::path::{Path, PathBuf};

/// Folders that exist, in the order in which they are searched.
pub(super) fn folders() -> Vec<PathBuf> {
    let mut all = Vec::new();
    if let Some(folder) = env::current_exe().ok().as_deref().and_then(Path::parent) {
        all.push(folder.to_owned());
        all.push(folder.join("../lib"));
    }
    all.extend(
        [
            "/usr/local/lib",
            "/usr/local/lib64",
            "/usr/lib",
            "/usr/lib64",
            "/usr/lib/x86_64-linux-gnu",
            "/usr/lib/aarch64-linux-gnu",
            "/opt/onnxruntime/lib",
            "/opt/homebrew/lib",
        ]
        .map(PathBuf::from),
    );
    for prefix in python_prefixes() {
        all.extend(wheel_folders(&prefix));
    }
    let mut seen = HashSet::new();
    all.retain(|folder| folder.is_dir() && seen.insert(folder.clone()));
    all
}

/// Libraries in a folder, the newest version first, according to their names.
pub(super) fn libraries_in(folder: &Path) -> Vec<PathBuf> {
    let mut files: Vec<PathBuf> = entries(folder)
        .filter(|path| {
            path.file_name()
                .and_then(|n| n.to_str())
                .is_some_and(is_library)
        })
        .collect();
    files.sort_by_key(|path| std::cmp::Reverse(numbers(path)));
    files
}

/// `libonnxruntime.so`, `libonnxruntime.so.1.31.1`, `libonnxruntime.1.31.1.dylib`, `onnxruntime.dll`; but not the
/// libraries of its providers in the same folder.
fn is_library(name: &str) -> bool {
    let digits = |text: &str| text.chars().all(|c| c.is_ascii_digit() || c == '.');
    if cfg!(windows) {
        return name.eq_ignore_ascii_case("onnxruntime.dll");
    }
    let Some(rest) = name.strip_prefix("libonnxruntime.") else {
        return false;
    };
    if cfg!(target_os = "macos") {
        rest.strip_suffix("dylib").is_some_and(digits)
    } else {
        rest.strip_prefix("so").is_some_and(digits)
    }
}

/// The numbers in a file's name: 1.9 comes before 1.31.
fn numbers(path: &Path) -> Vec<u32> {
    let name = path.file_name().map(|n| n.to_string_lossy().into_owned());
    let name = name.unwrap_or_default();
    name.split(|c: char| !c.is_ascii_digit())
        .filter_map(|number| number.parse().ok())
        .collect()
}

/// Folders in which Python is installed: the active environment, those whose `python` is on `PATH`, the
/// targets of their links, and the user's own.
fn python_prefixes() -> Vec<PathBuf> {
    let named = ["VIRTUAL_ENV", "CONDA_PREFIX"].into_iter();
    let mut prefixes: Vec<PathBuf> = named.filter_map(env::var_os).map(PathBuf::from).collect();
    let path = env::var_os("PATH").unwrap_or_default();
    for folder in env::split_paths(&path) {
        for name in ["python3", "python", "python.exe"] {
            let program = folder.join(name);
            if !program.is_file() {
                continue;
            }
            // On Windows `python.exe` is in the prefix itself, elsewhere in its `bin`.
            let prefix = |program: &Path| {
                let folder = program.parent()?;
                let folder = if cfg!(windows) {
                    folder
                } else {
                    folder.parent()?
                };
                Some(folder.to_owned())
            };
            prefixes.extend(prefix(&program));
            prefixes.extend(program.canonicalize().ok().as_deref().and_then(prefix));
        }
    }
    let home = env::home_dir();
    prefixes.extend(home.map(|home| home.join(".local")));
    prefixes
}

/// Where `pip install onnxruntime` puts its library under a prefix.
fn wheel_folders(prefix: &Path) -> Vec<PathBuf> {
    let mut packages = vec![prefix.join("Lib/site-packages")];
    for lib in ["lib", "lib64"] {
        for python in entries(&prefix.join(lib)) {
            let name = python.file_name().and_then(|n| n.to_str());
            if name.is_some_and(|n| n.starts_with("python")) {
                packages.push(python.join("site-packages"));
                packages.push(python.join("dist-packages"));
            }
        }
    }
    let capi = packages.iter().map(|p| p.join("onnxruntime/capi"));
    capi.filter(|folder| folder.is_dir()).collect()
}

/// The entries of a folder; none if it cannot be read.
fn entries(folder: &Path) -> impl Iterator<Item = PathBuf> + use<> {
    let entries = std::fs::read_dir(folder).into_iter().flatten();
    entries.filter_map(|entry| Some(entry.ok()?.path()))
}

#[cfg(all(test, target_os = "linux"))]
mod tests {
    use super::*;

    #[test]
    fn the_newest_library_comes_first_and_its_providers_do_not_count() {
        let folder = tempfile::tempdir().unwrap();
        for name in [
            "libonnxruntime.so.1.9.0",
            "libonnxruntime.so.1.31.1",
            "libonnxruntime.so",
            "libonnxruntime_providers_shared.so",
            "libonnxruntime.so.txt",
            "libother.so",
        ] {
            std::fs::write(folder.path().join(name), "").unwrap();
        }
        let found = libraries_in(folder.path());
        let names: Vec<_> = found
            .iter()
            .map(|p| p.file_name().unwrap().to_str().unwrap())
            .collect();
        assert_eq!(
            names,
            [
                "libonnxruntime.so.1.31.1",
                "libonnxruntime.so.1.9.0",
                "libonnxruntime.so"
            ]
        );
        assert_eq!(
            libraries_in(&folder.path().join("none")),
            [] as [PathBuf; 0]
        );
    }

    #[test]
    fn the_library_of_a_python_wheel_is_found() {
        let prefix = tempfile::tempdir().unwrap();
        let capi = prefix
            .path()
            .join("lib/python3.12/site-packages/onnxruntime/capi");
        std::fs::create_dir_all(&capi).unwrap();
        std::fs::create_dir_all(prefix.path().join("lib/python3.9/site-packages")).unwrap();
        assert_eq!(wheel_folders(prefix.path()), [capi]);
    }
}
