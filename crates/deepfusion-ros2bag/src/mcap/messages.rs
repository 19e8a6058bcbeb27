//! A file's messages in time order, chunk by chunk.

use super::chunk::{self, ChunkProblem, Content, Entry};
use super::{ChunkInfo, McapFile};
use crate::packed::{is_packed, unpack};
use crate::problem::StorageProblem;
use deepfusion_rosbag::{Error, Message, Result, Selection, Serialization, Time};
use std::cmp::Reverse;
use std::collections::{BinaryHeap, VecDeque, binary_heap::PeekMut};
use std::sync::Arc;

/// Memory: a chunk is decompressed shortly before its first message and released after its last; each open chunk takes 40
/// bytes a message.
pub(super) struct Messages<'a> {
    file: &'a McapFile,
    wanted: Vec<bool>,
    selection: Selection,
    /// Chunks not open yet, by their first message's time.
    waiting: VecDeque<&'a ChunkInfo>,
    /// Open chunks, the one with the next message first.
    open: BinaryHeap<Reverse<OpenChunk<'a>>>,
    errors: VecDeque<Error>,
}

/// A chunk with messages left; ordered by the next of them, then by its position in the file.
struct OpenChunk<'a> {
    next: (Time, usize),
    entries: std::vec::IntoIter<Entry>,
    content: Content<'a>,
}

impl<'a> Messages<'a> {
    pub(super) fn new(file: &'a McapFile, wanted: Vec<bool>, selection: &Selection) -> Self {
        let index = &file.index;
        let is_wanted = |channel: &u16| index.places.get(channel).is_some_and(|p| wanted[*p]);
        let chunks = index.chunks.iter().filter(|info| {
            let holds = info.channels.as_ref();
            selection.overlaps(info.first, info.last)
                && holds.is_none_or(|channels| channels.iter().any(is_wanted))
        });
        let mut waiting: Vec<&ChunkInfo> = chunks.collect();
        waiting.sort_by_key(|info| (info.first, info.from));
        let loose = within(&index.loose, selection).filter(|e| is_wanted(&e.channel));
        let loose: Vec<Entry> = loose.cloned().collect();
        let mut messages = Self {
            file,
            wanted,
            selection: selection.clone(),
            waiting: waiting.into(),
            open: BinaryHeap::new(),
            errors: VecDeque::new(),
        };
        messages.push(Content::Stored(file.bytes()), loose, 0);
        messages
    }

    /// Opens the chunks that may have the next message.
    fn advance(&mut self) {
        while self.errors.is_empty() {
            let next = self.open.peek().map(|Reverse(chunk)| chunk.next.0);
            let first = self.waiting.front().map(|info| info.first);
            match (first, next) {
                (None, _) => return,
                (Some(first), Some(next)) if first > next => return,
                _ => {
                    if let Some(info) = self.waiting.pop_front() {
                        self.open_chunk(info);
                    }
                }
            }
        }
    }

    fn open_chunk(&mut self, info: &'a ChunkInfo) {
        let (content, problem) = chunk::open(&self.file.bytes()[info.from..info.to]);
        let walk = chunk::walk(content.bytes());
        // What is wrong with a scanned chunk was reported by the scan.
        if let Some(problem) = problem.or(walk.broken).filter(|_| !info.scanned) {
            return self.fail(info, problem);
        }
        let mut entries = walk.messages;
        if let Some(early) = entries.iter().find(|e| e.time < info.first) {
            // It comes too late to keep the order.
            let (time, first) = (early.time, info.first);
            return self.fail(info, ChunkProblem::Early { time, first });
        }
        let places = &self.file.index.places;
        let wanted = |channel: &u16| places.get(channel).is_some_and(|p| self.wanted[*p]);
        entries.retain(|e| wanted(&e.channel) && self.selection.contains(e.time));
        entries.sort_by_key(|e| (e.time, e.range.start));
        self.push(content, entries, info.from);
    }

    fn push(&mut self, content: Content<'a>, entries: Vec<Entry>, place: usize) {
        if let Some(first) = entries.first() {
            self.open.push(Reverse(OpenChunk {
                next: (first.time, place),
                entries: entries.into_iter(),
                content,
            }));
        }
    }

