//! Some packets as an IVF file, which ffmpeg decodes to one picture per packet, numbered as the packets are.
//!
//! IVF is a header of 32 bytes (codec, size, rate, count) and, before each packet, its length and a time. ffmpeg names a picture by
//! that time, so a picture that it does not write is noticed by its missing name.

use super::Codec;
use crate::program::{Printed, outcome, with_either_option_name};
use crate::{Error, PacketProblem, ProgramProblem, ProgramTask, Result};
use std::ffi::OsStr;
use std::fs::File;
use std::io::{BufWriter, Read, Write};
use std::path::Path;

const NAME: &str = "packets.ivf";
/// The file with the first packets, which are decoded again to find the wrong one.
const TRIED: &str = "tried.ivf";
const HEAD: u64 = 32;
/// The unit of a packet's time, its number, as the file's header gives it.
const RATE: &str = "1:25";
/// Messages of ffmpeg that are about itself or the disk, not about a packet.
const OWN_PROBLEMS: [&str; 4] = [
    "Unknown decoder",
    "Decoder not found",
    "No space left on device",
    "Permission denied",
];

/// Packets in a temporary file, which is deleted when this is dropped.
#[derive(Debug)]
pub(super) struct Batch<'a> {
    codec: Codec,
    folder: &'a Path,
    file: BufWriter<File>,
    first: u64,
    /// Where each packet ends in the file.
    ends: Vec<u64>,
}

impl<'a> Batch<'a> {
    /// An empty batch in a folder, whose first packet will be number `first` of the stream.
    ///
    /// # Errors
    /// [`Error::File`].
    pub(super) fn new(folder: &'a Path, codec: Codec, first: u64) -> Result<Self> {
        let path = folder.join(NAME);
        let failed = |e| Error::file(&path, e);
        let mut file = BufWriter::new(File::create(&path).map_err(failed)?);
        file.write_all(&head(codec)).map_err(failed)?;
        Ok(Self {
            codec,
            folder,
            file,
            first,
            ends: Vec::new(),
        })
    }

    /// Number of packets.
    pub(super) fn len(&self) -> usize {
        self.ends.len()
    }

    /// Adds the next packet.
    ///
    /// # Errors
    /// [`Error::File`].
    pub(super) fn add(&mut self, packet: &[u8]) -> Result<()> {
        let head = packet_head(packet, self.first + self.ends.len() as u64);
        let written = self.file.write_all(&head);
        let written = written.and_then(|()| self.file.write_all(packet));
        written.map_err(|e| Error::file(&self.folder.join(NAME), e))?;
        let start = self.ends.last().copied().unwrap_or(HEAD);
        self.ends.push(start + (head.len() + packet.len()) as u64);
        Ok(())
    }

    /// Decodes all packets into the folder, and deletes their file. The inner error: the number of the first packet that does not give
    /// a complete picture, and why.
    ///
    /// # Errors
    /// [`Error::Program`] if ffmpeg is not installed; [`Error::File`].
    pub(super) fn decode(
        mut self,
        of: &Path,
    ) -> Result<std::result::Result<(), (u64, PacketProblem)>> {
        let path = self.folder.join(NAME);
        self.file.flush().map_err(|e| Error::file(&path, e))?;
        let whole = self.run(of, NAME, self.folder, self.len())?;
        let outcome = match whole {
            None => Ok(()),
            Some(problem) => Err(self.first_wrong(of, problem)?),
        };
        std::fs::remove_file(&path).map_err(|e| Error::file(&path, e))?;
        Ok(outcome)
    }

    /// Finds the first wrong packet by decoding fewer of them; `problem` is the one found for all of them.
    fn first_wrong(&self, of: &Path, problem: PacketProblem) -> Result<(u64, PacketProblem)> {
        let aside = self.folder.join("tried");
        let path = self.folder.join(TRIED);
        let (mut whole, mut wrong) = (0, (self.len(), problem));
        // The packets after a wrong one cannot make it right.
        while wrong.0 - whole > 1 {
            let middle = (whole + wrong.0) / 2;
            std::fs::create_dir_all(&aside).map_err(|e| Error::file(&aside, e))?;
            self.copy(middle, &path)
                .map_err(|e| Error::file(&path, e))?;
            let found = self.run(of, &format!("../{TRIED}"), &aside, middle)?;
            std::fs::remove_dir_all(&aside).map_err(|e| Error::file(&aside, e))?;
            match found {
                Some(problem) => wrong = (middle, problem),
                None => whole = middle,
            }
        }
        Ok((self.first + whole as u64, wrong.1))
    }

    /// The first packets in another file.
    fn copy(&self, packets: usize, path: &Path) -> std::io::Result<()> {
        let end = packets.checked_sub(1).map_or(HEAD, |last| self.ends[last]);
        let mut all = File::open(self.folder.join(NAME))?.take(end);
        std::io::copy(&mut all, &mut File::create(path)?).map(|_| ())
    }

