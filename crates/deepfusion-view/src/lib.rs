//! Results in the browser: a server of one page, and of what the page asks for.
//!
//! [`Folder`] is what `predict` and `perceive` wrote (or a training run), read anew as it grows; [`Server`] answers for one or two of
//! them. Files are decoded when they are asked for and not kept: what the server holds is the list of frames and a few numbers a frame.
//! The page makes pictures, cloud, boxes and the metres under the pointer from one download of a frame's depth.
//!
//! With the feature `rerun`, `write_rerun` writes a folder's frames to a file for that viewer.
//!
//! Only names that a folder's listing holds are served, and the pictures that sidecars name; no path is ever made from a request.

mod assets;
mod depth;
mod error;
mod folder;
mod http;
#[cfg(feature = "rerun")]
mod rerun;
mod routes;
mod server;
mod training;

pub use depth::{DepthCode, DepthFile};
pub use error::{Error, Result};
pub use folder::Folder;
#[cfg(feature = "rerun")]
pub use rerun::{RerunReport, rerun_version, write_rerun};
pub use server::{Server, Settings};
