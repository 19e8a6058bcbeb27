//! What the targets share.

use std::path::PathBuf;

/// A folder for a target's files, in memory where the system has such a place: readers that take a path get one, and
/// a disk is not written to death.
///
/// # Panics
/// Where it cannot be made.
pub fn scratch(target: &str) -> PathBuf {
    let memory = PathBuf::from("/dev/shm");
    let base = match memory.is_dir() {
        true => memory,
        false => std::env::temp_dir(),
    };
    let folder = base.join(format!("deepfusion-fuzz-{target}-{}", std::process::id()));
    std::fs::create_dir_all(&folder).expect("a folder for the target's files");
    folder
}
