//! Atomic file writes: a file is complete or absent, even after a crash or a power cut.
//!
//! Everything that the program writes goes through here: [`write_atomically`] for a file that is complete once it exists,
//! [`write_unsynced`] for one of many files whose completion is marked by a later one, [`publish_all`] for many files at once,
//! and [`Partial`] for a writer that needs a path. [`publish_folder`] does the same for a whole folder. [`Content`] checks that a
//! file still is what was written.

mod content;
mod partial;
mod sync;

pub use content::Content;
pub use partial::{Partial, publish_all, write_aside, write_atomically, write_unsynced};
pub use sync::{publish, publish_folder, sync_files, sync_folder, sync_tree};
