use super::{BitLayout, ByteOrder, CanId, CanSignal, MultiplexCondition, Number};
use crate::error::{Error, Result, SignalProblem};
use can_dbc::{MessageId, MultiplexIndicator, NumericValue, SignalExtendedValueType};
use deepfusion_fs::FileError;
use std::path::Path;

/// A DBC file: the description of the signals in CAN frames.
#[derive(Debug, Clone)]
pub struct Dbc(can_dbc::Dbc);

impl Dbc {
    /// Reads a file in UTF-8 or Latin-1 (units such as "°" are not always in UTF-8).
    ///
    /// # Errors
    /// [`Error::File`]; [`Error::Dbc`] with the line that cannot be read.
    pub fn open(path: &Path) -> Result<Self> {
        let bytes = std::fs::read(path).map_err(|source| FileError::new(path, source))?;
        let text = String::from_utf8(bytes)
            .unwrap_or_else(|e| e.as_bytes().iter().map(|b| char::from(*b)).collect());
        Self::of_text(&text, Some(path))
    }

    /// Reads a file's text.
    ///
    /// # Errors
    /// [`Error::Dbc`] with the line that cannot be read.
    pub fn parse(text: &str) -> Result<Self> {
        Self::of_text(text, None)
    }

    fn of_text(text: &str, path: Option<&Path>) -> Result<Self> {
        can_dbc::Dbc::try_from(text)
            .map(Self)
            .map_err(|error| Error::Dbc {
                path: path.map(Path::to_owned),
                problem: error.into(),
            })
    }

    /// The names of all signals, "Message.Signal", in the file's order.
    pub fn names(&self) -> impl Iterator<Item = String> {
        self.0.messages.iter().flat_map(|message| {
            let signals = message.signals.iter();
            signals.map(|signal| format!("{}.{}", message.name, signal.name))
        })
    }

    /// The unit of a signal, as written in the file; `None` if there is no such signal.
    #[must_use]
    pub fn unit(&self, name: &str) -> Option<&str> {
        self.find(name).ok().map(|(_, signal)| signal.unit.as_str())
    }

    /// A signal by its name, "Message.Signal".
    ///
    /// # Errors
    /// [`Error::NoSignal`], which lists the signals that exist; [`Error::Layout`] for a signal that does not fit into a frame.
    pub fn signal(&self, name: &str) -> Result<CanSignal> {
        let (message, signal) = self.find(name)?;
        let layout = self.layout(message, signal);
        layout.validate(name)?;
        let mut multiplexed = Vec::new();
        self.conditions(message, signal, &mut multiplexed);
        for condition in &multiplexed {
            condition.switch.validate(name)?;
        }
        Ok(CanSignal {
            id: id(message.id),
            layout,
            multiplexed,
            range: range(signal),
        })
    }

    fn find(&self, name: &str) -> Result<(&can_dbc::Message, &can_dbc::Signal)> {
        let missing = |problem| Error::NoSignal {
            name: name.to_owned(),
            problem,
        };
        let Some((message_name, signal_name)) = name.split_once('.') else {
            return Err(missing(SignalProblem::Name));
        };
        let messages = &self.0.messages;
        let Some(message) = messages.iter().find(|m| m.name == message_name) else {
            return Err(missing(SignalProblem::NoMessage {
                message: message_name.to_owned(),
                known: messages.iter().map(|m| m.name.clone()).collect(),
            }));
        };
        let signals = &message.signals;
        let Some(signal) = signals.iter().find(|s| s.name == signal_name) else {
            return Err(missing(SignalProblem::NoSignal {
                message: message_name.to_owned(),
                known: signals.iter().map(|s| s.name.clone()).collect(),
            }));
        };
        Ok((message, signal))
    }

    fn layout(&self, message: &can_dbc::Message, signal: &can_dbc::Signal) -> BitLayout {
        let mut float_types = self.0.signal_extended_value_type_list.iter();
        let float_type = float_types
            .find(|e| e.message_id == message.id && e.signal_name == signal.name)
            .map(|e| e.signal_extended_value_type);
        let number = match (float_type, signal.value_type) {
            (Some(SignalExtendedValueType::IEEEfloat32Bit), _) => Number::Float32,
            (Some(SignalExtendedValueType::IEEEdouble64bit), _) => Number::Float64,
            (_, can_dbc::ValueType::Signed) => Number::Signed,
            (_, can_dbc::ValueType::Unsigned) => Number::Unsigned,
        };
        // More than 16 bits is beyond any frame and is refused when the layout is checked.
        let bits = |value: u64| u16::try_from(value).unwrap_or(u16::MAX);
        BitLayout {
            start_bit: bits(signal.start_bit),
            length: bits(signal.size),
            byte_order: match signal.byte_order {
                can_dbc::ByteOrder::LittleEndian => ByteOrder::Intel,
                can_dbc::ByteOrder::BigEndian => ByteOrder::Motorola,
            },
            number,
            scale: signal.factor,
            offset: signal.offset,
        }
    }

    /// The conditions for a signal to be in its frame: its multiplexor's value, and the conditions of
    /// that multiplexor itself.
    fn conditions(
        &self,
        message: &can_dbc::Message,
        signal: &can_dbc::Signal,
        found: &mut Vec<MultiplexCondition>,
    ) {
        let (MultiplexIndicator::MultiplexedSignal(value)
        | MultiplexIndicator::MultiplexorAndMultiplexedSignal(value)) =
            signal.multiplexer_indicator
        else {
            return;
        };
        // `SG_MUL_VAL_` gives the multiplexor and ranges; without it, there is one multiplexor and one value.
        let mut extended = self.0.extended_multiplex.iter();
        let extended =
            extended.find(|e| e.message_id == message.id && e.signal_name == signal.name);
        let is_switch = |s: &&can_dbc::Signal| match extended {
            Some(extended) => s.name == extended.multiplexor_signal_name,
            None => s.multiplexer_indicator == MultiplexIndicator::Multiplexor,
        };
        let Some(switch) = message.signals.iter().find(is_switch) else {
            // Without a multiplexor, it is never known whether the signal is present.
            return found.push(MultiplexCondition {
                switch: self.layout(message, signal),
                ranges: Vec::new(),
            });
        };
        let ranges = match extended {
            Some(extended) => {
                let mappings = extended.mappings.iter();
                mappings.map(|m| (m.min_value, m.max_value)).collect()
            }
            None => vec![(value, value)],
        };
        found.push(MultiplexCondition {
            switch: self.layout(message, switch),
            ranges,
        });
        // A file could name multiplexors in a circle; a real chain is no longer than its message.
        if found.len() <= message.signals.len() && switch.name != signal.name {
            self.conditions(message, switch, found);
        }
    }
}

fn id(id: MessageId) -> CanId {
    match id {
        MessageId::Standard(id) => CanId::Standard(id),
        MessageId::Extended(id) => CanId::Extended { extended: id },
    }
}

/// The smallest and the largest value; `[0|0]` means that the file gives no range.
fn range(signal: &can_dbc::Signal) -> Option<[f64; 2]> {
    let number = |value: &NumericValue| match *value {
        NumericValue::Uint(value) => value as f64,
        NumericValue::Int(value) => value as f64,
        NumericValue::Double(value) => value,
    };
    let range = [number(&signal.min), number(&signal.max)];
    (range[0] < range[1]).then_some(range)
}
