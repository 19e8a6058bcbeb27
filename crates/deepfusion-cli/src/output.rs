//! Data goes to stdout, warnings to stderr, runs to `runs/<command>-<time>`.

use std::io::{ErrorKind, Write};
use std::path::{Path, PathBuf};

use crate::failure::{Context, Result};
use deepfusion_fs::create_unused;
pub(crate) use deepfusion_jobs::dates::now;
pub(crate) use deepfusion_jobs::name_of;

/// Warnings of all crates on stderr.
pub(crate) fn init_logging() {
    tracing_subscriber::fmt()
        .with_max_level(tracing_subscriber::filter::LevelFilter::WARN)
        .with_writer(std::io::stderr)
        .with_ansi(colours_on_stderr())
        .without_time()
        // Otherwise a warning on a closed stderr would end the program.
        .log_internal_errors(false)
        .with_target(false)
        .init();
}

/// Whether stderr is a terminal that shows colours (`NO_COLOR` is honoured).
fn colours_on_stderr() -> bool {
    anstream::AutoStream::choice(&std::io::stderr()) != anstream::ColorChoice::Never
}

/// Prints data on stdout. It is no failure if the reader has closed the pipe (`… | head`).
pub(crate) fn print(text: &str) -> Result<()> {
    let mut out = std::io::stdout().lock();
    match out.write_all(text.as_bytes()).and_then(|()| out.flush()) {
        Err(error) if error.kind() != ErrorKind::BrokenPipe => {
            Err(error).context("cannot write to stdout")
        }
        _ => Ok(()),
    }
}

/// Prints a value as JSON on stdout.
pub(crate) fn print_json<T: serde::Serialize + ?Sized>(value: &T) -> Result<()> {
    let text =
        serde_json::to_string_pretty(value).context("the result cannot be written as JSON")?;
    print(&format!("{text}\n"))
}

/// Writes a file, whole or not at all.
pub(crate) fn write(path: &Path, bytes: impl AsRef<[u8]>) -> Result<()> {
    let written = deepfusion_fs::write(path, bytes);
    Ok(written.map_err(|e| deepfusion_data::Error::file(path, e))?)
}

/// Creates a folder for outputs if it does not exist.
pub(crate) fn make_folder(folder: &Path) -> Result<()> {
    if folder.is_file() {
        let path = folder.to_owned();
        return Err(crate::error::CliError::NotAFolder { path }.into());
    }
    let failed = |e| deepfusion_data::Error::file(folder, e);
    Ok(std::fs::create_dir_all(folder).map_err(failed)?)
}

/// The folder a command writes to: the one asked for, or a new `runs/<command>-<time>`. It is created; a folder that is not empty
/// is refused.
pub(crate) fn run_folder(asked: Option<&Path>, command: &str) -> Result<PathBuf> {
    let Some(folder) = asked else {
        return new_run_folder(Path::new("runs"), command);
    };
    let folder = folder.to_owned();
    let failed = |e| deepfusion_data::Error::file(&folder, e);
    std::fs::create_dir_all(&folder).map_err(failed)?;
    if std::fs::read_dir(&folder).map_err(failed)?.next().is_some() {
        return Err(crate::error::CliError::Exists {
            path: folder,
            hint: "choose another folder, or empty this one first",
        }
        .into());
    }
    Ok(folder)
}

/// Fails if a run could not be written to the folder asked for: an error before long work, not after it. Leaves no folder that did not
/// exist before.
#[cfg(feature = "train")]
pub(crate) fn require_run_folder(asked: &Path) -> Result<()> {
    let made = !asked.exists();
    let folder = run_folder(Some(asked), "")?;
    let probe = deepfusion_fs::Partial::beside(&folder.join("config.toml"));
    let written = probe.create();
    // Removes the probe, so that the folder is empty again.
    drop(probe);
    if made {
        // The run creates it again, and reports then what prevents that.
        let _ = std::fs::remove_dir(&folder);
    }
    written.map_err(|e| deepfusion_data::Error::file(&folder, e))?;
    Ok(())
}

/// A new folder named by the command and the time. Two commands that start at once get different folders.
fn new_run_folder(runs: &Path, command: &str) -> Result<PathBuf> {
    make_folder(runs)?;
    let folder = runs.join(format!("{command}-{}", now()));
    let made = create_unused(&folder);
    Ok(made.map_err(|e| deepfusion_data::Error::file(&folder, e))?)
}

/// Fails if the file exists and may not be replaced, or if its folder does not exist: an error before long work, not after it.
pub(crate) fn require_new(file: &Path, overwrite: bool) -> Result<()> {
    if file.exists() && (!overwrite || file.is_dir()) {
        return Err(crate::error::CliError::Exists {
            path: file.to_owned(),
            hint: "choose another name, or give --overwrite to replace a file",
        }
        .into());
    }
    require_folder_of(file)
}

/// Fails if the folder of a file does not exist.
fn require_folder_of(file: &Path) -> Result<()> {
    match file.parent() {
        Some(folder) if folder != Path::new("") && !folder.is_dir() => {
            let missing = std::io::Error::from(ErrorKind::NotFound);
            Err(deepfusion_data::Error::file(folder, missing).into())
        }
        _ => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nothing_is_overwritten() {
        let folder = tempfile::tempdir().unwrap();
        let run = folder.path().join("run");
        assert_eq!(run_folder(Some(&run), "demo").unwrap(), run);
        assert_eq!(
            run_folder(Some(&run), "demo").unwrap(),
            run,
            "an empty folder may be used"
        );
        std::fs::write(run.join("file"), "x").unwrap();
        assert!(run_folder(Some(&run), "demo").is_err());
    }

    #[cfg(feature = "train")]
    #[test]
    fn a_run_is_refused_before_it_starts() {
        let folder = tempfile::tempdir().unwrap();
        let run = folder.path().join("runs/run");
        require_run_folder(&run).unwrap();
        assert!(!run.exists());
        std::fs::create_dir(&run).unwrap();
        require_run_folder(&run).unwrap();
        assert_eq!(std::fs::read_dir(&run).unwrap().count(), 0);
        std::fs::write(run.join("file"), "x").unwrap();
        assert!(require_run_folder(&run).is_err());
    }

    /// Skipped for a user who may write everywhere.
    #[cfg(all(unix, feature = "train"))]
    #[test]
    fn a_folder_that_cannot_be_written_to_is_refused() {
        use std::os::unix::fs::PermissionsExt;

        let folder = tempfile::tempdir().unwrap();
        let run = folder.path().join("run");
        std::fs::create_dir(&run).unwrap();
        std::fs::set_permissions(&run, std::fs::Permissions::from_mode(0o555)).unwrap();
        let refused = require_run_folder(&run).map_err(|error| error.to_string());
        if std::fs::write(run.join("file"), "x").is_ok() {
            eprintln!("skipped: this user may write everywhere");
            return;
        }
        assert!(refused.unwrap_err().contains("run"));
    }

    #[test]
    fn two_commands_that_start_at_once_have_a_folder_each() {
        let folder = tempfile::tempdir().unwrap();
        let runs = folder.path().join("runs");
        let first = new_run_folder(&runs, "train").unwrap();
        let second = new_run_folder(&runs, "train").unwrap();
        assert!(first != second && first.is_dir() && second.is_dir());
        assert_eq!(second.parent(), Some(runs.as_path()));
    }
}
