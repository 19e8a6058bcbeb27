//! Messages for SQLite's errors about a database.

use crate::storage::COPY_AGAIN;
use rusqlite::ErrorCode;

/// What an error of SQLite's means for a bag.
pub(super) fn message(e: &rusqlite::Error) -> String {
    match e.sqlite_error_code() {
        Some(ErrorCode::NotADatabase) => "not an SQLite database".to_owned(),
        Some(ErrorCode::DatabaseCorrupt) => format!("the database is damaged: {e}"),
        Some(ErrorCode::ReadOnly | ErrorCode::CannotOpen) => format!("cannot be opened: {e}"),
        None | Some(ErrorCode::Unknown) => format!("not a recorder's database: {e}"),
        _ => e.to_string(),
    }
}

/// What to do about it.
pub(super) fn hint(e: &rusqlite::Error) -> &'static str {
    match e.sqlite_error_code() {
        Some(ErrorCode::NotADatabase) => "give the recording's own .db3 file",
        Some(ErrorCode::DatabaseCorrupt) => "copy the file again",
        Some(ErrorCode::ReadOnly | ErrorCode::CannotOpen) => {
            "its recorder was stopped: copy the file with its -wal or -journal to where it can be written, and open it \
             once with sqlite3"
        }
        None | Some(ErrorCode::Unknown) => {
            "give a database written by rosbag2, with the tables `topics` and `messages`"
        }
        _ => COPY_AGAIN,
    }
}
