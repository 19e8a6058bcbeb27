use crate::bag::Bag;
use crate::buffer::Pool;
use crate::chunk::Chunk;
use crate::connection::Connection;
use crate::entry;
use crate::index::ChunkInfo;
use crate::{Time, content};

/// A topic's content in a bag.
#[derive(Debug, Clone, PartialEq)]
pub struct TopicInfo {
    /// Its name.
    pub name: String,
    /// Its message type; that of the first connection if they differ.
    pub type_name: String,
    /// The MD5 of that type's definition.
    pub md5: String,
    /// Number of connections, that is publishers.
    pub connections: usize,
    /// Number of messages.
    pub count: u64,
    /// The recording times of its first and last message; `None` without any.
    pub range: Option<(Time, Time)>,
}

impl TopicInfo {
    /// Message rate in Hz: their number minus one over the time between the first and the last. `None` for fewer than
    /// two messages, or all at one time.
    #[must_use]
    pub fn rate_hz(&self) -> Option<f64> {
        let (first, last) = self.range?;
        let seconds = last.seconds_since(first);
        (self.count > 1 && seconds > 0.0).then(|| (self.count - 1) as f64 / seconds)
    }

    /// Connections grouped by topic, in order of names; each with the times of its first and last message.
    #[must_use]
    pub fn gather<'a>(
        connections: impl IntoIterator<Item = (&'a Connection, Option<(Time, Time)>)>,
    ) -> Vec<Self> {
        let mut topics: Vec<Self> = Vec::new();
        for (connection, range) in connections {
            match topics.iter_mut().find(|t| t.name == connection.topic) {
                Some(topic) => {
                    topic.connections += 1;
                    topic.count += connection.count;
                    topic.range = hull(topic.range, range);
                }
                None => topics.push(Self {
                    name: connection.topic.clone(),
                    type_name: connection.type_name.clone(),
                    md5: connection.md5.clone(),
                    connections: 1,
                    count: connection.count,
                    range,
                }),
            }
        }
        topics.sort_by(|a, b| a.name.cmp(&b.name));
        topics
    }
}

/// The topics of `bag`, by name.
pub(crate) fn topics(bag: &Bag) -> Vec<TopicInfo> {
    let mut topics = group(bag.connections());
    for topic in &mut topics {
        topic.range = range(bag, &topic.name);
    }
    topics
}

/// Connections grouped by topic, without their times.
pub(crate) fn group(connections: &[Connection]) -> Vec<TopicInfo> {
    TopicInfo::gather(connections.iter().map(|connection| (connection, None)))
}

/// From the earlier first to the later last time of two ranges.
#[must_use]
pub fn hull(a: Option<(Time, Time)>, b: Option<(Time, Time)>) -> Option<(Time, Time)> {
    match (a, b) {
        (Some(a), Some(b)) => Some((a.0.min(b.0), a.1.max(b.1))),
        (one, None) | (None, one) => one,
    }
}

/// The times of a topic's first and last message. For a chunk that cannot be read, those of the whole chunk count: reading its
/// messages reports the error, and the rest of the bag is not lost.
fn range(bag: &Bag, topic: &str) -> Option<(Time, Time)> {
    let of_topic = |place: u32| bag.connections()[place as usize].topic == topic;
    let mut chunks: Vec<&ChunkInfo> = bag
        .chunks()
        .iter()
        .filter(|info| {
            info.counts
                .iter()
                .any(|&(place, n)| n > 0 && of_topic(place))
        })
        .collect();
    let (mut first, mut last): (Option<Time>, Option<Time>) = (None, None);
    // In order of the chunks' own ranges: once a chunk begins after the best first time, no later chunk can improve it.
    chunks.sort_by_key(|info| info.first);
    for info in &chunks {
        if first.is_some_and(|first| info.first > first) {
            break;
        }
        let found = times(bag, info, of_topic);
        let earliest = found.map_or(Some(info.first), Iterator::min);
        first = earliest.into_iter().chain(first).min();
    }
    chunks.sort_by_key(|info| std::cmp::Reverse(info.last));
    for info in &chunks {
        if last.is_some_and(|last| info.last < last) {
            break;
        }
        let found = times(bag, info, of_topic);
        let latest = found.map_or(Some(info.last), Iterator::max);
        last = latest.into_iter().chain(last).max();
    }
    first.zip(last)
}

/// The times of a chunk's messages of one topic, from the index data alone if there is any. `None` if the chunk cannot be read.
fn times(
    bag: &Bag,
    info: &ChunkInfo,
    of_topic: impl Fn(u32) -> bool,
) -> Option<impl Iterator<Item = Time>> {
    let (file, places): (&[u8], _) = (bag.source(), bag.places());
    let entries = if info.scanned {
        content::open(
            bag.source(),
            info,
            bag.options().chunk_limit(),
            &Pool::new(0),
        )
        .map(|opened| entry::walk(opened.content.bytes(file)).entries(places))
        .map(|mut entries| {
            entries.retain(|e| of_topic(e.connection));
            entries
        })
    } else {
        Chunk::read(file, info.position)
            .and_then(|chunk| entry::indexed(file, chunk.end, info, places, of_topic))
    };
    Some(entries.ok()?.into_iter().map(|e| e.time))
}
