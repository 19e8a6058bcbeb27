use crate::bag::{Bag, BagOptions};
use crate::connection::Connection;
use crate::message::Message;
use crate::messages::Messages;
use crate::topic::{self, TopicInfo, hull};
use crate::{Error, Result, Selection, Time};
use std::collections::VecDeque;
use std::path::Path;

/// Several bags as one recording: a drive that the recorder split, or sensors recorded by several machines.
///
/// Connections of one topic and one MD5 are merged; messages come in time order over all bags.
pub struct BagSet {
    bags: Vec<Bag>,
    connections: Vec<Connection>,
    /// For each bag, maps a connection's index in the bag to its index in `connections`.
    places: Vec<Vec<u32>>,
}

impl BagSet {
    /// Opens the bags at `paths`, in any order.
    ///
    /// # Errors
    /// As [`Bag::open`], and [`Error::EmptySet`].
    pub fn open<P: AsRef<Path>>(paths: impl IntoIterator<Item = P>) -> Result<Self> {
        Self::open_with(paths, BagOptions::default())
    }

    /// As [`BagSet::open`], with options for every bag.
    ///
    /// # Errors
    /// As [`BagSet::open`].
    pub fn open_with<P: AsRef<Path>>(
        paths: impl IntoIterator<Item = P>,
        options: BagOptions,
    ) -> Result<Self> {
        let bags = paths.into_iter().map(|path| Bag::open_with(path, options));
        Self::new(bags.collect::<Result<_>>()?)
    }

    /// A set of open bags.
    ///
    /// # Errors
    /// [`Error::EmptySet`].
    pub fn new(bags: Vec<Bag>) -> Result<Self> {
        if bags.is_empty() {
            return Err(Error::EmptySet);
        }
        let mut connections: Vec<Connection> = Vec::new();
        let mut merge = |connection: &Connection| {
            let same = |c: &&mut Connection| c.topic == connection.topic && c.md5 == connection.md5;
            if let Some(known) = connections.iter_mut().find(same) {
                known.count += connection.count;
                return known.id;
            }
            let id = connections.len() as u32;
            connections.push(Connection {
                id,
                ..connection.clone()
            });
            id
        };
        let places = bags
            .iter()
            .map(|bag| bag.connections().iter().map(&mut merge).collect());
        let places = places.collect();
        Ok(Self {
            bags,
            connections,
            places,
        })
    }

    /// The bags, in the order they were given.
    #[must_use]
    pub fn bags(&self) -> &[Bag] {
        &self.bags
    }

    /// The merged connections; `id` is the index in this list.
    #[must_use]
    pub fn connections(&self) -> &[Connection] {
        &self.connections
    }

    /// Number of messages in all bags.
    #[must_use]
    pub fn message_count(&self) -> u64 {
        self.bags.iter().map(Bag::message_count).sum()
    }

    /// The times of the first and the last message; `None` without any.
    #[must_use]
    pub fn time_range(&self) -> Option<(Time, Time)> {
        self.bags.iter().map(Bag::time_range).fold(None, hull)
    }

    /// The topics of all bags by name, with type, count, time range and rate.
    ///
    /// # Errors
    /// As [`Bag::topics`].
    pub fn topics(&self) -> Result<Vec<TopicInfo>> {
        let each = self
            .bags
            .iter()
            .map(Bag::topics)
            .collect::<Result<Vec<_>>>()?;
        let mut topics = topic::group(&self.connections);
        for topic in &mut topics {
            let same = each.iter().flatten().filter(|t| t.name == topic.name);
            topic.range = same.map(|t| t.range).fold(None, hull);
        }
        Ok(topics)
    }

    /// The messages that `selection` asks for, in time order over all bags; with equal times, in the bags' order. A bag
    /// that begins later is not touched before its time.
    ///
    /// # Errors
    /// [`Error::NoSuchTopic`] for a topic that no bag has.
    pub fn messages(&self, selection: Selection) -> Result<SetMessages<'_>> {
        let wanted = selection.wanted(&self.connections, self.bags[0].path())?;
        let of_bag = |bag: usize| {
            self.places[bag]
                .iter()
                .map(|&p| wanted[p as usize])
                .collect()
        };
        let mut waiting: Vec<_> = (0..self.bags.len())
            .filter_map(|bag| Some((self.bags[bag].time_range()?.0, bag)))
            .collect();
        waiting.sort_unstable();
        let start = |(first, bag): (Time, usize)| BagMessages {
            first,
            bag,
            messages: Messages::of(
                &self.bags[bag],
                of_bag(bag),
                selection.clone(),
                self.bags[bag].options().threads,
            ),
        };
        Ok(SetMessages {
            set: self,
            waiting: waiting.into_iter().map(start).collect(),
            active: Vec::new(),
        })
    }
}

/// The messages of a [`BagSet`] in time order; see [`Messages`] for errors. It uses the memory of all bags whose
/// times overlap.
pub struct SetMessages<'set> {
    set: &'set BagSet,
    /// Bags not read yet, by their first message.
    waiting: VecDeque<BagMessages<'set>>,
    active: Vec<BagMessages<'set>>,
}

struct BagMessages<'set> {
    first: Time,
    bag: usize,
    messages: Messages<'set>,
}

impl<'set> Iterator for SetMessages<'set> {
    type Item = Result<Message<'set>>;

    fn next(&mut self) -> Option<Self::Item> {
        loop {
            // The threads of a bag that is finished end here.
            self.active
                .retain_mut(|bag_messages| bag_messages.messages.next_time().is_some());
            let time = |bag_messages: &mut BagMessages<'set>| {
                bag_messages
                    .messages
                    .next_time()
                    .map(|time| (time, bag_messages.bag))
            };
            let earliest = self.active.iter_mut().filter_map(time).min();
            match (earliest, self.waiting.front()) {
                (None, None) => return None,
                (Some((time, bag)), front)
                    if front.is_none_or(|bag_messages| bag_messages.first > time) =>
                {
                    let bag_messages = self
                        .active
                        .iter_mut()
                        .find(|bag_messages| bag_messages.bag == bag)?;
                    let message = bag_messages.messages.next()?;
                    return Some(message.map(|message| self.merged(message, bag)));
                }
                _ => self.active.extend(self.waiting.pop_front()),
            }
        }
    }
}

impl<'set> SetMessages<'set> {
    fn merged(&self, message: Message<'set>, bag: usize) -> Message<'set> {
        let set = self.set;
        let own = set.bags[bag].connections();
        // A connection is an element of its bag's list, so its address gives its index.
        let place = own.iter().position(|c| std::ptr::eq(c, message.connection));
        let connection = place.map(|place| &set.connections[set.places[bag][place] as usize]);
        Message {
            connection: connection.unwrap_or(message.connection),
            ..message
        }
    }
}
