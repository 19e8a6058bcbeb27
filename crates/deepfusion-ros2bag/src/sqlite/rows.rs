//! Messages from rows: first their keys, some thousand at a time, then each one's bytes.

use super::{SqliteFile, failed};
use crate::packed::{is_packed, unpack};
use crate::problem::StorageProblem;
use deepfusion_rosbag::{Message, Result, Selection, Time};
use rusqlite::types::ValueRef;
use rusqlite::{Connection, params};
use std::collections::VecDeque;
use std::sync::Arc;

/// Number of rows requested at once, keys only.
const PAGE: i64 = 4096;

/// The key of a message.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Key {
    /// Time in nanoseconds.
    pub time: u64,
    pub id: i64,
    /// The topic's number; in a list, the index of its channel.
    pub topic: i64,
}

fn key(row: &rusqlite::Row<'_>) -> rusqlite::Result<Key> {
    let time: i64 = row.get(1)?;
    Ok(Key {
        id: row.get(0)?,
        time: u64::try_from(time).unwrap_or_default(),
        topic: row.get(2)?,
    })
}

/// Whether the database can order messages by time without reading all of them.
pub(super) fn is_indexed(database: &Connection) -> bool {
    let text = "SELECT count(*) FROM pragma_index_list('messages') AS list, pragma_index_info(list.name) AS info \
                WHERE info.seqno = 0 AND info.name = 'timestamp' AND list.partial = 0";
    let count: rusqlite::Result<i64> = database.query_row(text, [], |row| row.get(0));
    count.is_ok_and(|count| count > 0)
}

/// A topic's number, its number of messages, its first and last time.
pub(super) type Count = (i64, u64, (Time, Time));

/// The number of messages and the time range of each topic.
pub(super) fn counts(database: &Connection) -> rusqlite::Result<Vec<Count>> {
    let mut rows = database.prepare(
        "SELECT topic_id, count(*), min(timestamp), max(timestamp) FROM messages GROUP BY topic_id",
    )?;
    let nanos = |n: i64| Time::from_nanos(u64::try_from(n).unwrap_or_default());
    let rows = rows.query_map([], |row| {
        let count: i64 = row.get(1)?;
        let range = (nanos(row.get(2)?), nanos(row.get(3)?));
        Ok((row.get(0)?, u64::try_from(count).unwrap_or_default(), range))
    })?;
    rows.collect()
}

/// All messages up to the damage, in the order in which they were written.
pub(super) fn all(database: &Connection) -> (Vec<Key>, Option<rusqlite::Error>) {
    let mut keys = Vec::new();
    let mut read = || -> rusqlite::Result<()> {
        let mut rows = database
            .prepare("SELECT id, timestamp, topic_id FROM messages NOT INDEXED ORDER BY id")?;
        let mut rows = rows.query([])?;
        while let Some(row) = rows.next()? {
            keys.push(key(row)?);
        }
        Ok(())
    };
    let broken = read().err();
    (keys, broken)
}

/// The messages of a file in time order.
pub(super) struct Rows<'a> {
    file: &'a SqliteFile,
    wanted: Vec<bool>,
    selection: Selection,
    page: VecDeque<Key>,
    /// The last key that was requested; for a list, how far it was read.
    after: (i64, i64),
    listed: usize,
    done: bool,
}

impl<'a> Rows<'a> {
    pub(super) fn new(file: &'a SqliteFile, wanted: Vec<bool>, selection: &Selection) -> Self {
        let start = selection.start().nanos();
        let listed = file.listed.as_ref();
        Self {
            file,
            wanted,
            selection: selection.clone(),
            page: VecDeque::new(),
            after: (i64::try_from(start).unwrap_or(i64::MAX), i64::MIN),
            listed: listed.map_or(0, |keys| keys.partition_point(|key| key.time < start)),
            done: false,
        }
    }

    /// The next key that is wanted.
    fn next_key(&mut self) -> Option<Result<Key>> {
        loop {
            let key = match &self.file.listed {
                Some(keys) => {
                    let key = keys.get(self.listed).copied()?;
                    self.listed += 1;
                    key
                }
                None => match self.page.pop_front() {
                    Some(key) => key,
                    None if self.done => return None,
                    None => match self.next_page() {
                        Ok(()) => continue,
                        Err(e) => {
                            self.done = true;
                            return Some(Err(failed(&self.file.path, e)));
                        }
                    },
                },
            };
            let time = Time::from_nanos(key.time);
            if !self.selection.contains(time) {
                // In time order: after the end of the selection nothing is wanted.
                return None;
            }
            let wanted = usize::try_from(key.topic)
                .ok()
                .and_then(|p| self.wanted.get(p));
            if wanted.copied().unwrap_or_default() {
                return Some(Ok(key));
            }
        }
    }

    fn next_page(&mut self) -> rusqlite::Result<()> {
        let database = self.file.database();
        let mut rows = database.prepare_cached(
            "SELECT id, timestamp, topic_id FROM messages \
             WHERE timestamp >= ?1 AND (timestamp > ?1 OR id > ?2) ORDER BY timestamp, id LIMIT ?3",
        )?;
        // A small selection requests few rows.
        let page = match self.after.1 {
            i64::MIN => 16,
            _ => PAGE,
        };
        let mut rows = rows.query(params![self.after.0, self.after.1, page])?;
        let mut found = 0;
        while let Some(row) = rows.next()? {
            found += 1;
            let mut key = key(row)?;
            self.after = (row.get(1)?, key.id);
            if let Some(place) = self.file.places.get(&key.topic) {
                key.topic = i64::try_from(*place).unwrap_or(i64::MAX);
                self.page.push_back(key);
            }
        }
        self.done = found < page;
        Ok(())
    }

    fn message(&self, key: &Key) -> Result<Message<'a>> {
        let file = self.file;
        let channel = &file.channels[key.topic as usize];
        let bytes = bytes(&file.database(), key.id).map_err(|e| failed(&file.path, e))?;
        let bytes = if is_packed(&bytes) {
            unpack(&bytes).map_err(|problem| {
                let (topic, row) = (channel.connection.topic.clone(), key.id);
                let problem = StorageProblem::Message {
                    topic,
                    row,
                    problem,
                };
                problem.of(&file.path)
            })?
        } else {
            bytes
        };
        let range = 0..bytes.len();
        Ok(Message::held(
            &file.path,
            &channel.connection,
            Time::from_nanos(key.time),
            channel.serialization,
            Arc::new(bytes),
            range,
        ))
    }
}

fn bytes(database: &Connection, id: i64) -> rusqlite::Result<Vec<u8>> {
    let mut row = database.prepare_cached("SELECT data FROM messages WHERE id = ?1")?;
    row.query_row([id], |row| match row.get_ref(0)? {
        ValueRef::Blob(bytes) | ValueRef::Text(bytes) => Ok(bytes.to_vec()),
        other => Err(rusqlite::Error::InvalidColumnType(
            0,
            "data".to_owned(),
            other.data_type(),
        )),
    })
}

impl<'a> Iterator for Rows<'a> {
    type Item = Result<Message<'a>>;

    fn next(&mut self) -> Option<Self::Item> {
        match self.next_key()? {
            Ok(key) => Some(self.message(&key)),
            Err(error) => Some(Err(error)),
        }
    }
}
