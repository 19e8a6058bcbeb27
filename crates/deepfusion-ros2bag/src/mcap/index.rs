//! A file's summary, which is at the end of the file.

use super::chunk::indexed_times;
use super::damage::McapProblem;
use super::definitions::Definitions;
use super::record::{Fields, MAGIC, TAIL, op, record};
use super::{ChunkInfo, Index};
use crate::storage::hull;
use deepfusion_rosbag::Time;

/// Numbers of the statistics record that show whether the summary is complete.
struct Statistics {
    messages: u64,
    schemas: u64,
    channels: u64,
    chunks: u64,
    /// Messages by channel.
    counts: Vec<(u16, u64)>,
}

/// Positions of a chunk's message indexes, by channel.
struct Indexes(Vec<(u16, u64)>);

/// Reads the index from the summary. If that is not possible, the file has to be scanned; the error is what is wrong with the summary,
/// if anything is.
pub(super) fn read(bytes: &[u8]) -> Result<Index, Option<McapProblem>> {
    let tail = bytes.len().checked_sub(TAIL);
    let (Some(tail), true) = (tail, bytes.ends_with(MAGIC)) else {
        return Err(Some(McapProblem::NoSummary));
    };
    let footer = match record(bytes, tail) {
        Ok(Some(footer)) if footer.op == op::FOOTER => footer,
        _ => return Err(Some(McapProblem::End)),
    };
    let start = Fields(footer.content).u64().unwrap_or_default();
    if start == 0 {
        return Err(None);
    }
    let mut definitions = Definitions::default();
    let (mut chunks, mut indexes, mut statistics) = (Vec::new(), Vec::new(), None);
    let mut at = usize::try_from(start).unwrap_or(usize::MAX);
    if at >= tail {
        return Err(Some(McapProblem::SummaryPlace));
    }
    while at < tail {
        let found = match record(&bytes[..tail], at) {
            Ok(Some(found)) => found,
            Ok(None) => break,
            Err(cut) => return Err(Some(McapProblem::SummaryCut(cut.problem()))),
        };
        let sound = match found.op {
            op::SCHEMA | op::CHANNEL => definitions.add(found.op, found.content).is_some(),
            op::CHUNK_INDEX => match chunk_index(bytes, found.content) {
                Some((info, index)) => {
                    chunks.push(info);
                    indexes.push(index);
                    true
                }
                None => false,
            },
            op::STATISTICS => {
                statistics = read_statistics(found.content);
                statistics.is_some()
            }
            _ => true,
        };
        if !sound {
            return Err(Some(McapProblem::SummaryRecord { at }));
        }
        at = found.end();
    }
    // Recorders may leave parts of the summary out; then only the file itself has the information.
    let Some(statistics) = statistics else {
        return Err(None);
    };
    let complete = statistics.chunks == chunks.len() as u64
        && statistics.channels == definitions.channels.len() as u64
        && statistics.schemas == definitions.schemas() as u64
        && (statistics.messages == 0 || !chunks.is_empty());
    // Without message indexes the times of a topic require decompressing all chunks: scanning the file once is less work.
    let indexed = chunks.iter().all(|chunk| chunk.channels.is_some());
    if !complete || !indexed {
        return Err(None);
    }
    for (id, count) in &statistics.counts {
        if let Some(place) = definitions.places.get(id) {
            definitions.channels[*place].connection.count = *count;
        }
    }
    let mut index = Index {
        channels: definitions.channels,
        places: definitions.places,
        chunks,
        ..Index::default()
    };
    set_ranges(bytes, &mut index, &indexes);
    Ok(index)
}

fn read_statistics(content: &[u8]) -> Option<Statistics> {
    let mut fields = Fields(content);
    let (messages, schemas, channels) = (fields.u64()?, fields.u16()?, fields.u32()?);
    let (_attachments, _metadata, chunks) = (fields.u32()?, fields.u32()?, fields.u32()?);
    let (_first, _last) = (fields.u64()?, fields.u64()?);
    Some(Statistics {
        messages,
        schemas: u64::from(schemas),
        channels: u64::from(channels),
        chunks: u64::from(chunks),
        counts: fields.map()?,
    })
}

fn chunk_index(bytes: &[u8], content: &[u8]) -> Option<(ChunkInfo, Indexes)> {
    let mut fields = Fields(content);
    let (first, last) = (fields.u64()?, fields.u64()?);
    let (start, _length) = (fields.u64()?, fields.u64()?);
    let indexes = fields.map()?;
    let found = record(bytes, usize::try_from(start).ok()?).ok()??;
    let channels: Vec<u16> = indexes.iter().map(|(channel, _)| *channel).collect();
    let info = ChunkInfo {
        from: found.start,
        to: found.end(),
        first: Time::from_nanos(first),
        last: Time::from_nanos(last),
        // Without message indexes it is unknown which channels are in it.
        channels: (!channels.is_empty()).then_some(channels),
        scanned: false,
    };
    (found.op == op::CHUNK).then_some((info, Indexes(indexes)))
}

/// Each channel's first and last time, from the message indexes of the few chunks that can hold them.
fn set_ranges(bytes: &[u8], index: &mut Index, indexes: &[Indexes]) {
    let mut by_first: Vec<usize> = (0..index.chunks.len()).collect();
    let mut by_last = by_first.clone();
    by_first.sort_by_key(|i| index.chunks[*i].first);
    by_last.sort_by_key(|i| std::cmp::Reverse(index.chunks[*i].last));
    let ids: Vec<(u16, usize)> = index
        .places
        .iter()
        .map(|(id, place)| (*id, *place))
        .collect();
    for (id, place) in ids {
        let times = |i: usize| times_in(bytes, &indexes[i], id);
        let mut range: Option<(Time, Time)> = None;
        for &i in &by_first {
            if range.is_some_and(|(first, _)| index.chunks[i].first > first) {
                break;
            }
            range = hull(range, times(i));
        }
        for &i in &by_last {
            if range.is_some_and(|(_, last)| index.chunks[i].last < last) {
                break;
            }
            range = hull(range, times(i));
        }
        index.channels[place].range = range;
    }
}

/// The times of a channel's first and last message in a chunk.
fn times_in(bytes: &[u8], indexes: &Indexes, id: u16) -> Option<(Time, Time)> {
    let (_, offset) = indexes.0.iter().find(|(channel, _)| *channel == id)?;
    let found = record(bytes, usize::try_from(*offset).ok()?).ok()??;
    let sound = found.op == op::MESSAGE_INDEX;
    let times: Vec<Time> = sound.then(|| indexed_times(found.content, id))??;
    Some((*times.iter().min()?, *times.iter().max()?))
}
