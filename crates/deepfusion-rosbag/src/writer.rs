use crate::compression::{Compression, compress};
use crate::encode::{VERSION, bag_header, entry, field, record, record_header, time_bytes};
use crate::msg::RosMessage;
use crate::op;
use crate::{Error, Result, Time};
use deepfusion_fs::Partial;
use std::collections::BTreeMap;
use std::fs::File;
use std::io::{BufWriter, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};

/// Offsets within a chunk are 32-bit, and other readers keep a chunk's length in an i32.
const LARGEST_CHUNK: usize = i32::MAX as usize;

/// Options for writing a bag.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct WriterOptions {
    /// The compression of chunks.
    pub compression: Compression,
    /// The size from which a chunk is closed, in bytes before compression: 768 KiB, as in ROS's recorder.
    pub chunk_bytes: usize,
}

impl Default for WriterOptions {
    fn default() -> Self {
        Self {
            compression: Compression::None,
            chunk_bytes: 768 << 10,
        }
    }
}

/// A connection of a [`BagWriter`].
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct ConnectionId(u32);

/// Writes a bag. The same calls give the same bytes.
///
/// The bag gets its name when [`BagWriter::finish`] has written the index; a writer that is dropped before leaves
/// nothing behind. Memory: one chunk, and 12 bytes per message in it.
///
/// ```no_run
/// use deepfusion_rosbag::{BagWriter, Time, WriterOptions, msg::Float32};
/// # fn main() -> deepfusion_rosbag::Result<()> {
/// let mut bag = BagWriter::create("speed.bag", WriterOptions::default())?;
/// let speed = bag.add_connection::<Float32>("/can/speed")?;
/// bag.write(speed, Time { sec: 1, nsec: 0 }, &Float32 { data: 8.3 })?;
/// bag.finish()
/// # }
/// ```
pub struct BagWriter {
    path: PathBuf,
    partial: Partial,
    out: BufWriter<File>,
    at: u64,
    options: WriterOptions,
    /// Each connection's record, as it goes into chunks and index.
    connections: Vec<Vec<u8>>,
    chunk: OpenChunk,
    /// Chunk information records of the chunks written.
    chunk_infos: Vec<u8>,
    chunks: u32,
    scratch: Vec<u8>,
}

/// The chunk being filled.
#[derive(Default)]
struct OpenChunk {
    content: Vec<u8>,
    /// The times and offsets of each connection's messages.
    index: BTreeMap<u32, Vec<(Time, u32)>>,
    range: Option<(Time, Time)>,
}

impl BagWriter {
    /// Begins a bag that will appear at `path`.
    ///
    /// # Errors
    /// [`Error::File`].
    pub fn create(path: impl AsRef<Path>, options: WriterOptions) -> Result<Self> {
        let path = path.as_ref();
        let partial = Partial::beside(path);
        let failed = |source| Error::file(path, source);
        let file = partial.create().map_err(failed)?;
        let mut writer = Self {
            path: path.to_owned(),
            partial,
            out: BufWriter::with_capacity(1 << 18, file),
            at: 0,
            options,
            connections: Vec::new(),
            chunk: OpenChunk::default(),
            chunk_infos: Vec::new(),
            chunks: 0,
            scratch: Vec::new(),
        };
        writer.put(b"#ROSBAG V2.0\n")?;
        let header = bag_header(0, 0, 0);
        writer.put(&header)?;
        Ok(writer)
    }

    /// Adds a topic of a known type. Each call adds a separate connection, even for the same topic.
    ///
    /// # Errors
    /// [`Error::TooLarge`] for a topic name that the format cannot hold.
    pub fn add_connection<'a, T: RosMessage<'a>>(&mut self, topic: &str) -> Result<ConnectionId> {
        self.add_raw_connection(topic, T::TYPE, T::MD5, T::DEFINITION)
    }

    /// Adds a topic of any type: its name, the MD5 of its definition and the definition with those of the types it
    /// uses, as in another bag's [`Connection`](crate::Connection).
    ///
    /// # Errors
    /// As [`BagWriter::add_connection`].
    pub fn add_raw_connection(
        &mut self,
        topic: &str,
        type_name: &str,
        md5: &str,
        definition: &str,
    ) -> Result<ConnectionId> {
        let id = self.connections.len() as u32;
        let size = topic.len() + type_name.len() + md5.len() + definition.len();
        self.check("a connection", size, LARGEST_CHUNK / 2)?;
        let mut data = Vec::new();
        let fields = [
            ("topic", topic),
            ("type", type_name),
            ("md5sum", md5),
            ("message_definition", definition),
        ];
        for (name, value) in fields {
            field(&mut data, name, value.as_bytes());
        }
        let mut bytes = Vec::new();
        let number = id.to_le_bytes();
        record(
            &mut bytes,
            op::CONNECTION,
            &[("conn", &number), ("topic", topic.as_bytes())],
            &data,
        );
        self.connections.push(bytes);
        Ok(ConnectionId(id))
    }

    /// Writes a message, recorded at `time`. Times need not increase.
    ///
    /// # Errors
    /// As [`BagWriter::write_raw`].
    pub fn write<'a, T: RosMessage<'a>>(
        &mut self,
        connection: ConnectionId,
        time: Time,
        message: &T,
    ) -> Result<()> {
        let mut bytes = std::mem::take(&mut self.scratch);
        bytes.clear();
        message.encode(&mut bytes);
        let written = self.write_raw(connection, time, &bytes);
        self.scratch = bytes;
        written
    }