    fn fail(&mut self, info: &ChunkInfo, problem: ChunkProblem) {
        let at = info.from;
        let problem = StorageProblem::Chunk { at, problem };
        self.errors.push_back(problem.of(&self.file.path));
    }
}

/// The messages, in time order, within the times of a selection. Often one image of many is requested, so the others are not visited.
fn within<'a>(ordered: &'a [Entry], selection: &Selection) -> impl Iterator<Item = &'a Entry> {
    let from = ordered.partition_point(|entry| entry.time < selection.start());
    let rest = ordered[from..].iter();
    rest.take_while(move |entry| selection.contains(entry.time))
}

impl<'a> Iterator for Messages<'a> {
    type Item = Result<Message<'a>>;

    fn next(&mut self) -> Option<Self::Item> {
        self.advance();
        if let Some(error) = self.errors.pop_front() {
            return Some(Err(error));
        }
        let mut top = self.open.peek_mut()?;
        let Reverse(chunk) = &mut *top;
        let entry = chunk.entries.next()?;
        let index = &self.file.index;
        let channel = &index.channels[*index.places.get(&entry.channel)?];
        let (path, connection) = (&*self.file.path, &channel.connection);
        let stored = &chunk.content.bytes()[entry.range.clone()];
        let message = match &chunk.content {
            _ if channel.serialization == Serialization::Cdr && is_packed(stored) => {
                let unpacked = unpack(stored).map(|bytes| {
                    let range = 0..bytes.len();
                    let bytes = Arc::new(bytes);
                    Message::held(
                        path,
                        connection,
                        entry.time,
                        channel.serialization,
                        bytes,
                        range,
                    )
                });
                unpacked.map_err(|problem| {
                    let (topic, time) = (connection.topic.clone(), entry.time);
                    let problem = StorageProblem::PackedMessage {
                        topic,
                        time,
                        problem,
                    };
                    problem.of(path)
                })
            }
            Content::Stored(bytes) => Ok(Message::stored(
                path,
                connection,
                entry.time,
                channel.serialization,
                &bytes[entry.range],
            )),
            Content::Unpacked(bytes) => Ok(Message::held(
                path,
                connection,
                entry.time,
                channel.serialization,
                Arc::clone(bytes),
                entry.range,
            )),
        };
        match chunk.entries.as_slice().first() {
            Some(following) => chunk.next.0 = following.time,
            None => drop(PeekMut::pop(top)),
        }
        Some(message)
    }
}

impl Ord for OpenChunk<'_> {
    fn cmp(&self, other: &Self) -> std::cmp::Ordering {
        self.next.cmp(&other.next)
    }
}

impl PartialOrd for OpenChunk<'_> {
    fn partial_cmp(&self, other: &Self) -> Option<std::cmp::Ordering> {
        Some(self.cmp(other))
    }
}

impl PartialEq for OpenChunk<'_> {
    fn eq(&self, other: &Self) -> bool {
        self.next == other.next
    }
}

impl Eq for OpenChunk<'_> {}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_time_range_selects_the_messages_within_it() {
        let entry = |(place, ns): (usize, u64)| Entry {
            time: Time::from_nanos(ns),
            channel: 0,
            range: place..place + 1,
        };
        let times = [1, 2, 2, 3, 5, 5, 8].into_iter().enumerate();
        let ordered: Vec<Entry> = times.map(entry).collect();
        for (from, until) in [
            (0, 9),
            (2, 3),
            (2, 2),
            (3, 5),
            (4, 5),
            (5, 6),
            (8, 9),
            (9, 20),
        ] {
            let selection = Selection::all()
                .from(Time::from_nanos(from))
                .until(Time::from_nanos(until));
            let found = within(&ordered, &selection).map(|e| e.range.start);
            let contained = ordered.iter().filter(|e| selection.contains(e.time));
            let expected: Vec<usize> = contained.map(|e| e.range.start).collect();
            assert_eq!(found.collect::<Vec<_>>(), expected, "{from} to {until}");
        }
        assert_eq!(within(&ordered, &Selection::all()).count(), ordered.len());
    }
}
