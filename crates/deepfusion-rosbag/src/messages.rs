//! A bag's messages in time order, chunk by chunk.

use crate::ahead::{Ahead, Ticket};
use crate::bag::Bag;
use crate::content::Content;
use crate::entry::{self, Entry};
use crate::index::ChunkInfo;
use crate::message::{Message, Payload, Serialization};
use crate::problem::{Fault, IndexProblem};
use crate::{Error, Result, Selection, Time};
use std::cmp::Reverse;
use std::collections::{BinaryHeap, VecDeque, binary_heap::PeekMut};
use std::ops::Range;
use std::sync::Arc;

/// The messages of a [`Bag`] in a [`Selection`], in time order; with equal times, in the file's order.
///
/// An error is about one chunk or one message. The iterator continues after it, so that a caller may stop there
/// (`?`) or count and continue.
///
/// Memory: a chunk is decompressed shortly before its first message and released after its last. At any time, memory
/// holds the chunks whose times overlap, up to two chunks per thread decompressed ahead, those that the caller's messages
/// keep alive, and 16 bytes per message of each open chunk. The rest is the file's mapping, which the system can drop
/// at any time.
pub struct Messages<'bag> {
    bag: &'bag Bag,
    wanted: Vec<bool>,
    selection: Selection,
    /// Chunks not open yet, by their first message's time.
    waiting: VecDeque<Waiting<'bag>>,
    /// How many chunks at the front of `waiting` have been submitted, and how many may be. The limit grows from one, so that
    /// a request for a single message does not decompress many chunks.
    submitted: usize,
    window: usize,
    ahead: Ahead,
    /// Open chunks, the one with the next message first.
    open: BinaryHeap<Reverse<OpenChunk>>,
    errors: VecDeque<Error>,
}

struct Waiting<'bag> {
    info: &'bag ChunkInfo,
    ticket: Ticket,
}

/// A chunk with messages left; ordered by the next of them, then by its position in the file.
struct OpenChunk {
    next: (Time, u64),
    entries: std::vec::IntoIter<Entry>,
    content: Content,
}

impl<'bag> Messages<'bag> {
    pub(crate) fn new(bag: &'bag Bag, selection: Selection) -> Result<Self> {
        let wanted = selection.wanted(bag.connections(), bag.path())?;
        Ok(Self::of(bag, wanted, selection, bag.options().threads))
    }

    /// As [`Self::new`], without threads of its own.
    pub(crate) fn on_demand(bag: &'bag Bag, selection: Selection) -> Result<Self> {
        let wanted = selection.wanted(bag.connections(), bag.path())?;
        Ok(Self::of(bag, wanted, selection, 0))
    }

    /// The messages of the connections in `wanted`, by index.
    pub(crate) fn of(
        bag: &'bag Bag,
        wanted: Vec<bool>,
        selection: Selection,
        threads: usize,
    ) -> Self {
        let mut chunks: Vec<_> = bag
            .chunks()
            .iter()
            .filter(|info| selection.overlaps(info.first, info.last))
            .filter(|info| {
                info.counts
                    .iter()
                    .any(|&(place, n)| n > 0 && wanted[place as usize])
            })
            .collect();
        chunks.sort_by_key(|info| (info.first, info.position));
        let waiting = chunks.into_iter().map(|info| Waiting {
            info,
            ticket: Ticket::OnDemand,
        });
        let options = bag.options();
        Self {
            bag,
            wanted,
            selection,
            waiting: waiting.collect(),
            submitted: 0,
            window: 1,
            ahead: Ahead::new(Arc::clone(bag.source()), options.chunk_limit(), threads),
            open: BinaryHeap::new(),
            errors: VecDeque::new(),
        }
    }

    /// The next message's time, after opening all chunks that may have it; [`Time::ZERO`] if an error comes first.
    pub(crate) fn next_time(&mut self) -> Option<Time> {
        loop {
            if !self.errors.is_empty() {
                return Some(Time::ZERO);
            }
            let next = self.open.peek().map(|Reverse(chunk)| chunk.next.0);
            match (self.waiting.front(), next) {
                (None, next) => return next,
                (Some(waiting), Some(next)) if waiting.info.first > next => return Some(next),
                _ => self.open_chunk(),
            }
        }
    }

    fn open_chunk(&mut self) {
        self.submit();
        let Some(Waiting { info, ticket }) = self.waiting.pop_front() else {
            return;
        };
        self.submitted = self.submitted.saturating_sub(1);
        match self.read_chunk(info, ticket) {
            Ok(Some(chunk)) => self.open.push(Reverse(chunk)),
            Ok(None) => {}
            Err(fault) => self.errors.push_back(self.chunk_error(info, fault)),
        }
        self.window = (2 * self.window).min(2 * self.bag.options().threads.max(1));
    }

