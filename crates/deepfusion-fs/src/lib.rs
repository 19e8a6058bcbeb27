//! Atomic file writes: a file is complete or absent, even after a crash or a power cut.

mod content;
mod partial;
mod sync;
mod unused;

pub use content::Content;
pub use partial::{Partial, publish_all, write, write_aside, write_atomically, write_unsynced};
pub use sync::{publish, publish_folder, sync_files, sync_folder, sync_tree};
pub use unused::unused;
