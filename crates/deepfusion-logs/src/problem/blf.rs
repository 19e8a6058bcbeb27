//! What is wrong with a binary log of Vector's.

use deepfusion_hint::count_of;

/// What is wrong with a binary log of Vector's.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum BlfProblem {
    /// It does not begin as one.
    #[error("no binary log of Vector's begins so")]
    NoLog,
    /// Its header has a size that no header has.
    #[error("a header of {}", count_of(*.0, "byte"))]
    Header(usize),
    /// It is shorter than its header says.
    #[error("the header says {}, the file has {bytes}", count_of(*stated, "byte"))]
    Length {
        /// The length in its header.
        stated: u64,
        /// Its length.
        bytes: u64,
    },
    /// Its date is none.
    #[error(
        "{0:?} is no date (year, month, day of the week, day, hour, minute, second, millisecond)"
    )]
    Date([u16; 8]),
    /// It ends before what is being read.
    #[error("the file ends after {left} of {}", count_of(*count, "byte"))]
    Cut {
        /// How many bytes are left.
        left: u64,
        /// How many there should be.
        count: usize,
    },
    /// It ends within an object.
    #[error("the file ends within an object")]
    ObjectCut,
    /// Something else stands where an object should begin.
    #[error("no object begins here")]
    NoObject,
    /// An object has a size that no object has.
    #[error("an object of {}", count_of(*.0, "byte"))]
    Object(usize),
    /// A container is too short for its own header.
    #[error("{}", count_of(*.0, "byte"))]
    Container(usize),
    /// A container says that it holds more than is believed.
    #[error("it says that it holds {0} bytes")]
    TooLarge(usize),
    /// A container's content cannot be unpacked.
    #[error("zlib: {0}")]
    Zlib(#[source] std::io::Error),
    /// A container is compressed in a way that is not read.
    #[error("compression {0}; 0 (none) and 2 (zlib) are known")]
    Compression(u16),
    /// A container's content has another size than it says.
    #[error("it holds {} and says {stated}", count_of(*bytes, "byte"))]
    ContainerSize {
        /// How many bytes came out.
        bytes: usize,
        /// The size it says.
        stated: usize,
    },
    /// An object of a container's content cannot be read.
    #[error("at byte {at} of what it holds: {problem}")]
    Within {
        /// Where, counted in the content; below 0 in that of the container before.
        at: i64,
        /// What is wrong there.
        problem: Box<BlfProblem>,
    },
    /// A CAN frame is too short.
    #[error("a CAN frame of {}", count_of(*.0, "byte"))]
    Frame(usize),
    /// A time is counted in an unknown unit.
    #[error("a time in unit {0}; 1 (10 µs) and 2 (1 ns) are known")]
    TimeUnit(u32),
    /// A time has more nanoseconds than can be counted.
    #[error("a time of more than 292 years")]
    TooLate,
    /// An identifier is too large for a standard frame's.
    #[error("identifier {0:X} has more than 11 bits")]
    LongIdentifier(u32),
}
