//! Serialisation of messages: every field's type reads and writes itself, and `message!` creates a type from a list of fields.

use super::MessageError;
use crate::Time;
use std::borrow::Cow;

/// The bytes of a message that have not been read yet.
pub(crate) struct Reader<'a> {
    rest: &'a [u8],
    format: Format,
}

/// How the bytes are laid out.
#[derive(Clone, Copy)]
enum Format {
    /// ROS 1: little-endian, without padding, strings without an end mark.
    Ros1,
    /// CDR: numbers lie at multiples of their size, counted from the payload's start; strings end in a zero.
    Cdr { big: bool, length: usize },
}

impl<'a> Reader<'a> {
    #[inline]
    fn take(&mut self, count: usize) -> Result<&'a [u8], MessageError> {
        match self.rest.split_at_checked(count) {
            Some((taken, rest)) => {
                self.rest = rest;
                Ok(taken)
            }
            None => Err(self.short(count as u64)),
        }
    }

    /// A number's bytes, lowest first.
    #[inline]
    fn number<const N: usize>(&mut self) -> Result<[u8; N], MessageError> {
        let Format::Cdr { big, length } = self.format else {
            return self.array();
        };
        self.take((length - self.rest.len()).next_multiple_of(N) - (length - self.rest.len()))?;
        let mut bytes = self.array()?;
        if big {
            bytes.reverse();
        }
        Ok(bytes)
    }

    #[inline]
    fn array<const N: usize>(&mut self) -> Result<[u8; N], MessageError> {
        match self.rest.split_first_chunk() {
            Some((taken, rest)) => {
                self.rest = rest;
                Ok(*taken)
            }
            None => Err(self.short(N as u64)),
        }
    }

    /// Whether the message comes from ROS 2.
    pub(crate) fn is_cdr(&self) -> bool {
        matches!(self.format, Format::Cdr { .. })
    }

    #[cold]
    fn short(&self, needed: u64) -> MessageError {
        MessageError::Short {
            field: String::new(),
            needed,
            left: self.rest.len(),
        }
    }

    /// The length before a string or an array whose items take at least `item` bytes each; an error if there are too few
    /// bytes for them.
    fn length(&mut self, item: usize) -> Result<usize, MessageError> {
        let length = u32::read(self)? as usize;
        if length.saturating_mul(item) > self.rest.len() {
            Err(self.short(length as u64 * item as u64))
        } else {
            Ok(length)
        }
    }
}

/// Decodes a whole ROS 1 message, up to its last byte.
pub(crate) fn decode<'a, T: Wire<'a>>(bytes: &'a [u8]) -> Result<T, MessageError> {
    let mut reader = Reader {
        rest: bytes,
        format: Format::Ros1,
    };
    let message = T::read(&mut reader)?;
    match reader.rest.len() {
        0 => Ok(message),
        left => Err(MessageError::Long { left }),
    }
}

/// Decodes a whole ROS 2 message: four bytes that describe its layout, then plain CDR (OMG DDSI-RTPS 10.5, XCDR
/// version 1).
pub(crate) fn decode_cdr<'a, T: Wire<'a>>(bytes: &'a [u8]) -> Result<T, MessageError> {
    let big = cdr_is_big_endian(bytes)?;
    let payload = bytes.get(CDR_HEADER..).unwrap_or_default();
    let mut reader = Reader {
        rest: payload,
        format: Format::Cdr {
            big,
            length: payload.len(),
        },
    };
    let message = T::read(&mut reader)?;
    // Middleware pads a message to a multiple of four bytes.
    match reader.rest.len() {
        0..4 => Ok(message),
        left => Err(MessageError::Long { left }),
    }
}

/// Decodes the beginning of a message.
pub(crate) fn decode_first<'a, T: Wire<'a>>(bytes: &'a [u8], cdr: bool) -> Result<T, MessageError> {
    let format = if cdr {
        Format::Cdr {
            big: cdr_is_big_endian(bytes)?,
            length: bytes.len() - CDR_HEADER,
        }
    } else {
        Format::Ros1
    };
    let rest = if cdr { &bytes[CDR_HEADER..] } else { bytes };
    T::read(&mut Reader { rest, format })
}

/// Number of bytes before a CDR payload: its representation, and options.
pub(crate) const CDR_HEADER: usize = 4;

/// Whether the numbers of a CDR message are big-endian.
pub(crate) fn cdr_is_big_endian(bytes: &[u8]) -> Result<bool, MessageError> {
    match bytes {
        [0, 0, _, _, ..] => Ok(true),
        [0, 1, _, _, ..] => Ok(false),
        [high, low, _, _, ..] => Err(MessageError::Encapsulation {
            found: u16::from_be_bytes([*high, *low]),
        }),
        _ => Err(MessageError::Short {
            field: "encapsulation".to_owned(),
            needed: CDR_HEADER as u64,
            left: bytes.len(),
        }),
    }
}

/// A field's type.
pub(crate) trait Wire<'a>: Sized {
    /// The fewest bytes it takes.
    const LEAST: usize;
    fn read(reader: &mut Reader<'a>) -> Result<Self, MessageError>;
    fn write(&self, out: &mut Vec<u8>);
}

macro_rules! number {
    ($($number:ty),*) => {$(
        impl<'a> Wire<'a> for $number {
            const LEAST: usize = size_of::<$number>();

            #[inline]
            fn read(reader: &mut Reader<'a>) -> Result<Self, MessageError> {
                reader.number().map(<$number>::from_le_bytes)
            }

            fn write(&self, out: &mut Vec<u8>) {
                out.extend_from_slice(&self.to_le_bytes());
            }
        }
    )*};
}
number!(u8, i8, u16, u32, i32, u64, f32, f64);

