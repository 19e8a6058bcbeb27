use crate::buffer::Buffer;
use crate::connection::Connection;
use crate::msg::RosMessage;
use crate::{Error, Result, Time};
use std::ops::Range;
use std::path::Path;
use std::sync::Arc;

/// A recorded message: who said it, when, and its bytes.
///
/// It borrows the bag. Of a compressed chunk it keeps the whole decompressed chunk alive (768 KiB by default): keep
/// what you decode rather than many messages.
#[derive(Clone)]
pub struct Message<'bag> {
    pub(crate) path: &'bag Path,
    pub(crate) connection: &'bag Connection,
    pub(crate) time: Time,
    pub(crate) payload: Payload<'bag>,
}

#[derive(Clone)]
pub(crate) enum Payload<'bag> {
    /// In the file itself.
    Stored(&'bag [u8]),
    /// In a decompressed chunk.
    Unpacked(Arc<Buffer>, Range<usize>),
}

impl<'bag> Message<'bag> {
    /// The connection it came by: topic, type, definition.
    #[must_use]
    pub fn connection(&self) -> &'bag Connection {
        self.connection
    }

    /// Its topic.
    #[must_use]
    pub fn topic(&self) -> &'bag str {
        &self.connection.topic
    }

    /// When it was recorded, by the recorder's clock. When it was measured stands in the message's own header.
    #[must_use]
    pub fn time(&self) -> Time {
        self.time
    }

    /// Its bytes as they were sent, little-endian.
    #[must_use]
    pub fn data(&self) -> &[u8] {
        match &self.payload {
            Payload::Stored(bytes) => bytes,
            Payload::Unpacked(chunk, range) => &chunk[range.clone()],
        }
    }

    /// Whether it is a `T`, by type name and MD5.
    #[must_use]
    pub fn is<'m, T: RosMessage<'m>>(&self) -> bool {
        // `*` stands for any definition, in recordings of tools that did not know it.
        let md5 = &self.connection.md5;
        self.connection.type_name == T::TYPE && (md5 == T::MD5 || md5 == "*")
    }

    /// The message as a `T`. Pixels and points are borrowed from it, all else is copied.
    ///
    /// # Errors
    /// [`Error::WrongType`] where the connection has another type or another version of it, [`Error::Message`] naming
    /// the field where the bytes do not fit the type.
    pub fn decode<'m, T: RosMessage<'m>>(&'m self) -> Result<T> {
        if !self.is::<T>() {
            return Err(self.wrong_type::<T>());
        }
        T::decode(self.data()).map_err(|source| Error::Message {
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
        let name = |name: &str, md5: &str| match same_name {
            true => format!("{name} of MD5 {md5}"),
            false => name.to_owned(),
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
