//! What SQLite says of a database, and what is wrong with a packed message of one.

use crate::storage::{COPY_AGAIN, MOST_BYTES};
use rusqlite::ErrorCode;
use std::io;

/// Why a message that was compressed by itself cannot be unpacked.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum PackedProblem {
    /// It is larger than a message may be.
    #[error("{MOST_BYTES} bytes or more unpacked")]
    TooLarge,
    /// No decoder can be set up.
    #[error("{0}")]
    Decoder(#[source] io::Error),
    /// Its bytes are damaged.
    #[error("cannot be unpacked: {0}")]
    Unpack(#[source] io::Error),
}

/// What an error of SQLite's means for a bag.
pub(super) fn said(e: &rusqlite::Error) -> String {
    match e.sqlite_error_code() {
        Some(ErrorCode::NotADatabase) => "not an SQLite database".to_owned(),
        Some(ErrorCode::DatabaseCorrupt) => format!("the database is damaged: {e}"),
        Some(ErrorCode::ReadOnly | ErrorCode::CannotOpen) => format!("cannot be opened: {e}"),
        None | Some(ErrorCode::Unknown) => format!("no recorder's database: {e}"),
        _ => e.to_string(),
    }
}

/// What to do about it.
pub(super) fn remedy(e: &rusqlite::Error) -> &'static str {
    match e.sqlite_error_code() {
        Some(ErrorCode::NotADatabase) => "give the recording's own .db3 file",
        Some(ErrorCode::DatabaseCorrupt) => "copy the file again",
        Some(ErrorCode::ReadOnly | ErrorCode::CannotOpen) => {
            "its recorder was stopped: copy the file with its -wal or -journal to where it can be written, and open it \
             once with sqlite3"
        }
        None | Some(ErrorCode::Unknown) => {
            "a bag has the tables `topics` and `messages`, as rosbag2 writes them"
        }
        _ => COPY_AGAIN,
    }
}
