//! Runs the program as its users do.

pub(crate) mod streams;

use std::path::Path;
use std::process::Command;

use serde_json::Value;

/// The result of a run.
pub(crate) struct Run {
    /// Its exit code.
    pub code: i32,
    /// Its standard output.
    pub stdout: String,
    /// Its standard error.
    pub stderr: String,
}

/// Runs `deepfusion` in a folder.
pub(crate) fn in_folder(folder: &Path, args: &[&str]) -> Run {
    let output = Command::new(env!("CARGO_BIN_EXE_deepfusion"))
        .current_dir(folder)
        .args(args)
        .env_remove("RUST_BACKTRACE")
        .output()
        .unwrap();
    Run {
        code: output.status.code().unwrap(),
        stdout: String::from_utf8(output.stdout).unwrap(),
        stderr: String::from_utf8(output.stderr).unwrap(),
    }
}

/// As [`in_folder`], with the arguments in one line.
pub(crate) fn run(folder: &Path, args: &str) -> Run {
    in_folder(folder, &args.split_whitespace().collect::<Vec<_>>())
}

/// Whether a file is a shard's lock, which is never removed.
pub(crate) fn is_lock(name: &str) -> bool {
    name.starts_with(".predict-") && name.ends_with(".lock")
}

/// A run that must succeed.
pub(crate) fn ok(folder: &Path, args: &str) -> Run {
    let run = run(folder, args);
    assert_eq!(run.code, 0, "{args}: {}", run.stderr);
    run
}

/// The JSON output of a run that must succeed.
pub(crate) fn json(folder: &Path, args: &str) -> Value {
    serde_json::from_str(&ok(folder, args).stdout).unwrap()
}

/// A run that must fail with code 1, name every one of `names`, give a hint, and print nothing.
pub(crate) fn fails(folder: &Path, args: &str, names: &[&str]) {
    let run = run(folder, args);
    assert_eq!(run.code, 1, "{args}: {}", run.stderr);
    assert_eq!(run.stdout, "", "{args}");
    for name in names {
        assert!(
            run.stderr.contains(name),
            "{args}: no `{name}` in {}",
            run.stderr
        );
    }
    assert!(run.stderr.contains("hint: "), "{args}: {}", run.stderr);
    assert!(!run.stderr.contains("panicked"), "{args}: {}", run.stderr);
}
