//! Atomic writes: a file or folder is complete or absent, even after a crash or a power cut. Also the order of names with numbers in them,
//! and [`FileError`]: why a file could not be used.

mod content;
mod file_error;
mod folder_lock;
mod in_the_way;
mod machine;
mod made_folders;
mod names;
mod order;
mod partial;
mod partial_folder;
mod sync;

pub use content::Content;
pub use file_error::FileError;
pub use folder_lock::FolderLock;
pub use in_the_way::{InTheWay, Unfinished, in_the_way};
pub use names::{absolute, create_unused, moved_path, unused};
pub use order::natural_order;
pub use partial::{Partial, publish_all, write, write_aside, write_atomically, write_unsynced};
pub use partial_folder::PartialFolder;
pub use sync::{publish, publish_folder, sync_files, sync_folder};
