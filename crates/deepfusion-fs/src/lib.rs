//! Files that are whole or not there, whatever ends the program or the machine's power.
//!
//! Everything that the program writes goes through here: [`write`] and [`write_atomically`] for a file that counts as done
//! once it is there, [`write_unsynced`] for one of many that something written later calls done, [`publish_all`] for many that are to be done
//! at once, and [`Partial`] for a writer that wants a path. [`publish_folder`] does the same for a whole folder. [`Content`] says whether a file still is what was written.

mod content;
mod partial;
mod sync;

pub use content::Content;
pub use partial::{Partial, publish_all, write, write_aside, write_atomically, write_unsynced};
pub use sync::{publish, publish_folder, sync_files, sync_folder, sync_tree};
