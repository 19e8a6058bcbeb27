//! A file without a usable summary, read from the front to its end or the first damage.

use super::chunk::{self, Entry, walk};
use super::damage::McapProblem;
use super::definitions::Definitions;
use super::record::{MAGIC, MESSAGE_HEAD, MessageHead, RecordProblem, op, record};
use super::{ChunkInfo, Index};
use deepfusion_rosbag::Time;

/// Builds the index by scanning the file. `summary` is what is wrong with its summary, `None` if the summary is only incomplete.
pub(super) fn read(bytes: &[u8], summary: Option<McapProblem>) -> Index {
    let mut scan = Scan {
        bytes,
        definitions: Definitions::default(),
        chunks: Vec::new(),
        loose: Vec::new(),
        problems: summary.into_iter().collect(),
    };
    scan.go();
    let mut index = Index {
        channels: scan.definitions.channels,
        places: scan.definitions.places,
        chunks: scan.chunks,
        loose: scan.loose,
        problems: scan.problems,
    };
    index.loose.sort_by_key(|m| (m.time, m.range.start));
    index
}

struct Scan<'a> {
    bytes: &'a [u8],
    definitions: Definitions,
    chunks: Vec<ChunkInfo>,
    loose: Vec<Entry>,
    problems: Vec<McapProblem>,
}

impl Scan<'_> {
    fn go(&mut self) {
        let mut at = MAGIC.len();
        loop {
            match record(self.bytes, at) {
                Ok(Some(found)) => {
                    let content = found.content;
                    match found.op {
                        op::SCHEMA | op::CHANNEL => self.define(found.op, content, at),
                        op::MESSAGE => self.message(content, found.start, at),
                        op::CHUNK => self.chunk(found.start, found.end(), at),
                        // What follows is the summary, which repeats earlier records.
                        op::DATA_END | op::FOOTER => return,
                        _ => {}
                    }
                    at = found.end();
                }
                Ok(None) => return,
                Err(cut) => {
                    if cut.op == Some(op::CHUNK) {
                        self.chunk(cut.start, cut.start + cut.content.len(), at);
                    }
                    self.problems.push(McapProblem::Record(cut.problem()));
                    return;
                }
            }
        }
    }

    fn define(&mut self, op: u8, content: &[u8], at: usize) {
        if self.definitions.add(op, content).is_none() {
            self.problems.push(McapProblem::Definition { at });
        }
    }

    fn message(&mut self, content: &[u8], start: usize, at: usize) {
        match MessageHead::read(content) {
            Some(head) => {
                let time = Time::from_nanos(head.log_time);
                let range = start + MESSAGE_HEAD..start + content.len();
                let entry = self.count(head.channel, time, range);
                self.loose.extend(entry);
            }
            None => {
                let short = RecordProblem::ShortMessage { at };
                self.problems.push(McapProblem::Record(short));
            }
        }
    }

    /// Counts a message of a channel that is known.
    fn count(&mut self, channel: u16, time: Time, range: std::ops::Range<usize>) -> Option<Entry> {
        let place = *self.definitions.places.get(&channel)?;
        self.definitions.channels[place].add(time);
        Some(Entry {
            time,
            channel,
            range,
        })
    }

    fn chunk(&mut self, from: usize, to: usize, at: usize) {
        let bytes = self.bytes;
        let (content, problem) = chunk::open(&bytes[from..to]);
        let walk = walk(content.bytes());
        for problem in problem.into_iter().chain(walk.broken) {
            self.problems.push(McapProblem::Chunk { at, problem });
        }
        for (op, content) in &walk.definitions {
            self.define(*op, content, at);
        }
        let mut channels: Vec<u16> = Vec::new();
        let mut range: Option<(Time, Time)> = None;
        for message in walk.messages {
            let (channel, time) = (message.channel, message.time);
            if self.count(channel, time, message.range).is_some() {
                range = crate::storage::hull(range, Some((time, time)));
                if !channels.contains(&channel) {
                    channels.push(channel);
                }
            }
        }
        // Otherwise the channel is empty, or its messages have no definition.
        let Some((first, last)) = range else { return };
        self.chunks.push(ChunkInfo {
            from,
            to,
            first,
            last,
            channels: Some(channels),
            scanned: true,
        });
    }
}
