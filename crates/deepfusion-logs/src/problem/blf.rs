//! What is wrong with a Vector binary log.

use deepfusion_hint::count_of;

/// What is wrong with a Vector binary log.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum BlfProblem {
    /// The file does not begin with the format's mark.
    #[error("not a Vector binary log (BLF)")]
    NoLog,
    /// The size of the file's header is impossible.
    #[error("invalid header size: {}", count_of(*.0, "byte"))]
    Header(usize),
    /// The file is shorter than its header says.
    #[error("the header gives a length of {}, the file has {bytes}", count_of(*stated, "byte"))]
    Length {
        /// The length in its header, bytes.
        stated: u64,
        /// Its actual length, bytes.
        bytes: u64,
    },
    /// The date in its header is invalid.
    #[error(
        "{0:?} is not a date (year, month, day of the week, day, hour, minute, second, millisecond)"
    )]
    Date([u16; 8]),
    /// The file ends before the end of what is being read.
    #[error("the file ends after {left} of {}", count_of(*count, "byte"))]
    Cut {
        /// Number of bytes left.
        left: u64,
        /// Number of bytes expected.
        count: usize,
    },
    /// The file ends within an object.
    #[error("the file ends within an object")]
    ObjectCut,
    /// There is no object where one should begin.
    #[error("no object begins here")]
    NoObject,
    /// The size of an object is impossible.
    #[error("invalid object size: {}", count_of(*.0, "byte"))]
    Object(usize),
    /// A container is too short for its own header.
    #[error("too short for its header: {}", count_of(*.0, "byte"))]
    Container(usize),
    /// The stated content of a container is larger than accepted.
    #[error("its stated content of {0} bytes is too large")]
    TooLarge(usize),
    /// A container's content cannot be decompressed.
    #[error("zlib: {0}")]
    Zlib(#[source] std::io::Error),
    /// A container is compressed with an unknown method.
    #[error("unknown compression {0}, expected 0 (none) or 2 (zlib)")]
    Compression(u16),
    /// A container's content has another size than its header says.
    #[error("its content has {}, its header says {stated}", count_of(*bytes, "byte"))]
    ContainerSize {
        /// Size of the content, bytes.
        bytes: usize,
        /// The size in its header, bytes.
        stated: usize,
    },
    /// An object in a container's content cannot be read.
    #[error("at byte {at} of its content: {problem}")]
    Within {
        /// Position in the content; below 0 in that of the container before.
        at: i64,
        /// What is wrong with the object.
        problem: Box<BlfProblem>,
    },
    /// A CAN frame is too short.
    #[error("a CAN frame of {} is too short", count_of(*.0, "byte"))]
    Frame(usize),
    /// A time has an unknown unit.
    #[error("unknown time unit {0}, expected 1 (10 µs) or 2 (1 ns)")]
    TimeUnit(u32),
    /// A time has more nanoseconds than an `i64` holds.
    #[error("a time beyond 292 years")]
    TooLate,
    /// An identifier is too large for a standard frame's.
    #[error("identifier {0:X} has more than 11 bits")]
    LongIdentifier(u32),
}
