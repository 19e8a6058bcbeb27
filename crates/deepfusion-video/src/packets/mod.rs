//! The frames of a stream whose packets are in a recording's messages, as files.
//!
//! As for a video, all frames are decoded once, in order, into a folder of JPEGs (`cache`); a frame is found by its packet's number
//! alone. Packets go to ffmpeg in hundreds, starting at a key frame (`batch`), so that memory does not grow with the recording. An
//! error names the packet by its number: ffmpeg names each picture by its packet, and errors in H.264 that ffmpeg would conceal are
//! detected here (`h264`).

mod batch;
mod codec;
mod h264;
mod nal;

pub use codec::Codec;

use crate::cache::{Origin, frame_path, keep};
use crate::decoded::Decoded;
use crate::{Error, PacketProblem, Result};
use batch::Batch;
use deepfusion_hint::Hint;
use std::path::{Path, PathBuf};

/// Least number of packets that are decoded together; the next key frame after them begins a new batch.
const TOGETHER: usize = 250;

/// Identifies a stream.
#[derive(Debug, Clone)]
pub struct PacketStream {
    /// Path of the recording, for messages and to notice that it changed: a file, or a folder of files.
    pub file: PathBuf,
    /// The stream's name in it, such as a topic.
    pub name: String,
    /// Its codec.
    pub codec: Codec,
    /// Number of messages before the first key frame, which are not packets here.
    pub before: u64,
    /// Number of packets from the first key frame on.
    pub count: usize,
}

/// A stream's frames: decoded when the first of them is requested.
#[derive(Debug)]
pub struct PacketFrames {
    stream: PacketStream,
    cache: PathBuf,
    decoded: Decoded,
}

impl PacketFrames {
    /// A stream whose frames will be kept in the folder `cache`, such as [`frames_folder`](crate::frames_folder) gives.
    ///
    /// # Errors
    /// [`Error::File`] if the working folder does not exist.
    pub fn new(stream: PacketStream, cache: &Path) -> Result<Self> {
        // ffmpeg runs in other folders.
        let cache = std::path::absolute(cache).map_err(|e| Error::file(cache, e))?;
        Ok(Self {
            stream,
            cache,
            decoded: Decoded::default(),
        })
    }

    /// Path of the JPEG of a packet's picture, counted from 0. The first call decodes all `packets`, starting at the first key frame, unless
    /// that was done before.
    ///
    /// # Errors
    /// Those of `packets`; [`Error::Packet`] for one that is damaged, does not follow the one before it, or is a B-frame;
    /// [`Error::Program`] without ffmpeg; [`Error::File`] if frames cannot be kept; [`Error::NotDecoded`] with the same message for every
    /// frame that is requested after that.
    pub fn frame<E, P>(
        &self,
        index: u64,
        packets: impl FnOnce() -> std::result::Result<P, E>,
    ) -> std::result::Result<PathBuf, E>
    where
        E: From<Error> + Hint,
        P: Iterator<Item = std::result::Result<Vec<u8>, E>>,
    {
        self.decoded.once::<E>(|| {
            let PacketStream { file, name, .. } = &self.stream;
            let origin =
                Origin::of(file, self.stream.count, Some(name.clone()))?.kept_in(&self.cache, file);
            keep(&self.cache, &origin, |part| self.decode(part, packets()?))
        })?;
        Ok(frame_path(&self.cache, index))
    }

    /// The picture of the first packet as PNG, without decoding the others.
    ///
    /// # Errors
    /// [`Error::Packet`], [`Error::Program`].
    pub fn first_picture(&self, packet: &[u8]) -> Result<Vec<u8>> {
        let picture = batch::picture(self.stream.codec, packet, &self.stream.file)?;
        picture.map_err(|problem| self.wrong(0, problem))
    }

    fn decode<E: From<Error>>(
        &self,
        part: &Path,
        packets: impl Iterator<Item = std::result::Result<Vec<u8>, E>>,
    ) -> std::result::Result<(), E> {
        let codec = self.stream.codec;
        let mut watch = (codec == Codec::H264).then(h264::PacketWatch::default);
        let mut batch = Batch::new(part, codec, 0)?;
        let mut number = 0;
        for packet in packets {
            let packet = packet?;
            if let Some(Err(problem)) = watch.as_mut().map(|watch| watch.next(&packet)) {
                return Err(self.wrong(number, problem).into());
            }
            if batch.len() >= TOGETHER && codec.begins(&packet) {
                self.decode_batch(batch)?;
                batch = Batch::new(part, codec, number)?;
            }
            batch.add(&packet)?;
            number += 1;
        }
        self.decode_batch(batch)?;
        if number != self.stream.count as u64 {
            let counted = self.stream.count;
            return Err(self.wrong(number, PacketProblem::Ended { counted }).into());
        }
        Ok(())
    }

    fn decode_batch(&self, batch: Batch<'_>) -> Result<()> {
        if batch.len() == 0 {
            return Ok(());
        }
        let decoded = batch.decode(&self.stream.file)?;
        decoded.map_err(|(number, problem)| self.wrong(number, problem))
    }

    fn wrong(&self, packet: u64, problem: PacketProblem) -> Error {
        Error::Packet {
            path: self.stream.file.clone(),
            stream: self.stream.name.clone(),
            number: self.stream.before + packet,
            problem,
        }
    }
}
