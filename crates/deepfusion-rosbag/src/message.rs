use crate::buffer::Buffer;
use crate::connection::Connection;
use crate::msg::wire::{CDR_HEADER, cdr_is_big_endian, decode_first};
use crate::msg::{CompressedVideo, Header, RosMessage};
use crate::{Error, Result, Time};
use std::ops::Range;
use std::path::Path;
use std::sync::Arc;

/// A recorded message: its connection, its time, and its bytes.
///
/// It borrows the bag. If its chunk is compressed, it keeps the whole decompressed chunk alive (768 KiB by default): keep
/// what you decode rather than many messages.
#[derive(Clone)]
pub struct Message<'bag> {
    pub(crate) path: &'bag Path,
    pub(crate) connection: &'bag Connection,
    pub(crate) time: Time,
    pub(crate) payload: Payload<'bag>,
    pub(crate) serialization: Serialization,
}

#[derive(Clone)]
pub(crate) enum Payload<'bag> {
    /// In the file's mapping.
    Stored(&'bag [u8]),
    /// In a decompressed chunk.
    Unpacked(Arc<Buffer>, Range<usize>),
    /// In memory owned by another reader.
    Held(Arc<Vec<u8>>, Range<usize>),
}

/// The serialisation format of a message.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Serialization {
    /// ROS 1: little-endian, without padding.
    Ros1,
    /// ROS 2: CDR, which states its own byte order.
    Cdr,
}

impl<'bag> Message<'bag> {
    /// A message from a recording of another format than [`Bag`](crate::Bag)'s: its bytes are `range` of `held`.
    /// `connection`'s MD5 is `*` if that format has none.
    ///
    /// # Panics
    /// If `range` lies outside of `held`.
    #[must_use]
    pub fn held(
        path: &'bag Path,
        connection: &'bag Connection,
        time: Time,
        serialization: Serialization,
        held: Arc<Vec<u8>>,
        range: Range<usize>,
    ) -> Self {
        assert!(
            range.start <= range.end && range.end <= held.len(),
            "a message lies within the bytes that hold it"
        );
        Self {
            path,
            connection,
            time,
            payload: Payload::Held(held, range),
            serialization,
        }
    }

    /// As [`Message::held`], with its bytes in memory that lives as long as the recording, such as a mapped file.
    #[must_use]
    pub fn stored(
        path: &'bag Path,
        connection: &'bag Connection,
        time: Time,
        serialization: Serialization,
        bytes: &'bag [u8],
    ) -> Self {
        Self {
            path,
            connection,
            time,
            payload: Payload::Stored(bytes),
            serialization,
        }
    }

    /// Its connection: topic, type, definition.
    #[must_use]
    pub fn connection(&self) -> &'bag Connection {
        self.connection
    }

    /// Its topic.
    #[must_use]
    pub fn topic(&self) -> &'bag str {
        &self.connection.topic
    }

    /// The time of recording, by the recorder's clock. The time of measurement is in the message's own header.
    #[must_use]
    pub fn time(&self) -> Time {
        self.time
    }

    /// Its serialised bytes.
    #[must_use]
    pub fn data(&self) -> &[u8] {
        match &self.payload {
            Payload::Stored(bytes) => bytes,
            Payload::Unpacked(chunk, range) => &chunk[range.clone()],
            Payload::Held(held, range) => &held[range.clone()],
        }
    }

    /// The serialisation format of its bytes.
    #[must_use]
    pub fn serialization(&self) -> Serialization {
        self.serialization
    }

    /// The header's time of measurement, without decoding the message, which must begin with a header; `None` if it is
    /// not set, or the message is too short. [`CompressedVideo`] begins with a time alone, which is used as well.
    #[must_use]
    pub fn header_stamp(&self) -> Option<Time> {
        let data = self.data();
        let word = |at: usize, big: bool| {
            let bytes = *data.get(at..)?.first_chunk()?;
            Some(if big {
                u32::from_be_bytes(bytes)
            } else {
                u32::from_le_bytes(bytes)
            })
        };
        let (at, big) = match self.serialization {
            Serialization::Ros1 if self.is_video() => (0, false),
            // After the sequence number.
            Serialization::Ros1 => (size_of::<u32>(), false),
            Serialization::Cdr => (CDR_HEADER, cdr_is_big_endian(data).ok()?),
        };
        let (sec, nsec) = (word(at, big)?, word(at + 4, big)?);
        let before_1970 = self.serialization == Serialization::Cdr && sec > i32::MAX as u32;
        let set = !before_1970 && (sec != 0 || nsec != 0);
        set.then_some(Time { sec, nsec })
    }

    /// The header's frame, without decoding the message, which must begin with a header; `None` if it is empty, or the
    /// message is too short.
    #[must_use]
    pub fn header_frame(&self) -> Option<String> {
        let cdr = self.serialization == Serialization::Cdr;
        let frame = if self.is_video() {
            let video: CompressedVideo<'_> = decode_first(self.data(), cdr).ok()?;
            video.frame_id
        } else {
            let header: Header = decode_first(self.data(), cdr).ok()?;
            header.frame_id
        };
        Some(frame).filter(|frame| !frame.is_empty())
    }

    fn is_video(&self) -> bool {
        self.connection.type_name == CompressedVideo::TYPE
    }

    /// Whether it is a `T`, by type name and MD5.
    #[must_use]
    pub fn is<'m, T: RosMessage<'m>>(&self) -> bool {
        // `*` stands for any definition, in recordings by tools that did not know it.
        let md5 = &self.connection.md5;
        self.connection.type_name == T::TYPE && (md5 == T::MD5 || md5 == "*")
    }

    /// Decodes the message as a `T`. Pixels and points are borrowed, everything else is copied.
    ///
    /// # Errors
    /// [`Error::WrongType`] if the connection has another type or another version of it, [`Error::Message`] naming
    /// the field if the bytes do not fit the type.
    pub fn decode<'m, T: RosMessage<'m>>(&'m self) -> Result<T> {
        if !self.is::<T>() {
            return Err(self.wrong_type::<T>());
        }
        let decoded = match self.serialization {
            Serialization::Ros1 => T::decode(self.data()),
            Serialization::Cdr => T::decode_cdr(self.data()),
        };
        decoded.map_err(|source| Error::Message {
            path: self.path.to_owned(),
            topic: self.connection.topic.clone(),
            time: self.time,
            type_name: T::TYPE,
            source: Box::new(source),
        })
    }

    fn wrong_type<'m, T: RosMessage<'m>>(&self) -> Error {
        let connection = self.connection;
        let same_name = connection.type_name == T::TYPE;
        let name = |name: &str, md5: &str| {
            if same_name {
                format!("{name} of MD5 {md5}")
            } else {
                name.to_owned()
            }
        };
        Error::WrongType {
            path: self.path.to_owned(),
            topic: connection.topic.clone(),
            found: name(&connection.type_name, &connection.md5),
            expected: name(T::TYPE, T::MD5),
        }
    }
}

impl std::fmt::Debug for Message<'_> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let Self {
            connection, time, ..
        } = self;
        write!(
            f,
            "Message({} {} at {time}, {} bytes)",
            connection.topic,
            connection.type_name,
            self.data().len()
        )
    }
}
