use crate::bag::Bag;
use crate::message::Message;
use crate::messages::Messages;
use crate::source_damage::SourceDamage;
use crate::topic::TopicInfo;
use crate::{Result, Selection, Time};
use std::fmt;
use std::path::Path;

/// Messages in time order, with errors for those that cannot be read.
pub type MessageIter<'a> = Box<dyn Iterator<Item = Result<Message<'a>>> + 'a>;

/// A recording of messages by topic and time, in any format: a [`Bag`], or a ROS 2 bag.
///
/// Several threads may read from it at once.
pub trait MessageSource: fmt::Debug + Send + Sync {
    /// The recording's file or folder.
    fn path(&self) -> &Path;

    /// The topics by name, with type, count, time range and rate.
    ///
    /// # Errors
    /// If the index cannot be read.
    fn topics(&self) -> Result<Vec<TopicInfo>>;

    /// The times of the first and the last message; `None` without any.
    fn time_range(&self) -> Option<(Time, Time)>;

    /// What is wrong with the recording, if not all of it can be read.
    fn damage(&self) -> Option<SourceDamage>;

    /// The messages that `selection` asks for, in time order, streaming: memory does not grow with the recording.
    ///
    /// # Errors
    /// [`Error::NoSuchTopic`](crate::Error::NoSuchTopic).
    fn messages(&self, selection: Selection) -> Result<MessageIter<'_>>;

    /// As [`Self::messages`], for a single message or a few: nothing is read ahead, no thread is started.
    ///
    /// # Errors
    /// As [`Self::messages`].
    fn messages_on_demand(&self, selection: Selection) -> Result<MessageIter<'_>> {
        self.messages(selection)
    }
}

impl MessageSource for Bag {
    fn path(&self) -> &Path {
        self.path()
    }

    fn topics(&self) -> Result<Vec<TopicInfo>> {
        self.topics()
    }

    fn time_range(&self) -> Option<(Time, Time)> {
        self.time_range()
    }

    fn damage(&self) -> Option<SourceDamage> {
        self.damage().cloned().map(SourceDamage::new)
    }

    fn messages(&self, selection: Selection) -> Result<MessageIter<'_>> {
        Ok(Box::new(self.messages(selection)?))
    }

    fn messages_on_demand(&self, selection: Selection) -> Result<MessageIter<'_>> {
        Ok(Box::new(Messages::on_demand(self, selection)?))
    }
}