    /// Keeps the threads busy with the next chunks.
    fn submit(&mut self) {
        let until = self.window.min(self.waiting.len());
        for waiting in self.waiting.range_mut(self.submitted.min(until)..until) {
            waiting.ticket = self.ahead.submit(waiting.info);
        }
        self.submitted = self.submitted.max(until);
    }

    fn read_chunk(
        &self,
        info: &ChunkInfo,
        ticket: Ticket,
    ) -> std::result::Result<Option<OpenChunk>, Fault> {
        let file: &[u8] = self.bag.source();
        let opened = self.ahead.chunk(ticket, info)?;
        let wanted = |place: u32| self.wanted[place as usize];
        let places = self.bag.places();
        let mut entries = if info.scanned {
            entry::walk(opened.content.bytes(file)).entries(places)
        } else {
            entry::indexed(file, opened.end, info, places, wanted)?
        };
        // A chunk with an earlier message than the index says was opened too late to keep the order.
        if let Some(early) = entries.iter().find(|e| e.time < info.first) {
            let problem = IndexProblem::Early {
                time: early.time,
                first: info.first,
            };
            return Err(Fault {
                offset: info.position,
                problem: problem.into(),
            });
        }
        entries.retain(|e| wanted(e.connection) && self.selection.contains(e.time));
        entries.sort_by_key(|e| (e.time, e.offset));
        let first = entries.first().map(|e| e.time);
        Ok(first.map(|time| OpenChunk {
            next: (time, info.position),
            entries: entries.into_iter(),
            content: opened.content,
        }))
    }

    fn chunk_error(&self, info: &ChunkInfo, fault: Fault) -> Error {
        let problem = if fault.offset == info.position {
            fault.problem
        } else {
            fault.elsewhere()
        };
        Error::Chunk {
            path: self.bag.path().to_owned(),
            offset: info.position,
            messages: info.messages(),
            problem,
        }
    }

    /// The next message of the chunk on top.
    fn pop(&mut self) -> Option<Result<Message<'bag>>> {
        let mut top = self.open.peek_mut()?;
        let Reverse(chunk) = &mut *top;
        let entry = chunk.entries.next();
        let position = chunk.next.1;
        let message = entry.map(|entry| read_message(self.bag, &chunk.content, &entry, position));
        match chunk.entries.as_slice().first() {
            Some(following) => chunk.next.0 = following.time,
            None => drop(PeekMut::pop(top)),
        }
        message
    }
}

fn read_message<'bag>(
    bag: &'bag Bag,
    content: &Content,
    entry: &Entry,
    position: u64,
) -> Result<Message<'bag>> {
    let file: &'bag [u8] = bag.source();
    let connection = &bag.connections()[entry.connection as usize];
    let failed = |fault: Fault| Error::Record {
        path: bag.path().to_owned(),
        offset: position,
        problem: fault.within(),
    };
    let payload = match content {
        Content::Stored { from, to } => {
            let data = entry::message(&file[*from..*to], entry, connection.id).map_err(failed)?;
            Payload::Stored(data)
        }
        Content::Unpacked(chunk) => {
            let data = entry::message(chunk, entry, connection.id).map_err(failed)?;
            Payload::Unpacked(Arc::clone(chunk), range_within(chunk, data))
        }
    };
    Ok(Message {
        path: bag.path(),
        connection,
        time: entry.time,
        payload,
        serialization: Serialization::Ros1,
    })
}

/// Range of `part`, a slice of `whole`, within it.
fn range_within(whole: &[u8], part: &[u8]) -> Range<usize> {
    let from = part.as_ptr().addr() - whole.as_ptr().addr();
    from..from + part.len()
}

impl<'bag> Iterator for Messages<'bag> {
    type Item = Result<Message<'bag>>;

    fn next(&mut self) -> Option<Self::Item> {
        self.next_time()?;
        match self.errors.pop_front() {
            Some(error) => Some(Err(error)),
            None => self.pop(),
        }
    }
}

impl OpenChunk {
    fn key(&self) -> (Time, u64) {
        self.next
    }
}

impl Ord for OpenChunk {
    fn cmp(&self, other: &Self) -> std::cmp::Ordering {
        self.key().cmp(&other.key())
    }
}

impl PartialOrd for OpenChunk {
    fn partial_cmp(&self, other: &Self) -> Option<std::cmp::Ordering> {
        Some(self.cmp(other))
    }
}

impl PartialEq for OpenChunk {
    fn eq(&self, other: &Self) -> bool {
        self.key() == other.key()
    }
}

impl Eq for OpenChunk {}
