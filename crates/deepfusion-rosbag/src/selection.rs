use crate::connection::Connection;
use crate::{Error, Result, Time};
use std::ops::Bound;
use std::path::Path;

/// A selection of messages: all topics and all times unless narrowed.
///
/// ```
/// use deepfusion_rosbag::{Selection, Time};
/// let first_minute = Selection::topics(["/imu/data", "/odom"]).until(Time { sec: 60, nsec: 0 });
/// # let _ = first_minute;
/// ```
#[derive(Debug, Clone)]
pub struct Selection {
    topics: Option<Vec<String>>,
    pub(crate) from: Time,
    pub(crate) until: Bound<Time>,
}

impl Default for Selection {
    fn default() -> Self {
        Self::all()
    }
}

impl Selection {
    /// Every message.
    #[must_use]
    pub fn all() -> Self {
        Self {
            topics: None,
            from: Time::ZERO,
            until: Bound::Unbounded,
        }
    }

    /// The messages of these topics, by their full names. A topic that does not exist is an error when reading begins.
    #[must_use]
    pub fn topics<T: Into<String>>(topics: impl IntoIterator<Item = T>) -> Self {
        Self {
            topics: Some(topics.into_iter().map(Into::into).collect()),
            ..Self::all()
        }
    }

    /// Only messages recorded at `time` or later.
    #[must_use]
    pub fn from(self, time: Time) -> Self {
        Self { from: time, ..self }
    }

    /// Only messages recorded before `time`.
    #[must_use]
    pub fn until(self, time: Time) -> Self {
        Self {
            until: Bound::Excluded(time),
            ..self
        }
    }

    /// Whether a message recorded at `time` is selected.
    #[must_use]
    pub fn contains(&self, time: Time) -> bool {
        self.from <= time && self.is_before_end(time)
    }

    /// Whether the interval from `first` to `last` overlaps the selected times.
    #[must_use]
    pub fn overlaps(&self, first: Time, last: Time) -> bool {
        self.from <= last && self.is_before_end(first)
    }

    fn is_before_end(&self, time: Time) -> bool {
        match self.until {
            Bound::Excluded(end) => time < end,
            Bound::Included(end) => time <= end,
            Bound::Unbounded => true,
        }
    }

    /// The time from which messages are wanted.
    #[must_use]
    pub fn start(&self) -> Time {
        self.from
    }

    /// Which of `connections` are selected, by index, for readers of other formats.
    ///
    /// # Errors
    /// [`Error::NoSuchTopic`] for a topic that none of them has.
    pub fn wanted(&self, connections: &[Connection], path: &Path) -> Result<Vec<bool>> {
        let Some(topics) = &self.topics else {
            return Ok(vec![true; connections.len()]);
        };
        if let Some(topic) = topics
            .iter()
            .find(|t| connections.iter().all(|c| c.topic != **t))
        {
            let mut names: Vec<String> = connections.iter().map(|c| c.topic.clone()).collect();
            names.sort_unstable();
            names.dedup();
            return Err(Error::NoSuchTopic {
                path: path.to_owned(),
                topic: topic.clone(),
                topics: names,
            });
        }
        Ok(connections
            .iter()
            .map(|c| topics.contains(&c.topic))
            .collect())
    }
}
