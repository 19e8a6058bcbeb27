use deepfusion_hint::Hint;
use std::borrow::Cow;

/// What can be wrong within a message.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum MessageError {
    /// The message ends within a field.
    #[error("field {field}: {needed} bytes needed, {left} left")]
    Short {
        /// The field, with those it lies in: `fields.name`.
        field: String,
        /// How many bytes it takes.
        needed: u64,
        /// How many there are.
        left: usize,
    },
    /// Bytes are left after the last field.
    #[error("{left} bytes left after the last field")]
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
    #[error("{what}: {problem}")]
    Layout {
        /// What has the size.
        what: String,
        /// The contradiction.
        problem: String,
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