impl<'a> Wire<'a> for bool {
    const LEAST: usize = 1;

    fn read(reader: &mut Reader<'a>) -> Result<Self, MessageError> {
        Ok(u8::read(reader)? != 0)
    }

    fn write(&self, out: &mut Vec<u8>) {
        out.push(u8::from(*self));
    }
}

impl<'a> Wire<'a> for Time {
    const LEAST: usize = 8;

    fn read(reader: &mut Reader<'a>) -> Result<Self, MessageError> {
        let (sec, nsec) = (u32::read(reader)?, u32::read(reader)?);
        // ROS 2 counts seconds with a sign; times before 1970 do not occur in recordings.
        let before_1970 = reader.is_cdr() && sec > i32::MAX as u32;
        Ok(if before_1970 {
            Self::ZERO
        } else {
            Self { sec, nsec }
        })
    }

    fn write(&self, out: &mut Vec<u8>) {
        self.sec.write(out);
        self.nsec.write(out);
    }
}

impl<'a> Wire<'a> for String {
    const LEAST: usize = 4;

    fn read(reader: &mut Reader<'a>) -> Result<Self, MessageError> {
        let length = reader.length(1)?;
        let mut bytes = reader.take(length)?;
        if reader.is_cdr() {
            bytes = bytes.strip_suffix(&[0]).unwrap_or(bytes);
        }
        let text = std::str::from_utf8(bytes);
        text.map(str::to_owned).map_err(|_| MessageError::Text {
            field: String::new(),
        })
    }

    fn write(&self, out: &mut Vec<u8>) {
        (self.len() as u32).write(out);
        out.extend_from_slice(self.as_bytes());
    }
}

/// Bulk data: borrowed.
impl<'a> Wire<'a> for Cow<'a, [u8]> {
    const LEAST: usize = 4;

    fn read(reader: &mut Reader<'a>) -> Result<Self, MessageError> {
        let length = reader.length(1)?;
        reader.take(length).map(Cow::Borrowed)
    }

    fn write(&self, out: &mut Vec<u8>) {
        (self.len() as u32).write(out);
        out.extend_from_slice(self);
    }
}

impl<'a, T: Wire<'a> + Default + Copy, const N: usize> Wire<'a> for [T; N] {
    const LEAST: usize = N * T::LEAST;

    #[inline]
    fn read(reader: &mut Reader<'a>) -> Result<Self, MessageError> {
        let mut items = [T::default(); N];
        for item in &mut items {
            *item = T::read(reader)?;
        }
        Ok(items)
    }

    fn write(&self, out: &mut Vec<u8>) {
        self.iter().for_each(|item| item.write(out));
    }
}

impl<'a, T: Wire<'a>> Wire<'a> for Vec<T> {
    const LEAST: usize = 4;

    fn read(reader: &mut Reader<'a>) -> Result<Self, MessageError> {
        let length = reader.length(T::LEAST)?;
        (0..length).map(|_| T::read(reader)).collect()
    }

    fn write(&self, out: &mut Vec<u8>) {
        (self.len() as u32).write(out);
        self.iter().for_each(|item| item.write(out));
    }
}

/// A struct of fields in the order of the wire, with its reader and writer. With `= "type" "md5" definition` after
/// its name, it is a message that a topic can have.
macro_rules! message {
    (
        $(#[$about:meta])*
        $name:ident $(<$life:lifetime>)? $(= $type:literal $md5:literal $definition:expr)? ;
        $($(#[$what:meta])* $field:ident: $kind:ty,)*
    ) => {
        $(#[$about])*
        #[derive(Debug, Clone, PartialEq)]
        pub struct $name $(<$life>)? {
            $($(#[$what])* pub $field: $kind,)*
        }

        impl<'a> $crate::msg::wire::Wire<'a> for message!(@of 'a $name $(<$life>)?) {
            const LEAST: usize = 0 $(+ <$kind as $crate::msg::wire::Wire<'a>>::LEAST)*;

            #[inline]
            fn read(reader: &mut $crate::msg::wire::Reader<'a>) -> Result<Self, $crate::msg::MessageError> {
                Ok(Self {
                    $($field: match $crate::msg::wire::Wire::read(reader) {
                        Ok(value) => value,
                        Err(error) => return Err(error.within(stringify!($field))),
                    },)*
                })
            }

            fn write(&self, out: &mut Vec<u8>) {
                $($crate::msg::wire::Wire::write(&self.$field, out);)*
            }
        }

        message!(@topic [$name $(<$life>)?] $($type, $md5, $definition)?);
    };
    (@topic [$($this:tt)*]) => {};
    (@topic [$($this:tt)*] $type:expr, $md5:expr, $definition:expr) => {
        impl<'a> $crate::msg::RosMessage<'a> for message!(@of 'a $($this)*) {
            const TYPE: &'static str = $type;
            const MD5: &'static str = $md5;
            const DEFINITION: &'static str = $definition;

            fn decode(bytes: &'a [u8]) -> Result<Self, $crate::msg::MessageError> {
                $crate::msg::wire::decode(bytes)
            }

            fn decode_cdr(bytes: &'a [u8]) -> Result<Self, $crate::msg::MessageError> {
                $crate::msg::wire::decode_cdr(bytes)
            }

            fn encode(&self, out: &mut Vec<u8>) {
                $crate::msg::wire::Wire::write(self, out);
            }
        }
    };
    (@of $given:lifetime $name:ident) => { $name };
    (@of $given:lifetime $name:ident <$life:lifetime>) => { $name<$given> };
}
pub(crate) use message;