    /// Decodes a file of the first `packets` into a folder; returns what was wrong, if anything was.
    fn run(
        &self,
        of: &Path,
        file: &str,
        folder: &Path,
        packets: usize,
    ) -> Result<Option<PacketProblem>> {
        let printed = ffmpeg(self.codec, &Source::File(file), (of, folder))?;
        let there = |i: &u64| crate::cache::frame_path(folder, *i).is_file();
        let numbers = self.first..self.first + packets as u64;
        if printed.succeeded && printed.complaint.is_empty() && numbers.clone().all(|i| there(&i)) {
            return Ok(None);
        }
        let message = &printed.complaint;
        if let Some(own) = message
            .lines()
            .find(|line| OWN_PROBLEMS.iter().any(|p| line.contains(p)))
        {
            return Err(Error::Program {
                path: of.to_owned(),
                program: "ffmpeg",
                problem: ProgramProblem::Unable {
                    message: own.trim().to_owned(),
                },
            });
        }
        if message.contains("monoton") || message.contains("Invalid pts") {
            return Ok(Some(PacketProblem::Reordered));
        }
        // The first line, without the name and address of the part of ffmpeg that printed it.
        let line = message.lines().next().unwrap_or_default();
        let line = line.rsplit_once("] ").map_or(line, |(_, line)| line);
        Ok(Some(if line.is_empty() {
            PacketProblem::NoPicture
        } else {
            let message = line.to_owned();
            PacketProblem::Damaged { message }
        }))
    }
}

/// A packet's picture as PNG.
///
/// # Errors
/// [`Error::Program`] if ffmpeg is not installed. The inner error: why there is none.
pub(super) fn picture(
    codec: Codec,
    packet: &[u8],
    of: &Path,
) -> Result<std::result::Result<Vec<u8>, PacketProblem>> {
    let file = [&head(codec)[..], &packet_head(packet, 0), packet].concat();
    let printed = ffmpeg(codec, &Source::Bytes(&file), (of, Path::new(".")))?;
    Ok(if printed.text.is_empty() {
        let message = printed.complaint;
        Err(PacketProblem::NoFirstPicture { message })
    } else {
        Ok(printed.text)
    })
}

/// The source and the output: a file by its name, with every picture written as a JPEG with its number; or bytes in memory, with the first
/// picture written as PNG.
enum Source<'a> {
    File(&'a str),
    Bytes(&'a [u8]),
}

/// Runs it on a file of packets; its messages show whether all is well.
fn ffmpeg(codec: Codec, source: &Source<'_>, (of, folder): (&Path, &Path)) -> Result<Printed> {
    let (name, bytes) = match source {
        Source::File(name) => (*name, None),
        Source::Bytes(bytes) => ("pipe:0", Some(*bytes)),
    };
    with_either_option_name(|mode| {
        // Times stay as they are. A packet with an error gives no picture, rather than half of one.
        let mut arguments = vec!["-v", "error", "-y", "-copyts", "-err_detect", "explode"];
        if let Some(decoder) = codec.decoder() {
            arguments.extend(["-c:v", decoder]);
        }
        arguments.extend([
            "-f",
            "ivf",
            "-i",
            name,
            "-map",
            "0:v:0",
            mode,
            "passthrough",
        ]);
        arguments.extend(match source {
            // Pictures are named in the encoder's unit of time, which follows the guessed rate of the stream unless it is set.
            Source::File(_) => &[
                "-q:v",
                "2",
                "-enc_time_base",
                RATE,
                "-frame_pts",
                "1",
                "-f",
                "image2",
                "%010d.jpg",
            ][..],
            Source::Bytes(_) => &[
                "-frames:v",
                "1",
                "-c:v",
                "png",
                "-f",
                "image2pipe",
                "pipe:1",
            ],
        });
        let arguments: Vec<&OsStr> = arguments.iter().map(OsStr::new).collect();
        outcome("ffmpeg", &arguments, (of, ProgramTask::Read), folder, bytes)
    })
}

/// The file's header. The frames' size and the number of packets in it are not used, since the packets determine both. The rate is 25 per
/// second: [`RATE`].
fn head(codec: Codec) -> [u8; HEAD as usize] {
    let mut head = [0; HEAD as usize];
    head[..4].copy_from_slice(b"DKIF");
    head[6] = HEAD as u8;
    head[8..12].copy_from_slice(codec.fourcc());
    // Width and height are arbitrary.
    (head[12], head[14]) = (64, 64);
    (head[16], head[20]) = (25, 1);
    head
}

fn packet_head(packet: &[u8], number: u64) -> [u8; 12] {
    let mut head = [0; 12];
    head[..4].copy_from_slice(&(packet.len() as u32).to_le_bytes());
    head[4..].copy_from_slice(&number.to_le_bytes());
    head
}
