use deepfusion_hint::{Hint, count_of};
use std::borrow::Cow;
use std::fmt;

/// Why a message cannot be read.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum MessageError {
    /// The message ends within a field.
    #[error("field {field}: {} needed, {left} left", count_of(*needed, "byte"))]
    Short {
        /// The field, with the fields that contain it: `fields.name`.
        field: String,
        /// Number of bytes it takes.
        needed: u64,
        /// Number of bytes left.
        left: usize,
    },
    /// Bytes are left after the last field.
    #[error("{} left after the last field", count_of(*left, "byte"))]
    Long {
        /// Number of bytes left.
        left: usize,
    },
    /// A string is not UTF-8.
    #[error("field {field}: not UTF-8")]
    Text {
        /// Name of the field.
        field: String,
    },
    /// A ROS 2 message has another layout than plain CDR.
    #[error("encapsulation {found:#06x}, expected plain CDR, 0x0000 or 0x0001")]
    Encapsulation {
        /// The representation's number.
        found: u16,
    },
    /// A cloud has no field of this name.
    #[error("no field {field} in the cloud; its fields: {}", fields.join(", "))]
    NoField {
        /// The requested name.
        field: String,
        /// The names of the cloud's fields.
        fields: Vec<String>,
    },
    /// The number type of a cloud's field is unknown.
    #[error("field {field}: datatype {datatype}, expected 1 (INT8) to 8 (FLOAT64)")]
    Datatype {
        /// Name of the field.
        field: String,
        /// The code of its type.
        datatype: u8,
    },
    /// Sizes within a message contradict each other.
    #[error("{of}: {problem}")]
    Layout {
        /// The part that has these sizes.
        of: MessagePart,
        /// The contradiction.
        problem: LayoutProblem,
    },
    /// An image's encoding is unknown, or not one of those requested.
    #[error("encoding `{encoding}`, expected {expected}")]
    Encoding {
        /// The image's encoding.
        encoding: String,
        /// The accepted encodings.
        expected: Cow<'static, str>,
    },
}

/// A part of a message that states how its bytes are laid out.
#[derive(Debug, Clone, PartialEq, Eq)]
#[non_exhaustive]
pub enum MessagePart {
    /// An image.
    Image {
        /// Width in pixels.
        width: u32,
        /// Height in pixels.
        height: u32,
        /// Name of the encoding.
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
        /// Length of the row, bytes.
        row: usize,
        /// Distance between rows, bytes.
        step: usize,
    },
    /// There are fewer bytes than the pixels take.
    #[error("{} needed, there are {left}", count_of(*needed, "byte"))]
    Pixels {
        /// Number of bytes that the pixels take.
        needed: usize,
        /// Number of bytes that there are.
        left: usize,
    },
    /// A Bayer pattern does not fit into the image.
    #[error("a Bayer pattern needs at least two rows and two columns")]
    Bayer,
    /// Pairs of pixels share a colour, but the width is odd.
    #[error("two pixels share a colour, so the width must be even")]
    OddWidth,
    /// A row of points is longer than the distance between rows.
    #[error("{points} points of {point_step} bytes do not fit into a row of {row_step}")]
    PointRow {
        /// Number of points in a row.
        points: u64,
        /// Distance between points, bytes.
        point_step: u32,
        /// Distance between rows, bytes.
        row_step: u32,
    },
    /// There are fewer bytes than the points take.
    #[error("{width}x{height} points of {point_step} bytes need {needed} bytes, there are {left}")]
    Points {
        /// Number of points in a row.
        width: u64,
        /// Number of rows.
        height: u64,
        /// Distance between points, bytes.
        point_step: u32,
        /// Number of bytes that the points take.
        needed: u128,
        /// Number of bytes that there are.
        left: usize,
    },
    /// A field has fewer numbers than were requested.
    #[error("{}, number {element} was asked for", count_of(*count, "number"))]
    Element {
        /// Number of numbers in the field.
        count: u32,
        /// The requested one, counted from 0.
        element: u32,
    },
    /// A field lies outside its point.
    #[error("it lies at bytes {offset} to {end} of a point of {point_step} bytes")]
    Outside {
        /// First byte of the field within the point.
        offset: u64,
        /// First byte after the field.
        end: u64,
        /// Distance between points, bytes.
        point_step: u32,
    },
    /// Columns have different lengths.
    #[error("{}, {first} has {points}", count_of(*numbers, "number"))]
    Columns {
        /// Number of numbers in the column.
        numbers: usize,
        /// Name of the first column.
        first: String,
        /// Number of numbers in the first column.
        points: usize,
    },
    /// The points take more bytes than the format can count.
    #[error("{points} points of {point_step} bytes exceed 4 GiB")]
    TooMany {
        /// Number of points.
        points: usize,
        /// Distance between points, bytes.
        point_step: usize,
    },
}

impl MessageError {
    /// The same error, about a field within `outer`.
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
                "copy the bag again: the message is damaged, or was recorded with another definition than its MD5 says"
            }
            Self::Encapsulation { .. } => {
                "copy the bag again, or record it with a middleware that writes plain CDR, not XCDR version 2 or parameter lists"
            }
            Self::NoField { .. } => "name one of the listed fields",
            Self::Datatype { .. } | Self::Layout { .. } => {
                "correct the driver, which describes the message's layout wrongly"
            }
            Self::Encoding { expected, .. } => {
                return Some(format!(
                    "convert the topic to one of these, with image_proc or cv_bridge: {expected}"
                ));
            }
        };
        Some(text.to_owned())
    }
}
