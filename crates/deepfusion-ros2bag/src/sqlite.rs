//! SQLite files (`.db3`), in which every message is a row.

mod rows;

use crate::problem::StorageProblem;
use crate::storage::{Channel, MOST_BYTES, Storage, hull};
use deepfusion_hint::count_of;
use deepfusion_rosbag::{Error, MessageIter, Result, Selection, SourceDamage, Time};
use rows::{Key, Rows};
use rusqlite::limits::Limit;
use rusqlite::{Connection, ErrorCode, OpenFlags};
use std::collections::HashMap;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex};

/// What is wrong with a database of which only a part can be read.
#[derive(Debug, Clone, thiserror::Error)]
#[error(
    "the database is damaged ({reason}); {} {} found",
    count_of(*messages, "message"),
    if *messages == 1 { "was" } else { "were" }
)]
pub struct DatabaseDamage {
    /// SQLite's message.
    pub reason: Arc<rusqlite::Error>,
    /// Number of messages that were found nevertheless.
    pub messages: usize,
}

/// A database of messages, open for reading.
pub(crate) struct SqliteFile {
    path: PathBuf,
    /// One reader at a time: a connection cannot be shared.
    database: Mutex<Connection>,
    channels: Vec<Channel>,
    /// Maps a topic's number to its index in `channels`.
    places: HashMap<i64, usize>,
    /// All messages in time order, if the database cannot order them itself: its index is missing, or it is damaged.
    listed: Option<Vec<Key>>,
    damage: Option<Arc<rusqlite::Error>>,
}

impl SqliteFile {
    /// Opens a database; the readable part of a truncated one is read.
    ///
    /// # Errors
    /// [`Error::Storage`] for a file that is not a recorder's database.
    pub(crate) fn open(path: &Path) -> Result<Self> {
        std::fs::File::open(path).map_err(|e| Error::file(path, e))?;
        let failed = |e: rusqlite::Error| failed(path, e);
        let database = connect(path).map_err(failed)?;
        let mut file = Self {
            path: path.to_owned(),
            database: Mutex::new(database),
            channels: Vec::new(),
            places: HashMap::new(),
            listed: None,
            damage: None,
        };
        match file.read_topics() {
            Err(e) if is_damage(&e) => {
                // SQLite refuses a file that is shorter than its header claims, except in recovery mode.
                let database = file.database();
                database
                    .execute_batch("PRAGMA writable_schema = ON")
                    .map_err(failed)?;
                drop(database);
                file.damage = Some(Arc::new(e));
                file.read_topics().map_err(failed)?;
            }
            other => other.map_err(failed)?,
        }
        file.read_index()?;
        Ok(file)
    }

    fn database(&self) -> std::sync::MutexGuard<'_, Connection> {
        // A reader that panicked has not changed anything.
        self.database
            .lock()
            .unwrap_or_else(|poisoned| poisoned.into_inner())
    }

    fn read_topics(&mut self) -> rusqlite::Result<()> {
        let (mut channels, mut places) = (Vec::new(), HashMap::new());
        {
            let database = self.database();
            let mut rows =
                database.prepare("SELECT id, name, type, serialization_format FROM topics")?;
            let mut rows = rows.query([])?;
            while let Some(row) = rows.next()? {
                let (id, place): (i64, usize) = (row.get(0)?, channels.len());
                let (topic, type_name): (String, String) = (row.get(1)?, row.get(2)?);
                let encoding: String = row.get(3)?;
                let number = u32::try_from(id).unwrap_or(place as u32);
                let definition = String::new();
                let channel = Channel::new(number, topic, &type_name, &encoding, definition);
                channels.push(channel);
                places.insert(id, place);
            }
        }
        (self.channels, self.places) = (channels, places);
        Ok(())
    }

    /// Counts the messages; lists them if the database cannot order them.
    fn read_index(&mut self) -> Result<()> {
        let (keys, broken) = {
            let database = self.database();
            let ordered = self.damage.is_none() && rows::is_indexed(&database);
            if ordered {
                let counts = rows::counts(&database);
                drop(database);
                match counts {
                    Ok(counts) => {
                        for (topic, count, range) in counts {
                            if let Some(place) = self.places.get(&topic) {
                                let channel = &mut self.channels[*place];
                                channel.connection.count = count;
                                channel.range = Some(range);
                            }
                        }
                        return Ok(());
                    }
                    Err(e) if !is_damage(&e) => return Err(failed(&self.path, e)),
                    Err(e) => self.damage = Some(Arc::new(e)),
                }
                rows::all(&self.database())
            } else {
                rows::all(&database)
            }
        };
        self.damage = self.damage.take().or(broken.map(Arc::new));
        let known = keys.into_iter().filter_map(|mut key| {
            key.topic = i64::try_from(*self.places.get(&key.topic)?).ok()?;
            Some(key)
        });
        let mut keys: Vec<Key> = known.collect();
        keys.sort_by_key(|key| (key.time, key.id));
        for key in &keys {
            self.channels[key.topic as usize].add(Time::from_nanos(key.time));
        }
        self.listed = Some(keys);
        Ok(())
    }
}

