//! Shows results in the browser: a server for one page and its data.
//!
//! A [`Folder`] is the output of `predict` or `perceive` (or a training run), refreshed as it grows; a [`Server`] serves one or
//! two of them. Files are decoded on demand and not kept: the server holds only the list of frames and a few numbers per frame.
//! The page makes pictures, cloud, boxes and the metres under the pointer from one download of a frame's depth.
//!
//! With the feature `rerun`, `write_rerun` writes a folder's frames to a file for that viewer.
//!
//! Only files in a folder's listing and pictures named by sidecars are served; no path is ever built from a request.

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

pub use deepfusion_fs::FileError;

pub use depth::{DepthCode, DepthFile};
#[cfg(feature = "rerun")]
pub use error::EncodingProblem;
pub use error::{ArrayProblem, ContentProblem, Error, FolderKind, Result};
pub use folder::{Folder, FrameProblem};
#[cfg(feature = "rerun")]
pub use rerun::{RerunReport, rerun_version, write_rerun};
pub use server::{Server, Settings};
