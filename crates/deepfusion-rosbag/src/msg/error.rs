use deepfusion_hint::{Hint, count_of};
use std::borrow::Cow;
use std::fmt;

/// What can be wrong within a message.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum MessageError {
    /// The message ends within a field.
    #[error("field {field}: {} needed, {left} left", count_of(*needed, "byte"))]
    Short {
        /// The field, with those it lies in: `fields.name`.
        field: String,
        /// How many bytes it takes.
        needed: u64,
        /// How many there are.
        left: usize,
    },
    /// Bytes are left after the last field.
    #[error("{} left after the last field", count_of(*left, "byte"))]
    Long {
        /// How many.
        left: usize,
    },
    /// A string is no UTF-8.
    #[error("field {field}: not UTF-8")]
    Text {
        /// The field.
        field: String,
    },
    /// A message of ROS 2 is laid out in another way than plain CDR.
    #[error("encapsulation {found:#06x}: expected plain CDR, 0x0000 or 0x0001")]
    Encapsulation {
        /// The representation's number.
        found: u16,
    },
    /// A cloud has no field of the name.
    #[error("no field {field} in the cloud; there are {}", fields.join(", "))]
    NoField {
        /// The name asked for.
        field: String,
        /// The names there are.
        fields: Vec<String>,
    },
    /// A cloud's field has an unknown type of number.
    #[error("field {field}: datatype {datatype}, expected 1 (INT8) to 8 (FLOAT64)")]
    Datatype {
        /// The field's name.
        field: String,
        /// What stands for its type.
        datatype: u8,
    },
    /// Sizes within a message contradict each other.
    #[error("{of}: {problem}")]
    Layout {
        /// What has the sizes.
        of: MessagePart,
        /// The contradiction.
        problem: LayoutProblem,
    },
    /// An image's encoding is unknown, or another than asked for.
    #[error("encoding `{encoding}`: expected {expected}")]
    Encoding {
        /// The image's.
        encoding: String,
        /// Those that would do.
        expected: Cow<'static, str>,
    },
}

/// A part of a message that states how its bytes are laid out.
#[derive(Debug, Clone, PartialEq, Eq)]
#[non_exhaustive]
pub enum MessagePart {
    /// An image.
    Image {
        /// Its width in pixels.
        width: u32,
        /// Its height in pixels.
        height: u32,
        /// Its encoding's name.
        encoding: String,
    },
    /// A cloud of points.
    Cloud,
    /// A field of a cloud's points, by name.
    Field(String),
}

impl fmt::Display for MessagePart {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Image {
                width,
                height,
                encoding,
            } => write!(f, "image of {width}x{height} {encoding}"),
            Self::Cloud => f.write_str("cloud"),
            Self::Field(name) => write!(f, "field {name}"),
        }
    }
}

/// How sizes within a message contradict each other.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum LayoutProblem {
    /// A row of pixels is longer than the distance between rows.
    #[error("a row of {row} bytes does not fit into a step of {step}")]
    Row {
        /// The row's length.
        row: usize,
        /// From row to row.
        step: usize,
    },
    /// There are fewer bytes than the pixels take.
    #[error("{} needed, there are {left}", count_of(*needed, "byte"))]
    Pixels {
        /// How many bytes they take.
        needed: usize,
        /// How many there are.
        left: usize,
    },
    /// A Bayer pattern does not fit into the image.
    #[error("a Bayer pattern has two rows and columns or more")]
    Bayer,
    /// Pairs of pixels share a colour, and the width is odd.
    #[error("two pixels share a colour, so the width must be even")]
    OddWidth,
    /// A row of points is longer than the distance between rows.
    #[error("{points} points of {point_step} bytes do not fit into a row of {row_step}")]
    PointRow {
        /// How many points a row has.
        points: u64,
        /// From point to point.
        point_step: u32,
        /// From row to row.
        row_step: u32,
    },
    /// There are fewer bytes than the points take.
    #[error("{width}x{height} points of {point_step} bytes need {needed} bytes, there are {left}")]
    Points {
        /// How many points a row has.
        width: u64,
        /// How many rows there are.
        height: u64,
        /// From point to point.
        point_step: u32,
        /// How many bytes they take.
        needed: u128,
        /// How many there are.
        left: usize,
    },
    /// A field has fewer numbers than were asked for.
    #[error("{}, number {element} was asked for", count_of(*count, "number"))]
    Element {
        /// How many it has.
        count: u32,
        /// The one asked for, counted from 0.
        element: u32,
    },
    /// A field lies outside of its point.
    #[error("bytes {offset} to {end} of a point of {point_step} bytes")]
    Outside {
        /// Where it begins.
        offset: u64,
        /// Where it ends.
        end: u64,
        /// From point to point.
        point_step: u32,
    },
    /// Columns have different lengths.
    #[error("{}, {first} has {points}", count_of(*numbers, "number"))]
    Columns {
        /// How many numbers the column has.
        numbers: usize,
        /// The first column's name.
        first: String,
        /// How many numbers that has.
        points: usize,
    },
    /// The points take more bytes than the format can count.
    #[error("{points} points of {point_step} bytes exceed 4 GiB")]
    TooMany {
        /// How many points there are.
        points: usize,
        /// From point to point.
        point_step: usize,
    },
}

impl MessageError {
    /// The same error, of a field within `outer`.
    #[must_use]
    pub(crate) fn within(mut self, outer: &str) -> Self {
        if let Self::Short { field, .. } | Self::Text { field } = &mut self {
            *field = if field.is_empty() {
                outer.to_owned()
            } else {
                format!("{outer}.{field}")
            };
        }
        self
    }
}

impl Hint for MessageError {
    fn hint(&self) -> Option<String> {
        let text = match self {
            Self::Short { .. } | Self::Long { .. } | Self::Text { .. } => {
                "the message is damaged, or was recorded with another definition than its MD5 says"
            }
            Self::Encapsulation { .. } => {
                "the message is damaged, or its middleware wrote XCDR version 2 or parameter lists, which are not read"
            }
            Self::NoField { .. } => "name one of the fields there are",
            Self::Datatype { .. } | Self::Layout { .. } => {
                "the driver that made the message describes it wrongly"
            }
            Self::Encoding { expected, .. } => {
                return Some(format!(
                    "convert the topic, with image_proc or cv_bridge, to one of {expected}"
                ));
            }
        };
        Some(text.to_owned())
    }
}