    /// Writes a message's bytes.
    ///
    /// # Errors
    /// [`Error::NoSuchConnection`], [`Error::TooLarge`] for a message of 2 GiB, [`Error::File`].
    pub fn write_raw(
        &mut self,
        connection: ConnectionId,
        time: Time,
        message: &[u8],
    ) -> Result<()> {
        let Some(definition) = self.connections.get(connection.0 as usize) else {
            return Err(Error::NoSuchConnection {
                path: self.path.clone(),
                connection: connection.0,
            });
        };
        // Reserves space for the records' headers, twice what they take.
        let needed = message.len().saturating_add(definition.len() + 128);
        if needed > LARGEST_CHUNK {
            return self.check(
                "a message",
                message.len(),
                LARGEST_CHUNK - definition.len() - 128,
            );
        }
        if self.chunk.content.len() + needed > LARGEST_CHUNK {
            self.close_chunk()?;
        }
        self.chunk.add(
            connection.0,
            &self.connections[connection.0 as usize],
            time,
            message,
        );
        if self.chunk.content.len() >= self.options.chunk_bytes {
            self.close_chunk()
        } else {
            Ok(())
        }
    }

    /// Writes the rest and the index, and gives the bag its name; an existing file of that name is replaced.
    ///
    /// # Errors
    /// [`Error::File`]; then nothing is left behind.
    pub fn finish(mut self) -> Result<()> {
        self.close_chunk()?;
        let index_pos = self.at;
        let header = bag_header(index_pos, self.connections.len() as u32, self.chunks);
        let index = [
            self.connections.concat(),
            std::mem::take(&mut self.chunk_infos),
        ]
        .concat();
        self.put(&index)?;
        let path = self.path;
        let failed = |source| Error::file(&path, source);
        let mut file = self
            .out
            .into_inner()
            .map_err(|error| failed(error.into_error()))?;
        file.seek(SeekFrom::Start(13)).map_err(failed)?;
        file.write_all(&header).map_err(failed)?;
        drop(file);
        self.partial.publish().map_err(failed)
    }

    fn close_chunk(&mut self) -> Result<()> {
        let chunk = std::mem::take(&mut self.chunk);
        let Some((first, last)) = chunk.range else {
            return Ok(());
        };
        let position = self.at;
        let compression = self.options.compression;
        let stored = compress(compression, &chunk.content)
            .map_err(|source| Error::file(&self.path, source))?;
        self.check("a compressed chunk", stored.len(), u32::MAX as usize)?;
        let size = (chunk.content.len() as u32).to_le_bytes();
        let mut bytes = Vec::new();
        let fields: [(&str, &[u8]); 2] = [
            ("compression", compression.name().as_bytes()),
            ("size", &size),
        ];
        record_header(&mut bytes, op::CHUNK, &fields, stored.len());
        self.put(&bytes)?;
        self.put(&stored)?;
        bytes.clear();
        let mut counts = Vec::new();
        for (connection, entries) in &chunk.index {
            let (connection, count) = (
                connection.to_le_bytes(),
                (entries.len() as u32).to_le_bytes(),
            );
            let data: Vec<u8> = entries
                .iter()
                .flat_map(|(time, offset)| entry(*time, *offset))
                .collect();
            let fields: [(&str, &[u8]); 3] =
                [("ver", &VERSION), ("conn", &connection), ("count", &count)];
            record(&mut bytes, op::INDEX_DATA, &fields, &data);
            counts.extend_from_slice(&[connection, count].concat());
        }
        self.put(&bytes)?;
        let fields: [(&str, &[u8]); 5] = [
            ("ver", &VERSION),
            ("chunk_pos", &position.to_le_bytes()),
            ("start_time", &time_bytes(first)),
            ("end_time", &time_bytes(last)),
            ("count", &(chunk.index.len() as u32).to_le_bytes()),
        ];
        record(&mut self.chunk_infos, op::CHUNK_INFO, &fields, &counts);
        self.chunks += 1;
        // The buffer is reused for the next chunk.
        self.chunk.content = chunk.content;
        self.chunk.content.clear();
        Ok(())
    }

    fn put(&mut self, bytes: &[u8]) -> Result<()> {
        self.at += bytes.len() as u64;
        self.out
            .write_all(bytes)
            .map_err(|source| Error::file(&self.path, source))
    }

    fn check(&self, what: &'static str, bytes: usize, limit: usize) -> Result<()> {
        if bytes > limit {
            Err(Error::TooLarge {
                path: self.path.clone(),
                what,
                bytes: bytes as u64,
                limit: limit as u64,
            })
        } else {
            Ok(())
        }
    }
}

impl OpenChunk {
    fn add(&mut self, connection: u32, definition: &[u8], time: Time, message: &[u8]) {
        let entries = self.index.entry(connection).or_default();
        if entries.is_empty() {
            // Once per chunk, not once per bag: a chunk can then be read even if others are lost.
            self.content.extend_from_slice(definition);
        }
        entries.push((time, self.content.len() as u32));
        let fields: [(&str, &[u8]); 2] = [
            ("conn", &connection.to_le_bytes()),
            ("time", &time_bytes(time)),
        ];
        record(&mut self.content, op::MESSAGE, &fields, message);
        let (first, last) = self.range.unwrap_or((time, time));
        self.range = Some((first.min(time), last.max(time)));
    }
}