/// Opens the file read-only, including what a recorder left in its journal.
fn connect(path: &Path) -> rusqlite::Result<Connection> {
    let beside = |ending: &str| {
        let mut name = path.as_os_str().to_owned();
        name.push(ending);
        Path::new(&name).exists()
    };
    let flags = OpenFlags::SQLITE_OPEN_READ_ONLY | OpenFlags::SQLITE_OPEN_NO_MUTEX;
    let database = if beside("-wal") || beside("-journal") {
        Connection::open_with_flags(path, flags)?
    } else {
        // No other process writes to it, so locks, which fail on a read-only disk, are not needed.
        match uri(path) {
            Some(uri) => Connection::open_with_flags(uri, flags | OpenFlags::SQLITE_OPEN_URI)?,
            None => Connection::open_with_flags(path, flags)?,
        }
    };
    database.set_limit(Limit::SQLITE_LIMIT_LENGTH, MOST_BYTES as i32)?;
    // A file from an untrusted source must not run code of its own: views, triggers.
    database.execute_batch("PRAGMA trusted_schema = OFF; PRAGMA query_only = ON")?;
    Ok(database)
}

/// The path as SQLite's URI for a file that does not change; `None` for a path that is not Unicode.
fn uri(path: &Path) -> Option<String> {
    let absolute = std::path::absolute(path).ok()?;
    let mut uri = String::from("file:");
    for byte in absolute.to_str()?.bytes() {
        match byte {
            b'A'..=b'Z' | b'a'..=b'z' | b'0'..=b'9' | b'/' | b'.' | b'-' | b'_' => {
                uri.push(char::from(byte));
            }
            other => uri.push_str(&format!("%{other:02X}")),
        }
    }
    uri.push_str("?immutable=1");
    Some(uri)
}

fn is_damage(e: &rusqlite::Error) -> bool {
    e.sqlite_error_code() == Some(ErrorCode::DatabaseCorrupt)
}

fn failed(path: &Path, e: rusqlite::Error) -> Error {
    StorageProblem::Sqlite(e).of(path)
}

impl Storage for SqliteFile {
    fn channels(&self) -> &[Channel] {
        &self.channels
    }

    fn range(&self) -> Option<(Time, Time)> {
        self.channels.iter().map(|c| c.range).fold(None, hull)
    }

    fn damage(&self) -> Option<SourceDamage> {
        let reason = Arc::clone(self.damage.as_ref()?);
        let messages = self.listed.as_ref().map_or(0, Vec::len);
        Some(SourceDamage::new(DatabaseDamage { reason, messages }))
    }

    fn messages<'a>(&'a self, wanted: Vec<bool>, selection: &Selection) -> MessageIter<'a> {
        Box::new(Rows::new(self, wanted, selection))
    }
}

impl std::fmt::Debug for SqliteFile {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("SqliteFile")
            .field("path", &self.path)
            .finish_non_exhaustive()
    }
}
